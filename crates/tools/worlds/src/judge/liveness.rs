//! Judges that an end soon has the newest values of its peer once its misfortunes are over.

use super::age::slack;
use super::reader::Reader;
use super::writer::Writer;
use super::{Broken, broken};
use crate::plan::Plan;

impl Reader {
    /// Judges that the newest values that `writer` wrote more than the slack before `now` have arrived.
    pub(crate) fn judge_liveness(
        &self,
        plan: &Plan,
        writer: &Writer,
        now: i64,
    ) -> Result<(), Broken> {
        let slack = slack(plan) + plan.max_age.0;
        let least = writer.newest_at(now - slack);
        match self.last_valid {
            Some((at, seen)) if now - at <= slack && seen >= least => Ok(()),
            seen => broken(
                "liveness",
                format!(
                    "at {now} the last valid values were {seen:?}, and {least:?} should be there"
                ),
            ),
        }
    }
}
