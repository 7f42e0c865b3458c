//! Threads of a simulated world, as coroutines on one thread: which of them runs next, and when time passes, only the seed
//! decides.
//!
//! A thread runs until it waits. In a world with [`Habits::preempts`] it may also lose the processor where it looks at the
//! clock, so that others run, and time passes, between what it has read and what it does with that.
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

/// How much of a stack a thread of a driver has.
const STACK: usize = 512 * 1024;

/// The time at which a world begins, in ns.
pub(crate) const BEGIN: i64 = 1_000_000_000;

/// So many times a thread is starved in a world.
pub(crate) const STARVED: u32 = 3;

/// A world in which nothing ends does so after that many turns.
const MOST_TURNS: u64 = 2_000_000;

/// What the scheduler may do to threads.
#[derive(Clone, Copy, Debug, Default)]
pub struct Habits {
    /// A thread that looks at the clock loses the processor once in so many looks; 0 for never.
    pub preempts: u64,
    /// A thread that is woken may get the processor late by up to this, in ns.
    pub late: i64,
    /// A thread that has lost the processor may be without it for up to this, in ns, three times in a world.
    pub starves: i64,
}

type Thread = Coroutine<(), (), (), DefaultStack>;

/// What a thread waits for.
enum Wait {
    /// The processor alone.
    Nothing,
    /// A time, a token, or a socket.
    Event {
        deadline: i64,
        stop: Option<Stop>,
        sockets: Vec<(u64, Interest)>,
    },
    /// Whatever another thread does, or a time.
    Anything { deadline: i64, seen: u64 },
}

struct Task {
    thread: Option<Thread>,
    yielder: *const Yielder<(), ()>,
    wait: Wait,
    /// The process that it belongs to.
    process: usize,
    /// Since when it runs without having waited.
    awake_since: i64,
    /// Not to be run before that.
    not_before: i64,
}

#[derive(Default)]
struct Process {
    /// Its threads do not run before that.
    suspended_until: i64,
}

/// All that is simulated on this thread.
struct World {
    now: i64,
    random: Random,
    habits: Habits,
    tasks: Vec<Task>,
    /// The tasks that have not ended.
    alive: Vec<usize>,
    /// When each of those can run; kept for the next turn.
    dues: Vec<i64>,
    /// The places of those that can run; kept for the next turn.
    ready: Vec<usize>,
    processes: Vec<Process>,
    current: Option<usize>,
    /// Threads run so far.
    turns: u64,
    network: Network,
    disk: Disk,
    /// What was spawned since the last look.
    spawned: Vec<(usize, Box<dyn FnOnce()>)>,
    /// How many times more a thread may be starved.
    starvations: u32,
    /// The world is to end now.
    is_over: bool,
}

thread_local! {
    static WORLD: RefCell<Option<World>> = const { RefCell::new(None) };
    /// Stacks of threads that have ended.
    static STACKS: RefCell<Vec<DefaultStack>> = const { RefCell::new(Vec::new()) };
}

/// Once in a process.
static KEEP_MEMORY: Once = Once::new();

/// Makes the system's allocator keep what a world frees for the next one: what was once allocated and freed in one piece, up to
/// 32 MiB, glibc neither asks the system for again nor gives back. A tenth of a world's time.
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

/// Why a world has come to no end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Stuck {
    /// Every thread waits for another one.
    Deadlock,
    /// Threads go on and on.
    Endless,
}

/// Runs `main` and all that it spawns, in a world of its own on this thread, until none is left.
///
/// # Errors
///
/// It comes to no end.
///
/// # Panics
///
/// A thread panicked, or a world runs on this thread already.
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
                // What it holds is leaked: its drops would wait in a world that has ended.
                // SAFETY: nothing on its stack is reachable from elsewhere but by reference counts that never fall.
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
    /// Lets the running thread wait for the processor for longer, now and then.
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
        // Nothing changes these times until a thread runs, but for a thread that gets the processor late.
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

    /// When a thread can run, if no other one does so before.
    fn due(&mut self, index: usize) -> i64 {
        let task = &mut self.tasks[index];
        // A wake counts once: it is not to be asked for again.
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

/// Lets the running thread wait.
fn suspend(wait: Wait) {
    let yielder = with(|world| {
        let current = world.current.expect("a thread of this world runs");
        world.tasks[current].wait = wait;
        world.tasks[current].yielder
    });
    // SAFETY: the thread that runs is the one whose yielder this is, and its coroutine lives until it has returned.
    unsafe { (*yielder).suspend(()) };
    with(|world| {
        let current = world.current.expect("it was resumed");
        let now = world.now;
        if world.tasks[current].not_before > 0 && world.tasks[current].awake_since < now {
            // It was woken late, or waited for nothing but the processor.
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

/// Lets the running thread sleep.
pub(crate) fn sleep(span: Nanos) {
    let deadline = with(|world| world.now + span.0.max(0));
    suspend(Wait::Event {
        deadline,
        stop: None,
        sockets: Vec::new(),
    });
}

/// Lets the running thread sleep until `done`.
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

/// Until when a process is suspended, or was the last time.
pub(crate) fn suspended_until(process: usize) -> Nanos {
    with(|world| Nanos(world.processes[process].suspended_until))
}

/// Acts on the network.
pub(crate) fn network<R>(act: impl FnOnce(&mut Network, &mut Random, i64) -> R) -> R {
    with(|world| act(&mut world.network, &mut world.random, world.now))
}

/// Acts on the disk.
pub(crate) fn disk<R>(act: impl FnOnce(&mut Disk, i64) -> R) -> R {
    with(|world| act(&mut world.disk, world.now))
}

/// The time in this world, as the running thread reads it: it may lose the processor right after that.
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

/// Lets the running thread wait until `deadline`, until `stop` is stopped or woken, or until one of these sockets is ready.
pub(crate) fn wait(deadline: Nanos, stop: &Stop, sockets: Vec<(u64, Interest)>) {
    suspend(Wait::Event {
        deadline: deadline.0,
        stop: Some(stop.clone()),
        sockets,
    });
}

/// Lets others run until `done` holds, or for `limit`; returns whether it held in time.
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

/// The time, and since when the running thread has not waited.
pub(crate) fn awake_since() -> (i64, i64) {
    with(|world| {
        let current = world
            .current
            .map(|current| world.tasks[current].awake_since);
        (world.now, current.unwrap_or(world.now))
    })
}
