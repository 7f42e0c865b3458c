//! Which variables of a run are valid.

use std::num::NonZeroU32;

use tickbus_image::signal::DataType;
use tickbus_virtual_time::{Client, Variable};

use super::*;

/// A run of a machine and a PLC, each with one variable, in the step with this number; the PLC has owed its answer for
/// `waited`.
fn view(members: &Arc<Members>, sequence: u64, waited: Nanos) -> RunView {
    RunView {
        members: Arc::clone(members),
        // The first step is the one in which the clients write their initial values.
        state: if sequence == 0 {
            State::InitialWrite
        } else {
            State::Write
        },
        step: Some(Step {
            sequence,
            time: Nanos::ZERO,
        }),
        length: Nanos::from_millis(1),
        pacing: Pacing::Fast,
        is_paused: false,
        missing: None,
        owes: vec![false, true],
        waited,
        hang: Nanos::from_secs(10),
        values: vec![1, 1],
    }
}

fn members() -> Arc<Members> {
    let client = |name: &str, writes| Client {
        name: name.to_owned(),
        multiple: NonZeroU32::MIN,
        interval: None,
        writes,
    };
    Arc::new(Members {
        clients: vec![client("machine", 0..1), client("plc", 1..2)],
        variables: ["sensor", "valve"]
            .map(|name| Variable::new(name, DataType::Bool))
            .into(),
    })
}

/// The shown flags of the two variables, and which of the two clients is stale.
fn shown(run: &ShownRun) -> ([u8; 2], [bool; 2]) {
    let flags: Vec<u8> = run.sheet.rows.iter().map(|row| row.flags).collect();
    let stale: Vec<bool> = run.stations().iter().map(|it| it.stale).collect();
    let two = "two of each";
    (flags.try_into().expect(two), stale.try_into().expect(two))
}

#[test]
fn the_variables_of_a_client_that_is_late_do_not_count_as_live() {
    let mut run = ShownRun::new(1, "run", Controls::default(), Nanos::ZERO);
    let members = members();
    let mut now = Nanos::ZERO;
    let mut after = |sequence, waited| {
        now += Nanos::from_millis(10);
        run.view = Some(view(&members, sequence, waited));
        run.update(now, now.0.unsigned_abs(), true);
        let json: serde_json::Value = serde_json::from_str(&run.json()).expect("right");
        let told = [0, 1].map(|at| json["signals"][at]["stale"] == true);
        let (flags, stale) = shown(&run);
        assert_eq!(told, stale);
        (flags, stale)
    };
    let unknown = STALE | UNKNOWN;
    assert_eq!(after(0, Nanos::ZERO), ([unknown; 2], [true; 2]));
    assert_eq!(after(7, Nanos::from_millis(1)), ([0; 2], [false; 2]));
    assert_eq!(after(7, Nanos::from_secs(2)), ([0, STALE], [false, true]));
    assert_eq!(after(8, Nanos::ZERO), ([0; 2], [false; 2]));
}

#[test]
fn nothing_counts_as_live_while_the_server_shows_nothing() {
    let mut run = ShownRun::new(1, "run", Controls::default(), Nanos::ZERO);
    run.view = Some(view(&members(), 7, Nanos::ZERO));
    run.update(Nanos::ZERO, 1, true);
    assert_eq!(shown(&run), ([0; 2], [false; 2]));
    run.sheet.ask(Nanos::ZERO, false);
    run.update(Nanos::from_secs(2), 2, true);
    assert_eq!(shown(&run), ([STALE; 2], [true; 2]));
}
