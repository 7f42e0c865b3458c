//! The clients that have joined, and the condition for joining.

use tickbus_base::Mistake;

use crate::declaration::check_name;
use crate::members::{Client, Members};
pub(crate) use crate::saved_run::MOST_CLIENTS;
use crate::{Declaration, StartCondition};

/// The clients that have joined before the start.
#[derive(Debug)]
pub(super) struct Joining {
    condition: StartCondition,
    /// With their seats, in the order in which they came: the run must not depend on that.
    joined: Vec<(usize, Declaration)>,
}

impl Joining {
    pub(super) fn new(condition: &StartCondition) -> Result<Self, Mistake> {
        let count = match condition {
            StartCondition::Names(names) => {
                for (at, name) in names.iter().enumerate() {
                    check_name("client", name)?;
                    if names[..at].contains(name) {
                        let what = format!("the client \"{name}\" is expected twice");
                        return Err(Mistake::new(what, "name each client once"));
                    }
                }
                names.len()
            }
            StartCondition::Count(count) => *count,
        };
        if !(1..=MOST_CLIENTS).contains(&count) {
            return Err(Mistake::new(
                format!("{count} clients are expected"),
                format!("a run has 1 to {MOST_CLIENTS} clients"),
            ));
        }
        Ok(Self {
            condition: condition.clone(),
            joined: Vec::new(),
        })
    }

    /// Accepts a client, or returns why it may not join.
    pub(super) fn join(&mut self, seat: usize, declaration: Declaration) -> Result<(), String> {
        declaration.check().map_err(|mistake| mistake.to_string())?;
        let name = &declaration.name;
        if self.joined.iter().any(|(_, other)| other.name == *name) {
            return Err(format!(
                "a client of the name \"{name}\" has joined already; give this one another name"
            ));
        }
        if let StartCondition::Names(names) = &self.condition
            && !names.contains(name)
        {
            return Err(format!(
                "no client of the name \"{name}\" is expected; expected are {}",
                listed(names.iter())
            ));
        }
        self.joined.push((seat, declaration));
        Ok(())
    }

    /// The client at `seat` has gone.
    pub(super) fn remove(&mut self, seat: usize) {
        self.joined.retain(|(other, _)| *other != seat);
    }

    /// The name of the client at `seat`.
    pub(super) fn name(&self, seat: usize) -> Option<&str> {
        let joined = self.joined.iter().find(|(other, _)| *other == seat);
        joined.map(|(_, declaration)| declaration.name.as_str())
    }

    /// True if the start condition is met.
    pub(super) fn is_complete(&self) -> bool {
        self.joined.len()
            == match &self.condition {
                StartCondition::Names(names) => names.len(),
                StartCondition::Count(count) => *count,
            }
    }

    /// The clients that the start waits for, as text for people.
    pub(super) fn missing(&self) -> String {
        match &self.condition {
            StartCondition::Names(names) => {
                let is_here = |name: &&String| self.joined.iter().any(|(_, d)| d.name == **name);
                listed(names.iter().filter(|name| !is_here(name)))
            }
            StartCondition::Count(count) => {
                format!(
                    "{} of {count} clients; joined have: {}",
                    count - self.joined.len(),
                    listed(self.joined.iter().map(|(_, declaration)| &declaration.name))
                )
            }
        }
    }

    /// The joined clients, in the order of their names; their variables are reported when the run starts.
    pub(super) fn members(&self) -> Members {
        let client = |(_, declaration): &(usize, Declaration)| Client {
            name: declaration.name.clone(),
            multiple: declaration.multiple,
            interval: declaration.interval,
            writes: 0..0,
        };
        let mut clients: Vec<Client> = self.joined.iter().map(client).collect();
        clients.sort_by(|a, b| a.name.cmp(&b.name));
        Members {
            clients,
            variables: Vec::new(),
        }
    }

    /// The clients with their seats, in the order in which they came.
    pub(super) fn joined(&self) -> impl ExactSizeIterator<Item = &(usize, Declaration)> {
        self.joined.iter()
    }

    /// The clients with their seats, in the order of their names.
    pub(super) fn into_clients(mut self) -> (Vec<usize>, Vec<Declaration>) {
        self.joined.sort_by(|a, b| a.1.name.cmp(&b.1.name));
        self.joined.into_iter().unzip()
    }
}

fn listed<'a>(names: impl Iterator<Item = &'a String>) -> String {
    let names: Vec<String> = names.map(|name| format!("\"{name}\"")).collect();
    if names.is_empty() {
        return "none".to_owned();
    }
    names.join(", ")
}
