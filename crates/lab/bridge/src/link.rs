//! The connection of a bridge with the dispatcher, with reconnects.

use std::io::{self, Read as _, Write as _};
use std::net::TcpStream;

use tickbus_base::os::{Interest, PollSet};
use tickbus_base::time::{Nanos, Stop};
use tickbus_net::{Address, Dialler, Stream, is_for_later};

use crate::speaker::Speaker;

/// The dispatcher's key in the poll set.
pub(crate) const DISPATCHER: usize = 1;

/// At most this many bytes are read at once.
pub(crate) const BUFFER: usize = 16 * 1024;

/// A stream in the poll set, with its interest.
pub(crate) struct Watched<S> {
    key: usize,
    pub(crate) stream: S,
    interest: Option<Interest>,
}

impl<S: Stream> Watched<S> {
    /// Waits for bytes of a stream.
    pub(crate) fn new(set: &mut PollSet, key: usize, stream: S) -> io::Result<Self> {
        set.add(key, &stream, Interest::Read)?;
        let interest = Some(Interest::Read);
        Ok(Self {
            key,
            stream,
            interest,
        })
    }

    /// Waits for these events from now on.
    pub(crate) fn watch(&mut self, set: &mut PollSet, reads: bool, writes: bool) -> io::Result<()> {
        let interest = match (reads, writes) {
            (true, true) => Some(Interest::ReadWrite),
            (true, false) => Some(Interest::Read),
            (false, true) => Some(Interest::Write),
            (false, false) => None,
        };
        if interest == self.interest {
            return Ok(());
        }
        match (self.interest, interest) {
            (Some(_), Some(interest)) => set.change(self.key, &self.stream, interest)?,
            (None, Some(interest)) => set.add(self.key, &self.stream, interest)?,
            (_, None) => set.remove(self.key, &self.stream),
        }
        self.interest = interest;
        Ok(())
    }

    /// Closes the stream.
    pub(crate) fn close(mut self, set: &mut PollSet) {
        if self.interest.is_some() {
            set.remove(self.key, &self.stream);
        }
        self.stream.close();
    }
}

/// The connection, or the attempts to have one.
pub(crate) struct Link {
    address: Address,
    dialler: Dialler,
    connection: Option<Watched<TcpStream>>,
    /// The last reported reason for the missing dispatcher.
    told: String,
    /// The dispatcher answered, but refused the client.
    is_refused: bool,
    buffer: Box<[u8]>,
}

impl Link {
    pub(crate) fn new(address: &Address, stop: &Stop) -> Self {
        Self {
            address: address.clone(),
            dialler: Dialler::new(address, stop),
            connection: None,
            told: String::new(),
            is_refused: false,
            buffer: vec![0; BUFFER].into(),
        }
    }

    /// When [`turn`](Self::turn) has something to do even if nothing arrives.
    pub(crate) fn deadline(&self, speaker: &dyn Speaker) -> Nanos {
        if self.connection.is_some() {
            speaker.deadline()
        } else {
            self.dialler.deadline()
        }
    }

    /// Reads the bytes that have arrived, and calls the dispatcher if it is not connected.
    pub(crate) fn turn(
        &mut self,
        now: Nanos,
        speaker: &mut dyn Speaker,
        set: &mut PollSet,
        news: &mut dyn FnMut(&str),
    ) -> io::Result<()> {
        let is_ready = |one: &tickbus_base::os::Ready| one.key == DISPATCHER && one.is_readable;
        if set.ready().iter().any(is_ready) && speaker.wants_to_hear() {
            self.read(now, speaker, set, news);
        }
        if let Err(why) = speaker.tick(now) {
            self.hang_up(now, &why, speaker, set, news);
        }
        if self.connection.is_some() {
            return Ok(());
        }
        match self.dialler.turn(now) {
            None => {}
            Some(Ok(stream)) => {
                self.connection = Some(Watched::new(set, DISPATCHER, stream)?);
                if !self.is_refused {
                    self.tell_connected(news);
                }
                speaker.connected(now);
            }
            Some(Err(error)) => {
                let why = format!("no dispatcher at {} ({error})", self.address);
                self.tell_away(why, news);
            }
        }
        Ok(())
    }

    fn read(
        &mut self,
        now: Nanos,
        speaker: &mut dyn Speaker,
        set: &mut PollSet,
        news: &mut dyn FnMut(&str),
    ) {
        let Some(connection) = &mut self.connection else {
            return;
        };
        let heard = match connection.stream.read(&mut self.buffer) {
            Ok(0) => Err("it closed the connection".to_owned()),
            Ok(count) => {
                let heard = speaker.hear(now, &self.buffer[..count]);
                self.is_refused |= heard.is_err();
                heard
            }
            Err(error) if is_for_later(&error) => Ok(()),
            Err(error) => Err(error.to_string()),
        };
        if let Err(why) = heard {
            self.hang_up(now, &why, speaker, set, news);
        } else if self.is_refused && speaker.is_here() {
            self.is_refused = false;
            self.tell_connected(news);
        }
    }

    /// Writes as much as the dispatcher accepts, and sets the next interest.
    pub(crate) fn write(
        &mut self,
        now: Nanos,
        speaker: &mut dyn Speaker,
        set: &mut PollSet,
        news: &mut dyn FnMut(&str),
    ) -> io::Result<()> {
        let Some(connection) = &mut self.connection else {
            return Ok(());
        };
        let broken = loop {
            let bytes = speaker.to_write();
            if bytes.is_empty() {
                break None;
            }
            match connection.stream.write(bytes) {
                Ok(0) => break None,
                Ok(count) => speaker.wrote(now, count),
                Err(error) if is_for_later(&error) => break None,
                Err(error) => break Some(error.to_string()),
            }
        };
        if let Some(why) = broken {
            self.hang_up(now, &why, speaker, set, news);
            return Ok(());
        }
        let is_blocked = !speaker.to_write().is_empty();
        connection.watch(set, speaker.wants_to_hear(), is_blocked)
    }

    /// Closes the connection, without a good-bye.
    pub(crate) fn close(&mut self, set: &mut PollSet) {
        if let Some(connection) = self.connection.take() {
            connection.close(set);
        }
    }

    fn hang_up(
        &mut self,
        now: Nanos,
        why: &str,
        speaker: &mut dyn Speaker,
        set: &mut PollSet,
        news: &mut dyn FnMut(&str),
    ) {
        self.close(set);
        if !speaker.disconnected() {
            self.dialler.pause(now);
            let why = format!("the dispatcher at {} is lost ({why})", self.address);
            self.tell_away(why, news);
        }
    }

    fn tell_connected(&mut self, news: &mut dyn FnMut(&str)) {
        self.told.clear();
        news(&format!("connected with {}", self.address));
    }

    /// Reports each reason once.
    fn tell_away(&mut self, why: String, news: &mut dyn FnMut(&str)) {
        if why != self.told {
            news(&format!("{why}; it is called again each second"));
            self.told = why;
        }
    }
}
