//! Tables of plain text.

/// Arranges rows under their headings in columns; columns without content are left out.
pub(super) fn aligned(headings: &[&str], rows: &[Vec<String>]) -> String {
    let length = |text: &str| text.chars().count();
    let widths: Vec<usize> = headings
        .iter()
        .enumerate()
        .map(|(column, heading)| {
            let longest = rows.iter().map(|row| length(&row[column])).max();
            match longest.unwrap_or(0) {
                0 => 0,
                longest => longest.max(length(heading)),
            }
        })
        .collect();
    let mut out = String::new();
    let mut put = |cells: &mut dyn Iterator<Item = &str>| {
        let columns = cells.zip(&widths).filter(|(_, width)| **width > 0);
        let cells: Vec<String> = columns
            .map(|(cell, width)| format!("{cell:width$}"))
            .collect();
        out.push_str(cells.join("  ").trim_end());
        out.push('\n');
    };
    put(&mut headings.iter().copied());
    for row in rows {
        put(&mut row.iter().map(String::as_str));
    }
    out
}
