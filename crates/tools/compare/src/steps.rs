//! The durations of a machine's steps in two recordings, side by side.

use std::collections::BTreeMap;

use tickbus_base::time::Nanos;
use tickbus_report::Change;

/// Numbers of steps are whole and at most this large.
const LARGEST: f64 = 9_999.0;

/// The steps of both recordings.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Steps {
    /// The name of the step signal.
    pub signal: String,
    /// The steps that occur, in the order of their numbers.
    pub rows: Vec<StepRow>,
}

/// One step.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StepRow {
    /// The number.
    pub number: u32,
    /// How often it occurs in the real recording, and its median duration.
    pub real: (usize, Option<Nanos>),
    /// The same in the simulated recording.
    pub simulated: (usize, Option<Nanos>),
    /// Begin and end of its first occurrence, on the clock of the real recording.
    pub first: Option<(Nanos, Nanos)>,
}

impl StepRow {
    /// How much longer the simulated step takes, by the medians; `None` if it occurs in one recording only.
    pub fn difference(&self) -> Option<Nanos> {
        Some(self.simulated.1? - self.real.1?)
    }
}

/// The durations of the steps of `signal`. A step whose beginning or end was not recorded does not count.
pub(super) fn steps(signal: &str, real: &[Change], simulated: &[Change]) -> Steps {
    let mut rows: BTreeMap<u32, StepRow> = BTreeMap::new();
    let [mut real, mut simulated] = [real, simulated].map(|changes| {
        let mut durations: BTreeMap<u32, Vec<Nanos>> = BTreeMap::new();
        for three in changes.windows(3) {
            let [before, here, after] = three else {
                continue;
            };
            let Some(step) = number(here.value).filter(|step| *step > 0) else {
                continue;
            };
            if before.value.is_nan() || after.value.is_nan() {
                continue;
            }
            durations.entry(step).or_default().push(after.at - here.at);
            let row = rows.entry(step).or_default();
            row.number = step;
            row.first.get_or_insert((here.at, after.at));
        }
        durations
    });
    for row in rows.values_mut() {
        let side = |side: &mut BTreeMap<u32, Vec<Nanos>>| {
            let mut durations = side.remove(&row.number).unwrap_or_default();
            durations.sort_unstable();
            (durations.len(), durations.get(durations.len() / 2).copied())
        };
        (row.real, row.simulated) = (side(&mut real), side(&mut simulated));
    }
    Steps {
        signal: signal.to_owned(),
        rows: rows.into_values().collect(),
    }
}

/// The number of a step.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "checked just before"
)]
fn number(value: f64) -> Option<u32> {
    let is_number = value.fract() == 0.0 && (0.0..=LARGEST).contains(&value);
    is_number.then_some(value as u32)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn changes(list: &[(i64, f64)]) -> Vec<Change> {
        let change = |(at, value): &(i64, f64)| Change {
            at: Nanos::from_millis(*at),
            value: *value,
        };
        list.iter().map(change).collect()
    }

    #[test]
    fn durations_stand_side_by_side() {
        let real = changes(&[
            (0, 2.0),
            (10, 1.0),
            (30, 2.0),
            (60, 0.0),
            (70, 1.0),
            (75, f64::NAN),
        ]);
        let simulated = changes(&[(0, 0.0), (10, 1.0), (35, 3.0), (60, 1.0), (90, 0.0)]);
        let found = steps("Step", &real, &simulated);
        let millis = Nanos::from_millis;
        let rows: Vec<_> = found
            .rows
            .iter()
            .map(|row| (row.number, row.real, row.simulated, row.difference()))
            .collect();
        let none = (0, None);
        assert_eq!(
            rows,
            [
                (
                    1,
                    (1, Some(millis(20))),
                    (2, Some(millis(30))),
                    Some(millis(10))
                ),
                (2, (1, Some(millis(30))), none, None),
                (3, none, (1, Some(millis(25))), None),
            ]
        );
    }
}
