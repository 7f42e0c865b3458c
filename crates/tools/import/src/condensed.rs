//! Messages that differ only in their quotations, printed three times.

use std::collections::HashMap;

use tickbus_base::toml_text::PlacedMistake;

/// The number of messages kept of each kind.
const KEPT: usize = 3;

/// `list` with the first three messages of each kind, the third with the number of further ones.
pub fn condensed(list: &[PlacedMistake]) -> Vec<PlacedMistake> {
    let kinds: Vec<String> = list.iter().map(kind).collect();
    let mut counts: HashMap<&str, usize> = HashMap::new();
    for kind in &kinds {
        *counts.entry(kind).or_default() += 1;
    }
    let mut seen: HashMap<&str, usize> = HashMap::new();
    let mut kept = Vec::new();
    for (found, kind) in list.iter().zip(&kinds) {
        let number = seen.entry(kind).or_default();
        *number += 1;
        // A line that announces one more message would be as long as that message.
        let more = counts[kind.as_str()].saturating_sub(KEPT);
        if *number > KEPT && more > 1 {
            continue;
        }
        let mut found = found.clone();
        if *number == KEPT && more > 1 {
            found.mistake.right = format!("{}; and {more} more like it", found.mistake.right);
        }
        kept.push(found);
    }
    kept
}

/// The words of a message, without quotations and numbers.
fn kind(found: &PlacedMistake) -> String {
    let all = format!("{};{}", found.mistake.what, found.mistake.right);
    let outside = all.split('"').step_by(2);
    outside
        .flat_map(str::chars)
        .filter(|c| !c.is_ascii_digit())
        .collect()
}
