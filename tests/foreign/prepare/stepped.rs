//! A hosted program in step with a server of virtual time, like a PLC: its cycles come at any time.

use std::path::{Path, PathBuf};

use tempfile::TempDir;
use tickbus::plc::{HostedProgram, Program as _, Scan};
use tickbus::time::Nanos;

use crate::harness::iec2c::Compiler;

/// A small generator of numbers that look random: equal seeds, equal tests.
pub struct Random(pub u64);

impl Random {
    pub fn below(&mut self, limit: usize) -> usize {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        usize::try_from(self.0 >> 33).expect("31 bits") % limit
    }
}

/// A program with `go` at %ID0, `ms` at %ID4 and `done` at %QD0.
pub struct Stepped {
    program: HostedProgram,
    object: PathBuf,
    pub inputs: Vec<u8>,
    pub outputs: Vec<u8>,
    go: u32,
    /// The time of the PLC, which runs freely.
    now: Nanos,
    pub jumps: Random,
    _folder: TempDir,
}

impl Stepped {
    pub fn load(compiler: &Compiler, text: &str) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let object = compiler.build(text, folder.path());
        let program = Self::program(&object);
        Self {
            inputs: vec![0; program.input_bytes()],
            outputs: vec![0; program.output_bytes()],
            program,
            object,
            go: 0,
            now: Nanos::ZERO,
            jumps: Random(1),
            _folder: folder,
        }
    }

    fn program(object: &Path) -> HostedProgram {
        HostedProgram::load(object, &[]).unwrap_or_else(|error| panic!("{error}"))
    }

    /// A cold start.
    pub fn restart(&mut self) {
        self.program = Self::program(&self.object);
        self.inputs.fill(0);
        self.outputs.fill(0);
        self.go = 0;
    }

    /// One cycle of the PLC at a time.
    pub fn scan(&mut self, now: Nanos) {
        self.program.scan(&mut Scan {
            now,
            alive: true,
            cycle: 0,
            inputs: &self.inputs,
            outputs: &mut self.outputs,
        });
    }

    /// Cycles at times that jump, even back.
    pub fn idle(&mut self, cycles: usize) {
        for _ in 0..cycles {
            let jump = [-3_000_000, 0, 1, 7_000_000, 90_000_000_000][self.jumps.below(5)];
            self.now += Nanos(jump);
            self.scan(self.now);
        }
    }

    fn done(&self) -> u32 {
        u32::from_be_bytes(self.outputs[..4].try_into().expect("four"))
    }

    /// One step at a virtual time in milliseconds, with idle cycles around it.
    pub fn step(&mut self, ms: u32) {
        let idle = self.jumps.below(3);
        self.idle(idle);
        self.go += 1;
        self.inputs[4..8].copy_from_slice(&ms.to_be_bytes());
        self.inputs[..4].copy_from_slice(&self.go.to_be_bytes());
        self.idle(1);
        assert_eq!(
            self.done(),
            self.go - 1,
            "it answers in the cycle after its outputs"
        );
        let outputs = self.outputs[4..].to_vec();
        self.idle(1);
        assert_eq!(self.done(), self.go);
        assert_eq!(
            self.outputs[4..],
            outputs,
            "outputs hold until the next step"
        );
    }
}
