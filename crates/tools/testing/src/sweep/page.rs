//! A sweep for its page.

use tickbus_report::{Swept, SweptRow, SweptRun};

use super::accepted::Accepted;
use super::judgement::Judgement;
use super::matrix::Mark;
use super::plan::{Cell, Plan};

/// A run on the page: its verdict, or why it could not be judged, and the address of its report.
pub fn swept_run(
    cell: &Cell,
    judgement: Result<&Judgement, &str>,
    passes: bool,
    report: Option<String>,
) -> SweptRun {
    let mark = Mark::of(judgement.ok(), passes);
    SweptRun {
        name: cell.name.clone(),
        mark: mark.as_text().to_owned(),
        word: judgement.map_or("wrong", Judgement::word),
        what: judgement.map_or_else(str::to_owned, ToString::to_string),
        passes,
        is_accepted: matches!(mark, Mark::Accepted(_)),
        report,
    }
}

/// The sweep of a file on the page, with its runs in the order of the plan's cells; `again` is the command that repeats a
/// run, with `{}` in the place of its name.
pub fn swept(
    (file, again): (&str, &str),
    (plan, accepted): (&Plan, &Accepted),
    mut runs: Vec<Option<SweptRun>>,
) -> Swept {
    let columns = plan.moments.len().max(1);
    let rows = plan.cells.chunks(columns).zip(runs.chunks_mut(columns));
    let rows = rows.map(|(cells, runs)| {
        let row = &plan.sweep.rows[cells[0].row];
        SweptRow {
            kind: row.kind.clone(),
            subject: row.subject.clone(),
            why: accepted.why(plan, &cells[0]).to_owned(),
            runs: runs.iter_mut().map(Option::take).collect(),
        }
    });
    Swept {
        file: file.to_owned(),
        again: again.to_owned(),
        moments: plan.moment_names().map(str::to_owned).collect(),
        rows: rows.collect(),
    }
}
