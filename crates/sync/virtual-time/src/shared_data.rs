//! The variables of a run, their committed values, and the values staged for the next commit.

use std::collections::HashMap;
use std::ops::Range;

use tickbus_base::Mistake;
use tickbus_base::toml_text::did_you_mean;

use crate::{Declaration, Variable, is_raw};

/// All variables, in the order of their clients and of each client's declaration; the logic's come last.
#[derive(Debug, Default)]
pub(crate) struct SharedData {
    variables: Vec<Variable>,
    by_name: HashMap<String, usize>,
    /// The index of the logic's first variable.
    logic_from: usize,
    /// The values that every client of a step sees.
    committed: Vec<u64>,
    /// The values of the next commit.
    staged: Vec<u64>,
    /// True during a commit, when hooks see the new values.
    is_committing: bool,
}

impl SharedData {
    /// The variables of these clients, which are in the order of their names, and of the logic.
    pub(crate) fn new(clients: &[Declaration], logic: &[Variable]) -> Result<Self, Mistake> {
        let mut data = Self::default();
        let mut owners: Vec<Option<&str>> = Vec::new();
        let of_clients = clients.iter().flat_map(|client| {
            let name = Some(client.name.as_str());
            client.writes.iter().map(move |variable| (name, variable))
        });
        let of_logic = logic.iter().map(|variable| (None, variable));
        for (owner, variable) in of_clients.chain(of_logic) {
            let at = data.variables.len();
            if let Some(first) = data.by_name.insert(variable.name.clone(), at) {
                return Err(Mistake::new(
                    format!(
                        "the variable \"{}\" is written by {} and by {}",
                        variable.name,
                        shown(owners[first]),
                        shown(owner)
                    ),
                    "one alone writes a variable: give one of the two another name",
                ));
            }
            owners.push(owner);
            data.variables.push(variable.clone());
        }
        data.logic_from = data.variables.len() - logic.len();
        data.committed = vec![0; data.variables.len()];
        data.staged = vec![0; data.variables.len()];
        for client in clients {
            for name in &client.reads {
                data.find_for(name).map_err(|right| {
                    let by = shown(Some(&client.name));
                    Mistake::new(
                        format!("{by} reads the variable \"{name}\", which nobody writes"),
                        right,
                    )
                })?;
            }
        }
        Ok(data)
    }

    /// The index of the variable `name`, or a suggestion.
    pub(crate) fn find_for(&self, name: &str) -> Result<usize, String> {
        self.by_name.get(name).copied().ok_or_else(|| {
            let names: Vec<&str> = self.variables.iter().map(|v| v.name.as_str()).collect();
            did_you_mean(name, "variables", &names)
        })
    }

    /// The index of the variable `name`.
    pub(crate) fn find(&self, name: &str) -> Result<usize, String> {
        let unknown = |right| format!("there is no variable \"{name}\"; {right}");
        self.find_for(name).map_err(unknown)
    }

    /// True if the logic writes this variable, and no client.
    pub(crate) fn is_of_logic(&self, at: usize) -> bool {
        at >= self.logic_from
    }

    pub(crate) fn variable(&self, at: usize) -> &Variable {
        &self.variables[at]
    }

    pub(crate) fn committed(&self) -> &[u64] {
        &self.committed
    }

    /// The value as a hook sees it.
    pub(crate) fn newest(&self, at: usize) -> u64 {
        if self.is_committing {
            self.staged[at]
        } else {
            self.committed[at]
        }
    }

    /// All variables, in order.
    pub(crate) fn variables(&self) -> &[Variable] {
        &self.variables
    }

    /// True if hooks see the values of the current commit.
    #[cfg(feature = "script")]
    pub(crate) fn is_committing(&self) -> bool {
        self.is_committing
    }

    /// Copies the committed values of the variables `from` into `to`.
    pub(crate) fn read(&self, from: &[u32], to: &mut [u64]) {
        for (slot, at) in to.iter_mut().zip(from) {
            *slot = self.committed[*at as usize];
        }
    }

    /// Stages the values of a client, whose variables are at `range`; refuses the first invalid raw value.
    pub(crate) fn stage(
        &mut self,
        range: Range<usize>,
        values: impl Iterator<Item = u64>,
    ) -> Result<(), String> {
        let variables = &self.variables[range.clone()];
        for ((slot, variable), value) in self.staged[range].iter_mut().zip(variables).zip(values) {
            if !is_raw(variable.data_type, value) {
                return Err(no_value(variable, value));
            }
            *slot = value;
        }
        Ok(())
    }

    pub(crate) fn write_by_logic(&mut self, at: usize, value: u64) -> Result<(), String> {
        let variable = &self.variables[at];
        if !self.is_of_logic(at) {
            return Err(format!(
                "the variable \"{}\" is a client's, so the logic may not write it",
                variable.name
            ));
        }
        if !is_raw(variable.data_type, value) {
            return Err(no_value(variable, value));
        }
        self.staged[at] = value;
        Ok(())
    }

    /// Commits these values of all variables.
    pub(crate) fn replace(&mut self, values: &[u64]) {
        self.staged.copy_from_slice(values);
        self.committed.copy_from_slice(values);
    }

    /// Begins a commit; until its end hooks see the staged values.
    pub(crate) fn begin_commit(&mut self) {
        self.is_committing = true;
    }

    /// True if the current commit changes this variable.
    pub(crate) fn changes(&self, at: usize) -> bool {
        self.committed[at] != self.staged[at]
    }

    /// Ends a commit: everyone sees the staged values.
    pub(crate) fn end_commit(&mut self) {
        self.committed.copy_from_slice(&self.staged);
        self.is_committing = false;
    }
}

fn no_value(variable: &Variable, value: u64) -> String {
    let Variable { name, data_type } = variable;
    format!("0x{value:x} is not a valid {data_type}, the type of the variable \"{name}\"")
}

fn shown(owner: Option<&str>) -> String {
    match owner {
        Some(client) => format!("client \"{client}\""),
        None => "the server's logic".to_owned(),
    }
}
