//! What one station shows: nothing that nobody wrote, nothing torn, nothing after something newer, fail-safe values while stale.

use super::reader::{Reader, Seen, Shown};
use super::writer::Writer;
use super::{Broken, Stamp, broken, level, real, whole};
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
        if shown.stamp == FAIL_SAFE {
            let is_right =
                !shown.level && shown.numbers.is_none_or(|numbers| numbers == (-7.0, 2.5));
            if !is_right {
                broken("fail-safe", format!("station {station} shows {shown:?}"))?;
            }
            judge_typed(plan, area, None, shown)?;
            if seen.is_stale && shown.edges > 0 {
                broken(
                    "stale edges",
                    format!("station {station} has {}", shown.edges),
                )?;
            }
            return Ok(());
        }
        if seen.is_stale {
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
        let is_right = shown.level == level(shown.stamp)
            && shown
                .numbers
                .is_none_or(|numbers| numbers == (whole(shown.stamp).into(), real(shown.stamp)));
        if !is_right {
            broken(
                "torn",
                format!("station {station} shows {shown:?} in the tick of {stamp:?}"),
            )?;
        }
        judge_typed(plan, area, Some(shown.stamp), shown)?;
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
}

/// The signals beside a stamp follow from it, whatever their types, orders and scales.
fn judge_typed(plan: &Plan, area: u64, stamp: Option<u64>, shown: &Shown) -> Result<(), Broken> {
    let letter = if area == 0 { 'Q' } else { 'I' };
    let typed = plan.features.beside(letter).iter();
    let expected: Vec<u64> = typed.flat_map(|typed| typed.shown(stamp, true)).collect();
    if shown.typed != expected {
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
