//! Any bytes as a CPU's answers to an S7 client, in pieces of any size.
//!
//! The first byte chooses the request; then come pieces, each preceded by its length. Nothing may panic or
//! loop forever, the client's requests are well-formed, and it only writes bytes that signals cover.

#![no_main]

use libfuzzer_sys::fuzz_target;
use tickbus_driver_cfg::{Config, Kind, Kinds};
use tickbus_bus_s7::item;
use tickbus_bus_s7::pdu::{Pdu, function};
use tickbus_bus_s7::{ClientOptions, FrameFields, SessionEvent, ConnectionParameters, Tsap, transport};
use tickbus_fieldbus::Role;
use tickbus_base::time::Nanos;

const CONFIG: &str = "[driver]\nid = 1\nname = \"fuzz\"\n[fieldbus]\nkind = \"s7-client\"\n\
    address = \"127.0.0.1:1\"\ninput = \"DB1\"\noutput = \"%DB2.DBB3\"\n\
    [fieldbus.at]\n\"bit\" = \"%M3.4\"\n\"back\" = \"%M3.5\"\n\"wide\" = \"DB7,LREAL8\"\n\
    [[signal]]\nname = \"s\"\naddress = \"%QX0.0\"\n[[signal]]\nname = \"far\"\naddress = \"%QL492\"\n\
    [[signal]]\nname = \"back\"\naddress = \"%QX1.0\"\n[[signal]]\nname = \"bit\"\naddress = \"%IX1.0\"\n\
    [[signal]]\nname = \"word\"\naddress = \"%IW690\"\n[[signal]]\nname = \"wide\"\naddress = \"%IL8\"\n\
    type = \"LREAL\"\n";

static KINDS: Kinds = Kinds::new(&[Kind::of::<ClientOptions>()]);

thread_local! {
    static FRAMES: FrameFields = {
        let config = Config::parse("fuzz.cfg", CONFIG, &KINDS).expect("a right file");
        let options: &ClientOptions = config.bus.downcast_ref().expect("its bus is a client");
        FrameFields::new(options, &config.table, Role::Device)
    };
}

fuzz_target!(|data: &[u8]| {
    let Some((choice, mut pieces)) = data.split_first() else {
        return;
    };
    let terms = ConnectionParameters {
        calling: Tsap::new(&[1, 0]),
        called: Tsap::of_slot(0, 1),
        pdu: 960,
        patience: Nanos(1000),
        asks_who: choice & 1 == 0,
    };
    let mut session = FRAMES.with(|frames| frames.session(terms, Nanos::ZERO));
    let mut now = Nanos::ZERO;
    while let Some((length, rest)) = pieces.split_first() {
        let (piece, rest) = rest.split_at(usize::from(*length).min(rest.len()));
        pieces = rest;
        now = now + Nanos(1);
        let mut bytes = piece;
        loop {
            match session.hear(now, bytes) {
                Ok(None) => break,
                Ok(Some(SessionEvent::Met(..))) => session.allow(choice & 2 == 0),
                Ok(Some(SessionEvent::Done)) => {
                    assert!(session.is_idle());
                    let is_refused = session.refusal(0).is_some();
                    session.suspend(0, is_refused);
                }
                Ok(Some(SessionEvent::State(_))) => assert!(session.is_idle()),
                Err(end) => {
                    assert!(!end.into_error("peer").to_string().is_empty());
                    return;
                }
            }
            bytes = &[];
        }
        if session.is_idle() && choice & 4 != 0 && now.0 % 3 == 0 {
            session.ask_state(now);
        } else if session.is_idle() && session.begin(now).is_some() {
            // Everything was left out.
            session.suspend(0, false);
        }
        check(session.to_write());
        let count = session.to_write().len();
        session.wrote(count);
        assert!(session.check(now).is_ok());
        assert!(session.deadline() > now);
    }
});

/// Everything sent consists of packets with whole PDUs.
fn check(mut sent: &[u8]) {
    let mut message = Vec::new();
    while !sent.is_empty() {
        let (length, tpdu) = transport::read(sent).expect("well made").expect("whole");
        sent = &sent[length..];
        if let transport::Tpdu::Data { last, bytes } = tpdu {
            message.extend_from_slice(bytes);
            if last {
                assert!(message.len() <= 960);
                check_writing(&Pdu::read(&message).expect("well made"));
                message.clear();
            }
        }
    }
    assert!(message.is_empty());
}

/// Only signals are written.
fn check_writing(pdu: &Pdu<'_>) {
    let [function::WRITE, _, items @ ..] = pdu.parameters else {
        return;
    };
    for item in items.chunks_exact(item::ADDRESS) {
        let (element, count) = (item[3], item[5]);
        let address = u32::from_be_bytes([0, item[9], item[10], item[11]]);
        match (item[8], item[7], element, address) {
            // A bit of the flags; a word of data block 1; 8 bytes of data block 7.
            (0x83, 0, 1, 28) => assert_eq!(count, 1),
            (0x84, 1, 2, 5520) => assert_eq!(count, 2),
            (0x84, 7, 2, 64) => assert_eq!(count, 8),
            other => panic!("no signal is at {other:?}"),
        }
    }
}
