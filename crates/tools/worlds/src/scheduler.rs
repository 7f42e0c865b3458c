//! Threads of a simulated world, as coroutines on one thread. Only the seed decides which of them runs next, and when
//! time passes.
//!
//! A thread runs until it waits. In a world with [`Habits::preempts`] a thread may also lose the processor where it
//! reads the clock. Other threads then run, and time passes, between what it has read and what it does with it.
#![allow(
    unsafe_code,
    reason = "a coroutine gives its thread a reference that the clock, which knows no coroutines, has to find again"
)]

use std::cell::RefCell;
use std::hint::black_box;
use std::sync::Once;

use corosensei::stack::DefaultStack;
use corosensei::{Coroutine, CoroutineResult, Yielder};
use tickbus_base::time::{Interest, Nanos, Stop};

use crate::disk::Disk;
use crate::network::Network;
use crate::random::Random;

/// The size of a thread's stack, in bytes.
const STACK: usize = 512 * 1024;

/// The time at which a world begins, in ns.
pub(crate) const BEGIN: i64 = 1_000_000_000;

/// The number of times that threads are starved in a world.
pub(crate) const STARVED: u32 = 3;

/// The number of turns after which a world that does not end is ended.
const MOST_TURNS: u64 = 2_000_000;

/// The liberties that the scheduler takes with threads.
#[derive(Clone, Copy, Debug, Default)]
pub struct Habits {
    /// On average, a thread loses the processor at one look at the clock in this many; 0 for never.
    pub preempts: u64,
    /// The maximum time by which a woken thread may get the processor late, in ns.
    pub late: i64,
    /// The maximum time for which a thread that has lost the processor may be without it, in ns; three times in a
    /// world.
    pub starves: i64,
}

type Thread = Coroutine<(), (), (), DefaultStack>;

/// The event for which a thread waits.
enum Wait {
    /// Nothing but the processor.
    Nothing,
    /// A time, a token, or a socket.
    Event {
        deadline: i64,
        stop: Option<Stop>,
        sockets: Vec<(u64, Interest)>,
    },
    /// Any action of another thread, or a time.
    Anything { deadline: i64, seen: u64 },
}

struct Task {
    thread: Option<Thread>,
    yielder: *const Yielder<(), ()>,
    wait: Wait,
    /// The process to which the task belongs.
    process: usize,
    /// The time since which the task has run without a wait.
    awake_since: i64,
    /// The task does not run before this time.
    not_before: i64,
}

#[derive(Default)]
struct Process {
    /// The threads of the process do not run before this time.
    suspended_until: i64,
}

/// The simulation of this thread.
struct World {
    now: i64,
    random: Random,
    habits: Habits,
    tasks: Vec<Task>,
    /// The tasks that have not ended.
    alive: Vec<usize>,
    /// When each of the tasks in `alive` can run; kept for the next turn.
    dues: Vec<i64>,
    /// The places in `alive` of the tasks that can run; kept for the next turn.
    ready: Vec<usize>,
    processes: Vec<Process>,
    current: Option<usize>,
    /// The number of turns so far, in each of which a thread has run.
    turns: u64,
    network: Network,
    disk: Disk,
    /// The threads spawned since the last look.
    spawned: Vec<(usize, Box<dyn FnOnce()>)>,
    /// The number of times that a thread may still be starved.
    starvations: u32,
    /// True if the world is to end now.
    is_over: bool,
}

thread_local! {
    static WORLD: RefCell<Option<World>> = const { RefCell::new(None) };
    /// The stacks of threads that have ended.
    static STACKS: RefCell<Vec<DefaultStack>> = const { RefCell::new(Vec::new()) };
}

/// Runs [`keep_memory`] once in a process.
static KEEP_MEMORY: Once = Once::new();

/// Makes the system's allocator keep the memory that a world frees, for the next one. Once a piece of up to 32 MiB has
/// been allocated and freed, glibc neither requests that much from the system again nor returns it. This saves a tenth
/// of a world's time.
fn keep_memory() {
    drop(black_box(vec![1_u8; 24 << 20]));
}

fn with<R>(act: impl FnOnce(&mut World) -> R) -> R {
    WORLD.with(|world| {
        act(world
            .borrow_mut()
            .as_mut()
            .expect("a world runs on this thread"))
    })
}

/// The reason why a world does not end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Stuck {
    /// Every thread waits for another one.
    Deadlock,
    /// Threads run without end.
    Endless,
}

/// Runs `main` and all threads that it spawns in a new world on this thread, until none is left.
///
/// # Errors
///
/// The world does not end.
///
/// # Panics
///
/// A thread panicked, or a world is already running on this thread.
pub(crate) fn run(seed: u64, habits: Habits, main: impl FnOnce() + 'static) -> Result<(), Stuck> {
    KEEP_MEMORY.call_once(keep_memory);
    WORLD.with(|world| {
        let before = world.borrow_mut().replace(World {
            // Some time after the computer was switched on.
            now: BEGIN,
            random: Random::new(seed),
            habits,
            tasks: Vec::new(),
            alive: Vec::new(),
            dues: Vec::new(),
            ready: Vec::new(),
            processes: vec![Process::default()],
            current: None,
            turns: 0,
            network: Network::default(),
            disk: Disk::default(),
            spawned: vec![(0, Box::new(main))],
            starvations: STARVED,
            is_over: false,
        });
        assert!(before.is_none(), "one world at a time");
    });
    let end = Ending;
    let result = run_all();
    drop(end);
    result
}

/// Ends the world, whatever has happened.
struct Ending;

impl Drop for Ending {
    fn drop(&mut self) {
        let tasks = with(|world| std::mem::take(&mut world.tasks));
        for task in tasks {
            if let Some(mut thread) = task.thread
                && !thread.done()
            {
                with(|world| world.disk.abandon());
                // The contents of the stack are leaked: their drops would wait in a world that has ended.
                // SAFETY: nothing on the stack is reachable from elsewhere, except through reference counts that never
                // fall.
                unsafe { thread.force_reset() };
                STACKS.with(|stacks| stacks.borrow_mut().push(thread.into_stack()));
            }
        }
        WORLD.with(|world| world.borrow_mut().take());
    }
}

fn run_all() -> Result<(), Stuck> {
    loop {
        if with(|world| world.is_over) {
            return Ok(());
        }
        begin_spawned();
        let Some(next) = with(World::next)? else {
            return Ok(());
        };
        let mut thread = with(|world| {
            world.current = Some(next);
            world.turns += 1;
            world.tasks[next].thread.take().expect("it does not run")
        });
        let result = thread.resume(());
        with(|world| {
            world.current = None;
            world.now += world.random.within(0, 2_000);
        });
        match result {
            CoroutineResult::Yield(()) => with(|world| world.tasks[next].thread = Some(thread)),
            CoroutineResult::Return(()) => {
                with(|world| {
                    world.tasks[next].wait = Wait::Nothing;
                    world.alive.retain(|alive| *alive != next);
                });
                STACKS.with(|stacks| stacks.borrow_mut().push(thread.into_stack()));
            }
        }
    }
}

fn begin_spawned() {
    let spawned = with(|world| std::mem::take(&mut world.spawned));
    for (process, body) in spawned {
        let stack = STACKS.with(|stacks| stacks.borrow_mut().pop());
        let stack = stack.unwrap_or_else(|| DefaultStack::new(STACK).expect("memory"));
        let index = with(|world| world.tasks.len());
        let thread = Coroutine::with_stack(stack, move |yielder: &Yielder<(), ()>, ()| {
            with(|world| world.tasks[index].yielder = std::ptr::from_ref(yielder));
            body();
        });
        with(|world| {
            let now = world.now;
            world.alive.push(index);
            world.tasks.push(Task {
                thread: Some(thread),
                yielder: std::ptr::null(),
                wait: Wait::Nothing,
                process,
                awake_since: now,
                not_before: now,
            });
        });
    }
}

impl World {
    /// Now and then, makes the running thread wait longer for the processor.
    fn starve(&mut self) {
        let longest = self.habits.starves;
        if longest == 0 || self.starvations == 0 || !self.random.once_in(10) {
            return;
        }
        self.starvations -= 1;
        let current = self.current.expect("a thread of this world runs");
        self.tasks[current].not_before = self.now + self.random.within(0, longest);
    }

    /// The thread to run next; `None` if all have ended.
    fn next(&mut self) -> Result<Option<usize>, Stuck> {
        if self.turns > MOST_TURNS {
            return Err(Stuck::Endless);
        }
        if self.alive.is_empty() {
            return Ok(None);
        }
        // These times do not change until a thread runs, except for a thread that gets the processor late.
        self.dues.clear();
        for place in 0..self.alive.len() {
            let due = self.due(self.alive[place]);
            self.dues.push(due);
        }
        loop {
            self.ready.clear();
            let dues = self.dues.iter().enumerate();
            let ready = dues.filter(|(_, due)| **due <= self.now);
            self.ready.extend(ready.map(|(place, _)| place));
            if self.ready.is_empty() {
                let soonest = self.dues.iter().min().copied();
                self.now = soonest
                    .filter(|soonest| *soonest < i64::MAX)
                    .ok_or(Stuck::Deadlock)?;
                continue;
            }
            let place = self.random.of(&self.ready);
            let chosen = self.alive[place];
            let task = &mut self.tasks[chosen];
            if !matches!(task.wait, Wait::Nothing) {
                task.wait = Wait::Nothing;
                let late = self.habits.late;
                if late > 0 && self.random.once_in(4) {
                    task.not_before = self.now + self.random.within(0, late);
                    if task.not_before > self.now {
                        self.dues[place] = task.not_before;
                        continue;
                    }
                }
                task.awake_since = self.now;
            }
            return Ok(Some(chosen));
        }
    }

    /// When a thread can run, if no other thread does so before.
    fn due(&mut self, index: usize) -> i64 {
        let task = &mut self.tasks[index];
        // A wake counts once, so it must not be queried again.
        if let Wait::Event {
            stop: Some(stop), ..
        } = &task.wait
            && stop.is_woken()
        {
            (task.wait, task.awake_since) = (Wait::Nothing, self.now);
        }
        let due = match &task.wait {
            Wait::Nothing => i64::MIN,
            Wait::Event {
                deadline, sockets, ..
            } => self.network.due(sockets).min(*deadline),
            Wait::Anything { seen, .. } if self.turns > seen + 1 => i64::MIN,
            Wait::Anything { deadline, .. } => *deadline,
        };
        let suspended = self.processes[task.process].suspended_until;
        due.max(suspended).max(task.not_before)
    }
}

/// Makes the running thread wait.
fn suspend(wait: Wait) {
    let yielder = with(|world| {
        let current = world.current.expect("a thread of this world runs");
        world.tasks[current].wait = wait;
        world.tasks[current].yielder
    });
    // SAFETY: this is the yielder of the running thread, whose coroutine lives until it has returned.
    unsafe { (*yielder).suspend(()) };
    with(|world| {
        let current = world.current.expect("it was resumed");
        let now = world.now;
        if world.tasks[current].not_before > 0 && world.tasks[current].awake_since < now {
            // The thread was woken late, or waited only for the processor.
            world.tasks[current].not_before = 0;
        }
    });
}

/// The time in this world.
pub(crate) fn now() -> Nanos {
    with(|world| Nanos(world.now))
}

/// Ends the world, whatever its threads do.
pub(crate) fn stop() {
    with(|world| world.is_over = true);
}

/// Makes the running thread sleep.
pub(crate) fn sleep(span: Nanos) {
    let deadline = with(|world| world.now + span.0.max(0));
    suspend(Wait::Event {
        deadline,
        stop: None,
        sockets: Vec::new(),
    });
}

/// Makes the running thread sleep until `done`.
pub(crate) fn sleep_until(done: impl Fn() -> bool) {
    while !done() {
        let seen = with(|world| world.turns);
        let deadline = with(|world| world.now + 1_000_000);
        suspend(Wait::Anything { deadline, seen });
    }
}

/// Starts a thread of a process.
pub(crate) fn spawn(process: usize, body: impl FnOnce() + 'static) {
    with(|world| world.spawned.push((process, Box::new(body))));
}

/// A new process.
pub(crate) fn new_process() -> usize {
    with(|world| {
        world.processes.push(Process::default());
        world.processes.len() - 1
    })
}

/// Stops all threads of a process for a time.
pub(crate) fn suspend_process(process: usize, span: Nanos) {
    with(|world| {
        let until = world.now + span.0;
        let process = &mut world.processes[process];
        process.suspended_until = process.suspended_until.max(until);
    });
}

/// The time until which a process is suspended, or was the last time.
pub(crate) fn suspended_until(process: usize) -> Nanos {
    with(|world| Nanos(world.processes[process].suspended_until))
}

/// Calls `act` with the network.
pub(crate) fn network<R>(act: impl FnOnce(&mut Network, &mut Random, i64) -> R) -> R {
    with(|world| act(&mut world.network, &mut world.random, world.now))
}

/// Calls `act` with the disk.
pub(crate) fn disk<R>(act: impl FnOnce(&mut Disk, i64) -> R) -> R {
    with(|world| act(&mut world.disk, world.now))
}

/// The time in this world, as the running thread reads it. The thread may lose the processor right after that.
pub(crate) fn look() -> Nanos {
    let (now, is_preempted) = with(|world| {
        let preempts = world.habits.preempts;
        let is_preempted =
            preempts > 0 && world.current.is_some() && world.random.once_in(preempts);
        if is_preempted {
            world.starve();
        }
        (world.now, is_preempted)
    });
    if is_preempted {
        suspend(Wait::Nothing);
    }
    Nanos(now)
}

/// Makes the running thread wait until `deadline`, until `stop` is stopped or woken, or until one of these sockets is
/// ready.
pub(crate) fn wait(deadline: Nanos, stop: &Stop, sockets: Vec<(u64, Interest)>) {
    suspend(Wait::Event {
        deadline: deadline.0,
        stop: Some(stop.clone()),
        sockets,
    });
}

/// Lets other threads run until `done` holds, or for `limit`; returns true if it held in time.
pub(crate) fn wait_for(limit: Nanos, done: &mut dyn FnMut() -> bool) -> bool {
    let deadline = with(|world| world.now.saturating_add(limit.0));
    loop {
        if done() {
            return true;
        }
        let (now, seen) = with(|world| (world.now, world.turns));
        if now >= deadline {
            return false;
        }
        suspend(Wait::Anything { deadline, seen });
    }
}

/// The process of the running thread.
pub(crate) fn process() -> usize {
    with(|world| {
        world
            .current
            .map_or(0, |current| world.tasks[current].process)
    })
}

/// The time, and the time since which the running thread has run without a wait.
pub(crate) fn awake_since() -> (i64, i64) {
    with(|world| {
        let current = world
            .current
            .map(|current| world.tasks[current].awake_since);
        (world.now, current.unwrap_or(world.now))
    })
}
