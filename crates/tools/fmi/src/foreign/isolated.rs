//! An FMU in a helper process, where it can crash or hang without harm.

use std::io::{self, ErrorKind, Write as _};
use std::process::{Child, ExitStatus};

use tickbus_base::os::helper::{self, Line};
use tickbus_base::time::{Clock as _, Monotonic, Nanos, Stop};
use tickbus_net::{Inbox, Message as _};

use super::helper::next;
use super::slave::{Failure, Setup, Slave, Stepped};
use super::talk::{Answer, Request};
use super::target::Target;
use crate::value::Value;

/// The longest time that an FMU can take to begin, or for a step.
const PATIENCE: Nanos = Nanos::from_secs(60);

/// The longest time that a helper can take to end after its line has ended.
const END: Nanos = Nanos::from_secs(2);

/// An FMU in a separate process.
#[derive(Debug)]
pub(super) struct Isolated {
    child: Child,
    line: Line,
    inbox: Inbox,
    file: String,
    is_over: bool,
}

impl Isolated {
    /// Begins a run in a new helper, and reads the first outputs.
    pub(super) fn open(
        setup: &Setup,
        inputs: &[Value],
        outputs: &mut [Value],
    ) -> Result<Self, Failure> {
        let cannot = |error: io::Error| {
            Failure(format!(
                "{}: no helper process can be started for it: {error}; leave out --isolated, or isolated = true",
                setup.file
            ))
        };
        let started =
            std::env::current_exe().and_then(|program| helper::start(&program, "fmu-helper", None));
        let (child, line) = started.map_err(cannot)?;
        line.set_read_timeout(Some(PATIENCE.to_duration()))
            .map_err(cannot)?;
        let mut slave = Self {
            child,
            line,
            inbox: Inbox::new(),
            file: setup.file.clone(),
            is_over: false,
        };
        let open = Request::Open {
            setup: Box::new(setup.clone()),
            inputs: inputs.to_vec(),
        };
        slave.ask(&open, "its beginning", outputs)?;
        Ok(slave)
    }

    fn ask(
        &mut self,
        request: &Request,
        what: &str,
        outputs: &mut [Value],
    ) -> Result<Stepped, Failure> {
        // If the helper is gone, reading its answer will show that.
        let _ = self.line.write_all(&request.write());
        match next(&mut self.line, &mut self.inbox) {
            Ok(Some(Answer::Outputs {
                outputs: new,
                stepped,
            })) if new.len() == outputs.len() => {
                outputs.copy_from_slice(&new);
                Ok(stepped)
            }
            Ok(Some(Answer::Ended)) => Ok(Stepped::Ended),
            Ok(Some(Answer::Failed(failure))) => {
                self.is_over = true;
                Err(failure)
            }
            Ok(Some(Answer::Outputs { .. })) => {
                Err(self.failed("it has damaged its helper process: tell its maker"))
            }
            Ok(None) => Err(self.gone(what)),
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {
                let why = format!(
                    "{what} took longer than {PATIENCE}; its helper process was ended: tell its maker"
                );
                Err(self.failed(&why))
            }
            Err(error)
                if matches!(
                    error.kind(),
                    ErrorKind::ConnectionReset | ErrorKind::ConnectionAborted
                ) =>
            {
                Err(self.gone(what))
            }
            Err(error) => Err(self.failed(&format!(
                "its helper process answered with {error}; it has damaged it: tell its maker"
            ))),
        }
    }

    fn failed(&mut self, why: &str) -> Failure {
        self.is_over = true;
        Failure(format!("{}: {why}", self.file))
    }

    /// Returns how the helper ended, or `None` if it is still running although its line has ended: an FMU can close
    /// files that are not its own.
    fn ended(&mut self) -> io::Result<Option<ExitStatus>> {
        let clock = Monotonic::shared();
        let due = clock.now() + END;
        loop {
            let ended = self.child.try_wait()?;
            if ended.is_some() || clock.now() >= due {
                return Ok(ended);
            }
            clock.wait_until(clock.now() + Nanos::from_millis(2), &Stop::new());
        }
    }

    /// Describes a helper that ended on its own.
    fn gone(&mut self, what: &str) -> Failure {
        let how = match self.ended() {
            Ok(Some(status)) => helper::ending(status),
            Ok(None) => "has closed the line to its host, and hangs".to_owned(),
            Err(error) => format!("has gone ({error})"),
        };
        self.failed(&format!("its process {how} in {what}: tell its maker"))
    }
}

impl Slave for Isolated {
    fn step(
        &mut self,
        inputs: &[Value],
        from: f64,
        length: f64,
        outputs: &mut [Value],
    ) -> Result<Stepped, Failure> {
        if self.is_over {
            return Err(Failure(format!("{}: it has ended", self.file)));
        }
        let request = Request::Step {
            inputs: inputs.to_vec(),
            from,
            length,
        };
        self.ask(
            &request,
            &format!("the step of {length} s at {from} s"),
            outputs,
        )
    }

    fn change(&mut self, variable: Target, value: Value) -> Result<Value, Failure> {
        let mut before = [value];
        let request = Request::Change { variable, value };
        self.ask(&request, "setting a variable", &mut before)?;
        Ok(before[0])
    }

    fn end(&mut self) -> Result<(), Failure> {
        if std::mem::replace(&mut self.is_over, true) {
            return Ok(());
        }
        let ended = self.ask(&Request::End, "its end", &mut []).map(|_| ());
        self.is_over = true;
        ended
    }
}

impl Drop for Isolated {
    fn drop(&mut self) {
        if !self.is_over {
            // An error at the end is of no use any more.
            let _ = self.end();
        }
        // The helper may hang, and has nothing to lose.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
