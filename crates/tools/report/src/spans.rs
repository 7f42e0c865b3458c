//! Things that last: steps, line states, faults, gaps.

use super::{MarkKind, Run};
use tickbus_base::time::Nanos;
use tickbus_base::toml_text::short_number;

/// Something with a beginning and an end.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Span {
    pub(super) from: Nanos,
    /// The end; the end of the run if there was no other.
    pub(super) until: Nanos,
    /// True if the span continued to the end of the run, as far as known.
    pub(super) is_open: bool,
    /// The subject; usually empty.
    pub(super) of: String,
    pub(super) text: String,
}

/// Steps: from the marks of the run, or else the values of the signal with this number; 0 means no step.
pub(super) fn steps(run: &Run, signal: Option<usize>) -> Vec<Span> {
    let marked = states(run, MarkKind::Step, "");
    let Some(signal) = signal.filter(|_| marked.is_empty()) else {
        return marked;
    };
    let values = run.signals()[signal].changes();
    let texts = values.iter().map(|change| {
        let is_step = change.value != 0.0 && !change.value.is_nan();
        (
            change.at,
            if is_step {
                short_number(change.value)
            } else {
                String::new()
            },
        )
    });
    one_after_another(texts, "", run)
}

/// The subjects of marks of a kind, in order of first occurrence.
pub(super) fn concerned(run: &Run, kind: MarkKind) -> Vec<&str> {
    let mut found: Vec<&str> = Vec::new();
    for mark in run.marks().iter().filter(|mark| mark.kind == kind) {
        if !found.contains(&&*mark.of) {
            found.push(&mark.of);
        }
    }
    found
}

/// States, each of which lasts until the next mark of its kind and subject; an empty text is no state.
pub(super) fn states(run: &Run, kind: MarkKind, of: &str) -> Vec<Span> {
    let marks = run
        .marks()
        .iter()
        .filter(|mark| mark.kind == kind && mark.of == of);
    one_after_another(marks.map(|mark| (mark.at, mark.text.clone())), of, run)
}

/// Marks with their own end: faults and gaps.
pub(super) fn events(run: &Run, kind: MarkKind) -> Vec<Span> {
    let (_, end) = run.extent();
    let marks = run.marks().iter().filter(|mark| mark.kind == kind);
    marks
        .map(|mark| Span {
            from: mark.at,
            until: mark.until.unwrap_or(end),
            is_open: mark.until.is_none(),
            of: mark.of.clone(),
            text: mark.text.clone(),
        })
        .collect()
}

/// The times during which a signal was on: known and not 0.
pub(super) fn while_on(run: &Run, signal: usize) -> Vec<Span> {
    let signal = &run.signals()[signal];
    let is_on = |value: f64| value != 0.0 && !value.is_nan();
    let mut was_on = false;
    let edges = signal.changes().iter().filter_map(|change| {
        let now = is_on(change.value);
        let text = || {
            if now {
                signal.name.clone()
            } else {
                String::new()
            }
        };
        (std::mem::replace(&mut was_on, now) != now).then(|| (change.at, text()))
    });
    one_after_another(edges, "", run)
}

fn one_after_another(
    texts: impl Iterator<Item = (Nanos, String)>,
    of: &str,
    run: &Run,
) -> Vec<Span> {
    let (_, end) = run.extent();
    let mut spans: Vec<Span> = Vec::new();
    for (from, text) in texts {
        if let Some(last) = spans.last_mut() {
            last.until = from;
            last.is_open = false;
        }
        spans.push(Span {
            from,
            until: end,
            is_open: true,
            of: of.to_owned(),
            text,
        });
    }
    spans.retain(|span| !span.text.is_empty());
    spans
}

/// The CSS class of a line state, by its word.
pub(super) fn state_class(word: &str) -> &'static str {
    match word {
        "running" | "live" => "good",
        "stale" => "stale",
        "failed" => "bad",
        _ => "idle",
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Mark, SignalKind};
    use super::*;

    fn mark(at: i64, kind: MarkKind, text: &str) -> Mark {
        Mark {
            at: Nanos(at),
            until: None,
            kind,
            of: String::new(),
            text: text.to_owned(),
        }
    }

    fn told(spans: &[Span]) -> Vec<(i64, i64, bool, &str)> {
        spans
            .iter()
            .map(|s| (s.from.0, s.until.0, s.is_open, &*s.text))
            .collect()
    }

    #[test]
    fn steps_come_from_a_signal_or_from_marks() {
        let mut run = Run::new(100);
        let step = run.add_signal("Step", SignalKind::Real, "");
        for (at, value) in [(0, 0.0), (10, 1.0), (20, 2.0), (30, 0.0), (40, 1.0)] {
            run.change(step, Nanos(at), value);
        }
        run.tick(Nanos(50));
        let spans = steps(&run, Some(step));
        assert_eq!(
            told(&spans),
            [
                (10, 20, false, "1"),
                (20, 30, false, "2"),
                (40, 50, true, "1")
            ]
        );
        assert_eq!(steps(&run, None), []);
        run.mark(mark(5, MarkKind::Step, "Home"));
        run.mark(mark(7, MarkKind::Step, ""));
        assert_eq!(told(&steps(&run, Some(step))), [(5, 7, false, "Home")]);
    }

    #[test]
    fn each_station_has_its_own_states() {
        let mut run = Run::new(100);
        for (at, of, text) in [(0, "a", "live"), (0, "b", "live"), (5, "a", "stale")] {
            run.mark(Mark {
                of: of.to_owned(),
                ..mark(at, MarkKind::Link, text)
            });
        }
        run.tick(Nanos(9));
        assert_eq!(concerned(&run, MarkKind::Link), ["a", "b"]);
        let spans = states(&run, MarkKind::Link, "a");
        assert_eq!(told(&spans), [(0, 5, false, "live"), (5, 9, true, "stale")]);
        assert_eq!(
            told(&states(&run, MarkKind::Link, "b")),
            [(0, 9, true, "live")]
        );
    }

    #[test]
    fn a_signal_can_tell_of_faults() {
        let mut run = Run::new(100);
        let lamp = run.add_signal("Lamp", SignalKind::Real, "");
        for (at, value) in [(0, 0.0), (3, 1.0), (4, 2.0), (6, 0.0), (8, 1.0)] {
            run.change(lamp, Nanos(at), value);
        }
        run.tick(Nanos(9));
        assert_eq!(
            told(&while_on(&run, lamp)),
            [(3, 6, false, "Lamp"), (8, 9, true, "Lamp")]
        );
    }

    #[test]
    fn faults_last_until_they_end() {
        let mut run = Run::new(100);
        run.mark(mark(5, MarkKind::Fault, "jam"));
        run.mark(Mark {
            until: Some(Nanos(9)),
            ..mark(6, MarkKind::Fault, "stuck")
        });
        run.tick(Nanos(20));
        let spans = events(&run, MarkKind::Fault);
        assert_eq!(told(&spans), [(5, 20, true, "jam"), (6, 9, false, "stuck")]);
    }
}
