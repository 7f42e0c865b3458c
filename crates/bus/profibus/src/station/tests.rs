use super::*;
use crate::Gsd;
use crate::telegram::{DATA_LIMIT, Telegram};

mod alarms;
mod records;

const MASTER: u8 = 2;
const SLAVE: u8 = 8;

/// A machine that records its events.
#[derive(Default)]
struct Machine {
    inputs: u8,
    loses: bool,
    outputs: Vec<Vec<u8>>,
    /// The time that counts for the last outputs.
    came: Nanos,
    delivered: usize,
    alive: usize,
    events: Vec<Event>,
}

impl Process for Machine {
    fn inputs(&mut self, _station: u8, _now: Nanos, inputs: &mut [u8]) -> bool {
        inputs.fill(self.inputs);
        !self.loses
    }

    fn delivered(&mut self, _station: u8) {
        self.delivered += 1;
    }

    fn outputs(&mut self, _station: u8, now: Nanos, outputs: &[u8]) {
        self.outputs.push(outputs.to_vec());
        self.came = now;
    }

    fn alive(&mut self, _station: u8, _now: Nanos) {
        self.alive += 1;
    }

    fn tell(&mut self, _station: u8, _now: Nanos, event: Event) {
        self.events.push(event);
    }
}

/// A station, its machine, and a master that toggles its frame count bit.
struct Rig {
    station: Station,
    machine: Machine,
    now: Nanos,
    master: u8,
    control: u8,
}

/// The reply.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Came {
    Nothing,
    Short,
    Data(u8, Vec<u8>),
}

fn identity() -> Identity {
    Identity {
        ident: 0x80E0,
        configuration: Configuration::of_bytes(&[0x50, 0x60]).expect("whole"),
        user: UserParameters::default(),
        sync: true,
        freeze: true,
        fail_safe: false,
        dpv1: false,
        max_diagnosis: DATA_LIMIT,
        acyclic: Acyclic::default(),
    }
}

const LOCK: u8 = 0x80;

impl Rig {
    fn new(identity: Identity) -> Self {
        Self {
            station: Station::new(SLAVE, identity),
            machine: Machine::default(),
            now: Nanos(0),
            master: MASTER,
            control: 0x6D,
        }
    }

    /// A rig in data exchange, with these bits of the first octet of `Set_Prm` and this watchdog.
    fn exchanging(identity: Identity, status: u8, watchdog: u8) -> Self {
        let mut rig = Self::new(identity);
        assert_eq!(rig.parameterise(status | LOCK, watchdog), Came::Short);
        assert_eq!(rig.ask(62, &[0x50, 0x60]), Came::Short);
        assert_eq!(rig.station.state(), State::DataExch);
        rig
    }

    fn parameterise(&mut self, status: u8, watchdog: u8) -> Came {
        let group = 0x02;
        self.ask(61, &[status, watchdog, 1, 11, 0x80, 0xE0, group])
    }

    fn raw(&mut self, dsap: Option<u8>, control: u8, data: &[u8]) -> Came {
        self.from(62, dsap, control, data)
    }

    /// A telegram of the master's service access point `ssap`, if it has any.
    fn from(&mut self, ssap: u8, dsap: Option<u8>, control: u8, data: &[u8]) -> Came {
        let frame = Frame {
            destination: SLAVE,
            source: self.master,
            control: Control(control),
            dsap,
            ssap: dsap.map(|_| ssap),
            data,
        };
        let mut reply = Vec::new();
        self.station
            .request(self.now, &frame, &mut self.machine, &mut reply);
        match Telegram::parse(&reply).expect("a telegram") {
            None => Came::Nothing,
            Some((Telegram::ShortAck, 1)) => Came::Short,
            Some((Telegram::Frame(answer), length)) if length == reply.len() => {
                assert_eq!((answer.destination, answer.source), (self.master, SLAVE));
                if answer.ssap.is_some() {
                    assert_eq!((answer.dsap, answer.ssap), (Some(ssap), dsap));
                }
                Came::Data(answer.control.0, answer.data.to_vec())
            }
            other => panic!("{other:?}"),
        }
    }

    fn toggle(&mut self) -> u8 {
        let control = self.control;
        self.control = if control == 0x5D { 0x7D } else { 0x5D };
        control
    }

    fn ask(&mut self, dsap: u8, data: &[u8]) -> Came {
        let control = self.toggle();
        self.raw(Some(dsap), control, data)
    }

    fn exchange(&mut self, outputs: &[u8]) -> Came {
        let control = self.toggle();
        self.raw(None, control, outputs)
    }

    fn control(&mut self, command: u8, groups: u8) {
        let came = self.raw(Some(58), 0x46, &[command, groups]);
        assert_eq!(came, Came::Nothing);
    }

    fn diagnose(&mut self, blocks: &[&[u8]], is_static: bool) {
        self.station.diagnose(&Diagnosed {
            blocks: blocks.iter().map(|block| block.to_vec()).collect(),
            is_static,
            alarms: Vec::new(),
        });
    }

    fn diagnosis(&mut self) -> Vec<u8> {
        match self.ask(60, &[]) {
            Came::Data(0x08, data) => data,
            other => panic!("{other:?}"),
        }
    }
}

fn data(inputs: &[u8]) -> Came {
    Came::Data(0x08, inputs.to_vec())
}

fn refused() -> Came {
    Came::Data(0x03, Vec::new())
}

#[test]
fn a_master_starts_it_up_and_exchanges_data() {
    let mut rig = Rig::new(identity());
    assert_eq!(rig.raw(None, 0x49, &[]), Came::Data(0x00, Vec::new()));
    assert_eq!(rig.diagnosis(), [0x02, 0x05, 0, 0xFF, 0x80, 0xE0]);
    assert_eq!(rig.ask(59, &[]), data(&[0x50, 0x60]));
    assert_eq!(rig.exchange(&[1, 2]), refused());
    assert_eq!(rig.ask(62, &[0x50, 0x60]), refused(), "not before Set_Prm");
    assert_eq!(rig.parameterise(LOCK | 0x08, 10), Came::Short);
    assert_eq!(rig.diagnosis(), [0x02, 0x0C, 0, MASTER, 0x80, 0xE0]);
    assert_eq!(rig.ask(62, &[0x50, 0x60]), Came::Short);
    assert_eq!(rig.diagnosis(), [0x00, 0x0C, 0, MASTER, 0x80, 0xE0]);
    rig.machine.inputs = 7;
    assert_eq!(rig.exchange(&[1, 2]), data(&[7, 7]));
    rig.machine.inputs = 8;
    assert_eq!(rig.exchange(&[3, 4]), data(&[8, 8]));
    assert_eq!(rig.machine.outputs, [[1, 2], [3, 4]]);
    assert_eq!(rig.ask(56, &[]), data(&[8, 8]), "RD_Inp");
    assert_eq!(rig.ask(57, &[]), data(&[3, 4]), "RD_Outp");
    let master = MASTER;
    let events = [Event::Parameterised { master }, Event::Exchanges { master }];
    assert_eq!(rig.machine.events, events);
}

#[test]
fn a_repeated_request_gets_the_same_answer_and_is_not_served_twice() {
    let mut rig = Rig::exchanging(identity(), 0, 0);
    rig.machine.inputs = 7;
    let first = rig.raw(None, 0x5D, &[1, 2]);
    rig.machine.inputs = 9;
    assert_eq!(rig.raw(None, 0x5D, &[1, 2]), first);
    assert_eq!((rig.machine.outputs.len(), rig.machine.alive), (1, 1));
    assert_eq!(rig.machine.delivered, 0, "the master does not have it");
    assert_eq!(rig.raw(None, 0x7D, &[1, 2]), data(&[9, 9]));
    assert_eq!(rig.machine.delivered, 1, "it has gone on");
    // Different outputs are accepted even from a master whose bit is stuck.
    assert_eq!(rig.raw(None, 0x7D, &[5, 6]), data(&[9, 9]));
    assert_eq!(rig.machine.outputs, [[1, 2], [1, 2], [5, 6]]);
    // A first request is never a repetition.
    rig.raw(None, 0x6D, &[5, 6]);
    rig.raw(None, 0x6D, &[5, 6]);
    assert_eq!(rig.machine.outputs.len(), 5);
}

#[test]
fn a_repeated_configuration_does_not_renew_the_outputs_of_before() {
    let mut rig = Rig::exchanging(identity(), 0, 0);
    rig.raw(None, 0x5D, &[1, 2]);
    assert_eq!(rig.parameterise(LOCK, 0), Came::Short);
    for _ in 0..2 {
        assert_eq!(rig.raw(Some(62), 0x5D, &[0x50, 0x60]), Came::Short);
    }
    assert_eq!(rig.station.state(), State::DataExch);
    assert_eq!((rig.machine.outputs.len(), rig.machine.alive), (1, 0));
}

#[test]
fn inputs_that_are_lost_on_the_way_are_sent_with_the_repetition() {
    let mut rig = Rig::exchanging(identity(), 0, 0);
    rig.machine.loses = true;
    assert_eq!(rig.raw(None, 0x5D, &[1, 2]), Came::Nothing);
    rig.machine.loses = false;
    assert_eq!(rig.raw(None, 0x5D, &[1, 2]), data(&[0, 0]));
}

#[test]
fn the_watchdog_releases_the_station_and_clears_its_outputs() {
    let mut rig = Rig::exchanging(identity(), 0x08, 10);
    rig.exchange(&[1, 2]);
    let limit = Nanos::from_millis(100);
    assert_eq!(rig.station.deadline(), limit);
    rig.now = limit - Nanos(1);
    // Any telegram of the master will do, even a broadcast.
    rig.control(0, 0);
    rig.now = limit;
    rig.station.turn(rig.now, &mut rig.machine);
    assert_eq!(rig.station.state(), State::DataExch);
    rig.now = rig.station.deadline();
    rig.station.turn(rig.now, &mut rig.machine);
    assert_eq!(rig.station.state(), State::WaitPrm);
    let why = Leaving::Watchdog(limit);
    assert_eq!(rig.machine.events.last(), Some(&Event::Left(why)));
    assert_eq!(rig.station.deadline(), Nanos::MAX);
    assert_eq!(rig.diagnosis(), [0x02, 0x05, 0, 0xFF, 0x80, 0xE0]);
    assert_eq!(rig.exchange(&[1, 2]), refused());
}

#[test]
fn wrong_parameters_are_acknowledged_and_told_in_the_diagnosis_and_in_words() {
    for (parameters, words) in [
        (
            &[LOCK, 0, 0, 11, 0x12, 0x34, 0][..],
            "expected ident 80E0, received 1234",
        ),
        (
            &[LOCK, 0, 0, 11, 0x80, 0xE0],
            "6 octets, expected at least 7",
        ),
        (&[LOCK | 0x08, 0, 5, 11, 0x80, 0xE0, 0], "its time is 0"),
    ] {
        let mut rig = Rig::new(identity());
        assert_eq!(rig.ask(61, parameters), Came::Short);
        assert_eq!(rig.ask(62, &[0x50, 0x60]), Came::Short, "without effect");
        assert_eq!(rig.diagnosis()[..2], [0x42, 0x05], "{words}");
        let Some(Event::Left(why)) = rig.machine.events.last() else {
            panic!("nothing told of {words}");
        };
        assert!(why.to_string().contains(words), "{why}");
        // The right parameters repair that.
        rig.parameterise(LOCK, 0);
        assert_eq!(rig.diagnosis()[..2], [0x02, 0x04]);
    }
}

#[test]
fn parameters_that_its_gsd_file_does_not_allow_are_refused_in_words() {
    let drive = include_str!("../../../../../tests/gsd/drive.gsd");
    let gsd = Gsd::read(drive.as_bytes()).expect("a right file");
    let names = ["Standard telegram 1", "Empty"].map(str::to_owned);
    let mut rig = Rig::new(gsd.identity(&names).expect("its modules"));
    let right = [
        &[LOCK, 0, 0, 11, 0x0D, 0x51, 0][..],
        &[0xC0, 0x60, 0, 1, 1, 0xF4, 1, 0xFF, 0x9C],
    ];
    let right = right.concat();
    let mut wrong = right.clone();
    wrong[10] = 3;
    for (parameters, words) in [
        (
            &wrong[..],
            "the device: parameter \"Stop mode\" is 3; the GSD allows 0 to 2",
        ),
        (
            &right[..13],
            "expected 9 octets of user parameters, received 6; those of slot 1 \"Standard telegram 1\" are missing",
        ),
    ] {
        assert_eq!(rig.ask(61, parameters), Came::Short);
        assert_eq!(rig.diagnosis()[..2], [0x42, 0x05], "{words}");
        let Some(Event::Left(why)) = rig.machine.events.last() else {
            panic!("nothing told of {words}");
        };
        assert!(why.to_string().contains(words), "{why}");
    }
    assert_eq!(rig.ask(61, &right), Came::Short);
    assert_eq!(rig.station.state(), State::WaitCfg);
}

#[test]
fn what_the_device_does_not_support_is_refused() {
    let plain = Identity {
        sync: false,
        ..identity()
    };
    let mut rig = Rig::new(plain);
    rig.parameterise(LOCK | 0x20, 0);
    assert_eq!(rig.diagnosis()[..2], [0x12, 0x05]);
    rig.parameterise(LOCK | 0x10, 0);
    assert_eq!(rig.diagnosis()[..2], [0x02, 0x04], "FREEZE it has");
}

#[test]
fn a_wrong_configuration_is_acknowledged_and_told_with_its_slot() {
    let mut rig = Rig::new(identity());
    rig.parameterise(LOCK, 0);
    assert_eq!(rig.ask(62, &[0x50, 0x61]), Came::Short);
    assert_eq!(rig.diagnosis()[..2], [0x06, 0x05]);
    let Some(Event::Left(why)) = rig.machine.events.last() else {
        panic!("nothing told");
    };
    let words = "slot 2: expected 60 (2 bytes of outputs), received 61 (4 bytes of outputs)";
    assert!(why.to_string().contains(words), "{why}");
}

#[test]
fn a_wrong_number_of_outputs_releases_it() {
    let mut rig = Rig::exchanging(identity(), 0, 0);
    assert_eq!(rig.exchange(&[1]), refused());
    assert_eq!(rig.station.state(), State::WaitPrm);
}

#[test]
fn another_master_reads_but_neither_parameterises_nor_drives_it() {
    let mut rig = Rig::exchanging(identity(), 0, 0);
    rig.master = 3;
    assert_eq!(rig.exchange(&[1, 2]), refused());
    assert_eq!(
        rig.ask(61, &[0x40, 0, 0, 0, 0, 0, 0]),
        Came::Short,
        "ignored"
    );
    assert_eq!(rig.ask(62, &[0x11]), refused());
    rig.control(0x02, 0);
    assert_eq!(rig.diagnosis()[3], MASTER);
    assert_eq!(rig.ask(56, &[]), data(&[0, 0]));
    rig.master = MASTER;
    assert_eq!(rig.exchange(&[1, 2]), data(&[0, 0]));
    assert_eq!(rig.ask(61, &[0x40, 0, 0, 0, 0, 0, 0]), Came::Short);
    assert_eq!(rig.station.state(), State::WaitPrm, "its own releases it");
}

#[test]
fn clear_takes_the_outputs_away_until_the_master_operates() {
    let mut rig = Rig::exchanging(identity(), 0, 0);
    rig.exchange(&[1, 2]);
    rig.control(0x02, 0);
    rig.exchange(&[3, 4]);
    assert_eq!(rig.ask(57, &[]), data(&[0, 0]));
    assert_eq!(rig.machine.outputs, [[1, 2]]);
    rig.control(0x00, 0);
    rig.exchange(&[5, 6]);
    assert_eq!(rig.machine.outputs, [[1, 2], [5, 6]]);
    assert_eq!(rig.machine.events[2..], [Event::Cleared, Event::Operates]);
}

#[test]
fn telegrams_without_outputs_mean_clear_to_a_device_that_knows_them() {
    let fail_safe = Identity {
        fail_safe: true,
        ..identity()
    };
    let mut rig = Rig::exchanging(fail_safe, 0, 0);
    rig.exchange(&[1, 2]);
    assert_eq!(rig.exchange(&[]), data(&[0, 0]));
    assert_eq!(rig.machine.events.last(), Some(&Event::Cleared));
    // After Clear by Global_Control, outputs alone do not end CLEAR.
    rig.control(0x02, 0);
    rig.exchange(&[3, 4]);
    assert_eq!(rig.machine.events.last(), Some(&Event::Cleared));
    rig.control(0x00, 0);
    rig.exchange(&[5, 6]);
    assert_eq!(rig.machine.outputs, [[1, 2], [5, 6]]);
}

#[test]
fn freeze_holds_the_inputs_and_sync_the_outputs_of_the_groups_they_are_for() {
    let mut rig = Rig::exchanging(identity(), 0x30, 0);
    rig.machine.inputs = 1;
    rig.control(0x08, 0x01);
    rig.machine.inputs = 2;
    assert_eq!(rig.exchange(&[1, 1]), data(&[2, 2]), "another group's");
    rig.control(0x08, 0x02);
    rig.machine.inputs = 3;
    assert_eq!(rig.exchange(&[1, 1]), data(&[2, 2]));
    let delivered = rig.machine.delivered;
    assert_eq!(rig.exchange(&[1, 1]), data(&[2, 2]));
    assert_eq!(
        rig.machine.delivered,
        delivered + 1,
        "once, not in each cycle"
    );
    rig.exchange(&[1, 1]);
    assert_eq!(rig.machine.delivered, delivered + 1);
    assert_eq!(rig.diagnosis()[1], 0x14);
    rig.control(0x04, 0);
    assert_eq!(rig.exchange(&[1, 1]), data(&[3, 3]));

    let before = rig.machine.outputs.len();
    rig.control(0x20, 0);
    rig.exchange(&[5, 5]);
    rig.exchange(&[6, 6]);
    assert_eq!(rig.machine.outputs.len(), before);
    assert_eq!(rig.diagnosis()[1], 0x24);
    rig.control(0x20, 0);
    assert_eq!(rig.machine.outputs.last(), Some(&vec![6, 6]));
    rig.exchange(&[7, 7]);
    // The command that ends the mode wins over the one that begins it.
    rig.control(0x30, 0);
    rig.exchange(&[8, 8]);
    assert_eq!(rig.machine.outputs[before..], [[6, 6], [7, 7], [8, 8]]);
}

#[test]
fn a_diagnosis_is_announced_once_and_read() {
    let mut rig = Rig::exchanging(identity(), 0, 0);
    rig.diagnose(&[&[0x03, 0x11, 0x22]], false);
    assert_eq!(rig.exchange(&[1, 2]), Came::Data(0x0A, vec![0, 0]));
    let expected = [0x08, 0x04, 0, MASTER, 0x80, 0xE0, 0x03, 0x11, 0x22];
    assert_eq!(rig.diagnosis(), expected);
    assert_eq!(rig.exchange(&[1, 2]), data(&[0, 0]));
    rig.diagnose(&[], false);
    assert_eq!(rig.exchange(&[1, 2]), Came::Data(0x0A, vec![0, 0]));
    assert_eq!(rig.diagnosis().len(), 6);
}

#[test]
fn a_diagnosis_that_does_not_fit_says_so_and_a_static_one_goes_on_until_it_is_over() {
    let small = Identity {
        max_diagnosis: 10,
        ..identity()
    };
    let mut rig = Rig::exchanging(small, 0, 0);
    let high = Came::Data(0x0A, vec![0, 0]);
    rig.diagnose(&[&[0x03, 0x11, 0x22], &[0x81, 0x40, 0x26]], false);
    assert_eq!(rig.exchange(&[1, 2]), high);
    let told = rig.diagnosis();
    assert_eq!(told[..3], [0x08, 0x04, 0x80], "Ext_Diag_Overflow");
    assert_eq!(told[6..], [0x03, 0x11, 0x22], "no half blocks");
    rig.diagnose(&[&[0x03, 0x11, 0x22]], true);
    for _ in 0..3 {
        assert_eq!(rig.exchange(&[1, 2]), high);
        assert_eq!(rig.diagnosis()[..3], [0x08, 0x06, 0x00], "Stat_Diag");
    }
    assert_eq!(rig.machine.outputs.last(), Some(&vec![1, 2]));
    rig.diagnose(&[], false);
    assert_eq!(rig.exchange(&[1, 2]), high, "that it is over is news, too");
    assert_eq!(rig.diagnosis(), [0x00, 0x04, 0, MASTER, 0x80, 0xE0]);
    assert_eq!(rig.exchange(&[1, 2]), data(&[0, 0]));
}

#[test]
fn a_station_without_inputs_acknowledges_shortly_unless_it_has_a_diagnosis() {
    let outputs_only = Identity {
        configuration: Configuration::of_bytes(&[0x20]).expect("whole"),
        ..identity()
    };
    let mut rig = Rig::new(outputs_only);
    rig.parameterise(LOCK, 0);
    rig.ask(62, &[0x20]);
    assert_eq!(rig.exchange(&[1]), Came::Short);
    rig.diagnose(&[&[0x02, 0x11]], false);
    assert_eq!(rig.exchange(&[1]), Came::Data(0x0A, Vec::new()));
}

#[test]
fn the_parameters_of_dpv1_set_the_unit_of_the_watchdog() {
    let dpv1 = Identity {
        dpv1: true,
        ..identity()
    };
    let mut rig = Rig::new(dpv1);
    rig.ask(61, &[LOCK | 0x08, 50, 2, 0, 0x80, 0xE0, 0, 0xC4, 0, 0]);
    assert_eq!(rig.station.deadline(), Nanos::from_millis(100));
    rig.ask(62, &[0x50, 0x60]);
    rig.exchange(&[]);
    assert_eq!(rig.machine.events.last(), Some(&Event::Cleared), "bit 6");
}

#[test]
fn min_tsdr_may_be_set_without_locking() {
    let mut rig = Rig::new(identity());
    assert_eq!(rig.station.min_tsdr(), 11);
    rig.ask(61, &[0, 0, 0, 30, 0, 0, 0]);
    assert_eq!(
        (rig.station.min_tsdr(), rig.station.state()),
        (30, State::WaitPrm)
    );
}

#[test]
fn unknown_services_and_set_slave_add_are_refused() {
    let mut rig = Rig::new(identity());
    for dsap in [0, 51, 53, 55, 63] {
        assert_eq!(rig.ask(dsap, &[1, 2, 3, 4]), refused());
    }
    let came = rig.raw(Some(60), 0x4E, &[]);
    assert_eq!(came, refused(), "no service of DP");
}

#[test]
fn what_was_answered_before_the_watchdog_is_not_repeated_after_it() {
    let mut rig = Rig::exchanging(identity(), 0x08, 10);
    let control = rig.toggle();
    assert_eq!(rig.raw(None, control, &[1, 2]), data(&[0, 0]));
    rig.now = Nanos::from_secs(1);
    assert_eq!(rig.raw(None, control, &[1, 2]), refused());
    assert_eq!(rig.station.state(), State::WaitPrm);
    assert_eq!(rig.raw(None, control, &[1, 2]), refused());
}

#[test]
fn an_answer_that_the_master_never_got_does_not_count_when_it_begins_anew() {
    for asked in [60, 61] {
        let mut rig = Rig::exchanging(identity(), 0, 0);
        rig.exchange(&[1, 2]);
        // The answer is lost, like those to the repetitions.
        let prm = [LOCK, 0, 1, 11, 0x80, 0xE0, 0];
        let first: &[u8] = if asked == 61 { &prm } else { &[] };
        rig.raw(Some(asked), 0x6D, first);
        rig.control = 0x5D;
        rig.exchange(&[1, 2]);
        assert_eq!(rig.machine.delivered, 0, "service {asked}");
        rig.exchange(&[1, 2]);
        assert_eq!(rig.machine.delivered, 1, "service {asked}");
    }
}

#[test]
fn outputs_from_before_clear_do_not_come_back_under_sync() {
    let mut rig = Rig::exchanging(identity(), 0x20, 0);
    rig.exchange(&[1, 2]);
    for command in [0x20, 0x02, 0x00] {
        rig.control(command, 0);
    }
    rig.exchange(&[5, 6]);
    assert_eq!(rig.machine.outputs.last(), Some(&vec![0, 0]), "held");
    rig.control(0x20, 0);
    assert_eq!(rig.machine.outputs.last(), Some(&vec![5, 6]));
}

#[test]
fn outputs_that_sync_held_before_clear_are_never_released() {
    let mut rig = Rig::exchanging(identity(), 0x20, 0);
    rig.control(0x20, 0);
    rig.exchange(&[3, 4]);
    rig.control(0x20, 0);
    rig.exchange(&[5, 6]);
    for command in [0x02, 0x00, 0x20] {
        rig.control(command, 0);
    }
    assert_eq!(rig.machine.outputs, [[0, 0], [3, 4]], "and never [5, 6]");
}

#[test]
fn outputs_after_clear_are_served_though_the_master_never_toggles_its_bit() {
    let mut rig = Rig::exchanging(identity(), 0, 0);
    rig.raw(None, 0x5D, &[1, 2]);
    rig.control(0x02, 0);
    for _ in 0..2 {
        rig.raw(None, 0x5D, &[0, 0]);
    }
    rig.control(0x00, 0);
    for _ in 0..2 {
        rig.raw(None, 0x5D, &[0, 0]);
    }
    assert_eq!(rig.machine.outputs, [[1, 2], [0, 0]]);
}

#[test]
fn outputs_that_sync_held_are_as_old_as_the_exchange_that_brought_them() {
    let mut rig = Rig::exchanging(identity(), 0x20, 0);
    rig.exchange(&[1, 2]);
    rig.control(0x20, 0);
    rig.now = Nanos::from_millis(10);
    rig.exchange(&[3, 4]);
    rig.now = Nanos::from_secs(60);
    rig.control(0x20, 0);
    assert_eq!(rig.machine.outputs, [[1, 2], [3, 4]]);
    assert_eq!(rig.machine.came, Nanos::from_millis(10));
}

#[test]
fn parameters_without_sync_end_it() {
    let mut rig = Rig::exchanging(identity(), 0x20, 0);
    rig.control(0x20, 0);
    rig.exchange(&[1, 2]);
    assert_eq!(rig.parameterise(LOCK, 0), Came::Short);
    rig.exchange(&[3, 4]);
    assert_eq!(rig.machine.outputs.last(), Some(&vec![3, 4]));
}

#[test]
fn a_refusal_takes_back_what_the_diagnosis_said_before() {
    let mut rig = Rig::new(identity());
    rig.parameterise(LOCK, 0);
    rig.ask(62, &[0x50]);
    let faults = |rig: &mut Rig| match rig.ask(60, &[]) {
        Came::Data(_, data) => data[0] & 0x54,
        other => panic!("{other:?}"),
    };
    assert_eq!(faults(&mut rig), 0x04, "the configuration");
    rig.ask(61, &[LOCK, 0, 1, 11, 0x12, 0x34, 0]);
    assert_eq!(faults(&mut rig), 0x40, "the parameters alone");
}
