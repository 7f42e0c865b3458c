//! An end that is a PLC program, scanned by tickbus. It writes and reads frames instead of slots.

use std::cell::RefCell;
use std::rc::Rc;

use tickbus_base::time::Nanos;
use tickbus_driver::{Code, Host};
use tickbus_plc::{Program, Scan};

use super::{Shared, judge_tick};
use crate::broken::Broken;
use crate::clock::SimulatedClock;
use crate::end::Found;
use crate::judge::Shown;
use crate::known;
use crate::plan::{FAIL_SAFE, Plan};
use crate::pulses::Pulses;
use crate::scheduler;
use crate::stamp::{Stamp, level, real, whole};

thread_local! {
    /// The world of this thread. A program is sent to the thread that scans it, which here is the same thread.
    static HERE: RefCell<Option<Rc<Shared>>> = const { RefCell::new(None) };
}

/// Sets the world of this thread.
pub(super) fn enter(shared: &Rc<Shared>) {
    HERE.with(|here| *here.borrow_mut() = Some(Rc::clone(shared)));
}

/// Clears the world of this thread.
pub(super) fn leave() {
    HERE.with(|here| here.borrow_mut().take());
}

/// The program of an end.
struct Stamped {
    plan: Plan,
    end: usize,
    process: usize,
    life: u64,
    tick: u64,
    pulses: Pulses,
    /// The last pulse that the program read.
    had_pulse: bool,
}

/// Begins to scan an end's program.
pub(super) fn open(shared: &Shared, (end, process): (usize, usize), life: u64) -> Host {
    let plan = &shared.plan;
    let text = plan.driver_cfg(end, &shared.link);
    let config = known::parse("driver.cfg", text);
    let program = Stamped {
        plan: plan.clone(),
        end,
        process,
        life,
        tick: 0,
        pulses: Pulses::new(plan, scheduler::now().0),
        had_pulse: false,
    };
    let interval = plan.ends[end].period;
    Host::open(
        &config,
        Box::new(program),
        interval,
        SimulatedClock::shared(),
    )
    .unwrap_or_else(|why| panic!("a program that is not scanned: {why}"))
}

/// Ends the scanning.
pub(super) fn close(host: Host) -> Result<(), Broken> {
    match host.close() {
        None => Ok(()),
        Some(what) => Err(Broken {
            promise: "close",
            what,
        }),
    }
}

impl Stamped {
    /// The area that the program writes or reads.
    fn area(&self, writes: bool) -> char {
        if (self.end == 0) == writes { 'I' } else { 'Q' }
    }

    fn write(&self, is_pulse: bool, frame: &mut [u8]) {
        let stamp = Stamp {
            life: self.life,
            area: 1 - self.end as u64,
            station: 0,
            tick: self.tick,
        };
        let stamp = stamp.number();
        frame[..8].copy_from_slice(&stamp.to_be_bytes());
        frame[8] = u8::from(is_pulse) | u8::from(level(stamp)) << 1;
        if self.plan.numbers {
            frame[10..12].copy_from_slice(&whole(stamp).to_le_bytes());
            #[expect(clippy::cast_possible_truncation, reason = "a small number")]
            let raw = (real(stamp) * 2.0) as f32;
            frame[12..16].copy_from_slice(&raw.to_be_bytes());
        }
        for typed in self.plan.features.beside(self.area(true)) {
            let bytes = typed.bytes(stamp);
            frame[typed.place..typed.place + bytes.len()].copy_from_slice(&bytes);
        }
    }

    fn read(&mut self, frame: &[u8]) -> Shown {
        let part = |place: usize| frame[place..place + 8].try_into().expect("eight bytes");
        let has_pulse = frame[8] & 1 == 1;
        let had_pulse = std::mem::replace(&mut self.had_pulse, has_pulse);
        let numbers = self.plan.numbers.then(|| {
            let whole = i16::from_le_bytes([frame[10], frame[11]]);
            let raw = f32::from_be_bytes([frame[12], frame[13], frame[14], frame[15]]);
            (f64::from(whole), f64::from(raw) / 2.0)
        });
        let typed = self.plan.features.beside(self.area(false)).iter();
        Shown {
            stamp: u64::from_be_bytes(part(0)),
            level: frame[8] >> 1 & 1 == 1,
            edges: u64::from(has_pulse && !had_pulse),
            numbers,
            beat: self.plan.beat(1 - self.end).map(|_| frame[9]),
            typed: typed
                .flat_map(|typed| typed.taken(&frame[typed.place..], true))
                .collect(),
        }
    }

    /// The values by which a program without its peer is judged. Such a program learns that its inputs do not count,
    /// and sees those that came last; the judge treats it as if it took fail-safe values instead.
    fn without_peer(&self) -> Shown {
        let typed = self.plan.features.beside(self.area(false)).iter();
        Shown {
            stamp: FAIL_SAFE,
            level: false,
            edges: 0,
            numbers: self.plan.numbers.then_some((-7.0, 2.5)),
            typed: typed.flat_map(|typed| typed.shown(None, true)).collect(),
            beat: None,
        }
    }
}

impl Program for Stamped {
    fn name(&self) -> &'static str {
        "stamped"
    }

    fn input_bytes(&self) -> usize {
        0
    }

    fn output_bytes(&self) -> usize {
        0
    }

    fn can_hang(&self) -> bool {
        true
    }

    fn scan(&mut self, scan: &mut Scan<'_>) {
        let Some(shared) = HERE.with(|here| here.borrow().clone()) else {
            return;
        };
        let state = &shared.ends[self.end];
        self.tick += 1;
        let shown = self.read(scan.inputs);
        let stall = state.stall.replace(Nanos::ZERO);
        if stall > Nanos::ZERO {
            scheduler::sleep(stall);
        }
        state.writer.borrow_mut().begin(self.life, self.tick);
        let now = scan.now.0;
        let is_pulse = self.pulses.are_due(now);
        self.write(is_pulse, scan.outputs);
        {
            let mut writer = state.writer.borrow_mut();
            writer.end(scheduler::now().0);
            if is_pulse {
                writer.pulses.push(now);
            }
        }
        // A program learns no age, only that it is within the limit.
        let found = Found {
            code: if scan.alive {
                Code::Unchanged
            } else {
                Code::Stale
            },
            age: if scan.alive {
                self.plan.max_age.0
            } else {
                i64::MAX
            },
            sequence: 0,
            stations: vec![if scan.alive {
                shown
            } else {
                self.without_peer()
            }],
            broken: None,
        };
        let (life, tick) = (self.life, self.tick);
        judge_tick(
            &shared,
            (self.end, self.process),
            (life, tick),
            (now, is_pulse),
            found,
        );
    }
}
