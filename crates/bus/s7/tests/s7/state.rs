//! A CPU in STOP, or one that refuses some requests.

use super::*;

#[test]
fn a_cpu_in_stop_is_stale_with_that_cause_until_it_runs() {
    let (mut machine, cpu) = machine_of_two(Cpu {
        blocks: vec![5, 7],
        state: Some(0x04),
        ..Cpu::default()
    });
    machine.until("it is in STOP from the beginning", |end| {
        end.link().cause.name() == "stopped"
    });
    assert_eq!(machine.end.statistic("cpu"), "stop");
    assert_eq!(both(&machine.end), (99.0, 99.0), "its values never counted");
    for state in [0x08, 0x04, 0x68, 0x0A] {
        cpu.lock().expect("no panic").state = Some(state);
        let runs = state & 0x0F == 8;
        machine.until("the new state has come", |end| {
            let is_fresh = end.tick().code != Code::Stale;
            is_fresh == runs && both(end) == if runs { (5.0, 7.0) } else { (99.0, 99.0) }
        });
        assert_eq!(
            machine.end.statistic("cpu"),
            if runs { "run" } else { "stop" }
        );
    }
    assert!(machine.end.link().reason.contains("STOP"));
}

#[test]
fn a_cpu_that_does_not_tell_its_state_is_asked_once_a_connection() {
    logged::expect("does not say whether it is in RUN");
    let (mut machine, cpu) = machine_of_two(Cpu {
        blocks: vec![5, 7],
        state: None,
        ..Cpu::default()
    });
    machine.until("values come", |end| both(end) == (5.0, 7.0));
    for _ in 0..1000 {
        pass(&machine.clock, 1);
    }
    machine.end.tick();
    assert_eq!(both(&machine.end), (5.0, 7.0));
    assert_eq!(machine.end.statistic("cpu"), "unknown");
    assert_eq!(cpu.lock().expect("no panic").asked, 1);
}

#[test]
fn a_station_of_which_something_is_refused_is_stale_alone_and_tried_again() {
    logged::expect("it is stale, and is tried again");
    let (mut machine, cpu) = machine_of_two(Cpu {
        blocks: vec![5],
        state: Some(8),
        ..Cpu::default()
    });
    machine.until("one station is served, the other one told", |end| {
        let told = end
            .driver
            .statistics()
            .contains("refused=station \"right\"");
        told && both(end) == (5.0, 99.0)
    });
    let refused = machine.end.statistic("refused");
    assert!(
        refused.contains("reading DB7 byte") && refused.contains("code 0x0A"),
        "{refused}"
    );
    assert_eq!(machine.end.statistic("link.failed"), "0");
    cpu.lock().expect("no panic").blocks = vec![5, 7];
    machine.until("both are served", |end| both(end) == (5.0, 7.0));
    assert_eq!(machine.end.statistic("refused"), "nothing");
    // And the other way round.
    cpu.lock().expect("no panic").blocks = vec![7];
    machine.until("the other one is left out", |end| both(end) == (99.0, 7.0));
    cpu.lock().expect("no panic").blocks = Vec::new();
    assert_eq!(machine.until_reason("refuses reading DB"), "refused");
}

#[test]
fn a_station_that_works_after_a_reconnect_is_not_told_as_refused_any_more() {
    logged::expect("it is stale, and is tried again");
    let (mut machine, cpu) = machine_of_two(Cpu {
        blocks: vec![5],
        state: Some(8),
        ..Cpu::default()
    });
    machine.until("one station is refused", |end| {
        end.driver
            .statistics()
            .contains("refused=station \"right\"")
    });
    cpu.lock().expect("no panic").hangs_up = true;
    machine.until("the connection is gone", |end| {
        end.statistic("link.failed") != "0"
    });
    let mut one = cpu.lock().expect("no panic");
    (one.hangs_up, one.blocks) = (false, vec![5, 7]);
    drop(one);
    machine.until("both are served", |end| both(end) == (5.0, 7.0));
    assert_eq!(machine.end.statistic("refused"), "nothing");
}

#[test]
fn a_station_of_which_nothing_is_read_is_fresh_again_after_a_stop() {
    let (mut machine, cpu) = machine_with(
        Cpu {
            blocks: vec![5],
            state: Some(4),
            ..Cpu::default()
        },
        "input = \"DB7\"",
        "%IB0",
    );
    machine.until("it is in STOP", |end| end.link().cause.name() == "stopped");
    cpu.lock().expect("no panic").state = Some(8);
    machine.until("all of it is fresh", |end| {
        end.tick().code != Code::Stale && end.link().cause.name() == "running"
    });
    assert_eq!(machine.end.get("l"), 5.0);
}

#[test]
fn cycles_that_send_nothing_do_not_keep_a_station_fresh() {
    logged::expect("it is stale, and is tried again");
    let (mut machine, _cpu) = machine_with(
        Cpu {
            state: Some(8),
            ..Cpu::default()
        },
        "input = \"DB7\"",
        "%IB0",
    );
    let cause = machine.until_reason("station \"right\" for");
    assert_eq!(cause, "silent");
}

#[test]
fn a_stop_said_before_a_reconnect_is_forgotten_when_it_cannot_be_asked_for_any_more() {
    logged::expect("does not say whether it is in RUN");
    let (mut machine, cpu) = machine_of_two(Cpu {
        blocks: vec![5, 7],
        state: Some(4),
        ..Cpu::default()
    });
    machine.until("it is in STOP", |end| end.link().cause.name() == "stopped");
    // Another CPU replaces this one, and closes the connection when a list is requested.
    cpu.lock().expect("no panic").hangs_up = true;
    machine.until("its values count", |end| both(end) == (5.0, 7.0));
    assert_eq!(machine.end.statistic("cpu"), "unknown");
}

#[test]
fn a_cpu_in_stop_that_once_refuses_to_say_so_stays_in_stop() {
    let (mut machine, cpu) = machine_of_two(Cpu {
        blocks: vec![5, 7],
        state: Some(4),
        ..Cpu::default()
    });
    machine.until("it is in STOP", |end| end.link().cause.name() == "stopped");
    let asked = {
        let mut cpu = cpu.lock().expect("no panic");
        cpu.refuses = 2;
        cpu.asked
    };
    machine.until("it is asked on", |end| {
        assert_eq!(end.tick().code, Code::Stale);
        assert_eq!(end.statistic("cpu"), "stop");
        cpu.lock().expect("no panic").asked > asked + 3
    });
    cpu.lock().expect("no panic").state = Some(8);
    machine.until("it runs", |end| both(end) == (5.0, 7.0));
    assert_eq!(machine.end.statistic("cpu"), "run");
}
