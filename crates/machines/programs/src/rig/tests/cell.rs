//! The program and the plant, with an operator.

use super::plant::Plant;
use crate::rig::image::command::{
    IM1_INDEX, IM1_JOG, IM2_INDEX, IM2_JOG, LA1_RUN, LA2_RUN, SC1, SC2,
};
use crate::rig::{La1Code, Rig};
use tickbus_base::time::Nanos;
use tickbus_plc::{HostedProgram, Program, Scan};

pub(super) const START: u8 = 1;
pub(super) const STOP: u8 = 2;
pub(super) const RESET: u8 = 4;

pub(super) const READY: u8 = 2;
pub(super) const RUN: u8 = 3;
pub(super) const ABORT: u8 = 4;
pub(super) const RECOVER: u8 = 5;
pub(super) const PARKED: u8 = 7;

/// The machine's inputs while it receives no data, according to the rig's `driver.cfg`.
const FAIL_SAFE: u16 = SC1 | SC2;

/// The age, in scans, from which on data are stale.
const STALE_SCANS: usize = 25;

const SCANS_PER_SECOND: usize = 100;

/// The outputs of one scan, by meaning.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Seen {
    pub(super) word: u16,
    pub(super) lamps: u8,
    pub(super) phase: u8,
    pub(super) step: u16,
    pub(super) cycles: u16,
}

impl Seen {
    pub(super) fn of(outputs: [u8; 8]) -> Self {
        let word = |at: usize| u16::from_be_bytes([outputs[at], outputs[at + 1]]);
        Self {
            word: word(0),
            lamps: outputs[2],
            phase: outputs[3],
            step: word(4),
            cycles: word(6),
        }
    }

    /// Checks the rules that must hold in every scan, for any inputs.
    #[track_caller]
    pub(super) fn check(self, inputs: &[u8]) {
        let on = |bits: u16| self.word & bits != 0;
        let la1_bottom = inputs[2] & 8 != 0;
        let la2_bottom = inputs[2] & 16 != 0;
        let moves = matches!(self.phase, 1 | 3 | 5 | 6);
        assert!(
            moves || !on(!(SC1 | SC2)),
            "moves outside its phases: {self:x?}"
        );
        assert!(
            self.phase == RUN || !on(IM1_INDEX | IM2_INDEX),
            "indexes outside run: {self:x?}"
        );
        assert!(
            self.phase != RUN || !on(IM1_JOG | IM2_JOG),
            "jogs in run: {self:x?}"
        );
        let bottom = la1_bottom && la2_bottom;
        assert!(
            bottom || !on(IM1_INDEX | IM1_JOG | IM2_JOG),
            "wheel against lift: {self:x?}"
        );
        assert!(
            la2_bottom || !on(IM2_INDEX),
            "wheel 2 against lift 2: {self:x?}"
        );
        let wheels = on(IM1_INDEX | IM1_JOG | IM2_JOG | IM2_INDEX);
        assert!(
            !wheels || !on(LA1_RUN | LA2_RUN),
            "wheel and lift at once: {self:x?}"
        );
        assert!(
            self.phase <= 7 && (self.step == 0) == (self.phase != RUN),
            "{self:x?}"
        );
        let lamps = match self.phase {
            READY => 1,
            RUN => 2,
            ABORT => 4,
            PARKED => 8,
            _ => 0,
        };
        assert_eq!(self.lamps, lamps, "{self:x?}");
    }
}

/// Names a file with the rig's program from `plc/rig/rig.st`, compiled. If set, every test of the rig runs it
/// in parallel with the built-in one, and all outputs must be equal in every scan; `tools/test` does that.
const COMPILED: &str = "TICKBUS_RIG_PROGRAM";

/// The compiled program, if one was named.
fn twin(la1_code: La1Code) -> Option<HostedProgram> {
    let file = std::env::var_os(COMPILED).filter(|_| la1_code == La1Code::MsbFirst)?;
    let alive = ("alive".to_owned(), "%IX3.0".to_owned());
    let twin = HostedProgram::load(file.as_ref(), &[alive]);
    Some(twin.unwrap_or_else(|error| panic!("{COMPILED}: {error}")))
}

/// The program, the plant, and all observations.
#[derive(Debug)]
pub(super) struct Cell {
    pub(super) rig: Rig,
    twin: Option<HostedProgram>,
    pub(super) plant: Plant,
    pub(super) alive: bool,
    pub(super) buttons: u8,
    pub(super) seen: Seen,
    /// Every command word of phase run and every phase, when it changed.
    pub(super) words: Vec<u16>,
    pub(super) phases: Vec<u8>,
    outputs: [u8; 8],
    now: Nanos,
}

impl Cell {
    pub(super) fn new(la1_code: La1Code) -> Self {
        let mut plant = Plant::new();
        plant.lsb_first = la1_code == La1Code::LsbFirst;
        Self {
            rig: Rig::new(la1_code),
            twin: twin(la1_code),
            plant,
            alive: true,
            buttons: 0,
            seen: Seen::of([0; 8]),
            words: Vec::new(),
            phases: vec![0],
            outputs: [0; 8],
            now: Nanos::from_secs(7),
        }
    }

    /// A cell that is homed and ready.
    pub(super) fn ready() -> Self {
        let mut cell = Self::new(La1Code::MsbFirst);
        cell.until_phase(READY);
        cell
    }

    /// A cell in the given step of its first cycle, at the first scan of that step.
    pub(super) fn in_step(step: u16) -> Self {
        let mut cell = Self::ready();
        cell.press(START);
        cell.until("the step", |cell| cell.seen.step == step);
        cell
    }

    /// One scan, and one move of the plant.
    pub(super) fn scan(&mut self) {
        let image = self.plant.image();
        self.scan_inputs([image[0], image[1], image[2] | self.buttons]);
        self.plant.step(if self.alive {
            self.seen.word
        } else {
            FAIL_SAFE
        });
    }

    /// Switches the program off for some scans, and a new one on, which has no memory. Until its data are
    /// stale, the machine continues with the last word.
    pub(super) fn power_cut(&mut self, off: usize) {
        for scan in 0..off {
            let stale = scan >= STALE_SCANS;
            self.plant
                .step(if stale { FAIL_SAFE } else { self.seen.word });
        }
        self.rig = Rig::new(La1Code::MsbFirst);
        self.twin = twin(La1Code::MsbFirst);
        self.outputs = [0; 8];
        self.now += Nanos::from_millis(10).times(i64::try_from(off).expect("some scans"));
        self.words.clear();
        self.phases = vec![0];
    }

    /// One scan with arbitrary inputs; the plant does not move.
    pub(super) fn scan_inputs(&mut self, inputs: [u8; 3]) {
        let bytes = [inputs[0], inputs[1], inputs[2], 0, 0, 0, 0, 0];
        let mut twins_outputs = self.outputs;
        let scan = |program: &mut dyn Program, outputs: &mut [u8]| {
            program.scan(&mut Scan {
                now: self.now,
                alive: self.alive,
                cycle: 0,
                inputs: &bytes,
                outputs,
            });
        };
        scan(&mut self.rig, &mut self.outputs);
        if let Some(twin) = &mut self.twin {
            scan(twin, &mut twins_outputs);
            let [seen, made] = [twins_outputs, self.outputs].map(Seen::of);
            assert_eq!(
                seen, made,
                "Structured Text and built-in, inputs {bytes:x?}"
            );
        }
        self.now += Nanos::from_millis(10);
        self.seen = Seen::of(self.outputs);
        self.seen.check(&bytes);
        if self.seen.phase == RUN && self.words.last() != Some(&self.seen.word) {
            self.words.push(self.seen.word);
        }
        if self.phases.last() != Some(&self.seen.phase) {
            self.phases.push(self.seen.phase);
        }
    }

    pub(super) fn scans(&mut self, count: usize) {
        for _ in 0..count {
            self.scan();
        }
    }

    /// Presses a button for 200 ms.
    pub(super) fn press(&mut self, button: u8) {
        self.buttons |= button;
        self.scans(20);
        self.buttons &= !button;
        self.scan();
    }

    /// Scans until `so` holds, for a minute at most.
    #[track_caller]
    pub(super) fn until(&mut self, what: &str, so: impl Fn(&Self) -> bool) {
        for _ in 0..60 * SCANS_PER_SECOND {
            if so(self) {
                return;
            }
            self.scan();
        }
        panic!(
            "never came to {what}: {:x?}, phases {:?}",
            self.seen, self.phases
        );
    }

    #[track_caller]
    pub(super) fn until_phase(&mut self, phase: u8) {
        self.until(&format!("phase {phase}"), |cell| cell.seen.phase == phase);
    }
}
