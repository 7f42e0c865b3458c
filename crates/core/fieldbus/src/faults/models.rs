//! The faults that a simulation's model has declared, and what the model is still to be told about them.

use std::sync::Arc;

use tickbus_base::Mistake;
use tickbus_base::toml_text::{did_you_mean, nearest, shown};

/// The most names in a message.
const MOST: usize = 20;

/// The declared faults of a model, by name, as the tick knows them.
#[derive(Debug, Default)]
pub(super) struct Models {
    names: Arc<[String]>,
    states: Box<[State]>,
    /// True if the model may have to be told something.
    has_news: bool,
}

/// One declared fault; `None` is a fault that is off.
#[derive(Clone, Copy, Debug, Default)]
struct State {
    now: Option<f64>,
    told: Option<f64>,
}

impl Models {
    pub(super) fn new(names: Arc<[String]>) -> Self {
        Self {
            states: vec![State::default(); names.len()].into(),
            has_news: false,
            names,
        }
    }

    /// The place of a declared fault.
    pub(super) fn position(&self, name: &str) -> Option<usize> {
        self.names.iter().position(|known| known == name)
    }

    /// Takes the faults that are active, in the order in which they act: of several faults with one name the last one
    /// counts.
    pub(super) fn set(&mut self, active: impl Iterator<Item = (usize, f64)>) {
        for state in &mut self.states {
            state.now = None;
        }
        for (place, value) in active {
            self.states[place].now = Some(value);
        }
        self.has_news = self.states.iter().any(|state| state.now != state.told);
    }

    /// Takes over the ends that the model has not been told under these earlier names: one who declares again, as an
    /// episode begins, still hears of them.
    pub(super) fn keep_ends(&mut self, earlier: &Self) {
        for (name, state) in self.names.iter().zip(&mut self.states) {
            let place = earlier.position(name).filter(|_| state.now.is_none());
            state.told = place.and_then(|place| earlier.states[place].told);
            self.has_news |= state.now != state.told;
        }
    }

    /// Returns whether there may be a change that the model has not been told.
    pub(super) const fn has_change(&self) -> bool {
        self.has_news
    }

    /// The next change that the model has not been told, with the place of the fault in the list of names.
    pub(super) fn next_change(&mut self) -> Option<(usize, Option<f64>)> {
        if !self.has_news {
            return None;
        }
        let mut states = self.states.iter_mut().enumerate();
        let found = states.find(|(_, state)| state.now != state.told);
        self.has_news = found.is_some();
        let (place, state) = found?;
        state.told = state.now;
        Some((place, state.now))
    }
}

/// The mistake of a fault that the model has not declared.
pub(super) fn undeclared(name: &str, declared: &[String]) -> Mistake {
    let what = format!("the model has no fault \"{}\"", shown(name));
    let names: Vec<&str> = declared.iter().map(String::as_str).collect();
    let right = if names.is_empty() {
        "let the simulation declare it before its first tick".to_owned()
    } else if names.len() > MOST && nearest(name, names.iter().copied()).is_none() {
        format!("name one of the {} that it has declared", names.len())
    } else {
        did_you_mean(name, "its faults", &names)
    };
    Mistake::new(what, right)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_model_is_told_each_change_once_and_of_one_name_the_last_value() {
        let names = ["leak", "wear"].map(str::to_owned);
        let mut models = Models::new(Arc::from(names));
        assert_eq!(models.next_change(), None);
        models.set([(1, 0.2), (0, 0.0), (1, 0.5)].into_iter());
        assert_eq!(models.next_change(), Some((0, Some(0.0))));
        assert_eq!(models.next_change(), Some((1, Some(0.5))));
        assert_eq!(models.next_change(), None);
        models.set([(1, 0.5)].into_iter());
        assert_eq!(models.next_change(), Some((0, None)));
        assert_eq!(models.next_change(), None);
        // Nobody has asked in between.
        models.set([(0, 1.0)].into_iter());
        models.set([(1, 0.5)].into_iter());
        assert_eq!(models.next_change(), None);
        // Both end, and the model declares them again before it asks.
        models.set([(0, 1.0), (1, 0.5)].into_iter());
        assert_eq!(models.next_change(), Some((0, Some(1.0))));
        models.set([].into_iter());
        let mut again = Models::new(Arc::from(["wear", "pump", "leak"].map(str::to_owned)));
        again.keep_ends(&models);
        assert_eq!(again.next_change(), Some((0, None)));
        assert_eq!(again.next_change(), Some((2, None)));
        assert_eq!(again.next_change(), None);
    }

    #[test]
    fn a_mistyped_name_is_answered_with_the_nearest_one() {
        let few = ["hose of clamp left", "hose of clamp right"].map(str::to_owned);
        let many: Vec<String> = (0..30).map(|number| format!("valve {number}")).collect();
        for (name, declared, right) in [
            (
                "hose of clamp lft",
                &few[..],
                "did you mean \"hose of clamp left\"?",
            ),
            (
                "pump",
                &few[..],
                "its faults are hose of clamp left, hose of clamp right",
            ),
            ("pump", &many[..], "name one of the 30 that it has declared"),
            (
                "pump",
                &[],
                "let the simulation declare it before its first tick",
            ),
        ] {
            let told = undeclared(name, declared).to_string();
            assert_eq!(told, format!("the model has no fault \"{name}\"; {right}"));
        }
    }
}
