mod datagrams;
mod stream;

use std::sync::Arc;

use super::*;
use crate::Piece;
use crate::client::Capabilities;
use crate::identification::READ_DEVICE_IDENTIFICATION;
use crate::table::Table;
use tickbus_base::time::Manual;
use tickbus_fieldbus::{LinkStatus, Role};
use tickbus_image::{StationStreams, TickEnd, image};
use tickbus_test_log as logged;

const CYCLE: Nanos = Nanos::from_millis(10);
const TIMEOUT: Nanos = Nanos::from_millis(100);
const MILLISECOND: Nanos = Nanos::from_millis(1);

/// The requests to a device from which register 5 is read, and to which register 0 is written.
const READ: &[u8] = &[3, 0, 5, 0, 1];
const WRITE: &[u8] = &[16, 0, 0, 0, 1, 2, 0, 0];
const WHO: &[u8] = &[43, READ_DEVICE_IDENTIFICATION, 1, 0];

/// A signal of one register, or of some bits of it.
fn signal(table: Table, wire: usize, bit: usize, bits: usize) -> Piece {
    Piece {
        table,
        wire,
        bit,
        bits,
        fills: bits >= 16,
    }
}

fn register(first: usize) -> Piece {
    signal(Table::HoldingRegisters, first * 16, 0, 16)
}

/// The stations of a client and their guards, which outlive connections.
struct Client {
    stations: Vec<Station>,
    guards: Vec<WriteGuard>,
    status: LinkStatus,
    port: Option<Port>,
    _tick: TickEnd,
}

impl Client {
    /// Two connections end while the device is asked who it is.
    fn hang_up_twice(&mut self) {
        for _ in 0..2 {
            let mut line = self.connect(tcp());
            line.read();
            assert_eq!(line.asked(), WHO);
            assert!(line.poll.hung_up());
        }
    }

    /// Units from 1 on, with two bytes in each direction, which may write to `write_to`.
    fn new(stations: usize, reads: &[Piece], writes: &[Piece], write_to: Option<&str>) -> Self {
        for words in [
            "nothing is written into the PLC",
            "nothing is written before it has said so",
            "the other stations go on",
        ] {
            logged::expect(words);
        }
        let directions = || StationStreams {
            tx_fail_safe: Box::new([0; 2]),
            tx_latched: Box::new([]),
            tx_counted: Box::default(),
            rx_counted: Box::default(),
            rx_fail_safe: Box::new([0; 2]),
            rx_latched: Box::new([]),
        };
        let (tick, end) = image((0..stations).map(|_| directions()).collect());
        let status = LinkStatus::new("test", Nanos::from_secs(1));
        let clock: Arc<Manual> = Manual::new();
        let port = Port::new(end, clock, Role::Device, None, status.clone());
        let station = |unit: usize| {
            let unit = u8::try_from(unit + 1).expect("few");
            Station::new(unit, reads.to_vec(), writes.to_vec(), 2)
        };
        Self {
            stations: (0..stations).map(station).collect(),
            guards: (0..stations).map(|_| WriteGuard::new(write_to)).collect(),
            status,
            port: Some(port),
            _tick: tick,
        }
    }

    /// A connection over a serial line, or over TCP.
    fn connect(&mut self, framing: Framing) -> Line<'_> {
        self.connect_with(framing, Capabilities::new(false, usize::MAX))
    }

    /// A connection to a device that is assumed to have these abilities.
    fn connect_with(&mut self, framing: Framing, able: Capabilities) -> Line<'_> {
        let poll = ClientSession::new(
            &mut self.stations,
            &mut self.guards,
            framing,
            able,
            (CYCLE, TIMEOUT),
            "the line".to_owned(),
            Nanos::ZERO,
        );
        Line {
            poll,
            port: self.port.as_mut().expect("a port"),
            status: self.status.clone(),
            now: Nanos::ZERO,
            transaction: 0,
        }
    }
}

fn serial() -> Framing {
    Framing::Serial {
        coding: Coding::Rtu,
        ascii: ascii::Framer::new(ascii::SILENCE),
        inbox: Vec::new(),
        character: Nanos(1),
        silence: Nanos(1),
        quiet_until: Nanos::ZERO,
        echo: None,
    }
}

fn tcp() -> Framing {
    Framing::Tcp {
        transaction: 0,
        inbox: Vec::new(),
    }
}

/// An RTU telegram of this unit, whose register has the value 7.
fn seven(unit: u8) -> Vec<u8> {
    let mut telegram = Vec::new();
    rtu::append(unit, &mut telegram, |pdu| {
        pdu.extend_from_slice(&[3, 2, 0, 7]);
    });
    telegram
}

/// A connection, and the far end of it.
struct Line<'a> {
    poll: ClientSession<'a>,
    port: &'a mut Port,
    status: LinkStatus,
    now: Nanos,
    transaction: u16,
}

impl Line<'_> {
    /// Unit and PDU of the next request.
    #[track_caller]
    fn asked_of(&mut self) -> (u8, Vec<u8>) {
        for _ in 0..20_000 {
            self.poll.turn(self.now, self.port).expect("it goes on");
            let telegram = self.poll.to_write(self.now).to_vec();
            if !telegram.is_empty() {
                self.poll.wrote(self.now, telegram.len(), self.port);
                return match self.poll.framing {
                    Framing::Serial { coding, .. } => datagrams::unit_and_pdu(coding, &telegram),
                    Framing::RtuOverTcp { .. } => {
                        let (unit, pdu) = rtu::parse(&telegram).expect("a telegram");
                        (unit, pdu.to_vec())
                    }
                    Framing::Tcp { .. } | Framing::Udp { .. } => {
                        let parsed = Telegram::parse(&telegram).expect("a telegram");
                        let (telegram, _) = parsed.expect("a whole one");
                        self.transaction = telegram.transaction;
                        (telegram.unit, telegram.pdu.to_vec())
                    }
                };
            }
            self.now += MILLISECOND;
        }
        panic!("nothing is asked");
    }

    #[track_caller]
    fn asked(&mut self) -> Vec<u8> {
        self.asked_of().1
    }

    /// Unit `unit` answers this.
    #[track_caller]
    fn answer_as(&mut self, unit: u8, pdu: &[u8]) {
        let mut telegram = Vec::new();
        match self.poll.framing {
            Framing::Serial { coding, .. } => {
                coding.append(unit, &mut telegram, |bytes| bytes.extend_from_slice(pdu));
            }
            Framing::RtuOverTcp { .. } => {
                rtu::append(unit, &mut telegram, |bytes| bytes.extend_from_slice(pdu));
            }
            Framing::Tcp { .. } | Framing::Udp { .. } => {
                let transaction = self.transaction;
                mbap::append(transaction, unit, &mut telegram, |bytes| {
                    bytes.extend_from_slice(pdu);
                });
            }
        }
        self.hear(&telegram).expect("it goes on");
    }

    /// These bytes arrive.
    fn hear(&mut self, bytes: &[u8]) -> Result<(), BusError> {
        self.poll.hear(self.now, bytes, self.port)
    }

    #[track_caller]
    fn answer(&mut self, pdu: &[u8]) {
        self.answer_as(1, pdu);
    }

    /// The device's register is read: answers the request.
    #[track_caller]
    fn read(&mut self) {
        assert_eq!(self.asked(), READ);
        self.answer(&[3, 2, 0, 7]);
    }

    /// The device is written to and read: answers both requests.
    #[track_caller]
    fn write_and_read(&mut self) {
        assert_eq!(self.asked(), WRITE);
        self.answer(&WRITE[..5]);
        self.read();
    }

    /// The device is asked for its identity, and reports it.
    #[track_caller]
    fn introduce(&mut self, product: &str) {
        assert_eq!(self.asked(), WHO);
        let identification = Identification::of_driver(product);
        let mut pdu = Vec::new();
        let asked = &WHO[1..];
        identification.answer(asked, &mut pdu).expect("an answer");
        self.answer(&pdu);
    }

    /// The device stays silent until the time-out.
    fn stay_silent(&mut self) {
        self.now = self.now + TIMEOUT + MILLISECOND;
    }

    fn statistic(&self, key: &str) -> Option<String> {
        let mut statistics = tickbus_base::statistics::Statistics::default();
        self.status.write(self.now, &mut statistics);
        let text = statistics.to_string();
        let mut lines = text.lines();
        lines.find_map(|line| Some(line.strip_prefix(key)?.strip_prefix('=')?.to_owned()))
    }
}

const FALLBACK: &str = "modbus device at the line, unit 1";

#[test]
fn a_device_that_was_away_is_asked_who_it_is_before_it_is_written_to() {
    let mut client = Client::new(1, &[register(5)], &[register(0)], Some("tickbus 7"));
    let mut line = client.connect(serial());
    line.read();
    line.introduce("7");
    for _ in 0..3 {
        line.write_and_read();
    }
    // Another device replaces this one.
    assert_eq!(line.asked(), WRITE);
    line.stay_silent();
    line.read();
    line.introduce("8");
    for _ in 0..3 {
        line.read();
    }
    assert_eq!(line.statistic("writes").as_deref(), Some("blocked"));
}

#[test]
fn a_device_that_is_silent_when_asked_who_it_is_is_read_and_counts_as_nameless_after_two_times() {
    let mut client = Client::new(1, &[register(5)], &[register(0)], Some(FALLBACK));
    for framing in [serial(), tcp()] {
        let mut line = client.connect(framing);
        for _ in 0..2 {
            line.read();
            while line.asked() == READ {
                line.answer(&[3, 2, 0, 7]);
            }
            // The client asked for the identity.
            line.stay_silent();
        }
        line.write_and_read();
        assert_eq!(line.statistic("identity").as_deref(), Some(FALLBACK));
    }
}

#[test]
fn a_device_that_hangs_up_when_asked_who_it_is_is_not_asked_on_the_third_connection() {
    let mut client = Client::new(1, &[register(5)], &[register(0)], Some(FALLBACK));
    client.hang_up_twice();
    let mut line = client.connect(tcp());
    line.read();
    line.write_and_read();
    assert!(!line.poll.hung_up());
    // The next answer may come from another device.
    let mut line = client.connect(tcp());
    line.read();
    assert_eq!(line.asked(), WHO);
}

#[test]
fn a_device_whose_connections_broke_while_it_was_asked_who_it_is_is_asked_again_if_another_one_is_named()
 {
    let mut client = Client::new(1, &[register(5)], &[register(0)], Some("tickbus 7"));
    client.hang_up_twice();
    let mut line = client.connect(tcp());
    line.read();
    line.read();
    assert_eq!(line.statistic("writes").as_deref(), Some("blocked"));
    line.now += Nanos::from_secs(10);
    line.read();
    line.introduce("7");
    line.write_and_read();
    assert_eq!(line.statistic("writes").as_deref(), Some("allowed"));
}

#[test]
fn a_late_answer_to_something_else_does_not_make_a_device_nameless() {
    let mut client = Client::new(1, &[register(5)], &[register(0)], Some(FALLBACK));
    let mut line = client.connect(serial());
    line.read();
    assert_eq!(line.asked(), WHO);
    line.answer(&[3, 2, 0, 7]);
    assert_eq!(line.statistic("identity"), None, "it has not said it yet");
    // The data that the device does send are still used.
    let identification = Identification::of_driver("7");
    let mut pdu = Vec::new();
    identification
        .answer(&WHO[1..], &mut pdu)
        .expect("an answer");
    line.answer(&pdu);
    assert_eq!(line.statistic("identity").as_deref(), Some("tickbus 7"));
    assert_eq!(line.statistic("writes").as_deref(), Some("blocked"));
    assert_eq!(
        line.statistic("modbus-client.unasked").as_deref(),
        Some("1")
    );
    line.read();
}

#[test]
fn a_device_that_says_who_it_is_when_it_counts_as_nameless_already_is_asked_again() {
    let mut client = Client::new(1, &[register(5)], &[register(0)], Some(FALLBACK));
    let mut line = client.connect(serial());
    for _ in 0..2 {
        while line.asked() == READ {
            line.answer(&[3, 2, 0, 7]);
        }
        line.stay_silent();
    }
    assert_eq!(line.asked(), WRITE);
    let late = [43, READ_DEVICE_IDENTIFICATION, 1, 0x81, 0, 0, 0];
    line.answer(&late);
    line.answer(&WRITE[..5]);
    line.read();
    line.introduce("7");
    line.read();
    assert_eq!(line.statistic("writes").as_deref(), Some("blocked"));
}

#[test]
fn a_malformed_answer_and_a_failure_are_no_sign_that_a_device_is_nameless() {
    let mut client = Client::new(1, &[register(5)], &[register(0)], Some(FALLBACK));
    let mut line = client.connect(tcp());
    for wrong in [&[43, 14, 1, 0x81, 0, 0, 1, 0][..], &[0xAB, 6]] {
        while line.asked() == READ {
            line.answer(&[3, 2, 0, 7]);
        }
        line.answer(wrong);
        assert_eq!(line.statistic("identity"), None);
    }
    while line.asked() == READ {
        line.answer(&[3, 2, 0, 7]);
    }
    line.answer(&[0xAB, 1]);
    assert_eq!(line.statistic("identity").as_deref(), Some(FALLBACK));
}

#[test]
fn a_station_that_refuses_rests_alone_and_is_asked_again_every_second() {
    let mut client = Client::new(2, &[register(5)], &[], None);
    for exception in [1, 2, 3, 4, 11] {
        let mut line = client.connect(tcp());
        line.port.running("polling");
        let mut asked = [0, 0];
        while line.now < Nanos::from_millis(2_050) {
            let (unit, pdu) = line.asked_of();
            assert_eq!(pdu, READ);
            asked[usize::from(unit) - 1] += 1;
            let answer: &[u8] = if unit == 1 {
                &[3, 2, 0, 7]
            } else {
                &[0x83, exception]
            };
            line.answer_as(unit, answer);
        }
        assert!(asked[0] > 150, "{asked:?}");
        assert!(asked[1] == 3, "{asked:?}");
        assert!(line.port.peer_age(1, line.now) > Nanos::from_secs(2));
    }
}

#[test]
fn a_station_that_is_silent_is_asked_more_and_more_rarely_beside_others() {
    let mut client = Client::new(2, &[register(5)], &[], None);
    for framing in [serial(), tcp()] {
        let mut line = client.connect(framing);
        let mut silent_at = Vec::new();
        while line.now < Nanos::from_secs(30) {
            let (unit, _) = line.asked_of();
            if unit == 1 {
                line.answer_as(unit, &[3, 2, 0, 7]);
            } else {
                silent_at.push(line.now.0 / 1_000_000_000);
                line.stay_silent();
            }
        }
        assert_eq!(silent_at, [0, 1, 3, 7, 15, 23]);
    }
}

#[test]
fn where_no_station_is_in_order_the_line_is_lost_and_comes_back() {
    let mut client = Client::new(2, &[register(5)], &[], None);
    let mut line = client.connect(serial());
    for _ in 0..4 {
        line.asked();
        line.stay_silent();
    }
    let link = line.status.link();
    assert_eq!(link.cause.name(), "link");
    assert!(
        link.reason.contains("unit 2 of the line"),
        "{}",
        link.reason
    );
    let before = line.now;
    let (unit, _) = line.asked_of();
    line.answer_as(unit, &[3, 2, 0, 7]);
    assert!(line.now - before <= CYCLE, "nobody rests");
    assert_eq!(line.status.link().cause.name(), "running");
}

#[test]
fn a_single_station_that_refuses_is_told_and_asked_again() {
    let mut client = Client::new(1, &[register(5)], &[], None);
    let mut line = client.connect(tcp());
    assert_eq!(line.asked(), READ);
    line.answer(&[0x83, 2]);
    let link = line.status.link();
    assert_eq!(link.cause.name(), "refused");
    let expected = "refused to read holding-register offset:5 (4x00006) (function 3): exception 02";
    assert!(link.reason.contains(expected), "{}", link.reason);
    let before = line.now;
    line.read();
    assert!(line.now - before >= Nanos::from_millis(990));
    assert_eq!(line.status.link().cause.name(), "running");
}

#[test]
fn a_device_without_the_functions_for_many_is_asked_for_single_ones() {
    let coils = [
        signal(Table::Coils, 4, 0, 1),
        signal(Table::Coils, 5, 1, 1),
        signal(Table::HoldingRegisters, 48, 0, 16),
    ];
    let mut client = Client::new(1, &[], &coils, Some(FALLBACK));
    for framing in [serial(), tcp()] {
        let mut line = client.connect(framing);
        assert_eq!(line.asked(), [1, 0, 4, 0, 1], "it is looked at");
        line.answer(&[1, 1, 0]);
        assert_eq!(line.asked(), WHO);
        line.answer(&[0xAB, 1]);
        assert_eq!(line.asked(), [15, 0, 4, 0, 2, 1, 0]);
        line.answer(&[0x8F, 1]);
        for _ in 0..2 {
            for coil in [4, 5] {
                let one = [5, 0, coil, 0, 0];
                assert_eq!(line.asked(), one);
                line.answer(&one);
            }
            let many = line.asked();
            if many[0] == 16 {
                assert_eq!(many, [16, 0, 3, 0, 1, 2, 0, 0]);
                line.answer(&[0x90, 1]);
                continue;
            }
            assert_eq!(many, [6, 0, 3, 0, 0]);
            line.answer(&many);
        }
    }
}

#[test]
fn a_device_without_what_lies_between_the_signals_is_read_in_pieces() {
    let reads = [
        signal(Table::InputRegisters, 16, 0, 8),
        signal(Table::InputRegisters, 160, 8, 8),
    ];
    let mut client = Client::new(1, &reads, &[], None);
    for exception in 1..=4 {
        let mut line = client.connect(tcp());
        assert_eq!(line.asked(), [4, 0, 1, 0, 10]);
        line.answer(&[0x84, exception]);
        for _ in 0..2 {
            for register in [1, 10] {
                assert_eq!(line.asked(), [4, 0, register, 0, 1]);
                line.answer(&[4, 2, 0, 7]);
            }
        }
    }
}

#[test]
fn a_device_that_cannot_mask_is_read_and_gets_all_but_the_bits() {
    logged::expect("it cannot write single bits of a register");
    let writes = [signal(Table::HoldingRegisters, 8, 0, 1), register(5)];
    let mut client = Client::new(1, &[register(9)], &writes, Some(FALLBACK));
    let mut line = client.connect_with(tcp(), Capabilities::new(false, 0));
    assert_eq!(line.asked(), [3, 0, 9, 0, 1]);
    line.answer(&[3, 2, 0, 0]);
    assert_eq!(line.asked(), WHO);
    line.answer(&[0xAB, 1]);
    assert_eq!(line.asked(), [22, 0, 0, 0xFF, 0xFE, 0, 0]);
    line.answer(&[0x96, 1]);
    for _ in 0..2 {
        // The other bits are never read in order to write them.
        let written = line.asked();
        assert_eq!(written[..5], [16, 0, 5, 0, 1]);
        line.answer(&[16, 0, 5, 0, 1]);
        assert_eq!(line.asked(), [3, 0, 9, 0, 1]);
        line.answer(&[3, 2, 0, 0]);
        assert_eq!(line.status.link().cause.name(), "running");
    }
    let refused = line.statistic("refused").expect("it is there");
    assert!(
        refused.contains("write bit 0 of holding-register offset:0"),
        "{refused}"
    );
}

#[test]
fn the_echo_of_a_request_is_not_its_answer() {
    let mut client = Client::new(1, &[register(5)], &[register(0)], Some(FALLBACK));
    let mut framing = serial();
    if let Framing::Serial { echo, .. } = &mut framing {
        *echo = Some(rtu::Echo::new(9_600));
    }
    let mut line = client.connect(framing);
    for _ in 0..2 {
        assert_eq!(line.asked(), READ);
        line.answer(READ);
        line.answer(&[3, 2, 0, 7]);
        if line.statistic("identity").is_none() {
            assert_eq!(line.asked(), WHO);
            line.answer(WHO);
            line.answer(&[0xAB, 1]);
        }
        assert_eq!(line.asked(), WRITE);
        line.answer(WRITE);
        line.answer(&WRITE[..5]);
    }
    assert_eq!(line.statistic("modbus-client.damaged"), None);
    assert_eq!(line.statistic("modbus-client.unasked"), None);
}

#[test]
fn a_bit_of_a_register_is_written_over_a_serial_line_as_over_tcp() {
    // 400021.5: bit 5 of the register with the offset 20, in its low byte.
    let bit = [signal(Table::HoldingRegisters, 20 * 16 + 8 + 5, 0, 1)];
    let mut client = Client::new(1, &[], &bit, Some(FALLBACK));
    for framing in [serial(), tcp()] {
        let mut line = client.connect(framing);
        assert_eq!(line.asked(), [3, 0, 20, 0, 1]);
        line.answer(&[3, 2, 0, 0]);
        assert_eq!(line.asked(), WHO);
        line.answer(&[0xAB, 1]);
        for _ in 0..3 {
            let mask = [22, 0, 20, 0xFF, 0xDF, 0, 0];
            assert_eq!(line.asked(), mask);
            line.answer(&mask);
            assert_eq!(line.status.link().cause.name(), "running");
        }
    }
}

#[test]
fn a_station_that_is_only_written_need_not_have_anything_to_be_read() {
    for exception in 1..=3 {
        let mut client = Client::new(1, &[], &[register(0)], Some(FALLBACK));
        let mut line = client.connect(tcp());
        assert_eq!(line.asked(), [3, 0, 0, 0, 1], "it is looked at");
        line.answer(&[0x83, exception]);
        assert_eq!(line.asked(), WHO);
        line.answer(&[0xAB, 1]);
        for _ in 0..2 {
            assert_eq!(line.asked(), WRITE);
            line.answer(&WRITE[..5]);
        }
        assert_eq!(line.statistic("modbus-client.refused"), None);
    }
}

#[test]
fn a_device_that_is_busy_or_away_is_not_taken_to_lack_function_23() {
    const BOTH: &[u8] = &[23, 0, 5, 0, 1, 0, 0, 0, 1, 2, 0, 0];
    let mut client = Client::new(1, &[register(5)], &[register(0)], Some(FALLBACK));
    for exception in [1, 2, 3, 4, 5, 6, 0x0A, 0x0B] {
        let mut line = client.connect_with(tcp(), Capabilities::new(true, usize::MAX));
        line.read();
        assert_eq!(line.asked(), WHO);
        line.answer(&[0xAB, 1]);
        assert_eq!(line.asked(), BOTH);
        line.answer(&[0x97, exception]);
        match exception {
            1..=4 => assert_eq!(line.asked(), WRITE),
            5 | 6 => assert_eq!(line.asked(), BOTH),
            _ => {
                // The gateway may have found another device there.
                line.read();
                line.introduce("8");
                assert_eq!(line.asked(), READ);
            }
        }
    }
}

#[test]
fn a_device_whose_answers_cannot_be_understood_is_asked_who_it_is_until_one_can() {
    let mut client = Client::new(1, &[register(5)], &[register(0)], Some(FALLBACK));
    for framing in [serial(), tcp()] {
        let mut line = client.connect(framing);
        for _ in 0..5 {
            while line.asked() == READ {
                line.answer(&[3, 2, 0, 7]);
            }
            if matches!(line.poll.framing, Framing::Serial { .. }) {
                line.hear(&[1, 0xAB, 1, 0, 0]).expect("it goes on");
            } else {
                line.answer(&[43, READ_DEVICE_IDENTIFICATION, 1, 0x81, 0, 0, 1, 0]);
            }
        }
        while line.asked() == READ {
            line.answer(&[3, 2, 0, 7]);
        }
        let identification = Identification::of_driver("7");
        let mut pdu = Vec::new();
        let answered = identification.answer(&WHO[1..], &mut pdu);
        answered.expect("an answer");
        line.answer(&pdu);
        assert_eq!(line.statistic("identity").as_deref(), Some("tickbus 7"));
        assert_eq!(line.statistic("writes").as_deref(), Some("blocked"));
    }
}

#[test]
fn a_device_that_answers_with_no_telegram_when_asked_who_it_is_is_not_asked_for_ever() {
    let mut client = Client::new(1, &[register(5)], &[register(0)], Some(FALLBACK));
    for _ in 0..2 {
        let mut line = client.connect(tcp());
        line.read();
        assert_eq!(line.asked(), WHO);
        let answered = line.hear(&[0, 2, 0, 9, 0, 3, 1, 0xAB, 1]);
        assert!(
            matches!(answered, Err(BusError::Protocol(_))),
            "{answered:?}"
        );
    }
    let mut line = client.connect(tcp());
    line.read();
    line.write_and_read();
}

#[test]
fn a_stray_byte_behind_an_answer_does_it_no_harm() {
    let mut client = Client::new(1, &[register(5)], &[], None);
    let mut line = client.connect(serial());
    for _ in 0..2 {
        assert_eq!(line.asked(), READ);
        let mut telegram = seven(1);
        telegram.push(0);
        line.hear(&telegram).expect("it goes on");
        assert_eq!(line.status.link().cause.name(), "running");
    }
    assert_eq!(line.statistic("modbus-client.damaged"), None);
}
