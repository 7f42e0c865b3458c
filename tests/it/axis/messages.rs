//! One axis per message, and a connection for each station.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

use crate::axis::machine::Machine;
use tickbus_test_log as logged;

/// Three axes, one further signal, and one message per part.
const ONE_BY_ONE: &str = "[driver]\nid = 1\nname = \"one by one\"\n[fieldbus]\nkind = \"socket\"\n\
    address = \"127.0.0.1:0\"\nmessage = \"axis\"\ncycle = \"2ms\"\n\
    [[axis]]\nname = \"A\"\n[[axis]]\nname = \"B\"\n[[axis]]\nname = \"C\"\ndiagnostics = true\n\
    [[signal]]\nname = \"time\"\naddress = \"%ID36\"\ntype = \"REAL\"\n";

#[test]
fn an_axis_per_message_reaches_that_axis_and_leaves_the_others() {
    let mut machine = Machine::new(ONE_BY_ONE);
    let mut plc = machine.clients(1).remove(0);
    let message = |axis: u8, bits: u8, position: f32| {
        let mut bytes = vec![0, axis, bits, 0];
        bytes.extend(position.to_be_bytes());
        bytes.resize(32, 0);
        bytes
    };
    plc.write_all(&message(2, 0x11, 20.0)).expect("it reads");
    machine.until("a command for B", |machine| machine.get("B.Execute") == 1.0);
    plc.write_all(&message(3, 0x10, 30.0)).expect("it reads");
    machine.until("the position of C", |machine| {
        machine.get("C.TargetPosition") == 30.0
    });
    assert_eq!(machine.get("B.TargetPosition"), 20.0);
    assert_eq!(machine.get("A.Enable"), 0.0);
    let pulses = machine.place("B.Execute");
    assert_eq!(machine.slots[pulses].real(), 1.0, "B goes on as it was");
    // An edge between two ticks must be seen as well.
    plc.write_all(&message(2, 0x10, 20.0)).expect("it reads");
    machine.until("its end", |machine| machine.get("B.Execute") == 0.0);
    let both = [message(2, 0x11, 21.0), message(2, 0x10, 21.0)].concat();
    plc.write_all(&both).expect("it reads");
    machine.until("a short pulse", |machine| machine.get("B.Execute") == 1.0);
    machine.until("its end", |machine| machine.get("B.Execute") == 0.0);
}

#[test]
fn feedback_comes_axis_by_axis_what_has_changed_first() {
    let mut machine = Machine::new(ONE_BY_ONE);
    machine.set("A.ActualPosition", 1.0);
    machine.set("B.ActualPosition", 2.0);
    machine.set("C.Status", 772.0);
    machine.set("time", 4.0);
    machine.tick();
    let mut plc = machine.clients(1).remove(0);
    // The longest structure has 16 bytes, so each message has 18.
    let mut record = [0; 18];
    let mut seen = [[0; 16]; 4];
    for _ in 0..4 {
        plc.read_exact(&mut record).expect("a message");
        assert_eq!(record[0], 0);
        seen[usize::from(record[1])].copy_from_slice(&record[2..]);
    }
    assert_eq!(seen[1][2..6], 1.0_f32.to_be_bytes());
    assert_eq!(seen[2][2..6], 2.0_f32.to_be_bytes());
    assert_eq!(seen[3][10..12], [3, 4]);
    assert_eq!(
        seen[0][..4],
        4.0_f32.to_be_bytes(),
        "what belongs to no axis is part 0"
    );
    machine.set("B.ActualPosition", 5.0);
    machine.tick();
    // At most the messages in transit, and then B ahead of its turn.
    let mut turns = 0;
    while record[1] != 2 || record[4..8] != 5.0_f32.to_be_bytes() {
        plc.read_exact(&mut record).expect("a message");
        turns += 1;
        assert!(turns < 200, "B has its turn");
    }
}

#[test]
fn a_message_for_an_axis_that_there_is_not_ends_the_connection_with_its_reason() {
    let mut machine = Machine::new(ONE_BY_ONE);
    let mut plc = machine.clients(1).remove(0);
    let mut message = [0; 32];
    message[1] = 4;
    plc.write_all(&message).expect("it reads");
    machine.until("the reason", |machine| {
        let reason = machine.statistic("reason").unwrap_or_default();
        reason.contains("axis 4, but there are 3") && reason.contains("listening")
    });
    assert_eq!(machine.statistic("cause").as_deref(), Some("protocol"));
}

#[test]
fn both_plcs_are_two_stations_of_one_driver_each_at_a_port_of_its_own() {
    let mut machine = Machine::new(
        "[driver]\nid = 1\nname = \"line\"\n[fieldbus]\nkind = \"socket\"\ncycle = \"2ms\"\n\
         max_age = \"250ms\"\n\
         [[station]]\nname = \"charger\"\naddress = \"127.0.0.1:0\"\n\
         [[station]]\nname = \"lathe\"\naddress = \"127.0.0.1:0\"\n\
         [[axis]]\nname = \"feeder\"\nstation = \"charger\"\n\
         [[axis]]\nname = \"arm\"\nstation = \"charger\"\n\
         [[axis]]\nname = \"knife\"\nstation = \"lathe\"\n",
    );
    let mut clients = machine.clients(2);
    let (mut lathe, mut charger) = (clients.remove(1), clients.remove(0));
    let mut outputs = [vec![0; 60], vec![0; 30]];
    outputs[0][30] = 0x10;
    outputs[1][0] = 0x10;
    machine.set("arm.ActualPosition", 1.0);
    machine.set("knife.ActualPosition", 2.0);
    let talk = |machine: &mut Machine, plc: &mut TcpStream, station: usize| {
        let mut input = vec![0; [20, 10][station]];
        plc.write_all(&outputs[station]).expect("it reads");
        plc.read_exact(&mut input).expect("a record");
        machine.tick();
        input
    };
    let begun = Instant::now();
    loop {
        let input = talk(&mut machine, &mut charger, 0);
        let other = talk(&mut machine, &mut lathe, 1);
        if machine.get("arm.Enable") + machine.get("knife.Enable") == 2.0
            && input[12..16] == 1.0_f32.to_be_bytes()
            && other[2..6] == 2.0_f32.to_be_bytes()
        {
            break;
        }
        assert!(begun.elapsed() < Duration::from_secs(10));
    }
    let running = |machine: &Machine| machine.statistic("state").as_deref() == Some("running");
    assert!(running(&machine), "{:?}", machine.statistic("reason"));

    // One connection is closed; the other is not affected.
    drop(lathe);
    while machine.get("knife.Enable") == 1.0 {
        talk(&mut machine, &mut charger, 0);
        assert!(begun.elapsed() < Duration::from_secs(20));
    }
    assert_eq!(machine.get("arm.Enable"), 1.0);
    assert!(!running(&machine));
    let reason = machine.statistic("reason").expect("a reason");
    assert!(
        reason.contains("\"charger\": connected with") && reason.contains("\"lathe\": listening"),
        "{reason}"
    );

    // The connection is opened again, perhaps before the driver has found the old one closed.
    logged::expect("was turned away, since one client is served at a time");
    let mut lathe = machine.clients(2).remove(1);
    while !running(&machine) || machine.get("knife.Enable") == 0.0 {
        talk(&mut machine, &mut charger, 0);
        talk(&mut machine, &mut lathe, 1);
        assert!(
            begun.elapsed() < Duration::from_secs(30),
            "{:?}",
            machine.statistic("reason")
        );
    }
}
