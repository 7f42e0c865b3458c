//! The core of the observer, by telegrams made by hand.

use super::*;
use crate::configuration::Configuration;
use crate::user_parameters::UserParameters;

const BAUD: u32 = 500_000;

fn identity(config: &[u8]) -> Identity {
    Identity {
        ident: 0x80E0,
        configuration: Configuration::of_bytes(config).expect("whole"),
        user: UserParameters::default(),
        sync: true,
        freeze: true,
        fail_safe: false,
        dpv1: false,
        max_diagnosis: 244,
        acyclic: crate::Acyclic::default(),
    }
}

/// A station at 8 with two bytes each way.
fn observer() -> Observer {
    Observer::new(BAUD, [(8, identity(&[0x51, 0x61]))])
}

fn frame(to: u8, from: u8, control: u8, dsap: Option<u8>, data: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::new();
    Frame {
        destination: to,
        source: from,
        control: Control(control),
        dsap,
        ssap: dsap.map(|_| 62),
        data,
    }
    .append(&mut bytes);
    bytes
}

fn request(data: &[u8]) -> Vec<u8> {
    frame(8, 2, 0x5D, None, data)
}

fn answer(data: &[u8]) -> Vec<u8> {
    frame(2, 8, 0x08, None, data)
}

/// The news in these telegrams, a millisecond apart.
fn news(observer: &mut Observer, telegrams: &[Vec<u8>]) -> Vec<String> {
    let mut all = Vec::new();
    for (number, bytes) in (1..).zip(telegrams) {
        observer.hear(Nanos::from_millis(number), &bytes[..], |_, told| {
            all.push(match told {
                News::Exchange {
                    outputs,
                    inputs,
                    is_cleared,
                    ..
                } => format!("{outputs:?} {inputs:?} {is_cleared}"),
                News::Cleared(is_cleared) => format!("cleared {is_cleared}"),
                News::Unreadable(why) => why.to_owned(),
                News::Diagnosis(words) => words,
            });
        });
    }
    all
}

#[test]
fn only_an_answer_in_time_from_the_station_to_its_master_completes_an_exchange() {
    let (ask, told) = (request(&[1, 0, 2, 0]), answer(&[3, 0, 4, 0]));
    let one = ["[1, 0, 2, 0] [3, 0, 4, 0] false"];
    for (telegrams, expected) in [
        (vec![ask.clone(), told.clone()], &one[..]),
        // Repeated by the master, and answered once.
        (vec![ask.clone(), ask.clone(), told.clone()], &one),
        // The master has gone on.
        (vec![ask.clone(), vec![0xDC, 2, 2], told.clone()], &[]),
        // Nobody has asked; another station answers; another master is meant; the service is not active.
        (vec![told.clone()], &[]),
        (
            vec![ask.clone(), frame(2, 9, 0x08, None, &[3, 0, 4, 0])],
            &[],
        ),
        (
            vec![ask.clone(), frame(3, 8, 0x08, None, &[3, 0, 4, 0])],
            &[],
        ),
        (vec![ask.clone(), frame(2, 8, 0x03, None, &[])], &[]),
        // Another service of the station.
        (vec![frame(8, 2, 0x5D, Some(57), &[]), told.clone()], &[]),
    ] {
        assert_eq!(
            news(&mut observer(), &telegrams),
            expected,
            "{telegrams:02X?}"
        );
    }
}

#[test]
fn a_damaged_request_or_answer_gives_no_values() {
    for index in 0..request(&[1, 0, 2, 0]).len() {
        let mut damaged = request(&[1, 0, 2, 0]);
        damaged[index] ^= 0x20;
        let told = news(&mut observer(), &[damaged, answer(&[3, 0, 4, 0])]);
        assert!(told.is_empty(), "{index}: {told:?}");
    }
}

#[test]
fn a_station_without_inputs_acknowledges_and_a_short_acknowledgement_is_no_inputs() {
    let mut without = Observer::new(BAUD, [(8, identity(&[0x60]))]);
    let told = news(&mut without, &[request(&[1, 2]), vec![0xE5]]);
    assert_eq!(told, ["[1, 2] [] false"]);
    let once = [request(&[1, 0, 2, 0]), vec![0xE5]];
    // One alone can be noise.
    assert!(news(&mut observer(), &once).is_empty());
    let told = news(
        &mut observer(),
        &[once.clone(), once.clone(), once].concat(),
    );
    let words = "master 2 and station 8 exchange 4 bytes of outputs and 0 bytes of inputs, expected 4 and 4";
    assert!(told[0].starts_with(words), "{told:?}");
}

#[test]
fn clear_and_operate_of_the_stations_master_and_its_groups_are_told_and_those_of_others_are_not() {
    let mut observer = observer();
    let control = |from, command, groups| frame(127, from, 0x46, Some(58), &[command, groups]);
    let set_prm = |groups| {
        let head = [0x88, 1, 10, 11, 0x80, 0xE0, groups];
        [frame(8, 2, 0x5D, Some(61), &head), vec![0xE5]]
    };
    let exchange = [request(&[1, 0, 2, 0]), answer(&[3, 0, 4, 0])];
    let telegrams = [
        &set_prm(0b10)[..],
        &exchange[..],
        // Another master; another group; SYNC, which is no CLEAR.
        &[control(3, 2, 0), control(2, 2, 0b100), control(2, 0x20, 0)],
        &[control(2, 2, 0b110)],
        &exchange[..],
        &[control(2, 2, 0), control(2, 0, 0)],
    ];
    let told = news(&mut observer, &telegrams.concat());
    let expected = [
        "[1, 0, 2, 0] [3, 0, 4, 0] false",
        "cleared true",
        "[1, 0, 2, 0] [3, 0, 4, 0] true",
        "cleared false",
    ];
    assert_eq!(told, expected);
}

#[test]
fn what_another_master_tells_a_station_changes_nothing_for_its_own() {
    let mut observer = observer();
    let exchange = [request(&[1, 0, 2, 0]), answer(&[3, 0, 4, 0])];
    let telegrams = [
        // Before the first exchange, the observer does not know whose station it is.
        &[frame(127, 3, 0x46, Some(58), &[2, 0])][..],
        &exchange[..],
        // The station acknowledges these parameters for another device, and does not obey.
        &[
            frame(8, 3, 0x5D, Some(61), &[0x88, 1, 10, 11, 0x0B, 0x1C, 0]),
            vec![0xE5],
        ],
        &exchange[..],
        &[frame(127, 2, 0x46, Some(58), &[2, 0])],
        &exchange[..],
    ];
    let told = news(&mut observer, &telegrams.concat());
    let expected = [
        "[1, 0, 2, 0] [3, 0, 4, 0] false",
        "[1, 0, 2, 0] [3, 0, 4, 0] false",
        "cleared true",
        "[1, 0, 2, 0] [3, 0, 4, 0] true",
    ];
    assert_eq!(told, expected);
}

#[test]
fn a_master_that_is_known_to_be_in_clear_may_send_no_outputs() {
    let telegrams = [
        request(&[1, 0, 2, 0]),
        answer(&[3, 0, 4, 0]),
        frame(127, 2, 0x46, Some(58), &[2, 0]),
        request(&[]),
        answer(&[3, 0, 4, 0]),
    ];
    let told = news(&mut observer(), &telegrams);
    let expected = [
        "[1, 0, 2, 0] [3, 0, 4, 0] false",
        "cleared true",
        "[0, 0, 0, 0] [3, 0, 4, 0] true",
    ];
    assert_eq!(told, expected);
}

#[test]
fn a_device_with_fail_safe_is_cleared_by_telegrams_without_outputs() {
    let safe = Identity {
        fail_safe: true,
        ..identity(&[0x51, 0x61])
    };
    let told = news(
        &mut Observer::new(BAUD, [(8, safe)]),
        &[request(&[]), answer(&[3, 0, 4, 0])],
    );
    assert_eq!(told, ["[0, 0, 0, 0] [3, 0, 4, 0] true"]);
    let told = news(&mut observer(), &[request(&[]), answer(&[3, 0, 4, 0])]);
    assert!(told[0].contains("exchange 0 bytes of outputs"), "{told:?}");
}

#[test]
fn the_right_start_up_ends_what_a_wrong_one_began() {
    let mut observer = observer();
    let start = |ident: u8, config: &[u8]| {
        [
            frame(8, 2, 0x5D, Some(61), &[0x88, 1, 10, 11, 0x80, ident, 0]),
            vec![0xE5],
            frame(8, 2, 0x7D, Some(62), config),
            vec![0xE5],
            request(&[1, 0, 2, 0]),
            answer(&[3, 0, 4, 0]),
        ]
    };
    for (ident, config, words) in [
        (
            0xE1,
            &[0x51, 0x61][..],
            "a device with the ident 80E1, expected 80E0",
        ),
        (0xE0, &[0x61, 0x51], "slot 1: expected 51"),
        (0xE0, &[0x51, 0x61], "[1, 0, 2, 0] [3, 0, 4, 0] false"),
    ] {
        let told = news(&mut observer, &start(ident, config));
        assert!(told.len() == 1 && told[0].contains(words), "{told:?}");
    }
}

#[test]
fn tokens_without_damaged_bytes_are_not_garbled_and_noise_is_until_a_telegram_with_a_checksum_passes()
 {
    let mut observer = observer();
    news(&mut observer, &[vec![0xDC, 2, 2], vec![0xE5]]);
    assert!(!observer.is_garbled() && observer.framed().is_none());
    news(&mut observer, &[vec![0x00, 0x01, 0xE5]]);
    assert!(observer.is_garbled());
    news(&mut observer, &[vec![0x02], request(&[1, 0, 2, 0])]);
    assert!(!observer.is_garbled() && observer.framed().is_some());
}

#[test]
fn a_diagnosis_is_told_once_by_the_standards_names() {
    let ask = frame(8, 2, 0x6D, Some(60), &[]);
    let is = |octets: &[u8]| {
        let mut bytes = Vec::new();
        Frame {
            destination: 2,
            source: 8,
            control: Control(8),
            dsap: Some(62),
            ssap: Some(60),
            data: octets,
        }
        .append(&mut bytes);
        bytes
    };
    let starts = is(&[0x02, 0x05, 0, 0xFF, 0x80, 0xE0]);
    let told = news(
        &mut observer(),
        &[
            ask.clone(),
            starts.clone(),
            ask.clone(),
            starts,
            ask,
            is(&[0, 0x0C, 0]),
        ],
    );
    assert_eq!(told, ["Station_Not_Ready, Prm_Req: 02 05 00 FF 80 E0"]);
}
