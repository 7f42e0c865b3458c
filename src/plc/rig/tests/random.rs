//! Whatever happens, the program stays within its bounds, and an operator gets it home again.
//!
//! [`Seen::check`](super::cell::Seen::check) holds in every scan of these tests.

use proptest::prelude::*;

use super::cell::{ABORT, Cell, PARKED, RESET, START, STOP};
use crate::plc::rig::La1Code;

/// Something that happens to a running cell.
#[derive(Clone, Copy, Debug)]
enum Trouble {
    Press(u8),
    Link(bool),
    Jam(bool, bool),
    NotOk,
    Mute(bool),
    Blind(bool),
    /// The sensors' bits are flipped for one scan.
    Noise([u8; 3]),
}

fn trouble() -> impl Strategy<Value = Trouble> {
    prop_oneof![
        4 => prop_oneof![Just(START), Just(STOP), Just(RESET)].prop_map(Trouble::Press),
        2 => any::<bool>().prop_map(Trouble::Link),
        1 => any::<(bool, bool)>().prop_map(|(la1, la2)| Trouble::Jam(la1, la2)),
        1 => Just(Trouble::NotOk),
        1 => any::<bool>().prop_map(Trouble::Mute),
        1 => any::<bool>().prop_map(Trouble::Blind),
        2 => any::<[u8; 3]>().prop_map(Trouble::Noise),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, ..ProptestConfig::default() })]

    #[test]
    fn random_inputs_never_make_it_unsafe(
        scans in prop::collection::vec((any::<[u8; 3]>(), 1_usize..40, 0_u8..20), 200),
    ) {
        let mut cell = Cell::new(La1Code::MsbFirst);
        for (inputs, times, luck) in scans {
            cell.alive = luck > 0;
            for _ in 0..times {
                cell.scan_inputs(inputs);
            }
        }
    }

    #[test]
    fn after_any_trouble_an_operator_can_park_the_rig(
        troubles in prop::collection::vec((trouble(), 0_usize..300), 1..60),
        started: bool,
    ) {
        let mut cell = Cell::ready();
        if started {
            cell.press(START);
        }
        for (trouble, scans) in troubles {
            match trouble {
                Trouble::Press(button) => cell.press(button),
                Trouble::Link(alive) => cell.alive = alive,
                Trouble::Jam(la1, la2) => {
                    cell.plant.la1.jammed = la1;
                    cell.plant.la2.jammed = la2;
                }
                Trouble::NotOk => cell.plant.not_ok = true,
                Trouble::Mute(mute) => cell.plant.mute = mute,
                Trouble::Blind(blind) => cell.plant.im1.blind = blind,
                Trouble::Noise(flips) => {
                    let image = cell.plant.image();
                    cell.scan_inputs(std::array::from_fn(|byte| image[byte] ^ flips[byte]));
                }
            }
            cell.scans(scans);
        }

        cell.alive = true;
        cell.plant.la1.jammed = false;
        cell.plant.la2.jammed = false;
        cell.plant.mute = false;
        cell.plant.im1.blind = false;
        cell.scans(2);
        for _ in 0..4 {
            if cell.seen.phase != PARKED {
                cell.press(STOP);
            }
            cell.until("a rest", |cell| [ABORT, PARKED].contains(&cell.seen.phase));
            if cell.seen.phase == PARKED {
                break;
            }
            cell.press(RESET);
        }
        prop_assert_eq!(cell.seen.phase, PARKED);
        prop_assert_eq!(cell.plant.la1.position, 0);
    }
}
