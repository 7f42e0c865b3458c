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
        shown: Shown,
    ) -> Result<(), Broken> {
        if shown.stamp == FAIL_SAFE {
            let is_right =
                !shown.level && shown.numbers.is_none_or(|numbers| numbers == (-7.0, 2.5));
            if !is_right {
                broken("fail-safe", format!("station {station} shows {shown:?}"))?;
            }
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
