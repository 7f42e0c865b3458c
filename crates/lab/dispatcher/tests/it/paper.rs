//! Every literal example of the paper, as it is printed there, with its stray blanks.

use crate::common::Lab;
use tickbus_dispatcher::{Counts, Device, Role};

const IDENTIFICATION: &str = "VR SIEMENS_LOGO001 Q08 I08 AQ02 AI03";
const DEVICES: [&str; 4] = [
    "VR:SIEMENS_LOGO002:Q08:I08:AQ02:AI03:192.168.0. 23:3334",
    "VR:SIEMENS_LOGO003:Q08:I08:AQ02:AI03:192.168.0. 23:3335",
    "VP:TESTING_BOARD:Q32:I32:AQ16:AI16:192.168.0.20 :3330",
    "VR:SIEMENS_LOGO001:Q08:I08:AQ02:AI03:192.168.0. 22:3334",
];
const VALUES: &str = "P Q1=20 Q2=20 Q3=5 Q4=24 Q5=0 Q6=0 Q7=0 AQ0=10 AQ1=15 AQ2=0";
const CONNECT: &str = "CONNECT I1:P1:Q2 Q1 :P2:I4";

#[test]
fn a_new_client_is_answered_by_the_list_of_devices_itself_last() {
    let mut lab = Lab::new();
    for (at, line) in DEVICES.iter().enumerate() {
        let device = Device::parse(line.as_bytes()).expect(line);
        let seat = lab
            .dispatcher
            .connected(lab.now, device.peer)
            .expect("there is room");
        let counts = device.to_string();
        let counts = counts
            .split(':')
            .skip(2)
            .take(4)
            .collect::<Vec<_>>()
            .join(" ");
        let heard = lab.ask(
            seat,
            &format!("{} {} {counts}", device.role.keyword(), device.name),
        );
        let expected: Vec<String> = DEVICES[..=at]
            .iter()
            .map(|line| line.replace(' ', ""))
            .collect();
        assert_eq!(heard, expected);
    }
}

#[test]
fn device_lines_say_what_the_client_said() {
    let device = Device::parse(DEVICES[3].as_bytes()).expect("it is printed so");
    let expected = Device {
        role: Role::Controller,
        name: "SIEMENS_LOGO001".to_owned(),
        counts: Counts::new(8, 8, 2, 3),
        peer: "192.168.0.22:3334".parse().expect("an address"),
    };
    assert_eq!(device, expected);
    assert_eq!(device.to_string(), DEVICES[3].replace(' ', ""));
}

#[test]
fn the_published_session_works_and_a_client_of_version_1_sees_nothing_else() {
    let mut lab = Lab::new();
    let first = lab.join("VP PUMP Q08 I08");
    let second = lab.join("VP TESTING_BOARD Q32 I32 AQ16 AI16");
    let logo = lab.connect();
    assert_eq!(lab.ask(logo, IDENTIFICATION).len(), 3);
    lab.hear(first);
    lab.hear(second);
    // P1 and P2 are the processes in the order of their registration.
    assert_eq!(lab.ask(logo, CONNECT), [""; 0]);
    assert_eq!(lab.ask(logo, VALUES), [""; 0]);
    assert_eq!(lab.hear(first), [""; 0]);
    assert_eq!(lab.hear(second), ["P I4=20"]);
    lab.say(first, "P Q1=24 Q2=24");
    assert_eq!(lab.hear(logo), ["P I1=24"]);
    assert_eq!(lab.ask(logo, VALUES), [""; 0]);
    assert_eq!(lab.hear(second), [""; 0], "nothing has changed");
}

#[test]
fn announced_are_two_analog_outputs_and_used_are_three() {
    let mut lab = Lab::new();
    let logo = lab.join(&format!("{IDENTIFICATION} V=2"));
    let scope = lab.join("VP SCOPE AI08");
    let answer = lab.ask(logo, "CONNECT AQ0:SCOPE:AI0 AQ1:SCOPE:AI1 AQ2:SCOPE:AI2");
    assert_eq!(answer, ["OK CONNECT"]);
    assert_eq!(lab.ask(logo, VALUES), [""; 0]);
    assert_eq!(lab.hear(scope), ["P AI0=10 AI1=15 AI2=0"]);
    assert_eq!(lab.ask(logo, "P AQ3=1"), ["ERR 404 you have no AQ3"]);
}

#[test]
fn controllers_are_cascaded() {
    let mut lab = Lab::new();
    let names = ["LOGO1", "LOGO2", "LOGO3"];
    let seats = names.map(|name| lab.join(&format!("VR {name} Q08 I08")));
    lab.say(seats[1], "CONNECT I1:LOGO1:Q1");
    lab.say(seats[2], "CONNECT I1:R2:Q1");
    lab.say(seats[0], "P Q1=24");
    assert_eq!(lab.hear(seats[1]), ["P I1=24"]);
    lab.say(seats[1], "P Q1=24");
    assert_eq!(lab.hear(seats[2]), ["P I1=24"]);
}
