//! A client's part of a run whose clients exchange their values without the server, without I/O: frames of the other
//! clients and of this one in; the next step, or whom to wait for, out.
//!
//! Each client keeps the state of the whole run, by the same rules as the server. So each knows when all due clients have
//! finished a step, and what is read in the next one; the order in which frames arrive does not matter.

use crate::barrier::{Barrier, State};
use crate::logic::Logic;
use crate::wire::{self, FromClient};
use crate::{MemberList, Outcome, Step};

/// The next action of a client.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Next {
    /// Run this step, which reads [`Mesh::reads`], and [hear](Mesh::hear) the own answer. Step 0: the initial values.
    Run(Step),
    /// Wait for the answer of the client at this place.
    Wait(usize),
    /// Wait for the server, which has allowed no further step.
    Server,
}

/// The state of a run in one of its clients.
#[derive(Debug)]
pub struct Mesh {
    barrier: Barrier<'static>,
    own: usize,
    /// The last step that the server allows.
    until: u64,
}

impl Mesh {
    /// The run of these clients before their initial values, for one of them.
    ///
    /// # Errors
    ///
    /// The list contradicts itself.
    pub fn new(list: &MemberList) -> Result<Self, String> {
        let mut declarations = Vec::new();
        for (_, declaration) in &list.members {
            let checked = declaration.check();
            checked.map_err(|mistake| mistake.to_string())?;
            declarations.push(declaration.clone());
        }
        if list.own >= declarations.len() {
            return Err("this client is not in the list of clients".to_owned());
        }
        if !declarations.is_sorted_by(|a, b| a.name < b.name) {
            return Err("the clients are not in the order of their names".to_owned());
        }
        if list.step.0 <= 0 {
            return Err(format!("a run with steps of {}", list.step));
        }
        let barrier = Barrier::new(list.step, declarations, Logic::new());
        Ok(Self {
            barrier: barrier.map_err(|mistake| mistake.to_string())?,
            own: list.own,
            until: 0,
        })
    }

    /// The server allows the steps up to this one.
    pub fn allow(&mut self, until: u64) {
        self.until = self.until.max(until);
    }

    /// The last step that the server allows.
    pub const fn until(&self) -> u64 {
        self.until
    }

    /// True if the client at this place has not answered the current step; otherwise its next frame has to wait.
    pub fn takes(&self, client: usize) -> bool {
        self.barrier.is_owing(client)
    }

    /// Takes a frame of the client at this place, without its header: its values of the current step.
    ///
    /// # Errors
    ///
    /// How the client violates the protocol, as the continuation of "the client …".
    pub fn hear(&mut self, client: usize, frame: &[u8]) -> Result<(), String> {
        match wire::from_client(frame)? {
            FromClient::Done {
                sequence,
                next,
                writes,
            } => self.barrier.done(client, (sequence, next), writes.iter()),
            _ => Err("sent another client something else than values".to_owned()),
        }
    }

    /// Advances as far as possible.
    pub fn advance(&mut self) -> Next {
        loop {
            if self.barrier.is_owing(self.own) {
                return Next::Run(self.barrier.step());
            }
            if let Some(client) = self.barrier.owing().next() {
                return Next::Wait(client);
            }
            if self.barrier.state() != State::PreRead {
                self.barrier.commit().expect("there is no logic");
            } else if self.barrier.step().sequence >= self.until || self.barrier.is_idle_for_ever()
            {
                return Next::Server;
            } else {
                self.barrier.begin_step().expect("there is no logic");
            }
        }
    }

    /// The values that this client reads in the current step.
    pub fn reads(&self) -> &[u64] {
        self.barrier.snapshot(self.own)
    }

    /// The name of the client at this place.
    pub fn name(&self, client: usize) -> &str {
        &self.barrier.declaration(client).name
    }

    /// The run so far, once the last allowed step is over.
    pub fn outcome(&self) -> Option<Outcome> {
        let is_over = self.barrier.state() == State::PreRead;
        is_over.then(|| self.barrier.outcome())
    }
}
