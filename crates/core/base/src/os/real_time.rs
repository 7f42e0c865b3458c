//! The real-time class, the processor and the locked memory of the calling thread.

#![allow(unsafe_code, reason = "the class of a thread has no safe wrapper")]

use std::io;

/// The calls of the operating system, each for the calling thread.
pub(crate) trait RealTimeSystem {
    /// Gives the thread this priority in the real-time class.
    ///
    /// # Errors
    ///
    /// The process may not do that, or the system has no such class.
    fn set_priority(&self, priority: u8) -> io::Result<()>;

    /// Lets the thread run on this processor only.
    ///
    /// # Errors
    ///
    /// There is no such processor, or the process may not use it.
    fn set_cpu(&self, cpu: u16) -> io::Result<()>;

    /// Keeps the memory of the process in the computer's memory, now and later.
    ///
    /// # Errors
    ///
    /// The process may not do that, or the system cannot.
    fn lock_memory(&self) -> io::Result<()>;
}

/// The operating system.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Os;

#[cfg(any(target_os = "linux", target_os = "android"))]
impl RealTimeSystem for Os {
    /// `SCHED_FIFO`; threads and processes that this thread starts later have the usual class.
    fn set_priority(&self, priority: u8) -> io::Result<()> {
        // SAFETY: a `sched_param` consists of integers.
        let mut wanted: libc::sched_param = unsafe { std::mem::zeroed() };
        wanted.sched_priority = priority.into();
        let class = libc::SCHED_FIFO | libc::SCHED_RESET_ON_FORK;
        // The call of POSIX for threads: musl refuses `sched_setscheduler`.
        // SAFETY: the thread is this one, and the parameter is valid during the call.
        let error =
            unsafe { libc::pthread_setschedparam(libc::pthread_self(), class, &raw const wanted) };
        if error == 0 {
            Ok(())
        } else {
            Err(io::Error::from_raw_os_error(error))
        }
    }

    fn set_cpu(&self, cpu: u16) -> io::Result<()> {
        let mut set = rustix::thread::CpuSet::new();
        if usize::from(cpu) >= rustix::thread::CpuSet::MAX_CPU {
            return Err(io::ErrorKind::InvalidInput.into());
        }
        set.set(cpu.into());
        Ok(rustix::thread::sched_setaffinity(None, &set)?)
    }

    /// Also memory that the process gets later. So no limit may apply: with one, memory beyond it could not be had.
    fn lock_memory(&self) -> io::Result<()> {
        use rustix::mm::{MlockAllFlags, mlockall};
        use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
        use rustix::thread::{CapabilitySet, capabilities};
        let may_lock_all =
            capabilities(None).is_ok_and(|sets| sets.effective.contains(CapabilitySet::IPC_LOCK));
        if !may_lock_all && getrlimit(Resource::Memlock).current.is_some() {
            let unlimited = Rlimit {
                current: None,
                maximum: None,
            };
            setrlimit(Resource::Memlock, unlimited)?;
        }
        Ok(mlockall(MlockAllFlags::CURRENT | MlockAllFlags::FUTURE)?)
    }
}

#[cfg(windows)]
impl RealTimeSystem for Os {
    /// "Time critical" from 50 on, and below that "highest". The system has no further levels for a thread of a process
    /// with the usual class.
    fn set_priority(&self, priority: u8) -> io::Result<()> {
        use windows_sys::Win32::System::Threading::{
            GetCurrentThread, SetThreadPriority, THREAD_PRIORITY_HIGHEST,
            THREAD_PRIORITY_TIME_CRITICAL,
        };
        let level = if priority >= 50 {
            THREAD_PRIORITY_TIME_CRITICAL
        } else {
            THREAD_PRIORITY_HIGHEST
        };
        // SAFETY: the thread is this one.
        let done = unsafe { SetThreadPriority(GetCurrentThread(), level) };
        if done == 0 {
            return Err(io::Error::last_os_error());
        }
        Ok(())
    }

    fn set_cpu(&self, cpu: u16) -> io::Result<()> {
        use windows_sys::Win32::System::Threading::{GetCurrentThread, SetThreadAffinityMask};
        let mask = 1_usize.checked_shl(cpu.into()).unwrap_or(0);
        // SAFETY: the thread is this one.
        let before = unsafe { SetThreadAffinityMask(GetCurrentThread(), mask) };
        if before == 0 {
            return Err(io::Error::last_os_error());
        }
        Ok(())
    }

    fn lock_memory(&self) -> io::Result<()> {
        Err(io::ErrorKind::Unsupported.into())
    }
}

#[cfg(not(any(target_os = "linux", target_os = "android", windows)))]
impl RealTimeSystem for Os {
    fn set_priority(&self, _: u8) -> io::Result<()> {
        Err(io::ErrorKind::Unsupported.into())
    }

    fn set_cpu(&self, _: u16) -> io::Result<()> {
        Err(io::ErrorKind::Unsupported.into())
    }

    fn lock_memory(&self) -> io::Result<()> {
        Err(io::ErrorKind::Unsupported.into())
    }
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    /// `SCHED_FIFO`.
    const FIFO: u32 = 1;

    /// The priority and the class of this thread, which the C library does not ask the system for: proc(5), `stat`.
    fn own_class() -> (u32, u32) {
        let stat = std::fs::read_to_string("/proc/thread-self/stat").expect("Linux has it");
        let (_, fields) = stat.rsplit_once(") ").expect("the name of the thread");
        let mut fields = fields.split_whitespace().skip(37);
        let mut number = || fields.next()?.parse().ok();
        (number().expect("a priority"), number().expect("a class"))
    }

    #[test]
    fn the_thread_has_the_class_and_its_own_threads_have_the_usual_one() {
        match Os.set_priority(3) {
            Ok(()) => {
                assert_eq!(own_class(), (3, FIFO));
                let of_child = std::thread::spawn(own_class).join();
                assert_eq!(of_child.expect("a class"), (0, 0));
            }
            // A computer that does not allow it.
            Err(error) => {
                assert_eq!(error.kind(), io::ErrorKind::PermissionDenied);
                assert_eq!(own_class(), (0, 0));
            }
        }
    }

    #[test]
    fn the_thread_runs_on_the_processor_and_on_no_other() {
        let may = rustix::thread::sched_getaffinity(None).expect("a set");
        let cpu = (0..u16::MAX).find(|cpu| may.is_set(usize::from(*cpu)));
        Os.set_cpu(cpu.expect("a processor"))
            .expect("it may run there");
        let may = rustix::thread::sched_getaffinity(None).expect("a set");
        assert_eq!(may.count(), 1);
        let missing = Os.set_cpu(u16::MAX).expect_err("no such processor");
        assert_eq!(missing.kind(), io::ErrorKind::InvalidInput);
    }
}
