//! The states of a run, from the initial write on, and the data that pass through them; how clients are connected does
//! not matter here.

use std::ops::Range;
use std::sync::Arc;

use tickbus_base::Mistake;
use tickbus_base::time::Nanos;
use tickbus_image::signal::DataType;

use crate::hash::Trace;
use crate::logic::{Access, Commit, Hook, Logic};
use crate::members::{Client, Members};
use crate::memory::Memory;
use crate::saved_run::SavedRun;
use crate::shared_data::SharedData;
use crate::step::step_of;
use crate::{Declaration, Outcome, Step};

/// The state of a run. The names are those of the paper.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum State {
    /// Clients join.
    Start,
    /// The clients initialise their variables; the time is one step below 0.
    InitialWrite,
    /// All writes are committed; which clients are due in the next step is fixed now.
    PreRead,
    /// The clients that are due read; then time moves on.
    Read,
    /// The clients that are due run.
    PreWrite,
    /// The clients that are due finish their runs and write.
    Write,
    /// The run has ended.
    Ended,
}

/// A run whose clients are known by their places in the order of their names.
#[derive(Debug)]
pub(crate) struct Barrier<'l> {
    length: Nanos,
    state: State,
    step: Step,
    members: Vec<Member>,
    shown: Arc<Members>,
    data: SharedData,
    logic: Logic<'l>,
    /// The variables with hooks for changes, in their order, each with its hook.
    change_calls: Vec<(usize, usize)>,
    /// The clients and the hooks for reads, in the order in which they are called.
    read_calls: Vec<(usize, usize)>,
    trace: Trace,
    owing: usize,
    /// The first step in which a client wants to run, after a commit.
    next_due: u64,
}

#[derive(Debug)]
struct Member {
    declaration: Declaration,
    writes: Range<usize>,
    reads: Box<[u32]>,
    read_types: Box<[DataType]>,
    /// The values that the client reads in this step.
    snapshot: Box<[u64]>,
    /// The number of the step in which the client runs next.
    next_update: u64,
    is_due: bool,
    /// The client has not answered yet.
    owes: bool,
}

impl<'l> Barrier<'l> {
    /// A run of these clients, in the state of the initial write.
    pub(crate) fn new(
        length: Nanos,
        mut clients: Vec<Declaration>,
        logic: Logic<'l>,
    ) -> Result<Self, Mistake> {
        clients.sort_by(|a, b| a.name.cmp(&b.name));
        let data = SharedData::new(&clients, &logic.variables)?;
        let trace = Trace::new(length.0, &clients, &logic.variables);
        let place = |of: &str, name: &str| {
            let what = format!("the server's logic hangs on {of} of the variable \"{name}\"");
            data.find_for(name)
                .map_err(|right| Mistake::new(format!("{what}, which nobody writes"), right))
        };
        let mut change_calls = Vec::new();
        for (hook, (name, _)) in logic.change.iter().enumerate() {
            let at = place("changes", name)?;
            if data.is_of_logic(at) {
                return Err(Mistake::new(
                    format!("the server's logic hangs on changes of its own variable \"{name}\""),
                    "do what follows from it where it is written",
                ));
            }
            change_calls.push((at, hook));
        }
        change_calls.sort_unstable();
        for (name, _) in &logic.read {
            place("reads", name)?;
        }
        let mut read_calls = Vec::new();
        for (at, client) in clients.iter().enumerate() {
            for read in &client.reads {
                let hooks = logic.read.iter().enumerate();
                let hooks = hooks.filter(|(_, (name, _))| name == read);
                read_calls.extend(hooks.map(|(hook, _)| (at, hook)));
            }
        }
        let mut from = 0;
        let member = |declaration: Declaration| {
            let writes = from..from + declaration.writes.len();
            from = writes.end;
            let find = |name| data.find(name).expect("checked with the data");
            let reads: Box<[u32]> = (declaration.reads.iter())
                .map(|name| u32::try_from(find(name)).expect("fewer variables than that"))
                .collect();
            let types = (reads.iter()).map(|at| data.variable(*at as usize).data_type);
            Member {
                writes,
                read_types: types.collect(),
                snapshot: vec![0; reads.len()].into(),
                reads,
                next_update: 1,
                is_due: true,
                owes: true,
                declaration,
            }
        };
        let members: Vec<Member> = clients.into_iter().map(member).collect();
        let client = |member: &Member| Client {
            name: member.declaration.name.clone(),
            multiple: member.declaration.multiple,
            interval: member.declaration.interval,
            writes: member.writes.clone(),
        };
        let shown = Members {
            clients: members.iter().map(client).collect(),
            variables: data.variables().to_vec(),
        };
        Ok(Self {
            length,
            shown: Arc::new(shown),
            state: State::InitialWrite,
            step: step_of(0, length),
            owing: members.len(),
            next_due: 0,
            members,
            data,
            logic,
            change_calls,
            read_calls,
            trace,
        })
    }

    /// Calls the hooks for the start.
    pub(crate) fn start(&mut self) -> Result<(), String> {
        let (data, step) = (&mut self.data, self.step);
        let hooks = self.logic.start.iter_mut();
        call_all(hooks, data, step)
    }

    pub(crate) const fn state(&self) -> State {
        self.state
    }

    /// The step that runs, or ran last.
    pub(crate) const fn step(&self) -> Step {
        self.step
    }

    /// The number of committed steps.
    pub(crate) const fn steps(&self) -> u64 {
        match self.state {
            State::PreWrite | State::Write => self.step.sequence - 1,
            // The number is still that of the previous step until its read hooks have run.
            _ => self.step.sequence,
        }
    }

    pub(crate) fn outcome(&self) -> Outcome {
        Outcome {
            steps: self.step.sequence,
            time: self.step.time,
            hash: self.trace.hash(),
        }
    }

    /// The trace so far.
    pub(crate) const fn trace(&self) -> &Trace {
        &self.trace
    }

    /// The number of the last step for which virtual time has room.
    pub(crate) const fn last_step(&self) -> u64 {
        (i64::MAX / self.length.0).unsigned_abs() + 1
    }

    /// True if no client wants to run again, between two steps.
    pub(crate) const fn is_idle_for_ever(&self) -> bool {
        self.step.sequence < self.last_step() && self.next_due > self.last_step()
    }

    /// The declaration of a client.
    pub(crate) fn declaration(&self, client: usize) -> &Declaration {
        &self.members[client].declaration
    }

    /// The types of the variables that a client reads.
    pub(crate) fn read_types(&self, client: usize) -> &[DataType] {
        &self.members[client].read_types
    }

    /// The values that a client reads in this step.
    pub(crate) fn snapshot(&self, client: usize) -> &[u64] {
        &self.members[client].snapshot
    }

    /// The places of the variables that a client writes.
    pub(crate) fn writes(&self, client: usize) -> Range<usize> {
        self.members[client].writes.clone()
    }

    /// The places of the variables that a client reads.
    pub(crate) fn reads(&self, client: usize) -> &[u32] {
        &self.members[client].reads
    }

    /// The participants of the run.
    pub(crate) const fn members(&self) -> &Arc<Members> {
        &self.shown
    }

    /// The values that everyone sees, one per variable.
    pub(crate) fn committed(&self) -> &[u64] {
        self.data.committed()
    }

    /// Per client, true if it has not answered yet.
    pub(crate) fn owes(&self) -> Vec<bool> {
        self.members.iter().map(|member| member.owes).collect()
    }

    /// The clients that have not answered yet.
    pub(crate) fn owing(&self) -> impl Iterator<Item = usize> {
        let members = self.members.iter().enumerate();
        members.filter_map(|(at, member)| member.owes.then_some(at))
    }

    /// True if a client has not answered yet.
    pub(crate) fn is_owing(&self, client: usize) -> bool {
        self.members[client].owes
    }

    /// The clients that are due in this step.
    pub(crate) fn due(&self) -> impl Iterator<Item = usize> {
        let members = self.members.iter().enumerate();
        members.filter_map(|(at, member)| member.is_due.then_some(at))
    }

    /// True if all clients have answered.
    pub(crate) const fn is_synchronised(&self) -> bool {
        self.owing == 0
    }

    /// A client has finished its run of the step `sequence`, and wants to run again in the step `next`, or as declared
    /// if that is 0; the error describes a violation of the protocol.
    pub(crate) fn done(
        &mut self,
        client: usize,
        (sequence, next): (u64, u64),
        values: impl ExactSizeIterator<Item = u64>,
    ) -> Result<(), String> {
        let member = &mut self.members[client];
        let now = self.step.sequence;
        if sequence != now {
            return Err(format!("answered step {sequence} in step {now}"));
        }
        if !member.owes {
            return Err(if member.is_due {
                format!("answered step {sequence} twice")
            } else {
                format!("answered step {sequence}, in which it was not due")
            });
        }
        if values.len() != member.writes.len() {
            return Err(format!(
                "wrote {} values in step {sequence}, expected {}, one for each variable that it declared",
                values.len(),
                member.writes.len()
            ));
        }
        let staged = self.data.stage(member.writes.clone(), values);
        staged.map_err(|why| format!("wrote a wrong value in step {sequence}: {why}"))?;
        if next != 0 {
            member.next_update = next.max(now + 1);
        }
        member.owes = false;
        self.owing -= 1;
        Ok(())
    }

    /// Commits all writes, and determines the clients of the next step.
    pub(crate) fn commit(&mut self) -> Result<(), String> {
        debug_assert!(self.is_synchronised(), "a client still runs");
        self.data.begin_commit();
        for (at, hook) in &self.change_calls {
            if self.data.changes(*at) {
                let mut access = Access {
                    data: &mut self.data,
                    step: self.step,
                    reader: None,
                };
                (self.logic.change[*hook].1)(&mut access)?;
            }
        }
        self.data.end_commit();
        self.trace.commit(self.step, self.data.committed());
        self.choose_due();
        Ok(())
    }

    /// Determines the clients of the next step.
    fn choose_due(&mut self) {
        self.state = State::PreRead;
        let next = self.step.sequence + 1;
        self.next_due = u64::MAX;
        for member in &mut self.members {
            member.is_due = member.next_update <= next;
            self.next_due = self.next_due.min(member.next_update);
        }
    }

    /// The step in which a client runs next, between two steps.
    pub(crate) fn next_update(&self, client: usize) -> u64 {
        self.members[client].next_update
    }

    /// Continues a saved run of the same clients: makes all its commits, and shows them to those who read each of them.
    pub(crate) fn restore(&mut self, saved: &SavedRun) -> Result<(), String> {
        if let Some(memory) = &saved.memory {
            self.make_all(memory, saved.step)?;
        } else {
            self.data.replace(&saved.values);
            self.step = step_of(saved.step, self.length);
            self.trace = saved.trace.clone();
            self.show_commit()?;
        }
        if self.trace.hash() != saved.hash() {
            return Err(format!(
                "the saved run has the trace hash {}, and its values have {}; it was not saved by this tickbus",
                saved.hash(),
                self.trace.hash()
            ));
        }
        self.owing = 0;
        for (member, client) in self.members.iter_mut().zip(&saved.clients) {
            member.owes = false;
            member.next_update = client.next;
        }
        self.choose_due();
        Ok(())
    }

    /// Makes all commits of a memory, up to the step `last`.
    fn make_all(&mut self, memory: &Memory, last: u64) -> Result<(), String> {
        let mut place = memory.start();
        for sequence in 0..=last {
            if memory.number(&place) == Some(sequence) {
                memory.pass(&mut place);
                self.data.replace(place.values());
            }
            self.step = step_of(sequence, self.length);
            self.trace.commit(self.step, self.data.committed());
            self.show_commit()?;
        }
        Ok(())
    }

    /// Shows the last commit to those who read each of them.
    pub(crate) fn show_commit(&mut self) -> Result<(), String> {
        let commit = Commit {
            step: self.step,
            length: self.length,
            members: &self.shown,
            values: self.data.committed(),
            trace: &self.trace,
        };
        (self.logic.commit.iter_mut()).try_for_each(|hook| hook(&commit))
    }

    /// Begins the next step, up to the runs of the clients that are due.
    pub(crate) fn begin_step(&mut self) -> Result<(), String> {
        debug_assert_eq!(self.state, State::PreRead, "a step begins between two");
        self.state = State::Read;
        for member in &mut self.members {
            if member.is_due {
                self.data.read(&member.reads, &mut member.snapshot);
            }
        }
        let step = Step {
            sequence: self.step.sequence + 1,
            time: self.step.time + self.length,
        };
        for (client, hook) in &self.read_calls {
            let member = &self.members[*client];
            if member.is_due {
                let mut access = Access {
                    data: &mut self.data,
                    step: self.step,
                    reader: Some(&member.declaration.name),
                };
                (self.logic.read[*hook].1)(&mut access)?;
            }
        }
        self.step = step;
        self.state = State::PreWrite;
        call_all(self.logic.time.iter_mut(), &mut self.data, step)?;
        self.owing = 0;
        for member in &mut self.members {
            member.owes = member.is_due;
            if member.is_due {
                self.owing += 1;
                member.next_update = member.declaration.next_after(step, self.length);
            }
        }
        self.state = State::Write;
        Ok(())
    }
}

fn call_all<'h, 'l: 'h>(
    hooks: impl Iterator<Item = &'h mut Hook<'l>>,
    data: &mut SharedData,
    step: Step,
) -> Result<(), String> {
    let mut access = Access {
        data,
        step,
        reader: None,
    };
    for hook in hooks {
        hook(&mut access)?;
    }
    Ok(())
}
