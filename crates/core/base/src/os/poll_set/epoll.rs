//! Waiting by epoll: Linux reports the ready sockets without checking each of them.

#![allow(
    unsafe_code,
    reason = "rustix calls either `epoll_pwait2` or `epoll_pwait`, decided when it is compiled"
)]

use std::os::fd::AsRawFd as _;
use std::ptr::{null, null_mut};

use rustix::buffer::spare_capacity;
use rustix::event::epoll::{self, CreateFlags, Event, EventData, EventFlags};
use rustix::event::{PollFd, PollFlags, Timespec};
use rustix::fd::OwnedFd;
use rustix::io::Errno;
use rustix::time::{
    Itimerspec, TimerfdClockId, TimerfdFlags, TimerfdTimerFlags, timerfd_create, timerfd_settime,
};

use super::{AsFd, Duration, Interest, Ready, io};
use crate::os::poll::{poll_once, timespec};
use crate::time::{Clock, Nanos};

/// Sockets reported by one wait; further ones are reported by the next.
const MOST: usize = 256;

/// The old call need not be exact from this span on, since it ends early.
const LONG: Duration = Duration::from_millis(4);

/// The margin: more than the old call rounds up.
const EARLY: Duration = Duration::from_millis(2);

pub(super) struct Watch {
    epoll: OwnedFd,
    events: Vec<Event>,
    /// True until the system has refused the call that waits to the nanosecond: Linux has it since 5.11, and the filter
    /// of an old container runtime may forbid it.
    is_exact: bool,
    /// For deadlines that are far; made when it is needed.
    timer: Option<Timer>,
}

/// A timer of the system, in the set that it wakes.
struct Timer {
    system: OwnedFd,
    /// When it ends a wait; `None` once it has.
    armed: Option<Nanos>,
}

/// The key of the timer.
const TIMER: u64 = u64::MAX - 2;

const fn flags(interest: Interest) -> EventFlags {
    match interest {
        Interest::Read => EventFlags::IN,
        Interest::Write => EventFlags::OUT,
        Interest::ReadWrite => EventFlags::IN.union(EventFlags::OUT),
    }
}

const fn data(key: usize) -> EventData {
    EventData::new_u64(key as u64)
}

impl Watch {
    pub(super) fn new() -> io::Result<Self> {
        Ok(Self {
            epoll: epoll::create(CreateFlags::CLOEXEC)?,
            events: Vec::with_capacity(MOST),
            // On 32 bits the two sides may differ about the size of a time.
            is_exact: cfg!(target_pointer_width = "64"),
            timer: None,
        })
    }

    pub(super) fn add(
        &mut self,
        key: usize,
        socket: &impl AsFd,
        interest: Interest,
    ) -> io::Result<()> {
        Ok(epoll::add(&self.epoll, socket, data(key), flags(interest))?)
    }

    pub(super) fn change(
        &mut self,
        key: usize,
        socket: &impl AsFd,
        interest: Interest,
    ) -> io::Result<()> {
        Ok(epoll::modify(
            &self.epoll,
            socket,
            data(key),
            flags(interest),
        )?)
    }

    pub(super) fn remove(&mut self, _key: usize, socket: &impl AsFd) {
        // This fails only for a socket that was never added.
        let _ = epoll::delete(&self.epoll, socket);
    }

    /// As [`wait`](Self::wait), until a `deadline` on `clock` that is far at `now`. Such a deadline mostly moves on before
    /// it comes, so a timer that ends earlier stays set, and its end also ends this wait.
    pub(super) fn wait_far(
        &mut self,
        (clock, now): (&dyn Clock, Nanos),
        deadline: Nanos,
        ready: &mut Vec<Ready>,
    ) -> io::Result<()> {
        let armed = self.timer.as_ref().and_then(|timer| timer.armed);
        if deadline == Nanos::MAX || armed.is_some_and(|armed| now < armed && armed <= deadline) {
            return self.wait(None, ready);
        }
        // The time may have passed since.
        let span = (deadline - clock.now()).max(Nanos(1)).to_duration();
        match self.arm(span) {
            Ok(timer) => {
                timer.armed = Some(deadline);
                self.wait(None, ready)
            }
            // No descriptor is left.
            Err(_) => self.wait(Some(span), ready),
        }
    }

    /// Sets the timer, whether it is armed or not.
    fn arm(&mut self, span: Duration) -> Result<&mut Timer, Errno> {
        let timer = match &mut self.timer {
            Some(timer) => timer,
            none => {
                let flags = TimerfdFlags::CLOEXEC | TimerfdFlags::NONBLOCK;
                let system = timerfd_create(TimerfdClockId::Monotonic, flags)?;
                // Nobody reads it: its end is an edge.
                let interest = EventFlags::IN | EventFlags::ET;
                epoll::add(&self.epoll, &system, EventData::new_u64(TIMER), interest)?;
                none.insert(Timer {
                    system,
                    armed: None,
                })
            }
        };
        let spans = Itimerspec {
            it_interval: timespec(Duration::ZERO),
            it_value: timespec(span),
        };
        timerfd_settime(&timer.system, TimerfdTimerFlags::empty(), &spans)?;
        Ok(timer)
    }

    pub(super) fn wait(
        &mut self,
        patience: Option<Duration>,
        ready: &mut Vec<Ready>,
    ) -> io::Result<()> {
        self.events.clear();
        if self.is_exact {
            match self.wait_exactly(patience.map(timespec)) {
                Err(Errno::NOSYS | Errno::PERM) => self.is_exact = false,
                // A signal interrupted the wait, such as that which lets a suspended process go on: what has arrived
                // meanwhile belongs to this wait.
                Err(Errno::INTR) => match self.wait_exactly(Some(timespec(Duration::ZERO))) {
                    Err(Errno::INTR) => {}
                    waited => waited?,
                },
                waited => waited?,
            }
        }
        if !self.is_exact {
            self.wait_long_or_twice(patience)?;
        }
        let broken = EventFlags::HUP | EventFlags::ERR;
        for event in &self.events {
            // Fields of a packed struct have to be copied out before they are borrowed.
            let (flags, data) = (event.flags, event.data);
            if data.u64() == TIMER {
                self.timer.iter_mut().for_each(|timer| timer.armed = None);
                continue;
            }
            ready.push(Ready {
                key: usize::try_from(data.u64()).unwrap_or(super::WAKE),
                is_readable: flags.intersects(EventFlags::IN | broken),
                is_writable: flags.intersects(EventFlags::OUT | broken),
            });
        }
        Ok(())
    }

    /// Waits by `epoll_pwait2`, which counts nanoseconds.
    fn wait_exactly(&mut self, patience: Option<Timespec>) -> Result<(), Errno> {
        let room = self.events.spare_capacity_mut();
        let patience: *const Timespec = patience.as_ref().map_or(null(), |patience| patience);
        // SAFETY: the kernel writes at most `room.len()` events into `room`, and reads a time or nothing at `patience`;
        // both outlive the call. `Event` and, on 64 bits, `Timespec` have the layouts of the kernel. Without a mask of
        // signals its size does not count.
        let count = unsafe {
            libc::syscall(
                libc::SYS_epoll_pwait2,
                self.epoll.as_raw_fd(),
                room.as_mut_ptr(),
                room.len(),
                patience,
                null_mut::<libc::sigset_t>(),
                0_usize,
            )
        };
        let Ok(count) = usize::try_from(count) else {
            return Err(Errno::from_io_error(&io::Error::last_os_error()).unwrap_or(Errno::INVAL));
        };
        // SAFETY: the kernel has written this number of events, and the list was empty.
        unsafe { self.events.set_len(count) };
        Ok(())
    }

    /// Waits by `epoll_pwait`, which counts whole milliseconds: a long wait ends a little early, and before a short one
    /// `ppoll` waits for epoll itself.
    fn wait_long_or_twice(&mut self, patience: Option<Duration>) -> io::Result<()> {
        let patience = match patience {
            Some(span) if span >= LONG => Some(span.saturating_sub(EARLY)),
            Some(span) => {
                if !span.is_zero() {
                    let mut epoll = [PollFd::new(&self.epoll, PollFlags::IN)];
                    poll_once(&mut epoll, Some(span))?;
                }
                Some(Duration::ZERO)
            }
            None => None,
        };
        let patience = patience.map(timespec);
        let room = spare_capacity(&mut self.events);
        let mut waited = epoll::wait(&self.epoll, room, patience.as_ref());
        if waited == Err(Errno::INTR) {
            let room = spare_capacity(&mut self.events);
            waited = epoll::wait(&self.epoll, room, Some(&timespec(Duration::ZERO)));
        }
        match waited {
            Ok(_) | Err(Errno::INTR) => Ok(()),
            Err(error) => Err(error.into()),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::os::unix::net::UnixDatagram;
    use std::os::unix::thread::JoinHandleExt as _;
    use std::sync::atomic::{AtomicI32, Ordering};
    use std::sync::mpsc::channel;
    use std::thread;
    use std::{fs, ptr};

    use super::*;
    use crate::time::Monotonic;

    const KEY: usize = 7;

    /// Waits for two sockets without and with a message, and for deadlines.
    fn waits_well(watch: &mut Watch) {
        let (near, far) = UnixDatagram::pair().expect("a pair");
        watch.add(KEY, &near, Interest::Read).expect("it is open");
        let (clock, mut ready) = (Monotonic::shared(), Vec::new());
        for span in [0, 300, 1_500, 3_000, 5_000, 110_000].map(Nanos::from_micros) {
            let deadline = clock.now() + span;
            let mut waits = 0;
            loop {
                let left = (deadline - clock.now()).to_duration();
                watch.wait(Some(left), &mut ready).expect("it waits");
                waits += 1;
                if left.is_zero() {
                    break;
                }
            }
            assert!(ready.is_empty(), "nothing was sent");
            // Ahead of a deadline, a wait may end early, but not again and again.
            assert!(waits < 10, "{waits} waits of {span}");
        }
        far.send(&[1]).expect("there is room");
        for patience in [
            None,
            Some(Duration::from_secs(9)),
            Some(Duration::from_millis(1)),
        ] {
            ready.clear();
            watch.wait(patience, &mut ready).expect("it waits");
            assert_eq!(
                ready.iter().map(|ready| ready.key).collect::<Vec<_>>(),
                [KEY]
            );
        }
        watch.remove(KEY, &near);
    }

    #[test]
    fn both_calls_wait_until_a_deadline_or_a_message() {
        let mut watch = Watch::new().expect("a descriptor");
        waits_well(&mut watch);
        watch.is_exact = false;
        waits_well(&mut watch);
    }

    /// Lets this thread's `epoll_pwait2` fail with this error, as an old kernel or a container's filter does. Returns false
    /// where the system has no filters.
    fn forbid(error: i32) -> bool {
        let number = u32::try_from(libc::SYS_epoll_pwait2).expect("a number");
        let error = libc::SECCOMP_RET_ERRNO | u32::try_from(error).expect("a number");
        let statement = |code: u32, jf, k| libc::sock_filter {
            code: u16::try_from(code).expect("a code"),
            jt: 0,
            jf,
            k,
        };
        let mut steps = [
            // The number of the call is the first word.
            statement(libc::BPF_LD | libc::BPF_W | libc::BPF_ABS, 0, 0),
            statement(libc::BPF_JMP | libc::BPF_JEQ | libc::BPF_K, 1, number),
            statement(libc::BPF_RET | libc::BPF_K, 0, error),
            statement(libc::BPF_RET | libc::BPF_K, 0, libc::SECCOMP_RET_ALLOW),
        ];
        let program = libc::sock_fprog {
            len: 4,
            filter: steps.as_mut_ptr(),
        };
        // SAFETY: the kernel copies the program, which is complete, before it returns.
        unsafe {
            libc::prctl(libc::PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0
                && libc::prctl(
                    libc::PR_SET_SECCOMP,
                    libc::SECCOMP_MODE_FILTER,
                    &raw const program,
                ) == 0
        }
    }

    #[test]
    fn the_timer_is_armed_again_for_an_earlier_deadline_only() {
        let clock = Monotonic::shared();
        let mut watch = Watch::new().expect("a descriptor");
        let mut ready = Vec::new();
        let armed = |watch: &Watch| watch.timer.as_ref().and_then(|timer| timer.armed);
        let (near, far) = UnixDatagram::pair().expect("a pair");
        watch.add(KEY, &near, Interest::Read).expect("it is open");
        far.send(&[1]).expect("there is room");
        let begin = clock.now();
        let mut wait = |watch: &mut Watch, deadline| {
            ready.clear();
            let now = clock.now();
            let waited = watch.wait_far((&*clock, now), deadline, &mut ready);
            waited.expect("it waits");
            ready.iter().map(|ready| ready.key).collect::<Vec<_>>()
        };
        let second = begin + Nanos::from_secs(1);
        assert_eq!(wait(&mut watch, Nanos::MAX), [KEY]);
        assert_eq!(armed(&watch), None, "never needs no timer");
        assert_eq!(wait(&mut watch, second), [KEY]);
        assert_eq!(wait(&mut watch, second + Nanos(1)), [KEY]);
        assert_eq!(armed(&watch), Some(second), "the deadline has moved on");
        let soon = begin + Nanos::from_millis(30);
        assert_eq!(wait(&mut watch, soon), [KEY]);
        assert_eq!(armed(&watch), Some(soon));
        watch.remove(KEY, &near);
        // The timer ends the wait for a later deadline, and each time that it is armed.
        assert!(wait(&mut watch, second).is_empty());
        assert!(clock.now() >= soon && armed(&watch).is_none());
        for _ in 0..2 {
            let soon = clock.now() + Nanos::from_millis(5);
            assert!(wait(&mut watch, soon).is_empty());
            assert!(clock.now() >= soon && clock.now() < second);
        }
        assert!(wait(&mut watch, begin).is_empty(), "a deadline of the past");
    }

    /// The socket that [`send_in_handler`] writes to.
    static SENDER: AtomicI32 = AtomicI32::new(-1);

    extern "C" fn send_in_handler(_: i32) {
        let sender = SENDER.load(Ordering::Relaxed);
        // SAFETY: one byte of a constant; handlers of signals may call `send`.
        unsafe { libc::send(sender, c"!".as_ptr().cast(), 1, libc::MSG_DONTWAIT) };
    }

    /// The system ends a wait by a signal before it runs the handler, so what the handler sends has come by the time that
    /// the wait returns, and is not among its events.
    #[test]
    fn a_wait_that_a_signal_interrupts_reports_what_has_come_meanwhile() {
        // SAFETY: all zeros is a valid action, and the handler stays as long as the program.
        unsafe {
            let mut action: libc::sigaction = std::mem::zeroed();
            action.sa_sigaction = send_in_handler as extern "C" fn(i32) as usize;
            assert_eq!(
                libc::sigaction(libc::SIGURG, &raw const action, ptr::null_mut()),
                0
            );
        }
        for (is_exact, patience) in [(true, None), (false, None), (false, Some(9))] {
            let (near, far) = UnixDatagram::pair().expect("a pair");
            SENDER.store(far.as_raw_fd(), Ordering::Relaxed);
            let (told, thread_number) = channel();
            let waiting = thread::spawn(move || {
                let mut watch = Watch::new().expect("a descriptor");
                watch.add(KEY, &near, Interest::Read).expect("it is open");
                watch.is_exact = is_exact;
                let mut ready = Vec::new();
                told.send(rustix::thread::gettid()).expect("it is awaited");
                let waited = watch.wait(patience.map(Duration::from_secs), &mut ready);
                waited.expect("it waits");
                ready.iter().map(|ready| ready.key).collect::<Vec<_>>()
            });
            let number = thread_number.recv().expect("it has started");
            let state = format!("/proc/self/task/{}/stat", number.as_raw_nonzero());
            while !fs::read_to_string(&state)
                .expect("it runs")
                .contains(") S ")
            {
                thread::yield_now();
            }
            // SAFETY: the thread is not joined yet.
            let sent = unsafe { libc::pthread_kill(waiting.as_pthread_t(), libc::SIGURG) };
            assert_eq!(sent, 0);
            assert_eq!(waiting.join().expect("no panic"), [KEY]);
        }
    }

    #[test]
    fn without_the_exact_call_the_old_one_waits() {
        for error in [libc::ENOSYS, libc::EPERM] {
            // The filter ends with its thread.
            let thread = thread::spawn(move || {
                if !forbid(error) {
                    return;
                }
                let mut watch = Watch::new().expect("a descriptor");
                waits_well(&mut watch);
                assert!(!watch.is_exact, "it was refused");
            });
            thread.join().expect("no panic");
        }
    }
}
