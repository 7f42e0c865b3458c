//! Tables that another room made, on the page of a run: their times lead to the chart, as those of the page do.

use maud::{Markup, html};

use super::tables::{Scale, table};
use tickbus_base::time::Nanos;

/// A cell of such a table.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Cell {
    /// A text.
    Text(String),
    /// A number, set flush right.
    Number(String),
    /// A text that leads to this span of the chart.
    Chart(Nanos, Nanos, String),
}

/// A section of the page with one table.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct MoreTable {
    /// The section's heading.
    pub heading: String,
    /// A sentence about the table.
    pub caption: String,
    /// The headings of the columns; those that begin with ">" head columns of numbers.
    pub headings: Vec<String>,
    /// The rows, each with a cell for each column.
    pub rows: Vec<Vec<Cell>>,
}

impl MoreTable {
    pub(super) fn markup(&self, scale: Scale) -> Markup {
        let headings: Vec<&str> = self.headings.iter().map(String::as_str).collect();
        let rows = html! {
            @for row in &self.rows {
                tr {
                    @for cell in row {
                        @match cell {
                            Cell::Text(text) => td { (text) },
                            Cell::Number(text) => td class="n" { (text) },
                            Cell::Chart(from, until, text) => td class="n" {
                                (scale.link_with(*from, *until, text))
                            },
                        }
                    }
                }
            }
        };
        table("wide", &self.caption, &headings, &rows)
    }
}
