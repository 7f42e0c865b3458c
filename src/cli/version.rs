//! The version of the command: for `--version` with the commit and the features.

use std::sync::LazyLock;

/// The cargo features that add something to the command.
const FEATURES: [(&str, bool); 5] = [
    ("mqtt", cfg!(feature = "mqtt")),
    ("opcua", cfg!(feature = "opcua")),
    ("page", cfg!(feature = "page")),
    ("script", cfg!(feature = "script")),
    ("zenoh", cfg!(feature = "zenoh")),
];

/// Returns the version with the commit and its date, unless they are unknown, and a line with the features.
pub(super) fn long() -> &'static str {
    static TEXT: LazyLock<String> = LazyLock::new(|| {
        let features: Vec<&str> = FEATURES
            .iter()
            .filter(|(_, is_in)| *is_in)
            .map(|(name, _)| *name)
            .collect();
        let features = if features.is_empty() {
            "none".to_owned()
        } else {
            features.join(" ")
        };
        let commit = option_env!("TICKBUS_COMMIT")
            .filter(|commit| !commit.is_empty())
            .map(|commit| format!(" ({commit})"));
        let commit = commit.unwrap_or_default();
        format!(
            "{}{commit}\nfeatures: {features}",
            env!("CARGO_PKG_VERSION")
        )
    });
    &TEXT
}
