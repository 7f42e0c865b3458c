//! Motors behind a contactor, and behind a drive.

use super::Machine;

#[test]
fn a_motor_runs_up_trips_and_is_reset() {
    let mut machine = Machine::new(
        "[[reply]]\nkind = \"motor\"\ncontactor = \"A\"\nrunning = \"a\"\nat_speed = \"b\"\nspeed = \"i\"\noverload = \"c\"\n\
         healthy = \"d\"\non_after = \"10ms\"\nstart_time = \"40ms\"\nstop_time = \"20ms\"\nfull_speed = 1500\n\
         trip = \"B\"\nreset = \"C\"\n",
    );
    machine.tick();
    assert_eq!((machine.value("a"), machine.value("d")), (0.0, 1.0));
    machine.set("A", 1.0);
    assert_eq!(machine.values("i", 6), "0 375 750 1125 1500 1500");
    assert_eq!((machine.value("a"), machine.value("b")), (1.0, 1.0));
    machine.set("B", 1.0);
    assert_eq!(machine.values("i", 3), "750 0 0");
    assert_eq!((machine.value("a"), machine.value("b")), (0.0, 0.0));
    assert_eq!((machine.value("c"), machine.value("d")), (1.0, 0.0));
    machine.set("B", 0.0);
    assert_eq!(machine.values("c", 2), "1 1", "it waits for its reset");
    machine.set("C", 1.0);
    assert_eq!(machine.values("c", 1), "0");
    assert_eq!(machine.values("a", 2), "1 1");
}

#[test]
fn a_motor_behind_a_drive_follows_its_target_while_it_runs() {
    let mut machine = Machine::new(
        "[[reply]]\nkind = \"motor\"\ncontactor = \"A\"\ntarget = \"N\"\nspeed = \"i\"\nat_speed = \"b\"\n\
         start_time = \"100ms\"\nstop_time = \"50ms\"\nfull_speed = 50\n",
    );
    machine.set("N", 12.0);
    assert_eq!(machine.values("i", 2), "0 0", "nothing switches it on");
    machine.set("A", 1.0);
    assert_eq!(machine.values("i", 4), "5 10 12 12");
    assert_eq!(machine.value("b"), 1.0);
    machine.set("N", 70.0);
    assert_eq!(machine.values("b", 8), "0 0 0 0 0 0 0 1");
    assert_eq!(machine.value("i"), 50.0, "a drive has no more than that");
    machine.set("N", -3.0);
    assert_eq!(machine.values("b", 5), "0 0 0 0 1");
    assert_eq!(machine.value("i"), 0.0, "it does not turn back");
    machine.set("A", 0.0);
    assert_eq!(machine.values("b", 2), "0 0", "it does not run");
}
