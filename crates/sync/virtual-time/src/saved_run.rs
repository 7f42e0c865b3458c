//! Runs that were saved at a step, as files.
//!
//! The file has the clients with their states, as far as they have given them, and when each of them runs next; the values
//! and the trace; and all commits up to the step, if they are kept. In the restored run a client takes over its state, or
//! runs its steps again from what it had read, as a member that comes back does.
//!
//! All numbers are little-endian: `TICKSYNC`, 4 bytes version, 8 bytes length of the content, the content, and 8 bytes
//! SipHash-2-4 of all bytes before, with a key of zeros.

use std::fs::{self, File};
use std::hash::Hasher as _;
use std::io::{self, Read as _, Write as _};
use std::path::{Path, PathBuf};

use siphasher::sip::SipHasher24;
use tickbus_base::Mistake;
use tickbus_base::time::Nanos;

use crate::bytes::{Reader, count, declared, read_declared, slots};
use crate::hash::Trace;
use crate::memory::{self, Memory};
use crate::{Declaration, TraceHash};

/// The first bytes of a file.
const MAGIC: [u8; 8] = *b"TICKSYNC";

/// The version of the format.
const VERSION: u32 = 1;

/// The bytes in front of the content.
const HEAD: usize = 20;

/// The bytes behind the content.
const TAIL: usize = 8;

/// The most clients of one run.
pub(crate) const MOST_CLIENTS: usize = 1000;

/// The longest state of a client, in bytes.
pub const LONGEST_STATE: usize = 500_000;

/// The largest file: the memory of a run, the states of its clients, and the names of its variables.
const LARGEST: u64 =
    2 * memory::MOST_SAVED as u64 + (MOST_CLIENTS * LONGEST_STATE) as u64 + (64 << 20);

/// A run that was saved at a step.
#[derive(Clone, Debug)]
pub struct SavedRun {
    /// The virtual time of one step.
    pub(crate) length: Nanos,
    /// The last step that was committed.
    pub(crate) step: u64,
    /// The trace up to this step.
    pub(crate) trace: Trace,
    /// The values of all variables.
    pub(crate) values: Vec<u64>,
    /// The clients in the order of their names.
    pub(crate) clients: Vec<ClientState>,
    /// All commits; `None` if all clients have states, and the run was longer than the memory.
    pub(crate) memory: Option<Memory>,
}

/// A client of a saved run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct ClientState {
    pub(crate) declaration: Declaration,
    /// The step in which it runs next.
    pub(crate) next: u64,
    /// `None`: it runs its steps again.
    pub(crate) state: Option<Vec<u8>>,
}

impl PartialEq for SavedRun {
    fn eq(&self, other: &Self) -> bool {
        self.to_bytes() == other.to_bytes()
    }
}

impl SavedRun {
    /// The number of steps that had been committed when the run was saved.
    pub const fn steps(&self) -> u64 {
        self.step
    }

    /// The trace hash of these steps.
    pub fn hash(&self) -> TraceHash {
        self.trace.hash()
    }

    /// The names of the clients, in their order.
    pub fn clients(&self) -> impl ExactSizeIterator<Item = &str> {
        self.clients.iter().map(|client| &*client.declaration.name)
    }

    /// Checks that a client is the one that it was, and can get back what it was, or returns the difference.
    pub(crate) fn takes(
        &self,
        declaration: &Declaration,
        takes_states: bool,
    ) -> Result<(), String> {
        let name = &declaration.name;
        let mut clients = self.clients.iter().map(|client| &client.declaration);
        let Some(was) = clients.find(|was| was.name == *name) else {
            return Err(format!(
                "the saved run has no client of the name \"{name}\""
            ));
        };
        match was.difference(declaration) {
            Some(difference) => Err(format!(
                "in the saved run \"{name}\" declared other things: {difference}"
            )),
            None if self.memory.is_none() && !takes_states => Err(format!(
                "the saved run has only the state of \"{name}\" and not its steps, and this client cannot take over a \
                 state; use one of version 4"
            )),
            None => Ok(()),
        }
    }

    /// Reads the file at `path`.
    ///
    /// # Errors
    ///
    /// The file cannot be read, is no saved run, or is damaged: the text begins with the path, and names the byte.
    pub fn load(path: &Path) -> Result<Self, Mistake> {
        let shown = path.display();
        let bytes = read(path).map_err(|error| {
            Mistake::new(
                format!("{shown}: {error}"),
                "write the path of a file that tickbus sync --save-to has written",
            )
        })?;
        Self::parse(&bytes).map_err(|(at, what)| {
            Mistake::new(
                format!("{shown}: byte {at}: {what}"),
                "restore another file, or begin the run from its start",
            )
        })
    }

    /// The line for people at the start of the restored run.
    pub(crate) fn news(&self) -> String {
        let step = self.step;
        let again = self.clients.iter().filter(|client| client.state.is_none());
        let what = match (again.count(), self.clients.len()) {
            (0, _) => "the clients take over their states".to_owned(),
            (again, all) if again == all => {
                format!("the clients run the steps up to {step} again")
            }
            (again, all) => format!(
                "{again} of {all} clients run the steps up to {step} again, the others take over their states"
            ),
        };
        format!("all have joined: {what}, then the run continues")
    }

    /// The content of the file.
    pub fn to_bytes(&self) -> Vec<u8> {
        to_bytes(self, self.memory.as_ref())
    }

    /// Reads the content of a file.
    ///
    /// # Errors
    ///
    /// The byte at which it is wrong, and what is wrong.
    pub fn parse(bytes: &[u8]) -> Result<Self, (usize, String)> {
        let begin = bytes.len().min(MAGIC.len());
        if bytes[..begin] != MAGIC[..begin] {
            return Err((0, "this is no saved run".to_owned()));
        }
        let cut = || (bytes.len(), "the file is cut".to_owned());
        let (head, rest) = bytes.split_at_checked(HEAD).ok_or_else(cut)?;
        let mut reader = Reader::new(&head[MAGIC.len()..]);
        let at_head = |what| (MAGIC.len(), what);
        let version = reader.half().map_err(at_head)?;
        if version != VERSION {
            let what =
                format!("the file has version {version}, and this tickbus reads version {VERSION}");
            return Err(at_head(what));
        }
        let length = reader.word().map_err(at_head)?;
        let end = usize::try_from(length).unwrap_or(usize::MAX);
        let (content, tail) = rest.split_at_checked(end).ok_or_else(cut)?;
        let stored: [u8; TAIL] = match tail.len() {
            0..TAIL => return Err(cut()),
            TAIL => tail.try_into().expect("8 bytes"),
            _ => {
                let what = "the file is longer than it says".to_owned();
                return Err((HEAD + end + TAIL, what));
            }
        };
        if sum(&bytes[..HEAD + end]) != u64::from_le_bytes(stored) {
            let what = "the file is damaged: its checksum is another one".to_owned();
            return Err((HEAD + end, what));
        }
        Self::read(content).map_err(|what| (HEAD, format!("the content is wrong: it {what}")))
    }

    fn read(content: &[u8]) -> Result<Self, String> {
        let mut reader = Reader::new(content);
        let length = Nanos(reader.word()?.cast_signed());
        if length <= Nanos::ZERO {
            return Err(format!("has steps of {length}"));
        }
        let step = reader.word()?;
        if step > (i64::MAX / length.0).unsigned_abs() {
            return Err(format!("ends with step {step}, behind all virtual time"));
        }
        let length_of_trace = reader_count(&mut reader)?;
        let trace = reader.bytes(length_of_trace)?;
        let trace = Trace::from_bytes(trace).ok_or("has a trace that cannot be read")?;
        let mut clients: Vec<ClientState> = Vec::new();
        for _ in 0..u16::from_le_bytes(reader.take()?) {
            let declaration = read_declared(&mut reader, true)?;
            let next = reader.word()?;
            let state = if reader.byte()? == 0 {
                None
            } else {
                let length = reader_count(&mut reader)?;
                if step == 0 || length > LONGEST_STATE {
                    return Err(format!(
                        "has a state of {length} bytes after step {step}; a state has {LONGEST_STATE} at most, after \
                         step 1 or a later one"
                    ));
                }
                Some(reader.bytes(length)?.to_vec())
            };
            clients.push(ClientState {
                declaration,
                next,
                state,
            });
        }
        if !clients.is_sorted_by(|a, b| a.declaration.name < b.declaration.name) {
            return Err("has clients that are not in the order of their names".to_owned());
        }
        let variables = clients.iter().map(|client| client.declaration.writes.len());
        let variables: usize = variables.sum();
        let values = reader.words(variables as u64)?.iter().collect();
        let memory = match reader.byte()? {
            0 if clients.iter().all(|client| client.state.is_some()) => None,
            0 => return Err("has neither commits nor all states".to_owned()),
            _ => {
                let memory = Memory::read(&mut reader, (clients.len(), variables), step);
                Some(memory.map_err(|what| format!("has a memory that is wrong: {what}"))?)
            }
        };
        reader.finish()?;
        Ok(Self {
            length,
            step,
            trace,
            values,
            clients,
            memory,
        })
    }
}

/// A number of bytes that follow.
fn reader_count(reader: &mut Reader<'_>) -> Result<usize, String> {
    reader.half().map(|count| count as usize)
}

/// The content of the file of a run with these commits.
pub(crate) fn to_bytes(run: &SavedRun, memory: Option<&Memory>) -> Vec<u8> {
    let mut out = Vec::new();
    let counted = |out: &mut Vec<u8>, bytes: &[u8]| {
        let count = u32::try_from(bytes.len()).expect("a state has its limit");
        out.extend_from_slice(&count.to_le_bytes());
        out.extend_from_slice(bytes);
    };
    out.extend_from_slice(&MAGIC);
    out.extend_from_slice(&VERSION.to_le_bytes());
    out.extend_from_slice(&[0; 8]);
    out.extend_from_slice(&run.length.0.to_le_bytes());
    out.extend_from_slice(&run.step.to_le_bytes());
    let trace = postcard::to_stdvec(&run.trace).expect("into a vector");
    counted(&mut out, &trace);
    count(&mut out, run.clients.len());
    for client in &run.clients {
        declared(&mut out, &client.declaration);
        out.extend_from_slice(&client.next.to_le_bytes());
        out.push(client.state.is_some().into());
        if let Some(state) = &client.state {
            counted(&mut out, state);
        }
    }
    slots(&mut out, &run.values);
    out.push(memory.is_some().into());
    if let Some(memory) = memory {
        memory.write(&mut out);
    }
    let content = (out.len() - HEAD) as u64;
    out[HEAD - 8..HEAD].copy_from_slice(&content.to_le_bytes());
    let sum = sum(&out);
    out.extend_from_slice(&sum.to_le_bytes());
    out
}

/// Writes the file at `path`: first beside it, so that an older file stays until this one is complete.
pub(crate) fn write(path: &Path, content: &[u8]) -> io::Result<()> {
    let mut part = path.as_os_str().to_owned();
    part.push(".part");
    let part = PathBuf::from(part);
    let written = (|| {
        let mut file = File::create(&part)?;
        file.write_all(content)?;
        file.sync_all()?;
        drop(file);
        fs::rename(&part, path)
    })();
    if written.is_err() {
        let _ = fs::remove_file(&part);
    }
    written
}

fn read(path: &Path) -> io::Result<Vec<u8>> {
    let file = File::open(path)?;
    let mut bytes = Vec::new();
    file.take(LARGEST + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > LARGEST {
        let what = format!("the file is larger than {LARGEST} bytes, as no saved run is");
        return Err(io::Error::other(what));
    }
    Ok(bytes)
}

fn sum(bytes: &[u8]) -> u64 {
    let mut hasher = SipHasher24::new();
    hasher.write(bytes);
    hasher.finish()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Variable;
    use tickbus_image::signal::DataType;

    fn saved() -> SavedRun {
        let mut plc = Declaration::new("plc");
        plc.writes.push(Variable::new("go", DataType::Bool));
        let mut tank = Declaration::new("tank");
        tank.reads.push("go".to_owned());
        let mut memory = Memory::default();
        memory.note_due(2, 0..2);
        memory.commit(0, &[0]);
        memory.note_due(2, 0..1);
        memory.commit(3, &[1]);
        SavedRun {
            length: Nanos::from_millis(1),
            step: 4,
            trace: Trace::new(1, &[], &[]),
            values: vec![1],
            clients: [(plc, 5, None), (tank, 9, Some(vec![1, 2, 3]))]
                .map(|(declaration, next, state)| ClientState {
                    declaration,
                    next,
                    state,
                })
                .into(),
            memory: Some(memory),
        }
    }

    #[test]
    fn a_file_is_read_as_it_was_written_and_refused_when_any_byte_is_another_one() {
        let run = saved();
        let bytes = run.to_bytes();
        assert_eq!(SavedRun::parse(&bytes), Ok(run));
        for at in 0..bytes.len() {
            let cut = SavedRun::parse(&bytes[..at]).expect_err("it is cut");
            assert_eq!(cut, (at, "the file is cut".to_owned()));
            let mut damaged = bytes.clone();
            damaged[at] ^= 0x10;
            SavedRun::parse(&damaged).expect_err("a byte is another one");
        }
        let longer = [&*bytes, &[0]].concat();
        let (at, what) = SavedRun::parse(&longer).expect_err("it is longer");
        assert_eq!(
            (at, &*what),
            (bytes.len(), "the file is longer than it says")
        );
    }

    #[test]
    fn a_file_replaces_an_older_one_as_a_whole_and_says_what_is_wrong_with_it() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("cell.saved");
        let run = saved();
        for _ in 0..2 {
            write(&path, &run.to_bytes()).expect("it can be written");
            assert_eq!(SavedRun::load(&path).expect("it is right"), run);
        }
        assert_eq!(fs::read_dir(folder.path()).expect("a folder").count(), 1);
        fs::write(&path, "[sync]\n").expect("it can be written");
        let told = SavedRun::load(&path).expect_err("another file").to_string();
        assert!(told.contains("byte 0: this is no saved run"), "{told}");
        let told = write(&folder.path().join("none/cell.saved"), &run.to_bytes());
        assert_eq!(told.expect_err("no folder").kind(), io::ErrorKind::NotFound);
    }

    #[test]
    fn any_content_with_a_right_checksum_is_refused_or_can_be_run_again() {
        let bytes = saved().to_bytes();
        let mut right = 0;
        for at in HEAD..bytes.len() - TAIL {
            for bit in 0..8 {
                let mut other = bytes.clone();
                other[at] ^= 1 << bit;
                let end = other.len() - TAIL;
                let sum = sum(&other[..end]);
                other[end..].copy_from_slice(&sum.to_le_bytes());
                let Ok(run) = SavedRun::parse(&other) else {
                    continue;
                };
                right += 1;
                let mut trace = run.trace.clone();
                trace.commit(crate::step::step_of(run.step, run.length), &run.values);
                for client in 0..run.clients.len() {
                    let Some(memory) = &run.memory else {
                        continue;
                    };
                    let mut place = memory.start();
                    while memory.next(&mut place, client).is_some() {
                        memory.pass(&mut place);
                    }
                }
            }
        }
        assert!(right > 100, "{right}");
    }

    #[test]
    fn a_state_that_no_run_can_have_is_refused() {
        let mut run = saved();
        run.clients[1].state = Some(vec![0; LONGEST_STATE + 1]);
        let (_, what) = SavedRun::parse(&run.to_bytes()).expect_err("a long state");
        assert!(what.contains("a state of 500001 bytes"), "{what}");
        let mut run = saved();
        run.step = 0;
        let (_, what) = SavedRun::parse(&run.to_bytes()).expect_err("before step 1");
        assert!(what.contains("after step 0"), "{what}");
    }

    #[test]
    fn a_memory_without_initial_values_is_refused() {
        let mut run = saved();
        run.memory = Some(Memory::default());
        let (at, what) = SavedRun::parse(&run.to_bytes()).expect_err("nothing to begin with");
        assert_eq!(at, HEAD);
        assert!(what.ends_with("it has no initial values"), "{what}");
    }
}
