//! The body of a block; every bus makes one.

use tickbus_base::time::Nanos;

/// A body: its declarations and statements.
#[derive(Default)]
pub(super) struct Body {
    /// The description of the block, for the head.
    pub(super) what: String,
    /// Lines between `VAR` and `END_VAR`.
    pub(super) variables: Vec<String>,
    /// Lines between `VAR_TEMP` and `END_VAR`.
    pub(super) temporary: Vec<String>,
    pub(super) code: Vec<String>,
    /// True if the block counts received images in `Received`.
    pub(super) receives: bool,
    /// True if the block counts sent images in `Sent`.
    pub(super) sends: bool,
    /// An expression that is TRUE in each call that received something from the simulation; empty if the block cannot
    /// know.
    pub(super) heard: String,
    /// True if the driver has heartbeat signals, which show the PLC that the simulation ticks.
    pub(super) has_heartbeat: bool,
}

impl Body {
    /// The declarations of those members of the control block, beside `Simulated`, that a statement sets.
    pub(super) fn status(&self) -> Vec<&'static str> {
        let members = [
            (
                self.has_heartbeat,
                "Alive : Bool;   // the simulation ticks: its heartbeat changes",
            ),
            (
                !self.has_heartbeat && !self.heard.is_empty(),
                "Alive : Bool;   // the simulation was heard of not longer ago than the driver's max_age",
            ),
            (
                self.receives,
                "Received : UDInt;   // images that have come since Simulated was set",
            ),
            (
                self.sends,
                "Sent : UDInt;   // images that have gone since then",
            ),
            (
                self.receives || self.sends,
                "Errors : UDInt;   // jobs that failed",
            ),
            (
                self.receives || self.sends,
                "Last_error : Word;   // STATUS of the last of them",
            ),
        ];
        let members = members.into_iter().filter(|(is_set, _)| *is_set);
        members.map(|(_, member)| member).collect()
    }
}

/// A bus without a block: the user has to add one here.
pub(super) fn by_hand(kind: &str, notes: &mut Vec<String>) -> Body {
    notes.push(format!(
        "the bus \"{kind}\" has no block of its own for S7: what brings the images is to be written by hand"
    ));
    Body {
        what: format!("The bus \"{kind}\" needs no call here, or one that only you can write."),
        code: vec![
            ";   // Put here what receives \"…_in\".Image and sends \"…_out\".Image.".to_owned(),
        ],
        ..Body::default()
    }
}

/// A duration for a timer, in whole milliseconds, at least one.
pub(super) fn time(span: Nanos) -> String {
    format!("T#{}ms", span.0.div_euclid(1_000_000).max(1))
}
