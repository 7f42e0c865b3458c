use tempfile::TempDir;

use super::*;
use crate::made::Place;

static KINDS: Kinds = Kinds::LOOPBACK.with_programs(tickbus_programs::PROGRAMS);

/// A mirror that is scanned every 10 ms, with an array in each direction.
const TEXT: &str = "[driver]\nid = 1\nname = \"It\"\n[fieldbus]\nkind = \"loopback\"\nprogram = \"mirror\"\nmode = \"stepped\"\n\
    scan = \"10ms\"\n\
    [[signal]]\nname = \"x[2]\"\naddress = \"%IW2\"\ntype = \"INT\"\n[[signal]]\nname = \"x[1]\"\naddress = \"%IW0\"\ntype = \"INT\"\n\
    [[signal]]\nname = \"y[1]\"\naddress = \"%QW0\"\ntype = \"INT\"\n[[signal]]\nname = \"y[2]\"\naddress = \"%QW2\"\ntype = \"INT\"\n\
    fail_safe = 7\n[[signal]]\nname = \"on\"\naddress = \"%IX4.0\"\n";

fn instance(version: Version, event_mode: EventMode) -> (TempDir, Instance) {
    instance_of(TEXT, version, event_mode)
}

fn instance_of(text: &str, version: Version, event_mode: EventMode) -> (TempDir, Instance) {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("driver.cfg"), text).expect("a file");
    let made = Instance::new(version, folder.path(), &token(text.as_bytes()), &KINDS);
    let mut instance = made.unwrap_or_else(|why| panic!("{why}"));
    instance.set_event_mode(event_mode);
    (folder, instance)
}

fn begun(version: Version, event_mode: EventMode) -> (TempDir, Instance) {
    let (folder, mut instance) = instance(version, event_mode);
    assert_eq!(instance.setup(0.0, None), Ok(()));
    assert_eq!(instance.enter_initialization(), Ok(()));
    assert_eq!(instance.open(), Ok(()));
    (folder, instance)
}

const EARLY: EventMode = EventMode::Used { early_return: true };
const LATE: EventMode = EventMode::Used {
    early_return: false,
};
const EVENT: StepEnd = StepEnd {
    event: true,
    early: false,
};
const QUIET: StepEnd = StepEnd {
    event: false,
    early: false,
};

fn reference(instance: &Instance, name: &str) -> u32 {
    let mut all = instance.exposed.variables.iter();
    let found = all.find(|variable| variable.name == name);
    found.expect("it is there").reference
}

#[test]
fn a_simulation_may_begin_before_zero() {
    let (_folder, mut instance) = instance(Version::Two, EventMode::Unused);
    for start in [-2.0, 0.0, 1000.0] {
        assert_eq!(instance.setup(start, None), Ok(()));
        assert_eq!(instance.enter_initialization(), Ok(()));
        assert_eq!(instance.open(), Ok(()));
        assert_eq!(instance.step(start, 0.01), Ok(QUIET), "{start}");
        assert_eq!(instance.step(start + 0.01, 0.01), Ok(QUIET), "{start}");
        assert!(instance.step(start, 0.01).is_err(), "{start}");
        instance.reset();
    }
}

#[test]
fn a_step_ends_at_the_bus_cycle_where_the_importer_allows_it() {
    let (_folder, mut instance) = begun(Version::Three, EARLY);
    let cycle = Place::Cycle.reference();
    // After the initialisation the instance is in the event mode, and nothing has arrived.
    assert_eq!(instance.ticks(cycle), Ok(false));
    assert_eq!(instance.update(), Ok(Updated::default()));
    assert_eq!(instance.leave_events(), Ok(()));
    // The PLC's first scan is at the end of the first step; then it scans every 10 ms.
    assert_eq!(instance.step(0.0, 0.05), Ok(EVENT));
    for (at, next) in [(0.05, 0.06), (0.06, 0.07), (0.07, 0.08)] {
        assert!((instance.time() - at).abs() < 1e-12, "{}", instance.time());
        assert_eq!(instance.enter_events(), Ok(()));
        assert_eq!(instance.ticks(cycle), Ok(true));
        let updated = Updated {
            terminate: false,
            next: Some(next),
        };
        assert_eq!(instance.update(), Ok(updated));
        assert_eq!(instance.ticks(cycle), Ok(false));
        assert_eq!(instance.leave_events(), Ok(()));
        let early = StepEnd {
            event: true,
            early: true,
        };
        assert_eq!(instance.step(at, 0.05), Ok(early));
    }
    // A step between two scans has no event.
    assert_eq!(instance.step(0.08, 0.004), Ok(QUIET));
    // Without early returns, and between several scans, the event is at the end of the step.
    let (_folder, mut instance) = begun(Version::Three, LATE);
    assert_eq!(instance.leave_events(), Ok(()));
    assert_eq!(instance.step(0.0, 0.05), Ok(EVENT));
    assert_eq!(instance.step(0.05, 0.05), Ok(EVENT));
    assert_eq!(instance.step(0.1, 0.004), Ok(QUIET));
}

#[test]
fn a_step_on_a_free_bus_ends_early_only_if_steps_keep_to_the_clock() {
    let text = TEXT.replace("stepped", "free");
    for (pace, early) in [(1.0, true), (0.0, false)] {
        let (_folder, mut instance) = instance_of(&text, Version::Three, EARLY);
        assert_eq!(instance.setup(0.0, None), Ok(()));
        assert_eq!(instance.enter_initialization(), Ok(()));
        let set = instance.set(&[Place::Pace.reference()], [pace].into_iter());
        assert_eq!(set, Ok(()));
        assert_eq!(instance.open(), Ok(()));
        assert_eq!(instance.leave_events(), Ok(()));
        // The program on its own thread answers long before a minute is over.
        let end = instance.step(0.0, 60.0).expect("it is done");
        assert_eq!(end.early, early);
        assert!(end.event || !early);
        assert_eq!(instance.time() < 60.0, early, "{}", instance.time());
        assert_eq!(instance.terminate(), Ok(()));
    }
}

#[test]
fn calls_in_a_wrong_order_are_refused_and_change_nothing() {
    let refused = |result: Result<(), String>, words: &str| {
        let why = result.expect_err(words);
        assert!(why.contains(words), "{words}\n{why}");
    };
    let step = |instance: &mut Instance| instance.step(0.0, 0.01).map(drop);
    let update = |instance: &mut Instance| instance.update().map(drop);
    for version in Version::ALL {
        let (_folder, mut it) = instance(version, EventMode::Unused);
        let enter = format!(
            "before the initialisation; call {}EnterInitializationMode",
            version.name()
        );
        refused(step(&mut it), &enter);
        refused(it.open(), &enter);
        refused(it.terminate(), &enter);
        assert_eq!(it.enter_initialization(), Ok(()));
        let exit = "before the initialisation has ended; call ";
        refused(it.enter_initialization(), exit);
        refused(it.setup(0.0, None), exit);
        refused(step(&mut it), exit);
        refused(it.terminate(), exit);
        assert_eq!(it.open(), Ok(()));
        refused(
            it.open(),
            "leaving the initialisation mode in the step mode",
        );
        refused(it.enter_initialization(), "in the step mode");
        refused(it.enter_events(), "the event mode was not asked for");
        refused(update(&mut it), "updating discrete states in the step mode");
        refused(it.leave_events(), "in the step mode");
        refused(it.ticks(10).map(drop), "in the step mode");
        assert_eq!(step(&mut it), Ok(()));
        assert_eq!(it.terminate(), Ok(()));
        let over = "after the end of the run; reset the instance";
        refused(it.terminate(), over);
        refused(it.step(0.01, 0.01).map(drop), over);
        refused(it.open(), over);
        it.reset();
        assert_eq!(it.enter_initialization(), Ok(()));
    }
    let (_folder, mut it) = begun(Version::Three, EARLY);
    let events = "in the event mode; call fmi3EnterStepMode first";
    refused(step(&mut it), events);
    refused(it.enter_events(), events);
    let words = "\"on\" (value reference 20) is of type Boolean, not Clock";
    refused(it.ticks(20).map(drop), words);
    refused(it.ticks(4000).map(drop), "there is no variable");
    let words = "\"bus.cycle\" (value reference 10) is of type Clock, not Boolean";
    refused(it.get::<bool>(&[10], 1, |_, _| ()), words);
    assert_eq!(it.terminate(), Ok(()));
}

#[test]
fn no_step_goes_beyond_the_stop_time() {
    for version in Version::ALL {
        let (_folder, mut it) = instance(version, EventMode::Unused);
        for stop in [-1.0, f64::NAN] {
            let why = it.setup(0.0, Some(stop)).expect_err("refused");
            assert!(why.starts_with("the stop time is "), "{why}");
        }
        // The last step ends at 0.30000000000000004 s.
        assert_eq!(it.setup(0.0, Some(0.3)), Ok(()));
        assert_eq!(it.enter_initialization(), Ok(()));
        assert_eq!(it.open(), Ok(()));
        assert_eq!(it.step(0.0, 0.1), Ok(QUIET));
        let why = it.step(0.1, 0.3).expect_err("refused");
        let words = "a step from 0.1 s to 0.4 s, but the run ends at 0.3 s";
        assert!(why.starts_with(words), "{why}");
        assert_eq!(it.step(0.1, 0.2), Ok(QUIET));
        assert!(it.step(0.1 + 0.2, 0.1).is_err());
        // The next run has no stop time.
        it.reset();
        assert_eq!(it.enter_initialization(), Ok(()));
        assert_eq!(it.open(), Ok(()));
        assert_eq!(it.step(0.0, 1.0), Ok(QUIET));
    }
}

#[test]
fn an_array_has_not_the_name_of_a_count_of_edges() {
    let text = format!(
        "{TEXT}[[signal]]\nname = \"go\"\naddress = \"%QX8.0\"\nlatch = \"both\"\n\
         [[signal]]\nname = \"go.edges[1]\"\naddress = \"%QW10\"\n[[signal]]\nname = \"go.edges[2]\"\naddress = \"%QW12\"\n"
    );
    let (_folder, it) = instance_of(&text, Version::Three, EventMode::Unused);
    let names = it.exposed.variables.iter().map(|one| one.name.as_str());
    let names: Vec<&str> = names.filter(|name| name.starts_with("go")).collect();
    assert_eq!(names, ["go", "go.edges[1]", "go.edges[2]", "go.edges"]);
}

#[test]
fn an_array_is_set_and_got_as_a_whole() {
    let (_folder, mut it) = begun(Version::Three, EventMode::Unused);
    let [x, y] = ["x", "y"].map(|name| reference(&it, name));
    let get = |it: &Instance, references: &[u32], count: usize| {
        let mut values = vec![0_i16; count];
        let got = it.get(references, count, |at, value| values[at] = value);
        got.map(|()| values)
    };
    assert_eq!(get(&it, &[y, x], 4), Ok(vec![0, 7, 0, 0]));
    assert_eq!(it.set(&[x], [5_i16, 6].into_iter()), Ok(()));
    assert!(it.step(0.0, 0.01).is_ok() && it.step(0.01, 0.01).is_ok());
    assert_eq!(get(&it, &[y], 2), Ok(vec![5, 6]));
    // The elements are in the order of their indices, not of the file.
    let second = it.config.table.position("x[2]").expect("it is there");
    assert_eq!(it.slots[second], Slot::from_real(6.0));
    for count in [0, 1, 3] {
        let why = get(&it, &[x], count).expect_err("refused");
        assert!(
            why.starts_with(&format!("{count} values for variables that have 2;")),
            "{why}"
        );
        let values = vec![1_i16; count];
        let why = it.set(&[x], values.into_iter()).expect_err("refused");
        assert!(why.contains("for variables that have 2;"), "{why}");
    }
    // As many values as variables, but not as elements.
    assert!(get(&it, &[x, y], 2).is_err());
    assert!(it.set(&[x, x], [1_i16, 2].into_iter()).is_err());
    // A further element has no value reference.
    assert!(get(&it, &[19], 1).is_err());
    // The PLC writes y.
    let why = it.set(&[y], [1_i16, 2].into_iter()).expect_err("refused");
    assert!(why.starts_with("\"y\" cannot be set now"), "{why}");
    // In FMI 2.0, which has no arrays, the elements are variables.
    let (_folder, two) = begun(Version::Two, EventMode::Unused);
    let mut value = 0.0;
    let got = two.get(&[reference(&two, "y[2]")], 1, |_, found: f64| value = found);
    assert_eq!((got, value), (Ok(()), 7.0));
}

#[test]
fn the_line_s_state_and_reason_are_variables() {
    let (_folder, mut it) = begun(Version::Three, EventMode::Unused);
    assert!(it.step(0.0, 0.01).is_ok());
    let state = |it: &Instance| {
        let mut state = -1;
        let got = it.get(&[Place::State.reference()], 1, |_, found: i64| {
            state = found;
        });
        got.map(|()| state)
    };
    assert_eq!(state(&it), Ok(2), "running");
    it.refresh_texts();
    let reason = it.text(Place::Reason.reference()).expect("a text");
    assert_eq!(reason.to_str(), Ok("the hosted program is there"));
    assert_eq!(it.terminate(), Ok(()));
    assert_eq!(state(&it), Ok(0), "closed");
}
