//! The picture of the rooms in docs/ARCHITECTURE.md: a graph in Mermaid, drawn from the manifests.

use std::collections::{BTreeMap, BTreeSet};

/// The lines that enclose the picture.
const BEGIN: &str =
    "<!-- drawn from the manifests: TICKBUS_UPDATE=1 cargo test --test architecture -->\n";
const END: &str = "<!-- end of the picture -->\n";

/// `text` with the picture of the crates; `manifests` are given by folder.
pub(crate) fn redrawn(text: &str, manifests: &BTreeMap<String, String>) -> String {
    let (before, rest) = text.split_once(BEGIN).expect("the picture begins");
    let (_, after) = rest.split_once(END).expect("the picture ends");
    format!("{before}{BEGIN}{}{END}{after}", picture(manifests))
}

/// An arrow from each crate to those that it uses, except where other arrows already lead to the same crate.
pub(crate) fn picture(manifests: &BTreeMap<String, String>) -> String {
    let uses = |manifest: &String| -> BTreeSet<String> {
        let table = manifest
            .split_once("[dependencies]\n")
            .map_or("", |(_, rest)| rest);
        let lines = table.lines().take_while(|line| !line.starts_with('['));
        let names =
            lines.filter_map(|line| line.strip_prefix("tickbus-")?.split(['.', ' ']).next());
        names
            .filter(|name| manifests.contains_key(*name))
            .map(str::to_owned)
            .collect()
    };
    let uses: BTreeMap<&String, BTreeSet<String>> = manifests
        .iter()
        .map(|(name, manifest)| (name, uses(manifest)))
        .collect();
    let mut lines = vec!["```mermaid".to_owned(), "graph TD".to_owned()];
    for (name, direct) in &uses {
        // The crates used indirectly.
        let mut open: Vec<&String> = direct.iter().flat_map(|used| &uses[used]).collect();
        let mut indirect = BTreeSet::new();
        while let Some(used) = open.pop() {
            if indirect.insert(used) {
                open.extend(&uses[used]);
            }
        }
        let drawn = direct.iter().filter(|used| !indirect.contains(used));
        lines.extend(drawn.map(|used| format!("    {name} --> {used}")));
    }
    lines.join("\n") + "\n```\n"
}
