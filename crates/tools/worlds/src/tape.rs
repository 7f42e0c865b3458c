//! The data that a driver delivered, tick by tick, as its recording should have them.

use std::fs::File;
use std::path::PathBuf;

use tickbus_base::os::{Lock, lock_file};

use crate::broken::{Broken, broken};
use crate::features::RecordPlan;
use crate::plan::Plan;
use crate::scheduler;

/// One tick.
#[derive(Clone, Debug)]
pub(crate) struct Row {
    /// When the first call of the tick began and the last one ended.
    pub(crate) began: i64,
    pub(crate) ended: i64,
    /// The simulation time that was passed.
    pub(crate) time: Option<i64>,
    pub(crate) code: i32,
    /// All slots after the tick, as bits.
    pub(crate) values: Vec<u64>,
    /// The same, with the values that this end sends as they are on the line.
    pub(crate) on_line: Vec<u64>,
}

/// The ticks of one life of an end, from its first.
#[derive(Clone, Debug)]
pub(crate) struct Tape {
    /// The names of the slots: signals, and counts of edges.
    pub(crate) names: Vec<String>,
    pub(crate) rows: Vec<Row>,
    pub(crate) plan: RecordPlan,
    /// The file, and its previous contents.
    pub(crate) path: PathBuf,
    pub(crate) before: Vec<u8>,
}

impl Plan {
    /// The name of an end's recording.
    pub(crate) fn recording(&self, end: usize) -> Option<String> {
        let plan = self.features.recordings[end].as_ref()?;
        let ending = if plan.is_csv { "csv" } else { "vcd" };
        Some(format!("end {end}.{ending}"))
    }

    /// The lines of `[record]` in the driver.cfg of an end.
    pub(crate) fn record_section(&self, end: usize) -> Vec<String> {
        let (Some(file), Some(plan)) = (self.recording(end), &self.features.recordings[end]) else {
            return Vec::new();
        };
        let ring = plan.ring.map(|ring| format!("ring = {ring}"));
        let head = format!("[record]\nfile = \"{file}\"");
        std::iter::once(head).chain(ring).collect()
    }
}

impl Tape {
    /// Begins a tape for a driver that is about to open; `None` if the end records nothing.
    pub(crate) fn begin(plan: &Plan, end: usize) -> Option<Self> {
        let file = plan.recording(end)?;
        let plan = plan.features.recordings[end].clone()?;
        let path = scheduler::disk(|disk, _| {
            let path = disk.folder().join(file);
            if let Some(limit) = plan.disk {
                disk.limit(path.clone(), limit);
            }
            path
        });
        if plan.is_contended && !path.exists() {
            // Fill the file with something else that is longer than the recording.
            std::fs::write(&path, "what was there before\n".repeat(2_000)).expect("a file");
        }
        let before = std::fs::read(&path).unwrap_or_default();
        Some(Self {
            names: Vec::new(),
            rows: Vec::new(),
            plan,
            path,
            before,
        })
    }

    /// Judges a driver that wants the file of another process: the file is left alone, and the refusal names a remedy.
    pub(crate) fn judge_refusal(
        &self,
        open: impl FnOnce() -> Option<String>,
    ) -> Result<(), Broken> {
        if !self.plan.is_contended {
            return Ok(());
        }
        let other = File::options().append(true).create(true).open(&self.path);
        let other = other.expect("a file");
        assert_eq!(
            lock_file(&other, Lock::Exclusive).ok(),
            Some(true),
            "nobody has it"
        );
        let refusal = open();
        let bytes = std::fs::read(&self.path).unwrap_or_default();
        let shown = self.path.display().to_string();
        match refusal {
            Some(refusal)
                if refusal.contains(&shown)
                    && refusal.contains("name another file")
                    && bytes == self.before =>
            {
                Ok(())
            }
            refusal => broken(
                "file",
                format!(
                    "a file of another process: {refusal:?}, {} bytes of {}",
                    bytes.len(),
                    self.before.len()
                ),
            ),
        }
    }
}
