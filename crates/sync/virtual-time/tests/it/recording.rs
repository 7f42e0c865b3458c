//! Runs are recorded, and two recordings show where their runs part.

use std::path::{Path, PathBuf};

use tickbus_base::time::{Monotonic, Nanos};
use tickbus_image::signal::DataType;
use tickbus_record::{Options, Recording, Tick};
use tickbus_virtual_time::{
    Compared, Declaration, Difference, Logic, Outcome, Participant, Parting, RecordedRun, Settings,
    Step, Variable, compare, in_process,
};

use crate::common::{client, mixer_settings, mixers, settings};

fn recorded(
    file: &Path,
    settings: Settings,
    participants: Vec<&mut dyn Participant>,
    logic: Logic<'_>,
) -> Outcome {
    let options = Options::to(file).expect("a format");
    let clock = Monotonic::shared() as _;
    let attached = RecordedRun::attach(logic, &options, "cell", settings.steps, &clock);
    let (logic, recorded) = attached.expect("a file");
    let outcome = in_process::run(settings, participants, logic).expect("it runs");
    assert_eq!(recorded.error(), None);
    outcome
}

/// Records a run of a tank and a PLC to `name`. The PLC writes `wrong` in addition to its output in step 700.
fn tank(folder: &Path, name: &str, steps: u64, multiple: u32, wrong: u64) -> PathBuf {
    let file = folder.join(name);
    let mut tank = client("tank", 1, &["level"], &["speed"], |_, reads, writes| {
        writes[0] += reads[0];
        Ok(())
    });
    let mut plc = client(
        "plc",
        multiple,
        &["speed", "lamp"],
        &["level"],
        |step, reads, writes| {
            let more = if step.sequence == 700 { wrong } else { 0 };
            writes[0] = reads[0] % 7 + more;
            Ok(())
        },
    );
    let settings = settings(steps, &["plc", "tank"]);
    recorded(&file, settings, vec![&mut tank, &mut plc], Logic::new());
    file
}

fn compared(a: &Path, b: &Path) -> Compared {
    compare([a, b]).expect("two recordings of runs")
}

#[test]
fn a_recording_has_what_is_read_in_each_step_and_the_hash_of_its_run() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("run.vcd");
    let mut machines = mixers(2);
    let machines = machines.iter_mut().map(|mixer| mixer as _).collect();
    let logic = Logic::new()
        .variable(Variable::new("sum", DataType::Lreal))
        .on_time(|access| access.set("sum", 2.5_f64.to_bits()));
    let outcome = recorded(&file, mixer_settings(5, 2), machines, logic);
    let mut recording = Recording::open(&file, None).expect("a recording");
    let columns = recording.columns().clone();
    assert_eq!(
        (&*columns.driver, &*columns.role, columns.stations.len()),
        ("cell", "sync", 0)
    );
    let told = columns.columns.iter().map(|column| {
        let data_type = column.data_type.expect("it has one");
        assert_eq!(column.address, None);
        format!("{}/{} {data_type}", column.station, column.name)
    });
    let told: Vec<String> = told.collect();
    let expected = [
        "m0/x0 LWORD",
        "m0/y0 UINT",
        "m1/x1 LWORD",
        "m1/y1 UINT",
        "/sum LREAL",
        "/trace hash LWORD",
    ];
    assert_eq!(told, expected);
    let mut tick = Tick::new(&columns);
    for row in 1..=6 {
        assert_eq!(recording.next(&mut tick), Ok(true));
        assert_eq!(tick.number, row);
        let before = i64::try_from(row - 1).expect("few");
        assert_eq!(tick.time, Nanos::from_millis(before));
        if row == 1 {
            let initial: Vec<u64> = tick.values.iter().map(|slot| slot.unsigned()).collect();
            assert_eq!(initial[..5], [1, 0, 2, 0, 0]);
        } else {
            assert_eq!(tick.values[4].real().to_bits(), 2.5_f64.to_bits());
        }
    }
    assert_eq!(tick.values[5].unsigned(), outcome.hash.0);
    assert_eq!(recording.next(&mut tick), Ok(false));
    assert!(!recording.is_cut());
}

#[test]
fn equal_runs_give_equal_files_and_the_same_hash() {
    let folder = tempfile::tempdir().expect("a folder");
    let files = ["a.vcd", "b.vcd"].map(|name| {
        let file = folder.path().join(name);
        let mut machines = mixers(5);
        let machines = machines.iter_mut().map(|mixer| mixer as _).collect();
        let outcome = recorded(&file, mixer_settings(3000, 5), machines, Logic::new());
        (file, outcome)
    });
    let [(a, outcome), (b, _)] = &files;
    assert_eq!(std::fs::read(a).expect("a"), std::fs::read(b).expect("b"));
    let expected = Compared {
        declared: Vec::new(),
        notes: Vec::new(),
        steps: 3000,
        hash: Some(outcome.hash),
        parting: None,
    };
    assert_eq!(compared(a, b), expected);
}

#[test]
fn the_first_step_variable_and_client_that_differ_are_found() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let right = tank(folder, "a.vcd", 1000, 1, 0);
    let wrong = tank(folder, "b.vcd", 1000, 1, 3);
    let compared = compared(&right, &wrong);
    assert_eq!(compared.steps, 699);
    let Some(Parting::Values {
        step: 700,
        time,
        differences,
    }) = compared.parting
    else {
        panic!("{compared:?}");
    };
    assert_eq!(time, Nanos::from_millis(699));
    let [
        Difference {
            variable,
            client,
            values: [a, b],
        },
    ] = &*differences
    else {
        panic!("{differences:?}");
    };
    assert_eq!((&**variable, client.as_deref()), ("speed", Some("plc")));
    let numbers = [a, b].map(|text| text.parse::<u64>().expect("a number"));
    assert_eq!(numbers[1], numbers[0] + 3);
}

#[test]
fn a_run_that_ends_earlier_is_told_with_its_number_of_steps() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let long = tank(folder, "long.vcd", 60, 1, 0);
    let short = tank(folder, "short.vcd", 50, 1, 0);
    let steps = 50;
    for (files, shorter) in [([&long, &short], 1), ([&short, &long], 0)] {
        let compared = compared(files[0], files[1]);
        assert_eq!(compared.parting, Some(Parting::End { shorter, steps }));
        assert_eq!(compared.steps, 50);
    }
    // Cut within a row, as by a power failure.
    let text = std::fs::read_to_string(&long).expect("text");
    let at = text.find("#40000000").expect("the row of step 41");
    let cut = folder.join("cut.vcd");
    std::fs::write(&cut, &text[..at + 12]).expect("written");
    let compared = compared(&long, &cut);
    let parting = Parting::End {
        shorter: 1,
        steps: 39,
    };
    assert_eq!(compared.parting, Some(parting));
    assert!(compared.notes[0].ends_with("never ended"), "{compared:?}");
    // Two that are cut at the same row.
    let compared = self::compared(&cut, &cut);
    assert_eq!(compared.parting, Some(Parting::Cut { steps: 39 }));
    assert_eq!(compared.notes.len(), 2, "{compared:?}");
}

#[test]
fn equal_values_of_other_clients_are_not_equal_runs() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let machine = |name: &str, multiple, client_name: &str, data_type| {
        let mut idle = client(client_name, multiple, &[], &[], |_, _, _| Ok(()));
        idle.declaration.writes = vec![
            Variable::new("x", data_type),
            Variable::new(name, data_type),
        ];
        let file = folder.join(format!("{name}-{multiple}-{client_name}-{data_type}.vcd"));
        let settings = settings(20, &[client_name]);
        recorded(&file, settings, vec![&mut idle], Logic::new());
        file
    };
    let first = machine("y", 1, "plc", DataType::Int);
    let slower = compared(&first, &machine("y", 2, "plc", DataType::Int));
    assert_eq!(slower.parting, Some(Parting::Hash { step: 0 }));
    for (other, expected) in [
        (
            machine("z", 1, "plc", DataType::Int),
            vec![
                "the variable \"y\" of client \"plc\" is in the first run alone",
                "the variable \"z\" of client \"plc\" is in the second run alone",
            ],
        ),
        (
            machine("y", 1, "robot", DataType::Int),
            vec![
                "the variable \"x\" is written by client \"plc\" in the first run, and by client \"robot\" in the second",
                "the variable \"y\" is written by client \"plc\" in the first run, and by client \"robot\" in the second",
            ],
        ),
    ] {
        let compared = compared(&first, &other);
        assert_eq!(compared.declared, expected);
        assert_eq!((compared.steps, compared.parting), (20, None));
    }
    let other = machine("y", 1, "plc", DataType::Dint);
    let told = compare([&*first, &*other]).expect_err("nothing in common");
    assert!(told.to_string().contains("no variable in common"), "{told}");
}

#[test]
fn a_difference_that_a_recording_cannot_hold_is_seen_by_the_hash() {
    struct Nan(u64);
    impl Participant for Nan {
        fn declare(&self) -> Declaration {
            let mut declaration = Declaration::new("nan");
            declaration.writes = vec![Variable::new("x", DataType::Lreal)];
            declaration
        }
        fn initial(&mut self, _: &mut [u64]) {}
        fn run(&mut self, step: Step, _: &[u64], writes: &mut [u64]) -> Result<(), String> {
            writes[0] = match step.sequence {
                1500 => f64::NAN.to_bits() | self.0,
                step => step,
            };
            Ok(())
        }
    }
    let folder = tempfile::tempdir().expect("a folder");
    let files = [0, 1].map(|bit| {
        let file = folder.path().join(format!("{bit}.vcd"));
        recorded(
            &file,
            settings(4000, &["nan"]),
            vec![&mut Nan(bit)],
            Logic::new(),
        );
        file
    });
    let compared = compared(&files[0], &files[1]);
    assert_eq!(compared.parting, Some(Parting::Hash { step: 2000 }));
    // The last row has a hash, too.
    let files = [0, 1].map(|bit| {
        let file = folder.path().join(format!("short-{bit}.vcd"));
        recorded(
            &file,
            settings(1501, &["nan"]),
            vec![&mut Nan(bit)],
            Logic::new(),
        );
        file
    });
    let short = crate::recording::compared(&files[0], &files[1]);
    assert_eq!(short.parting, Some(Parting::Hash { step: 1501 }));
    assert_eq!(short.steps, 1501);
}

#[test]
fn a_stopped_run_is_equal_to_one_that_was_to_end_there() {
    let folder = tempfile::tempdir().expect("a folder");
    let files = [Some(30), None].map(|steps| {
        let file = folder.path().join(format!("{steps:?}.vcd"));
        let mut alone = client("a", 1, &["x"], &[], |step, _, writes| {
            writes[0] = step.sequence;
            // The run without an end is broken off.
            match step.sequence {
                31 => Err("enough".to_owned()),
                _ => Ok(()),
            }
        });
        let options = Options::to(&file).expect("a format");
        let clock = Monotonic::shared() as _;
        let attached = RecordedRun::attach(Logic::new(), &options, "cell", steps, &clock);
        let (logic, _) = attached.expect("a file");
        let settings = Settings {
            steps,
            ..settings(30, &["a"])
        };
        let outcome = in_process::run(settings, vec![&mut alone], logic);
        (file, outcome)
    });
    let hash = files[0].1.clone().expect("it ends").hash;
    assert_eq!(files[1].1.clone().expect_err("broken off").steps, 30);
    let compared = compared(&files[0].0, &files[1].0);
    assert_eq!(
        (compared.steps, compared.hash, compared.parting),
        (30, Some(hash), None)
    );
}

#[test]
fn files_that_are_no_recordings_of_runs_are_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let right = tank(folder, "a.vcd", 10, 1, 0);
    let table = tank(folder, "a.csv", 10, 1, 0);
    let text = std::fs::read_to_string(&right).expect("text");
    let of_driver = folder.join("driver.vcd");
    std::fs::write(&of_driver, text.replace("\"cell\" sync", "\"cell\" device")).expect("written");
    let other_step = folder.join("step.vcd");
    std::fs::write(&other_step, text.replace("#1000000\n", "#2000000\n")).expect("written");
    let damaged = folder.join("damaged.vcd");
    std::fs::write(&damaged, text.replace("#2000000\n", "#2\n")).expect("written");
    for (other, expected) in [
        (table, "does not name the clients"),
        (of_driver, "no recording of a run on virtual time"),
        (other_step, "row 2 is at 2ms, and in"),
        (damaged, "the time goes back from 1ms to 2ns"),
        (folder.join("none.vcd"), "cannot be read"),
    ] {
        let told = compare([&*right, &*other]).expect_err(expected).to_string();
        assert!(told.contains(expected), "{told}");
        assert!(told.contains(&*other.display().to_string()), "{told}");
    }
}

#[test]
fn a_file_that_cannot_be_made_is_refused_before_the_run_and_leaves_none() {
    let folder = tempfile::tempdir().expect("a folder");
    let clock = Monotonic::shared() as _;
    let attach = |file: &Path| {
        let options = Options::to(file).expect("a format");
        RecordedRun::attach(Logic::new(), &options, "cell", None, &clock).map(|_| ())
    };
    let told = attach(&folder.path().join("none/run.vcd")).expect_err("no folder");
    assert!(told.to_string().contains("cannot be made"), "{told}");
    let file = folder.path().join("run.vcd");
    attach(&file).expect("it can be made");
    assert!(!file.exists(), "no client has joined yet");
    std::fs::write(&file, "of an earlier run").expect("written");
    attach(&file).expect("it can be made");
    assert_eq!(
        std::fs::read(&file).expect("it is there"),
        b"of an earlier run"
    );
}
