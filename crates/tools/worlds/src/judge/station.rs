//! Judges what one station shows: only values that somebody wrote, untorn and in order, and fail-safe values while
//! stale.

use super::reader::Reader;
use super::seen::{Seen, Shown};
use super::writer::Writer;
use super::{Broken, Stamp, broken};
use crate::faults::{self, Activity, FaultPlan};
use crate::plan::{FAIL_SAFE, Plan};

impl Reader {
    pub(super) fn judge_station(
        &mut self,
        plan: &Plan,
        (area, station): (u64, usize),
        writer: &Writer,
        seen: &Seen<'_>,
        shown: &Shown,
    ) -> Result<(), Broken> {
        // Of several stations, one may have its sources while another has none yet.
        let is_other = (plan.laboratory.is_asked || plan.bus.has_units()) && plan.stations > 1;
        if seen.is_stale && plan.features.hosted.map(|end| end as u64) == Some(area) {
            // The inputs of a stale program are not promised. The value of a signal that got stuck meanwhile is known
            // when they count again.
            self.hold(plan, area, seen.tick, &[f64::NAN; 3]);
            return Ok(());
        }
        if shown.stamp == FAIL_SAFE {
            self.judge_beside(plan, (area, station), None, (seen.tick, shown))?;
            judge_typed(plan, area, None, shown)?;
            if seen.is_stale && shown.edges > 0 && !is_other {
                broken(
                    "stale edges",
                    format!("station {station} has {}", shown.edges),
                )?;
            }
            return Ok(());
        }
        if seen.is_stale && !is_other {
            broken("stale values", format!("station {station} shows {shown:?}"))?;
        }
        let stamp = Stamp::of(shown.stamp);
        let Stamp { life, tick, .. } = stamp;
        if stamp.area != area || stamp.station != station as u64 || !writer.has_begun(life, tick) {
            broken(
                "invented",
                format!("station {station} shows {stamp:?}, which nobody wrote"),
            )?;
        }
        self.judge_beside(plan, (area, station), Some(shown.stamp), (seen.tick, shown))?;
        judge_typed(plan, area, Some(shown.stamp), shown)?;
        let writing = usize::from(area == 0);
        self.judge_beat(plan, writer, (writing, stamp), shown.beat)?;
        let newest = &mut self.newest[station];
        if (life, tick) < *newest {
            broken(
                "order",
                format!("station {station} shows {stamp:?} after {newest:?}"),
            )?;
        }
        *newest = (life, tick);
        super::age::judge_young(plan, writer, seen, (station, stamp))
    }

    /// Judges the level and the numbers beside a stamp, which follow from it, except for the effects of faults.
    fn judge_beside(
        &mut self,
        plan: &Plan,
        (area, station): (u64, usize),
        stamp: Option<u64>,
        (tick, shown): (u64, &Shown),
    ) -> Result<(), Broken> {
        let letter = ['Q', 'I'][usize::from(area == 1)];
        let truth = faults::values(stamp);
        let was = |fault: usize, signal: usize| match self.held.get(&fault) {
            Some(value) => vec![*value],
            None => vec![self.before[signal], truth[signal]],
        };
        let bends = (&plan.features.faults[..], plan.features.hosted);
        let level = f64::from(u8::from(shown.level));
        let (whole, real) = shown.numbers.unwrap_or_default();
        let values = &[level, whole, real][..if shown.numbers.is_some() { 3 } else { 1 }];
        let is_bent = |fault: &FaultPlan| fault.signal().is_some_and(|(_, of)| of == letter);
        // Most ticks show the values as they were written.
        if !(station == 0 && bends.0.iter().any(is_bent)) && values == &truth[..values.len()] {
            if station == 0 {
                self.before[..values.len()].copy_from_slice(values);
            }
            return Ok(());
        }
        let spans = faults::expected(bends, (letter, station), stamp, tick, was);
        // Connections on request are made one by one. A signal without one has its fail-safe value, and so has the
        // stamp.
        let apart = plan.laboratory.is_asked.then(|| faults::values(None));
        for (index, (value, spans)) in values.iter().zip(&spans).enumerate() {
            let is_alone = apart.is_some_and(|apart| stamp.is_none() || *value == apart[index]);
            if is_alone
                || spans
                    .iter()
                    .any(|(least, most)| (least..=most).contains(&value))
            {
                continue;
            }
            let promise = match stamp {
                _ if !plan.features.faults.is_empty() => "faults",
                None => "fail-safe",
                Some(_) => "torn",
            };
            broken(
                promise,
                format!(
                    "tick {tick}: station {station} shows {value} of {spans:?}: {shown:?} in the tick of {:?}",
                    stamp.map(Stamp::of)
                ),
            )?;
        }
        if station == 0 {
            self.hold(plan, area, tick, values);
        }
        Ok(())
    }

    /// Remembers the values at which signals are stuck.
    fn hold(&mut self, plan: &Plan, area: u64, tick: u64, values: &[f64]) {
        for (index, fault) in plan.features.faults.iter().enumerate() {
            let Some((signal, letter)) = fault.signal() else {
                continue;
            };
            if (letter == 'I') != (area == 1) || fault.end as u64 != area {
                continue;
            }
            if fault.activity(tick) == Activity::Yes {
                let held = self.held.entry(index).or_insert(values[signal]);
                if held.is_nan() {
                    *held = values[signal];
                }
            } else {
                self.held.remove(&index);
            }
        }
        self.before[..values.len()].copy_from_slice(values);
    }
}

/// Judges the signals beside a stamp, which follow from it, whatever their types, orders and scales.
fn judge_typed(plan: &Plan, area: u64, stamp: Option<u64>, shown: &Shown) -> Result<(), Broken> {
    let letter = if area == 0 { 'Q' } else { 'I' };
    let typed = plan.features.beside(letter).iter();
    let expected = typed.flat_map(|typed| typed.shown(stamp, true));
    if !expected.clone().eq(shown.typed.iter().copied()) {
        let expected: Vec<u64> = expected.collect();
        return broken(
            "types",
            format!(
                "{:x?} are shown, and {expected:x?} were written",
                shown.typed
            ),
        );
    }
    Ok(())
}
