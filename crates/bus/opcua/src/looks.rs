//! Looks at a line that tasks read instead of the bus itself.

use tickbus_base::time::Nanos;
use tickbus_fieldbus::Port;

/// The times when a bus looked at its tasks' input.
///
/// If the process was suspended, the tasks run only after the bus has looked, and need several turns for all the
/// waiting input. So input that they pass on shortly after a late look counts as having waited, too.
#[derive(Debug)]
pub(super) struct TaskLooks {
    /// Until this time the tasks may pass on waiting input.
    until: Nanos,
}

impl TaskLooks {
    /// Nothing has waited yet.
    pub(super) const fn new() -> Self {
        Self {
            until: Nanos(i64::MIN),
        }
    }

    /// The bus looks at `now`. Returns whether its input may have waited while the process stood still.
    pub(super) fn look(&mut self, port: &mut Port, now: Nanos) -> bool {
        let due = port.next_look();
        port.look_at_line(now);
        let has_waited = self.has_waited(due, now, port.next_look());
        if has_waited {
            port.look_leaves_some();
        }
        has_waited
    }

    /// The same for a look that was due, and for the one that follows.
    fn has_waited(&mut self, due: Nanos, now: Nanos, next: Nanos) -> bool {
        let rest = next - now;
        // The same rule as the port's: threads often wake a little late.
        if now - due > rest {
            self.until = next;
        }
        now < self.until
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_tasks_hand_in_has_waited_for_a_rest_after_each_late_look() {
        let mut looks = TaskLooks::new();
        let mut due = 25;
        let mut look = |now: i64| {
            let (before, next) = (std::mem::replace(&mut due, now + 25), now + 25);
            looks.has_waited(Nanos(before), Nanos(now), Nanos(next))
        };
        assert!(!look(25), "in time");
        assert!(!look(75), "a little late");
        assert!(look(2000), "the tasks have not run yet");
        assert!(look(2001), "they have read a part");
        assert!(look(2024));
        assert!(
            !look(2025),
            "what comes now has come now, however much it is"
        );
        assert!(look(9000));
        assert!(look(9060), "suspended again");
        assert!(look(9080));
        assert!(!look(9085));
    }
}
