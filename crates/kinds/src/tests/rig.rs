//! The rig's driver.cfg, which both of its ends read.

use std::path::Path;

use tickbus_base::time::Nanos;
use tickbus_bus_socket::{self as socket, TcpRole};
use tickbus_driver_cfg::{CommandLineEnd, Config};
use tickbus_fieldbus::Role;
use tickbus_image::signal::{Area, ByteOrder, DataType, Slot};

use crate::KINDS;

fn rig() -> Config {
    rig_as(Role::Device)
}

fn rig_as(role: Role) -> Config {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../driver.cfg");
    let asked = CommandLineEnd { role, moved: false };
    Config::load_as(&path, Some(asked), &KINDS).unwrap_or_else(|mistakes| panic!("{mistakes}"))
}

/// The rig's words in the numbering of its builders: each bit of the WORD, and its signal.
const COMMAND_WORD: [(usize, &str); 13] = [
    (0, "IM1 index"),
    (1, "IM1 jog"),
    (2, "LA1 run"),
    (3, "LA1 code low"),
    (4, "LA1 code high"),
    (5, "SC1"),
    (7, "IM2 index"),
    (8, "IM2 jog"),
    (10, "LA2 run"),
    (11, "LA2 up"),
    (12, "SC2"),
    (13, "Lamp"),
    (15, "Acknowledge"),
];
const STATUS_WORD: [(usize, &str); 11] = [
    (0, "Step 1 complete"),
    (1, "Step 2 complete"),
    (2, "Step 3 complete"),
    (3, "Step 4 complete"),
    (4, "Step 5 complete"),
    (5, "Step 6 complete"),
    (11, "Package sensor 1"),
    (12, "Package sensor 2"),
    (13, "Homing sensor 1"),
    (14, "Homing sensor 2"),
    (15, "Not OK"),
];

#[test]
fn both_rig_words_lie_bit_by_bit_as_their_builders_counted() {
    let table = rig().table;
    for (area, word) in [
        (Area::Output, &COMMAND_WORD[..]),
        (Area::Input, &STATUS_WORD[..]),
    ] {
        for (bit, name) in word {
            let signal = &table.signals[table.position(name).expect(name)];
            assert_eq!(
                (signal.area, signal.data_type),
                (area, DataType::Bool),
                "{name}"
            );
            // Big-endian: bit n of the WORD at byte k is byte k + 1 - n/8, bit n mod 8.
            let place = (signal.byte, usize::from(signal.bit));
            assert_eq!(place, (1 - bit / 8, bit % 8), "{name}");
            assert_eq!(place, ByteOrder::Abcd.bit_position(2, *bit), "{name}");
            // The word itself with this bit set, as a big-endian PLC sends it.
            let frame = (1u16 << bit).to_be_bytes();
            assert_eq!(usize::from(frame[signal.byte]), 1 << signal.bit, "{name}");
            // With swapped bytes the bit is in the other byte.
            let swapped = ByteOrder::Dcba.bit_position(2, *bit);
            assert_eq!(swapped, (bit / 8, bit % 8), "{name}");
            assert_eq!(
                usize::from((1u16 << bit).to_le_bytes()[swapped.0]),
                1 << swapped.1
            );
            assert_eq!(ByteOrder::Badc.bit_position(2, *bit), swapped, "{name}");
        }
        let in_word = table
            .signals
            .iter()
            .filter(|signal| signal.area == area && signal.byte < 2);
        assert_eq!(in_word.count(), word.len());
    }
}

#[test]
fn the_rig_reads_whole() {
    let config = rig();
    assert_eq!(
        (config.id, config.name.as_str(), config.role),
        (4711, "Test rig", Role::Device)
    );
    let bytes = |area| config.table.stations[0].bytes(area);
    assert_eq!((bytes(Area::Input), bytes(Area::Output)), (8, 8));
    assert_eq!(config.timing.cycle, Some(Nanos::from_millis(2)));
    assert_eq!(config.timing.max_age, Nanos::from_millis(250));
    assert_eq!(config.timing.watchdog, None);
    let bus: &socket::Options = config.bus.downcast_ref().expect("a socket");
    assert_eq!(bus.address.to_string(), "127.0.0.1:20030");
    assert_eq!(bus.tcp, TcpRole::Listen);
    for cup in ["SC1", "SC2"] {
        let signal = &config.table.signals[config.table.position(cup).expect(cup)];
        assert_eq!(
            signal.fail_safe,
            Slot::from_real(1.0),
            "{cup} must not let go"
        );
    }
    let position = &config.table.signals[config.table.position("LA1 position").unwrap()];
    let scale = position.scale.expect("a scale");
    assert!((scale.value(27_648.0) - 250.0).abs() < 1e-9);
}

#[test]
fn the_rig_s_file_serves_its_plc_as_well() {
    let (device, controller) = (rig(), rig_as(Role::Controller));
    assert_eq!(controller.table, device.table);
    let bus: &socket::Options = controller.bus.downcast_ref().expect("a socket");
    assert_eq!(bus.address.to_string(), "127.0.0.1:20030");
    assert_eq!(bus.tcp, TcpRole::Connect);
}
