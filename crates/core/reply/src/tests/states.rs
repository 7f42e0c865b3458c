//! Integrators and tracks, whose states change with time.

use super::{Machine, read};

#[test]
fn an_integrator_adds_its_flows_within_limits_and_is_reset() {
    let mut machine = Machine::new(
        "[[reply]]\nkind = \"integrator\"\nsignal = \"i\"\nlimits = [0, 100]\nstart = 50\nreset = \"D\"\n\
         flows = [{ when = \"A\", rate = 1000 }, { when = [\"B\", \"not C\"], input = \"N\", gain = -100 }]\n",
    );
    assert_eq!(machine.values("i", 2), "50 50");
    machine.set("A", 1.0);
    assert_eq!(machine.values("i", 6), "60 70 80 90 100 100");
    machine.set("B", 1.0);
    machine.set("N", 15.0);
    assert_eq!(machine.values("i", 2), "95 90");
    machine.set("N", f64::NAN);
    assert_eq!(machine.values("i", 2), "90 90", "no number flows");
    machine.set("N", 70.0);
    assert_eq!(machine.values("i", 3), "30 0 0");
    machine.set("C", 1.0);
    machine.set("D", 1.0);
    assert_eq!(machine.values("i", 1), "50");
}

#[test]
fn integrators_read_each_other_as_they_were_a_tick_before_also_under_zeros() {
    // A tank that flows into another one.
    let mut machine = Machine::new(
        "[[reply]]\nkind = \"integrator\"\nsignal = \"i\"\nlimits = [0, 100]\nstart = 100\n\
         flows = [{ input = \"i\", gain = -10 }, { input = \"j\", gain = 10 }]\n\
         [[reply]]\nkind = \"integrator\"\nsignal = \"j\"\n\
         flows = [{ input = \"i\", gain = 10 }, { input = \"j\", gain = -10 }]\n",
    );
    machine.tick();
    for _ in 0..200 {
        machine.set("i", 0.0);
        machine.set("j", 0.0);
        machine.tick();
    }
    let (one, other) = (machine.value("i"), machine.value("j"));
    assert!((one - 50.0).abs() < 3.0, "{one}");
    assert!((other - 50.0).abs() < 3.0, "{other}");
}

const TRACK: &str = "[[reply]]\nkind = \"track\"\nlength = 100\nsize = 10\nparts = [1, 5]\nforward = \"A\"\nreverse = \"C\"\n\
                     rate = 1000\n";

#[test]
fn parts_pass_sensors_and_leave_a_track_at_exits_and_at_its_end() {
    let mut machine = Machine::new(&format!(
        "{TRACK}sensors = [{{ signal = \"a\", at = 35 }}, {{ signal = \"b\", at = 35, above = 3 }}]\n\
         exits = [{{ at = 65, when = \"B\", signal = \"l\" }}]\nplaces = [{{ position = \"i\", height = \"k\" }}]\n",
    ));
    assert_eq!(machine.values("i", 2), "0 0", "it waits for the belt");
    assert_eq!(machine.value("k"), 1.0);
    machine.set("A", 1.0);
    assert_eq!(machine.values("i", 3), "10 20 30");
    assert_eq!(machine.values("a", 3), "1 0 0");
    assert_eq!(machine.value("i"), 60.0);
    // The next part enters when there is a place for it.
    assert_eq!(machine.values("i", 7), "70 80 90 100 110 0 10");
    assert_eq!(machine.value("k"), 5.0);
    assert_eq!(machine.values("b", 4), "0 0 1 0", "a high part");
    machine.set("B", 1.0);
    assert_eq!(machine.values("i", 3), "60 0 10", "pushed off at 65 to 75");
}

#[test]
fn a_track_has_as_many_parts_as_places_at_least_a_gap_apart() {
    let mut machine = Machine::new(&format!(
        "{TRACK}gap = 30\nenters = \"D\"\nplaces = [{{ position = \"i\" }}, {{ position = \"j\" }}]\n\
         exits = [{{ at = 80, signal = \"k\", above = 3 }}]\n",
    ));
    machine.set("A", 1.0);
    assert_eq!(machine.values("i", 2), "-10 -10", "nothing enters");
    machine.set("D", 1.0);
    assert_eq!(machine.values("j", 5), "-10 -10 -10 0 10");
    assert_eq!(machine.value("i"), 40.0);
    machine.set("D", 0.0);
    assert_eq!(machine.values("j", 8), "20 30 40 50 60 70 -10 -10");
    assert_eq!(machine.value("k"), 1.0, "only the high one leaves there");
    assert_eq!(machine.value("i"), -10.0, "the low one has left at the end");
    machine.set("D", 1.0);
    machine.set("A", 0.0);
    machine.tick();
    machine.set("C", 1.0);
    machine.set("D", 0.0);
    assert_eq!(
        machine.values("i", 1),
        "-10",
        "it went back where it came from"
    );
}

#[test]
fn no_part_enters_a_track_that_runs_backwards() {
    let mut machine = Machine::new(&format!(
        "{TRACK}places = [{{ position = \"i\", height = \"k\" }}]\n"
    ));
    machine.set("C", 1.0);
    assert_eq!(machine.values("i", 4), "0 -10 -10 -10");
    machine.set("C", 0.0);
    assert_eq!(machine.values("i", 1), "0");
    assert_eq!(machine.value("k"), 5.0, "the second part");
}

#[test]
fn wrong_integrators_and_tracks_are_refused_at_their_place() {
    let integrator = "[[reply]]\nkind = \"integrator\"\nsignal = \"i\"\n";
    let track = format!("{TRACK}places = [{{ position = \"i\" }}]\n");
    for (text, told) in [
        (
            format!("{integrator}flows = []"),
            "x:4:9: \"flows\" has 0 tables; write 1 to 64 tables, such as flows = [{ … }]",
        ),
        (
            format!("{integrator}flows = [{{ when = \"A\" }}]"),
            "x:4:19: this table has no \"rate\" and no \"input\"; add how fast it flows, such as rate = 5",
        ),
        (
            format!("{integrator}flows = [{{ rate = 1, input = \"N\" }}]"),
            "x:4:19: \"rate\" stands beside \"input\"; remove one of them",
        ),
        (
            format!("{integrator}flows = [{{ rate = 1, wenn = \"A\" }}]"),
            "did you mean \"when\"?",
        ),
        (
            format!("{integrator}flows = [{{ rate = 1, when = \"X\" }}]"),
            "x:4:29: there is no signal \"X\"",
        ),
        (
            format!("{track}sensors = [{{ at = 1 }}]"),
            "x:10:19: this table has no \"signal\"; add \"signal\" to each table",
        ),
        (
            format!(
                "{track}sensors = [{{ signal = \"a\", at = 1 }}, {{ signal = \"a\", at = 2 }}]"
            ),
            "\"a\" is made by the reply on line 10, too",
        ),
        (
            format!("{track}exits = [{{ at = 1, above = 5, below = 3 }}]"),
            "x:10:39: no height is above 5 and below 3; write the lower height with \"above\"",
        ),
        (
            format!("{track}exits = [{{ at = 1, signal = \"a\" }}]"),
            "x:10:29: \"a\" is a BOOL, and no number",
        ),
        (
            format!("{track}gap = 5"),
            "x:10:7: parts of 10 enter every 5; write a gap that is not shorter than a part",
        ),
        (
            track.replace("size = 10", "size = 0"),
            "\"size\" is 0; write more than 0",
        ),
        (
            track.replace("parts = [1, 5]", "parts = []"),
            "an empty list has no number",
        ),
        (
            track.replace("forward = \"A\"\nreverse = \"C\"\nrate = 1000\n", ""),
            "x:1:1: [[reply]] has no \"input\" and no \"forward\"; write what moves it",
        ),
    ] {
        let wrong = read(&text).expect_err(told);
        assert!(wrong.contains(told), "{wrong}\nexpected: {told}");
    }
}
