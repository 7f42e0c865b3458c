//! Which branches of a block the runs have taken.

use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering};

use tickbus_image::signal::Slot;
use tickbus_prepare::Block;

/// One branch of a block.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Branch {
    /// The line in the source, from 1.
    pub line: usize,
    /// The keyword at which the branch begins, such as `ELSE`.
    pub label: String,
    /// True if a run has taken the branch.
    pub taken: bool,
}

/// The branches of a block.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Coverage {
    /// The block.
    pub block: String,
    /// The file of the block.
    pub file: String,
    /// The branches, in the order of their lines.
    pub branches: Vec<Branch>,
}

impl Coverage {
    /// The number of branches that were taken.
    pub fn taken(&self) -> usize {
        self.branches.iter().filter(|branch| branch.taken).count()
    }

    /// Adds the branches that other tests of the same block have taken. Returns false if that is another block.
    pub fn add(&mut self, other: &Self) -> bool {
        if (&self.block, &self.file) != (&other.block, &other.file) {
            return false;
        }
        for (branch, other) in self.branches.iter_mut().zip(&other.branches) {
            branch.taken |= other.taken;
        }
        true
    }

    /// One line for people: `FB_Valve: 14 of 16 branches; not taken: line 23 ELSE`.
    pub fn line(&self) -> String {
        let all = self.branches.len();
        let head = format!("{}: {} of {all} branches", self.block, self.taken());
        let missed = self.branches.iter().filter(|branch| !branch.taken);
        let missed = missed.map(|branch| format!("line {} {}", branch.line, branch.label));
        let missed: Vec<String> = missed.collect();
        if missed.is_empty() {
            return head;
        }
        format!("{head}; not taken: {}", missed.join(", "))
    }
}

/// The branches of a block, while it runs. Runs on several threads share it.
#[derive(Debug)]
pub(crate) struct Counted {
    file: String,
    block: String,
    branches: Vec<tickbus_prepare::Branch>,
    /// The signals whose bits are the branches.
    signals: Range<usize>,
    bits: Vec<AtomicU64>,
}

impl Counted {
    pub(super) fn new(file: &str, block: &Block, signals: Range<usize>) -> Self {
        Self {
            file: file.to_owned(),
            block: block.name.clone(),
            branches: block.branches.clone(),
            bits: signals.clone().map(|_| AtomicU64::new(0)).collect(),
            signals,
        }
    }

    /// True if a signal only counts branches.
    pub(crate) fn is_counter(&self, signal: usize) -> bool {
        self.signals.contains(&signal)
    }

    /// Adds the branches that a run has taken, by the values at its end.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a DWORD"
    )]
    pub(crate) fn add(&self, slots: &[Slot]) {
        for (bits, slot) in self.bits.iter().zip(&slots[self.signals.clone()]) {
            bits.fetch_or(slot.real() as u64, Ordering::Relaxed);
        }
    }

    pub(crate) fn coverage(&self) -> Coverage {
        let taken = |number: usize| {
            let per_signal = 32;
            let bits = self.bits.get(number / per_signal);
            let bits = bits.map_or(0, |bits| bits.load(Ordering::Relaxed));
            bits >> (number % per_signal) & 1 == 1
        };
        let branches = self.branches.iter().enumerate();
        Coverage {
            block: self.block.clone(),
            file: self.file.clone(),
            branches: branches
                .map(|(number, branch)| Branch {
                    line: branch.line,
                    label: branch.label.clone(),
                    taken: taken(number),
                })
                .collect(),
        }
    }
}
