use super::*;
use crate::fieldbus::modbus::identification::READ_DEVICE_IDENTIFICATION;
use crate::fieldbus::modbus::table::Table;
use crate::fieldbus::{LinkStatus, Role};
use crate::image::{Directions, image};
use crate::time::Manual;

const CYCLE: Nanos = Nanos::from_millis(10);
const TIMEOUT: Nanos = Nanos::from_millis(100);

/// A controller that writes one register of the one unit of a serial line.
struct Line<'a> {
    poll: Poll<'a>,
    port: Port,
    now: Nanos,
}

impl Line<'_> {
    /// The PDU of the next request.
    fn asked(&mut self) -> Vec<u8> {
        for _ in 0..100 {
            self.poll
                .turn(self.now, &mut self.port)
                .expect("it goes on");
            let telegram = self.poll.to_write(self.now).to_vec();
            if !telegram.is_empty() {
                self.poll.wrote(telegram.len());
                return rtu::parse(&telegram).expect("a telegram").1.to_vec();
            }
            self.now += Nanos::from_millis(1);
        }
        panic!("nothing is asked");
    }

    fn answer(&mut self, pdu: &[u8]) {
        let mut telegram = Vec::new();
        rtu::append(1, &mut telegram, |bytes| bytes.extend_from_slice(pdu));
        let arrived = self.poll.arrived(self.now, &telegram, &mut self.port);
        arrived.expect("it goes on");
    }

    /// Says who the device is.
    fn introduce(&mut self, product: &str) {
        assert_eq!(self.asked(), [43, READ_DEVICE_IDENTIFICATION, 1, 0]);
        let identification = Identification::of_driver(product);
        let mut pdu = Vec::new();
        let asked = [READ_DEVICE_IDENTIFICATION, 1, 0];
        identification.answer(&asked, &mut pdu).expect("an answer");
        self.answer(&pdu);
    }
}

#[test]
fn a_device_that_was_away_is_asked_who_it_is_before_it_is_written_to() {
    crate::os::logged::expect("nothing is written into the PLC \"tickbus ");
    let (_tick, end) = image(vec![Directions {
        tx_fail_safe: Box::new([0; 2]),
        tx_latched: Box::new([]),
        rx_fail_safe: Box::new([]),
        rx_latched: Box::new([]),
    }]);
    let status = LinkStatus::new("test", Nanos::from_secs(1));
    let port = Port::new(end, Manual::new(), Role::Controller, None, status);
    let register = Block {
        table: Table::HoldingRegisters,
        first: 0,
        byte: 0,
        bytes: 2,
    };
    let mut stations = [Station {
        unit: 1,
        reads: Vec::new(),
        writes: vec![register],
        combine: true,
        sends: Vec::new(),
        receives: Vec::new(),
        identified: false,
        queries: Vec::new(),
    }];
    let mut guards = [Guard::new(Some("tickbus 7"))];
    let framing = Framing::Rtu {
        inbox: Vec::new(),
        character: Nanos(1),
        silence: Nanos(1),
        quiet_until: Nanos::ZERO,
    };
    let times = (CYCLE, TIMEOUT);
    let peer = "the line".to_owned();
    let poll = Poll::new(
        &mut stations,
        &mut guards,
        framing,
        times,
        peer,
        Nanos::ZERO,
    );
    let now = Nanos::ZERO;
    let mut line = Line { poll, port, now };
    line.introduce("7");
    let write = [16, 0, 0, 0, 1, 2, 0, 0];
    for _ in 0..3 {
        assert_eq!(line.asked(), write);
        line.answer(&write[..5]);
    }
    // It is unplugged, and another one put in its place.
    assert_eq!(line.asked(), write);
    line.now = line.now + TIMEOUT + Nanos::from_millis(1);
    line.introduce("8");
    for _ in 0..3 {
        assert_eq!(line.asked(), [3, 0, 0, 0, 1], "it is only looked at");
        line.answer(&[3, 2, 0, 0]);
    }
}
