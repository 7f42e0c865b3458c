//! The control block of an SFC action: the action qualifiers.

use super::{RTrig, Rs, Ton};
use tickbus_base::time::Nanos;

/// The qualifiers under which active steps ask for one action, at one call.
#[derive(Clone, Copy, Debug, Default)]
#[expect(
    clippy::struct_excessive_bools,
    reason = "the standard's block has these inputs"
)]
pub struct Qualifiers {
    /// `N`: as long as the step is active.
    pub n: bool,
    /// `R`: ends what `S`, `SD`, `DS` and `SL` began; dominant.
    pub r: bool,
    /// `S`: from now on until `R`.
    pub s: bool,
    /// `L`: as long as the step is active, at most for `t`.
    pub l: bool,
    /// `D`: after `t`, if the step is still active, and as long as it is.
    pub d: bool,
    /// `P`: once, when the step becomes active.
    pub p: bool,
    /// `P0`: once, when the step has ended; `Q` stays off.
    pub p0: bool,
    /// `P1`: once, when the step becomes active; `Q` stays off.
    pub p1: bool,
    /// `SD`: after `t`, even if the step has ended meanwhile, until `R`.
    pub sd: bool,
    /// `DS`: after `t`, if the step is still active, until `R`.
    pub ds: bool,
    /// `SL`: from now on for `t`, even if the step ends, or until `R`.
    pub sl: bool,
    /// The time of the active timed qualifier (`L`, `D`, `SD`, `DS`, `SL`).
    pub t: Nanos,
}

/// Determines from the qualifiers if an action runs.
///
/// `Q = ¬R ∧ (N ∨ S' ∨ (L ∧ ¬TON(L)) ∨ TON(D) ∨ rise(P) ∨ TON(SD') ∨ DS' ∨ (SL' ∧ ¬TON(SL')))`,
/// where a dash marks the latch that `R` clears. The action runs (`A`) in every call with `Q`, and
/// once for `P1` and `P0`; with the final scan also once after `Q` has gone.
#[derive(Clone, Copy, Debug, Default)]
#[expect(clippy::struct_excessive_bools, reason = "one block's memory")]
pub struct ActionControl {
    /// `Q`, as of the last call.
    pub q: bool,
    /// Two timed qualifiers were on at once in the last call, which the standard calls an error.
    pub conflict: bool,
    final_scan: bool,
    stored: Rs,
    limited: Ton,
    delayed: Ton,
    pulse: RTrig,
    first: RTrig,
    last: bool,
    stored_delayed: (Rs, Ton, Nanos),
    delayed_stored: (Ton, Rs),
    stored_limited: (Rs, Ton, Nanos),
}

impl ActionControl {
    /// A control block; with `final_scan`, deactivated actions run once more.
    pub fn new(final_scan: bool) -> Self {
        Self {
            final_scan,
            ..Self::default()
        }
    }

    /// Evaluates the block and returns `A`: true if the action runs in this scan.
    pub fn call(&mut self, now: Nanos, on: &Qualifiers) -> bool {
        let timed = [on.l, on.d, on.sd, on.ds, on.sl];
        self.conflict = timed.into_iter().filter(|&on| on).count() > 1;

        let stored = self.stored.call(on.s, on.r);
        let over = self.limited.call(now, on.l, on.t);
        let limited = on.l && !over;
        let delayed = self.delayed.call(now, on.d, on.t);
        let pulse = self.pulse.call(on.p);

        // These continue after their step has ended, when `t` may belong to another.
        let (latch, timer, time) = &mut self.stored_delayed;
        if on.sd {
            *time = on.t;
        }
        let latched = latch.call(on.sd, on.r);
        let stored_delayed = timer.call(now, latched, *time);

        let (timer, latch) = &mut self.delayed_stored;
        let due = timer.call(now, on.ds, on.t);
        let delayed_stored = latch.call(due, on.r);

        let (latch, timer, time) = &mut self.stored_limited;
        if on.sl {
            *time = on.t;
        }
        let latched = latch.call(on.sl, on.r);
        let over = timer.call(now, latched, *time);
        let stored_limited = latched && !over;

        let q_before = self.q;
        self.q = !on.r
            && (on.n
                || stored
                || limited
                || delayed
                || pulse
                || stored_delayed
                || delayed_stored
                || stored_limited);

        let first = self.first.call(on.p1);
        let last = self.last && !on.p0;
        self.last = on.p0;
        self.q || first || last || (self.final_scan && q_before)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    type Set = fn(&mut Qualifiers);

    /// A step is active in scans 2 to 7, the step with `R` from scan 14; a scan takes 10 ms.
    #[rustfmt::skip]
    const GOLDEN: [(&str, Set, i64, &str); 14] = [
        ("N",    |on| on.n = true,  0,  "..111111.........."),
        ("S",    |on| on.s = true,  0,  "..111111111111...."),
        ("L30",  |on| on.l = true,  30, "..111............."),
        ("L90",  |on| on.l = true,  90, "..111111.........."),
        ("D30",  |on| on.d = true,  30, ".....111.........."),
        ("SD30", |on| on.sd = true, 30, ".....111111111...."),
        ("SD90", |on| on.sd = true, 90, "...........111...."),
        ("DS30", |on| on.ds = true, 30, ".....111111111...."),
        ("DS90", |on| on.ds = true, 90, ".................."),
        ("SL30", |on| on.sl = true, 30, "..111............."),
        ("SL90", |on| on.sl = true, 90, "..111111111......."),
        ("P",    |on| on.p = true,  0,  "..1..............."),
        ("P0",   |on| on.p0 = true, 0,  "........1........."),
        ("P1",   |on| on.p1 = true, 0,  "..1..............."),
    ];

    fn play(final_scan: bool, set: Set, millis: i64) -> (String, String) {
        let mut block = ActionControl::new(final_scan);
        (0..18)
            .map(|scan| {
                let mut on = Qualifiers {
                    r: scan >= 14,
                    ..Qualifiers::default()
                };
                if (2..=7).contains(&scan) {
                    set(&mut on);
                    on.t = Nanos::from_millis(millis);
                }
                let runs = block.call(Nanos::from_millis(scan * 10), &on);
                assert!(!block.conflict);
                let mark = |on| if on { '1' } else { '.' };
                (mark(runs), mark(block.q))
            })
            .unzip()
    }

    #[test]
    fn every_qualifier_follows_its_golden_row() {
        for (name, set, millis, row) in GOLDEN {
            let (runs, q) = play(false, set, millis);
            assert_eq!(runs, row, "{name}");
            let quiet = name == "P0" || name == "P1";
            assert_eq!(
                q,
                if quiet {
                    ".".repeat(18)
                } else {
                    row.to_owned()
                },
                "{name}"
            );
        }
    }

    #[test]
    fn with_the_final_scan_each_run_is_one_scan_longer() {
        for (name, set, millis, row) in GOLDEN {
            let quiet = name == "P0" || name == "P1";
            let longer = if quiet {
                row.to_owned()
            } else {
                row.replacen("1.", "11", 1)
            };
            assert_eq!(play(true, set, millis).0, longer, "{name}");
        }
    }

    #[test]
    fn a_limited_action_is_limited_anew_each_time() {
        let mut block = ActionControl::default();
        let mut q = String::new();
        for (scan, l) in "..11111..11111".bytes().enumerate() {
            let on = Qualifiers {
                l: l == b'1',
                t: Nanos::from_millis(30),
                ..Qualifiers::default()
            };
            let now = Nanos::from_millis(10 * i64::try_from(scan).expect("short"));
            q.push(if block.call(now, &on) { '1' } else { '.' });
        }
        assert_eq!(q, "..111....111..");
    }

    #[test]
    fn two_timed_qualifiers_at_once_are_a_conflict() {
        let mut block = ActionControl::default();
        let on = Qualifiers {
            l: true,
            d: true,
            t: Nanos(1),
            ..Qualifiers::default()
        };
        block.call(Nanos::ZERO, &on);
        assert!(block.conflict);
    }
}
