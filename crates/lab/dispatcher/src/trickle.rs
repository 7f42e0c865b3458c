//! A quick stream of lines that come one by one.

use tickbus_base::time::Nanos;

/// Turns that begin within this time of each other are quick: 10,000 in a second.
const QUICK: Nanos = Nanos::from_micros(100);

/// A turn with fewer lines than this costs more than its lines do.
const FEW: u64 = 8;

/// This many consecutive turns count as a stream. A shorter burst does not, and is forwarded at once.
const STREAM: u32 = 16;

/// Detects a client that writes lines one by one, so fast that it would be interrupted for every few of them.
///
/// If that client shares a core with the dispatcher, each write wakes the dispatcher, and the system soon prefers the
/// thread that has just slept: two switches and a turn for four lines or so. If the dispatcher yields first, it finds
/// hundreds of lines at once, and both get more done. Other clients that send at that moment also wait, for as long as
/// the system gives the core to others. Below such rates nothing changes.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Trickle {
    /// When the last turn began.
    last: Nanos,
    /// Lines received before its end.
    lines: u64,
    /// Quick turns with few lines since the last other turn.
    turns: u32,
}

impl Trickle {
    /// A turn that began at `now` is over, with `lines` received so far. Returns whether other threads should get this
    /// core first.
    pub(crate) fn turn(&mut self, now: Nanos, lines: u64) -> bool {
        let is_quick = now - self.last < QUICK;
        let has_few = (1..FEW).contains(&(lines - self.lines));
        self.turns = if is_quick && has_few {
            self.turns.saturating_add(1)
        } else {
            0
        };
        self.last = now;
        self.lines = lines;
        self.turns >= STREAM
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The number of pauses in 100 turns that are `span` apart and have `lines` lines.
    fn pauses(span: Nanos, lines: impl Fn(u64) -> u64) -> usize {
        let mut trickle = Trickle::default();
        let (mut now, mut all) = (Nanos::from_secs(1), 0);
        let pauses = (0..100).filter(|turn| {
            now += span;
            all += lines(*turn);
            trickle.turn(now, all)
        });
        pauses.count()
    }

    #[test]
    fn only_many_quick_turns_with_few_lines_in_succession_make_a_pause() {
        let quick = Nanos::from_micros(10);
        // The first turn comes long after the start of the clock.
        assert_eq!(pauses(quick, |_| 1), 100 - 16);
        assert_eq!(pauses(quick, |_| 7), 100 - 16);
        assert_eq!(pauses(quick, |_| 8), 0, "many lines at once");
        assert_eq!(pauses(quick, |_| 0), 0, "no lines");
        assert_eq!(pauses(QUICK, |_| 1), 0, "at their ease");
        let burst = |turn| if turn % 16 == 15 { 100 } else { 1 };
        assert_eq!(pauses(quick, burst), 0, "bursts");
    }
}
