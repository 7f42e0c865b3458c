//! The bridge on a serial port, or on a virtual one.

use std::io;
use std::path::{Path, PathBuf};

use tickbus_base::os::{LinkedTerminal, PollSet, Ready, SerialSettings};
use tickbus_base::time::{Clock, Nanos, Stop};
use tickbus_net::serial::{gone, open};
use tickbus_net::{Address, Stream, is_for_later};

use crate::ascii::AsciiBridge;
use crate::link::{BUFFER, Link, Watched};

/// The port's key in the poll set.
const PORT: usize = 0;

/// How often to look for a missing port.
const LOOK: Nanos = Nanos::from_secs(1);

/// The location of the client.
#[derive(Debug)]
pub enum Device {
    /// On a serial port, by the system's name.
    Port(String, SerialSettings),
    /// On this machine: on a virtual port that the bridge creates.
    Virtual(VirtualPort),
}

/// A virtual serial port that programs open by a name of the user's choice.
#[derive(Debug)]
pub struct VirtualPort {
    link: PathBuf,
    port: Option<LinkedTerminal>,
}

impl VirtualPort {
    /// Creates a virtual port, and the symbolic link `link` to it.
    ///
    /// # Errors
    ///
    /// There is a file of this name that is not a link to a virtual port, or the system has no free ports.
    pub fn new(link: &Path) -> io::Result<Self> {
        Ok(Self {
            link: link.to_owned(),
            port: Some(LinkedTerminal::open(link)?),
        })
    }
}

/// The environment of a bridge.
pub struct Hosting<'h> {
    /// The clock.
    pub clock: &'h dyn Clock,
    /// Ends the bridge.
    pub stop: &'h Stop,
    /// Takes news for an operator, one line each.
    pub news: &'h mut dyn FnMut(&str),
}

/// Carries lines between `device` and the dispatcher at `address` until stopped. Lost ends are opened again.
///
/// # Errors
///
/// The port cannot be opened at the start, or the system cannot wait for it.
pub fn run(
    bridge: &mut AsciiBridge,
    mut device: Device,
    address: &Address,
    hosting: Hosting<'_>,
) -> Result<(), String> {
    let port = device.open()?;
    let no_wait = |error: io::Error| format!("the system cannot wait for the port: {error}");
    let mut set = PollSet::new(hosting.stop);
    let mut host = Host {
        bridge,
        port: Some(Watched::new(&mut set, PORT, port).map_err(no_wait)?),
        set,
        link: Link::new(address, hosting.stop),
        device,
        next_look: Nanos::ZERO,
        buffer: vec![0; BUFFER].into(),
        hosting,
    };
    while !host.hosting.stop.is_stopped() {
        host.turn().map_err(no_wait)?;
    }
    Ok(())
}

impl Device {
    fn open(&mut self) -> Result<Box<dyn Stream>, String> {
        match self {
            Self::Port(name, settings) => match open(name, *settings) {
                Ok(port) => Ok(Box::new(port)),
                Err(error) => Err(error.to_string()),
            },
            Self::Virtual(port) => {
                let port = port.port.take();
                port.map_or_else(
                    || Err("the system has taken the virtual port away".to_owned()),
                    |port| Ok(Box::new(port) as _),
                )
            }
        }
    }

    fn name(&self) -> String {
        match self {
            Self::Port(name, _) => name.clone(),
            Self::Virtual(port) => port.link.display().to_string(),
        }
    }
}

struct Host<'b, 'h> {
    bridge: &'b mut AsciiBridge,
    hosting: Hosting<'h>,
    set: PollSet,
    link: Link,
    device: Device,
    port: Option<Watched<Box<dyn Stream>>>,
    /// When to look for a missing port.
    next_look: Nanos,
    buffer: Box<[u8]>,
}

impl Host<'_, '_> {
    fn turn(&mut self) -> io::Result<()> {
        let deadline = match &self.port {
            None => self.next_look,
            Some(_) => self.link.deadline(self.bridge),
        };
        self.set.wait(self.hosting.clock, deadline)?;
        let now = self.hosting.clock.now();
        let is_readable = |one: &Ready| one.key == PORT && one.is_readable;
        if self.set.ready().iter().any(is_readable) {
            self.read(now);
        }
        if self.port.is_none() {
            self.look(now)?;
        }
        if self.port.is_some() {
            let news = &mut *self.hosting.news;
            self.link.turn(now, self.bridge, &mut self.set, news)?;
            self.write(now)?;
        }
        if self.port.is_some() {
            let news = &mut *self.hosting.news;
            self.link.write(now, self.bridge, &mut self.set, news)?;
        }
        Ok(())
    }

    /// Checks if the port is back.
    fn look(&mut self, now: Nanos) -> io::Result<()> {
        if now >= self.next_look {
            self.next_look = now + LOOK;
            if let Ok(port) = self.device.open() {
                (self.hosting.news)(&format!("{} is there again", self.device.name()));
                self.port = Some(Watched::new(&mut self.set, PORT, port)?);
            }
        }
        Ok(())
    }

    fn read(&mut self, now: Nanos) {
        let Some(port) = &mut self.port else {
            return;
        };
        match port.stream.read(&mut self.buffer) {
            Ok(0) => self.unplug(now, "it was closed"),
            Ok(count) => self.bridge.from_serial(now, &self.buffer[..count]),
            Err(error) if is_for_later(&error) => {}
            Err(error) => self.unplug(now, &error.to_string()),
        }
    }

    /// The serial port is gone: its client has left.
    fn unplug(&mut self, now: Nanos, why: &str) {
        if let Some(port) = self.port.take() {
            port.close(&mut self.set);
            let device = self.device.name();
            (self.hosting.news)(&gone(&device, why).to_string());
            self.next_look = now + LOOK;
            self.bridge.unplugged();
            self.link.close(&mut self.set);
        }
    }

    /// Writes as much as the port accepts, and sets the next interest.
    fn write(&mut self, now: Nanos) -> io::Result<()> {
        let Some(port) = &mut self.port else {
            return Ok(());
        };
        let broken = loop {
            let bytes = self.bridge.to_serial();
            if bytes.is_empty() {
                break None;
            }
            match port.stream.write(bytes) {
                Ok(0) => break None,
                Ok(count) => self.bridge.wrote_to_serial(count),
                Err(error) if is_for_later(&error) => break None,
                Err(error) => break Some(error.to_string()),
            }
        };
        if let Some(why) = broken {
            self.unplug(now, &why);
            return Ok(());
        }
        let is_blocked = !self.bridge.to_serial().is_empty();
        port.watch(&mut self.set, self.bridge.wants_serial(), is_blocked)
    }
}
