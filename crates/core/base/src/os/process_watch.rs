//! Checks if another process is still alive.

use rustix::process::{Pid, test_kill_process};

/// Watches another process of this computer. On Linux, a later process with the same number is not mistaken for it.
#[derive(Debug)]
pub struct ProcessWatch {
    pid: Pid,
    #[cfg(target_os = "linux")]
    file: Option<rustix::fd::OwnedFd>,
}

impl ProcessWatch {
    /// Watches the process with this id; `None` if no such process exists.
    pub fn of(pid: u32) -> Option<Self> {
        let pid = Pid::from_raw(i32::try_from(pid).ok()?)?;
        let watch = Self {
            pid,
            // Kernels before 5.3 have no such files.
            #[cfg(target_os = "linux")]
            file: rustix::process::pidfd_open(pid, rustix::process::PidfdFlags::empty()).ok(),
        };
        (!watch.has_ended()).then_some(watch)
    }

    /// True if the process has ended, even if nobody has fetched its exit code yet.
    pub fn has_ended(&self) -> bool {
        #[cfg(target_os = "linux")]
        if let Some(file) = &self.file {
            use rustix::event::{PollFd, PollFlags};

            let mut ended = [PollFd::new(file, PollFlags::IN)];
            let asked = super::poll::poll_once(&mut ended, Some(std::time::Duration::ZERO));
            return asked.is_ok() && ended[0].revents().contains(PollFlags::IN);
        }
        // A process of another user exists, too, although it may not be signalled.
        test_kill_process(self.pid) == Err(rustix::io::Errno::SRCH)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::process::{Command, Stdio};

    #[test]
    fn a_process_is_there_until_it_ends() {
        let own = ProcessWatch::of(std::process::id()).expect("this one");
        assert!(!own.has_ended());
        let mut child = Command::new("cat")
            .stdin(Stdio::piped())
            .spawn()
            .expect("it starts");
        let watch = ProcessWatch::of(child.id()).expect("it runs");
        assert!(!watch.has_ended());
        drop(child.stdin.take());
        let pid = child.id();
        child.wait().expect("it ends");
        assert!(watch.has_ended());
        assert!(ProcessWatch::of(pid).is_none());
    }
}
