//! Replays the recorded sessions of foreign clients with our servers, as described in `README.md` here: the answers are
//! the same, byte for byte.
#![allow(missing_docs, reason = "a test")]

#[path = "../../foreign/harness/mod.rs"]
mod foreign;

use std::collections::BTreeMap;
use std::io::{Read as _, Write as _};
use std::net::{Shutdown, TcpStream};
use std::path::{Path, PathBuf};
use std::time::Duration;

use foreign::machine::Machine;
use foreign::pcap::From;
use foreign::session::{Hex, Session, Step};
use tickbus::time::Manual;

/// The sessions, by their names.
fn sessions() -> Vec<(String, Session)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/sessions");
    let files = std::fs::read_dir(folder).expect("the folder");
    let files = files.map(|entry| entry.expect("an entry").path());
    let mut files: Vec<PathBuf> = files
        .filter(|path| path.extension().is_some_and(|it| it == "session"))
        .collect();
    files.sort();
    let read = |path: PathBuf| {
        let text = std::fs::read_to_string(&path).expect("text");
        let name = path.display().to_string();
        let session = text.parse().unwrap_or_else(|why| panic!("{name}: {why}"));
        (name, session)
    };
    files.into_iter().map(read).collect()
}

/// Sends the client's data, on a clock that stands still.
fn replay(session: &Session) -> Result<(), String> {
    let mut machine = Machine::open_on(&Manual::new(), &session.config);
    let address = machine.address();
    let mut clients = BTreeMap::new();
    for (number, step) in session.steps.iter().enumerate() {
        let told = |why: String| format!("step {} of {}: {why}", number + 1, session.client);
        match step {
            Step::Set(name, value) => machine.set(name, *value),
            Step::Sees(name, value) => {
                machine.tick();
                let seen = machine.get(name);
                if seen.to_bits() != value.to_bits() {
                    return Err(told(format!("{name} is {seen}, not {value}")));
                }
            }
            Step::Said(client, From::Client, bytes) => {
                machine.tick();
                let stream = clients.entry(*client).or_insert_with(|| {
                    let stream = TcpStream::connect(address).expect("it listens");
                    let limit = Some(Duration::from_secs(20));
                    stream.set_read_timeout(limit).expect("a TCP option");
                    stream.set_nodelay(true).expect("a TCP option");
                    stream
                });
                let bytes: Option<Vec<u8>> = bytes.iter().copied().collect();
                let bytes = bytes.expect("nothing that a client says is masked");
                let said = stream.write_all(&bytes);
                said.map_err(|why| told(format!("nobody hears it: {why}")))?;
            }
            Step::Said(client, From::Server, expected) => {
                let stream = clients.get_mut(client);
                let stream = stream.expect("a server answers");
                let mut answer = vec![0; expected.len()];
                let heard = stream.read_exact(&mut answer);
                heard.map_err(|why| told(format!("no answer: {why}")))?;
                let is_same = |(one, other): (&u8, &Option<u8>)| other.is_none_or(|it| it == *one);
                if !answer.iter().zip(expected).all(is_same) {
                    let answer: Vec<_> = answer.into_iter().map(Some).collect();
                    let (given, expected) = (Hex(&answer), Hex(expected));
                    return Err(told(format!("answered\n{given}, not\n{expected}")));
                }
            }
            Step::Leaves(client) => {
                if let Some(stream) = clients.remove(client) {
                    nothing_more(stream).map_err(told)?;
                }
            }
        }
    }
    for stream in clients.into_values() {
        nothing_more(stream)?;
    }
    Ok(())
}

/// Checks that the server sends no more than it did then.
fn nothing_more(mut stream: TcpStream) -> Result<(), String> {
    let _ = stream.shutdown(Shutdown::Write);
    let mut rest = Vec::new();
    let ended = stream.read_to_end(&mut rest);
    if rest.is_empty() {
        ended
            .map(drop)
            .map_err(|why| format!("the server does not leave: {why}"))
    } else {
        Err(format!("the server says more: {rest:02x?}"))
    }
}

#[test]
fn every_recorded_client_is_answered_as_it_was() {
    let sessions = sessions();
    assert!(sessions.len() > 5, "the sessions are there");
    for (name, session) in sessions {
        let said = session.steps.iter();
        let said = said.filter(|step| matches!(step, Step::Said(_, From::Server, _)));
        assert!(said.count() > 2, "{name} has answers");
        replay(&session).unwrap_or_else(|why| panic!("{name}: {why}"));
    }
}

/// The test above detects a different answer: in each session one bit of the last answer is changed, and the values
/// that the simulation saw.
#[test]
fn another_answer_is_found() {
    for (name, session) in sessions() {
        let mut another = session.clone();
        let answers = another.steps.iter_mut().rev();
        let mut bytes = answers.filter_map(|step| match step {
            Step::Said(_, From::Server, bytes) => bytes.last_mut()?.as_mut(),
            _ => None,
        });
        *bytes.next().expect("an answer") ^= 1;
        drop(bytes);
        let why = replay(&another).expect_err(&name);
        assert!(why.contains("answered"), "{why}");

        let mut another = session;
        let seen = another.steps.iter_mut().find_map(|step| match step {
            Step::Sees(_, value) => Some(value),
            _ => None,
        });
        *seen.expect("something was written") += 1.0;
        let why = replay(&another).expect_err(&name);
        assert!(why.contains(", not "), "{why}");
    }
}

#[test]
fn a_session_is_written_as_it_is_read() {
    for (name, session) in sessions() {
        assert_eq!(session.to_string().parse(), Ok(session), "{name}");
    }
}
