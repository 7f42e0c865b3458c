//! The helper process: `tickbus fmu-helper`, which runs an FMU for its host.

use std::io::{self, Read as _, Write as _};

#[cfg(not(target_os = "linux"))]
use tickbus_base::os::helper;
use tickbus_base::os::helper::{Line, take_over};
use tickbus_net::{Inbox, Message};

use super::slave::{Direct, Slave as _, Stepped};
use super::talk::{Answer, Request};
use crate::value::Value;

/// Serves the host on stdin until the connection ends.
///
/// # Errors
///
/// This process was not started as a helper, or the host is gone.
pub fn serve() -> io::Result<()> {
    let purpose =
        "this command is for tickbus itself, which starts it for `tickbus run --isolated`";
    let (mut line, _) = take_over(false, purpose)?;
    // A helper with a hanging FMU must not outlive its host.
    #[cfg(not(target_os = "linux"))]
    {
        let watched = line.try_clone()?;
        std::thread::spawn(move || {
            helper::wait_for_end(&watched);
            helper::kill_this_process();
        });
    }
    #[cfg(target_os = "linux")]
    rustix::process::set_parent_process_death_signal(Some(rustix::process::Signal::KILL))?;
    let mut inbox = Inbox::new();
    let Some(Request::Open { setup, inputs }) = next(&mut line, &mut inbox)? else {
        return Ok(());
    };
    let mut outputs = vec![Value::Real(0.0); setup.outputs.len()];
    let mut slave = match Direct::open(&setup, &inputs, &mut outputs) {
        Ok(slave) => slave,
        Err(failure) => return tell(&mut line, &Answer::Failed(failure)),
    };
    let stepped = Stepped::Done;
    let mut answer = Answer::Outputs {
        outputs: outputs.clone(),
        stepped,
    };
    loop {
        tell(&mut line, &answer)?;
        answer = match next(&mut line, &mut inbox)? {
            Some(Request::Step {
                inputs,
                from,
                length,
            }) => match slave.step(&inputs, from, length, &mut outputs) {
                Ok(stepped) => Answer::Outputs {
                    outputs: outputs.clone(),
                    stepped,
                },
                Err(failure) => Answer::Failed(failure),
            },
            Some(Request::Change { variable, value }) => match slave.change(variable, value) {
                Ok(before) => Answer::Outputs {
                    outputs: vec![before],
                    stepped: Stepped::Done,
                },
                Err(failure) => Answer::Failed(failure),
            },
            Some(Request::End) => match slave.end() {
                Ok(()) => Answer::Ended,
                Err(failure) => Answer::Failed(failure),
            },
            Some(Request::Open { .. }) | None => return Ok(()),
        };
    }
}

fn tell(line: &mut Line, answer: &Answer) -> io::Result<()> {
    line.write_all(&answer.write())
}

/// Returns the next message; `None` at the end of the line.
pub(super) fn next<M: Message>(line: &mut Line, inbox: &mut Inbox) -> io::Result<Option<M>> {
    loop {
        if let Some(message) = inbox.take().map_err(io::Error::other)? {
            return Ok(Some(message));
        }
        let mut bytes = [0; 16 << 10];
        match line.read(&mut bytes) {
            Ok(0) => return Ok(None),
            Ok(count) => inbox.push(&bytes[..count]),
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
}
