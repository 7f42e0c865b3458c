//! A small machine that obeys the rig's program, detailed enough to test the program.
//!
//! The plant implements the rules that matter to the program: moves start on edges, unreferenced lifts only make
//! reference runs, faults are latched, bottles stay in place. One call per scan of 10 ms.

use super::bottles::Bottles;
use crate::rig::image::command::{
    ACKNOWLEDGE, IM1_INDEX, IM1_JOG, IM2_INDEX, IM2_JOG, LA1_CODE, LA1_CODE_HIGH, LA1_CODE_LOW,
    LA1_RUN, LA2_RUN, LA2_UP, SC1, SC2,
};

/// The words of the cycle, from the protocol.
pub(super) const WORDS: [u16; 6] = [0x0001, 0x0024, 0x000C, 0x0080, 0x3C34, 0x343C];

pub(super) const BIG: i32 = 200_000;
const SMALL: i32 = 20_000;
const STROKE_2: i32 = 150_000;
const BOTTOM: i32 = 500;
const SPEED: i32 = 4_000;
const SLOW: i32 = 500;
const MARGIN: i32 = 10_000;

/// A lift; lengths in micrometres.
#[derive(Clone, Debug)]
pub(super) struct Lift {
    pub(super) position: i32,
    pub(super) referenced: bool,
    /// The lift is blocked, and its beam interrupted.
    pub(super) jammed: bool,
    top: i32,
    target: Option<i32>,
    before: Option<i32>,
}

impl Lift {
    fn new(position: i32, top: i32) -> Self {
        Self {
            position,
            referenced: false,
            jammed: false,
            top,
            target: None,
            before: None,
        }
    }

    /// Moves by one scan; `by` is the commanded move. Returns whether the move is refused.
    fn step(&mut self, by: Option<i32>, down: i32) -> bool {
        if self.at_bottom() && self.target.is_none() {
            self.referenced = true;
            // The lift sinks onto its stop, as in the reference simulator when the run command drops
            // (`LiftDrive.stop`). No command could send it there: a referenced lift refuses to go down.
            if !self.jammed {
                self.position = 0;
            }
        }
        let mut refused = false;
        if by != self.before {
            self.target = None;
            if let Some(by) = by {
                if self.referenced {
                    self.target = Some(self.position + by);
                    refused = !(0..=self.top + MARGIN).contains(&(self.position + by));
                } else {
                    refused = by != down;
                    self.target = Some(0);
                }
                if refused {
                    self.target = None;
                }
            }
            self.before = by;
        }
        if let Some(target) = self.target.filter(|_| !self.jammed) {
            let speed = if self.referenced { SPEED } else { SLOW };
            self.position += (target - self.position).clamp(-speed, speed);
            if self.position == target {
                self.target = None;
                self.referenced = true;
            }
        }
        refused
    }

    pub(super) fn at_bottom(&self) -> bool {
        self.position <= BOTTOM
    }
}

/// An index wheel; angles in tenths of a degree.
#[derive(Clone, Debug)]
pub(super) struct Wheel {
    pub(super) angle: i32,
    /// The homing sensor is broken.
    pub(super) blind: bool,
    left: i32,
    index_before: bool,
}

impl Wheel {
    fn new(angle: i32) -> Self {
        Self {
            angle,
            blind: false,
            left: 0,
            index_before: false,
        }
    }

    /// Moves by one scan.
    fn step(&mut self, index: bool, jog: bool, by: i32) {
        if index && !self.index_before && self.left == 0 {
            self.left = by - self.angle % by;
        }
        self.index_before = index;
        let moved = if self.left > 0 {
            self.left.min(30)
        } else {
            i32::from(jog) * 6
        };
        self.left = (self.left - moved).max(0);
        self.angle = (self.angle + moved) % 3600;
        if moved == 0 && self.in_window() {
            self.angle = 0;
        }
    }

    pub(super) fn turning(&self) -> bool {
        self.left > 0
    }

    fn in_window(&self) -> bool {
        self.angle <= 50 || self.angle >= 3550
    }

    pub(super) fn home(&self) -> bool {
        !self.blind && self.in_window()
    }
}

/// The machine.
#[derive(Clone, Debug)]
#[expect(
    clippy::struct_excessive_bools,
    reason = "switches that the tests flip"
)]
pub(super) struct Plant {
    pub(super) la1: Lift,
    pub(super) la2: Lift,
    pub(super) im1: Wheel,
    pub(super) im2: Wheel,
    pub(super) not_ok: bool,
    /// The machine raises Not OK on its own when a lift is jammed.
    pub(super) sees_jams: bool,
    /// The machine never reports a step as complete.
    pub(super) mute: bool,
    /// The code of lift 1 comes LSB first.
    pub(super) lsb_first: bool,
    /// Bits of [`image`](Self::image) that are always on.
    pub(super) stuck: [u8; 3],
    pub(super) bottles: Bottles,
    blocked: u32,
    complete: u16,
    word: u16,
}

impl Plant {
    /// A machine that was switched off in the middle of something.
    pub(super) fn new() -> Self {
        Self {
            la1: Lift::new(80_000, BIG),
            la2: Lift::new(60_000, STROKE_2),
            im1: Wheel::new(700),
            im2: Wheel::new(1800),
            not_ok: false,
            sees_jams: true,
            mute: false,
            lsb_first: false,
            stuck: [0; 3],
            bottles: Bottles::default(),
            blocked: 0,
            complete: 0,
            word: 0,
        }
    }

    /// Moves by one scan under a command word.
    pub(super) fn step(&mut self, word: u16) {
        let on = |bits: u16| word & bits != 0;
        let acknowledged = on(ACKNOWLEDGE) && self.word & ACKNOWLEDGE == 0;
        if acknowledged && self.not_ok && !self.la1.jammed && !self.la2.jammed {
            self.not_ok = false;
            for lift in [&mut self.la1, &mut self.la2] {
                lift.referenced = lift.at_bottom();
                lift.target = None;
                lift.before = None;
            }
        }
        if acknowledged || word != self.word {
            self.complete = 0;
        }
        self.word = word;

        let (minus, plus) = if self.lsb_first {
            (LA1_CODE_HIGH, LA1_CODE_LOW)
        } else {
            (LA1_CODE_LOW, LA1_CODE_HIGH)
        };
        self.bottles
            .suck([&self.la1, &self.la2], [on(SC1), on(SC2)]);
        let big_or_small = match word & LA1_CODE {
            0 => BIG,
            LA1_CODE => -BIG,
            code if code == minus => -SMALL,
            code => {
                assert_eq!(code, plus);
                SMALL
            }
        };
        let la2_by = if on(LA2_UP) { STROKE_2 } else { -STROKE_2 };
        self.not_ok |= self.la1.step(on(LA1_RUN).then_some(big_or_small), -BIG);
        self.not_ok |= self.la2.step(on(LA2_RUN).then_some(la2_by), -STROKE_2);
        let all_down = self.la1.at_bottom() && self.la2.at_bottom();
        self.not_ok |= on(IM1_INDEX | IM1_JOG | IM2_JOG) && !all_down;
        self.im1.step(on(IM1_INDEX), on(IM1_JOG), 900);
        self.im2.step(on(IM2_INDEX), on(IM2_JOG), 1800);
        self.bottles
            .follow([&self.la1, &self.la2], [&self.im1, &self.im2]);

        let pushed = (self.la1.jammed && on(LA1_RUN)) || (self.la2.jammed && on(LA2_RUN));
        self.blocked = if pushed { self.blocked + 1 } else { 0 };
        self.not_ok |= self.sees_jams && self.blocked > 100;

        let still = [&self.la1, &self.la2]
            .iter()
            .all(|lift| lift.target.is_none())
            && self.im1.left == 0
            && self.im2.left == 0;
        if let Some(step) = WORDS.iter().position(|&w| w == self.msb_first(word))
            && still
            && !self.mute
        {
            self.complete |= 1 << step;
        }
    }

    fn msb_first(&self, word: u16) -> u16 {
        let small = word & LA1_CODE != 0 && word & LA1_CODE != LA1_CODE;
        if self.lsb_first && small {
            word ^ LA1_CODE
        } else {
            word
        }
    }

    /// The first three bytes of `%I`, without the buttons.
    pub(super) fn image(&self) -> [u8; 3] {
        let mut status = self.complete;
        status |= u16::from(self.la1.jammed) << 11;
        status |= u16::from(self.la2.jammed) << 12;
        status |= u16::from(self.im1.home()) << 13;
        status |= u16::from(self.im2.home()) << 14;
        status |= u16::from(self.not_ok) << 15;
        let [high, low] = status.to_be_bytes();
        let panel = u8::from(self.la1.at_bottom()) << 3 | u8::from(self.la2.at_bottom()) << 4;
        let image = [high, low, panel];
        std::array::from_fn(|byte| image[byte] | self.stuck[byte])
    }
}
