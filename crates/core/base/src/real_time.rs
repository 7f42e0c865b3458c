//! Real time for a thread: what it asks of the operating system, and what a refusal means.

use std::env::consts::OS;
use std::fmt;
use std::io;
use std::path::Path;

use crate::os::{Os, RealTimeSystem};

/// The settings of a thread that must wake on time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RealTime {
    /// The priority in the real-time class, 1 to 99; `None` for the usual class.
    pub priority: Option<u8>,
    /// The number of the only processor that runs the thread.
    pub cpu: Option<u16>,
    /// True if all memory of the process must stay in the computer's memory.
    pub lock_memory: bool,
    /// True if a driver must not open without these settings.
    pub required: bool,
}

impl RealTime {
    /// Applies the settings to the calling thread. Returns one text for each that the system refused, with the command
    /// that allows it; the others are in effect.
    pub fn apply(self) -> Vec<String> {
        self.apply_with(&Os)
    }

    /// As [`apply`](Self::apply), with other calls.
    fn apply_with(self, system: &dyn RealTimeSystem) -> Vec<String> {
        let mut refused = Vec::new();
        // Locking takes the longest, and needs no priority yet.
        if self.lock_memory
            && let Err(error) = system.lock_memory()
        {
            refused.push(refusal("lock_memory", &error, &self.memory_right()));
        }
        if let Some(cpu) = self.cpu
            && let Err(error) = system.set_cpu(cpu)
        {
            refused.push(refusal(&format!("cpu = {cpu}"), &error, CPU_RIGHT));
        }
        if let Some(priority) = self.priority
            && let Err(error) = system.set_priority(priority)
        {
            let right = self.priority_right(priority);
            refused.push(refusal(&format!("priority = {priority}"), &error, &right));
        }
        refused
    }

    fn priority_right(self, priority: u8) -> String {
        let command = self.setcap(std::env::current_exe().ok().as_deref());
        format!(
            "{command}for a user: echo \"$USER - rtprio {priority}\" | sudo tee /etc/security/limits.d/tickbus.conf, then \
             log in again; for a service: LimitRTPRIO={priority}; for a container: --ulimit rtprio={priority}"
        )
    }

    fn memory_right(self) -> String {
        let command = self.setcap(std::env::current_exe().ok().as_deref());
        format!(
            "{command}for a user: echo \"$USER - memlock unlimited\" | sudo tee \
             /etc/security/limits.d/tickbus-memory.conf, then log in again; for a service: LimitMEMLOCK=infinity; for a \
             container: --ulimit memlock=-1"
        )
    }

    /// How `program` gets all rights for these settings. Empty for all but our command: Java does not start if its file
    /// has rights.
    fn setcap(self, program: Option<&Path>) -> String {
        let ours = program.filter(|file| file.file_stem().is_some_and(|name| name == "tickbus"));
        let memory = if self.lock_memory {
            ",cap_ipc_lock"
        } else {
            ""
        };
        ours.map_or_else(String::new, |file| {
            let file = file.display();
            format!("for the command: sudo setcap cap_sys_nice{memory}=ep {file}; ")
        })
    }

    /// Tries the settings on a thread of its own, and returns the refusals. Memory that this locks stays locked.
    ///
    /// # Errors
    ///
    /// The system refused the thread.
    pub fn tried(self) -> io::Result<Vec<String>> {
        let thread = std::thread::Builder::new().name("real time".to_owned());
        let thread = thread.spawn(move || self.apply())?;
        Ok(thread.join().unwrap_or_default())
    }
}

/// The settings as a driver.cfg has them.
impl fmt::Display for RealTime {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let priority = self.priority.map(|priority| format!("priority {priority}"));
        let cpu = self.cpu.map(|cpu| format!("cpu {cpu}"));
        let memory = self.lock_memory.then(|| "memory locked".to_owned());
        let required = self.required.then(|| "required".to_owned());
        let all = [priority, cpu, memory, required].into_iter().flatten();
        let all: Vec<String> = all.collect();
        f.write_str(&all.join(", "))
    }
}

const CPU_RIGHT: &str = "name a processor that this process may use; on Linux nproc --all counts them, from 0, and \
                         taskset -pc $$ lists the allowed ones";

fn refusal(what: &str, error: &io::Error, right: &str) -> String {
    if error.kind() == io::ErrorKind::Unsupported {
        return format!("the system refuses {what}; remove it: {OS} cannot do that");
    }
    format!("the system refuses {what} ({error}); {right}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::RefCell;

    /// A system that notes each call, and refuses all with this kind of error.
    struct Fake(RefCell<Vec<String>>, Option<io::ErrorKind>);

    impl Fake {
        fn call(&self, what: String) -> io::Result<()> {
            self.0.borrow_mut().push(what);
            self.1.map_or(Ok(()), |kind| Err(kind.into()))
        }
    }

    impl RealTimeSystem for Fake {
        fn set_priority(&self, priority: u8) -> io::Result<()> {
            self.call(format!("priority {priority}"))
        }

        fn set_cpu(&self, cpu: u16) -> io::Result<()> {
            self.call(format!("cpu {cpu}"))
        }

        fn lock_memory(&self) -> io::Result<()> {
            self.call("memory".to_owned())
        }
    }

    const ALL: RealTime = RealTime {
        priority: Some(50),
        cpu: Some(1),
        lock_memory: true,
        required: false,
    };

    #[test]
    fn each_setting_is_one_call_and_one_that_is_not_asked_for_is_none() {
        let allows = Fake(RefCell::default(), None);
        assert_eq!(ALL.apply_with(&allows), Vec::<String>::new());
        assert_eq!(*allows.0.borrow(), ["memory", "cpu 1", "priority 50"]);
        let asked = Fake(RefCell::default(), None);
        assert!(RealTime::default().apply_with(&asked).is_empty());
        assert!(asked.0.borrow().is_empty());
        assert_eq!(ALL.to_string(), "priority 50, cpu 1, memory locked");
        let required = RealTime {
            required: true,
            ..RealTime::default()
        };
        assert_eq!(required.to_string(), "required");
    }

    #[test]
    fn a_refusal_names_the_commands_that_allow_it_and_the_others_are_tried() {
        let refuses = Fake(RefCell::default(), Some(io::ErrorKind::PermissionDenied));
        let refused = ALL.apply_with(&refuses);
        assert_eq!(refuses.0.borrow().len(), 3);
        let [memory, cpu, priority] = &refused[..] else {
            panic!("{refused:?}");
        };
        assert!(memory.contains("LimitMEMLOCK=infinity"), "{memory}");
        assert!(cpu.starts_with("the system refuses cpu = 1 ("), "{cpu}");
        for part in ["rtprio 50", "LimitRTPRIO=50"] {
            assert!(priority.contains(part), "{priority}");
        }
    }

    #[test]
    fn only_the_own_command_is_to_be_given_rights() {
        let of = |real_time: RealTime, program| real_time.setcap(Some(Path::new(program)));
        let command =
            "for the command: sudo setcap cap_sys_nice,cap_ipc_lock=ep /usr/bin/tickbus; ";
        assert_eq!(of(ALL, "/usr/bin/tickbus"), command);
        let command = "for the command: sudo setcap cap_sys_nice=ep /usr/bin/tickbus; ";
        assert_eq!(of(RealTime::default(), "/usr/bin/tickbus"), command);
        assert_eq!(of(ALL, "/usr/lib/jvm/bin/java"), "");
    }

    #[test]
    fn a_system_without_the_call_says_to_remove_the_key() {
        let cannot = Fake(RefCell::default(), Some(io::ErrorKind::Unsupported));
        let refused = ALL.apply_with(&cannot);
        assert!(
            refused.iter().all(|text| text.contains("; remove it: ")),
            "{refused:?}"
        );
    }
}
