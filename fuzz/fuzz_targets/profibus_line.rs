//! A PROFIBUS line: any bytes, in pieces and with pauses, to two stations; and any bytes as a GSD file.
//!
//! The first byte says which. On the line, each piece has its length and the pause before it in front.

#![no_main]

use libfuzzer_sys::fuzz_target;
use tickbus_base::time::Nanos;
use tickbus_bus_profibus::telegram::{DATA_LIMIT, Telegram};
use tickbus_bus_profibus::{
    Acyclic, Alarm, AlarmKind, AlarmSupport, Configuration, Diagnosed, DriveParameter, Event, Format, Gsd, Identity, Nameplate, Process, Record, Segment, Station, UserParameters,
};

fuzz_target!(|data: &[u8]| {
    let Some((first, rest)) = data.split_first() else {
        return;
    };
    if first & 1 == 0 {
        line(first & 2 != 0, rest);
    } else if let Ok(gsd) = Gsd::read(rest) {
        let all: Vec<String> = gsd.modules.iter().map(|module| module.name.clone()).collect();
        if let Ok(identity) = gsd.identity(&all) {
            assert!(identity.configuration.inputs() <= DATA_LIMIT);
            assert_eq!(identity.configuration.difference(identity.configuration.bytes()), None);
            assert_eq!(identity.user.check(identity.user.defaults()), Ok(None));
        }
    }
});

fn line(dpv1: bool, mut stream: &[u8]) {
    let station = |address, configuration| {
        let identity = Identity {
            ident: 0x80E0,
            configuration,
            user: UserParameters::default(),
            sync: true,
            freeze: true,
            fail_safe: address == 4,
            dpv1,
            max_diagnosis: 6 + usize::from(address),
            acyclic: acyclic(),
        };
        Station::new(address, identity)
    };
    let fixed = Configuration::of_bytes(&[0x50, 0x60]).expect("whole");
    let stations = vec![station(3, fixed), station(4, Configuration::of_sizes(20, 0))];
    let mut segment = Segment::new(500_000, stations);
    let mut now = Nanos(0);
    let mut reply = Vec::new();
    while let [length, pause, rest @ ..] = stream {
        now = now + Nanos::from_micros(i64::from(*pause) * 100);
        segment.turn(now, &mut Machine);
        let (piece, behind) = rest.split_at(rest.len().min(usize::from(*length) + 1));
        stream = behind;
        if piece.is_empty() {
            break;
        }
        // Some of the time a device is broken.
        let diagnosed = Diagnosed {
            blocks: vec![vec![0x42, 1]; usize::from(pause % 3)],
            is_static: pause % 5 == 0,
            alarms: (0..pause % 4)
                .map(|slot| Alarm {
                    kind: if pause % 7 == 0 { AlarmKind::Process } else { AlarmKind::Diagnosis },
                    slot,
                    data: vec![0; usize::from(pause % 33)],
                })
                .collect(),
        };
        segment.station_mut(3).expect("it is there").diagnose(&diagnosed);
        let Ok(heard) = segment.hear(now, piece, &mut Machine, &mut reply) else {
            return;
        };
        if heard.answer.is_some() {
            let parsed = Telegram::parse(&reply).expect("its own telegrams are right");
            assert_eq!(parsed.map(|(_, length)| length), Some(reply.len()));
        }
    }
}

/// Both kinds of connections, to a record that is written and one that is read.
fn acyclic() -> Acyclic {
    let record = |index, is_writable| Record {
        slot: 1,
        index,
        octets: vec![index; 240],
        is_writable,
    };
    Acyclic {
        class_1: true,
        alarms: AlarmSupport::ALL,
        connections: 2,
        max_data: 240,
        send_timeout: 1,
        records: vec![record(0, true), record(1, false)],
        parameters: vec![DriveParameter {
            number: 945,
            format: Format::Unsigned16,
            is_array: true,
            octets: vec![0; 16],
            is_writable: true,
        }],
        nameplate: Nameplate::default(),
    }
}

struct Machine;

impl Process for Machine {
    fn inputs(&mut self, _: u8, now: Nanos, inputs: &mut [u8]) -> bool {
        inputs.fill(1);
        now.0 % 3 != 0
    }

    fn delivered(&mut self, _: u8) {}

    fn outputs(&mut self, station: u8, _: Nanos, outputs: &[u8]) {
        assert_eq!(outputs.len(), if station == 3 { 2 } else { 0 });
    }

    fn alive(&mut self, _: u8, _: Nanos) {}

    fn read_record(&mut self, _: u8, now: Nanos, record: usize, octets: &mut [u8]) {
        assert_eq!(octets.len(), if record < 2 { 240 } else { 16 });
        octets[0] = now.0.to_le_bytes()[1];
    }

    fn wrote_record(&mut self, _: u8, _: Nanos, record: usize, octets: &[u8]) {
        assert!((record, octets.len()) == (0, 240) || (record, octets.len()) == (2, 16));
    }

    fn tell(&mut self, _: u8, _: Nanos, event: Event) {
        if let Event::Left(why) = event {
            assert!(!why.to_string().is_empty());
        }
    }
}
