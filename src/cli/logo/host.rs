//! A controller and its connection to the dispatcher: values in, scans, values out.

use std::io::{self, Read as _, Write as _};
use std::net::TcpStream;
use std::time::Duration;

use jiff::Timestamp;
use jiff::tz::TimeZone;

use super::say;
use tickbus_base::os::{Interest, PollSet};
use tickbus_base::time::{Clock, Nanos, Pace, Stop, system_time};
use tickbus_dispatcher::client::{Client, Event};
use tickbus_dispatcher::{Channel, Kind, Number, ON_VOLTS, level};
use tickbus_function_blocks::{Controller, WallTime};
use tickbus_net::{Address, Dialler, close_gracefully, is_for_later};

/// The key of the socket in the poll set.
const SOCKET: usize = 0;

/// The parameters of a hosted controller.
pub(super) struct Hosting<'h> {
    pub(super) address: &'h Address,
    pub(super) cycle: Nanos,
    /// The time at which the controller ends on its own.
    pub(super) end: Nanos,
    pub(super) clock: &'h dyn Clock,
    pub(super) stop: &'h Stop,
}

/// Counts the controller's work.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Counts {
    pub(super) scans: u64,
    /// The number of times that the dispatcher has accepted the controller.
    pub(super) joined: u64,
}

/// Runs until stopped, or until the end time. While the dispatcher is away, all inputs are off, as if their cables were
/// pulled.
pub(super) fn run(
    controller: Controller,
    client: Client,
    hosting: &Hosting<'_>,
) -> io::Result<Counts> {
    let mut host = Host {
        terminal: Terminal::new(controller),
        client,
        set: PollSet::new(hosting.stop),
        dialler: Dialler::new(hosting.address, hosting.stop),
        stream: None,
        interest: Interest::Read,
        arrived: Vec::new(),
        news: News::default(),
        counts: Counts::default(),
        zone: TimeZone::system(),
        due: Nanos::MAX,
        hosting,
    };
    let mut pace = Pace::new(hosting.clock.now(), hosting.cycle);
    while !hosting.stop.is_stopped() && hosting.clock.now() < hosting.end {
        host.turn(&mut pace)?;
    }
    if let Some(stream) = host.stream.take() {
        host.set.remove(SOCKET, &stream);
        close_gracefully(&stream);
    }
    Ok(host.counts)
}

struct Host<'h> {
    terminal: Terminal,
    client: Client,
    hosting: &'h Hosting<'h>,
    set: PollSet,
    dialler: Dialler,
    stream: Option<TcpStream>,
    interest: Interest,
    /// The values of the last read; `None` ends the values of a line.
    arrived: Vec<Option<(Channel, Number)>>,
    news: News,
    counts: Counts,
    zone: TimeZone,
    /// The time when the program's next timer expires.
    due: Nanos,
}

impl Host<'_> {
    fn turn(&mut self, pace: &mut Pace) -> io::Result<()> {
        let network = match &self.stream {
            Some(_) => self.client.deadline(),
            None => self.dialler.deadline(),
        };
        let deadline = pace.due().min(self.due).min(network).min(self.hosting.end);
        self.set.wait(self.hosting.clock, deadline)?;
        let now = self.hosting.clock.now();
        if self.stream.is_none() {
            self.dial(now)?;
        }
        if self.set.ready().iter().any(|ready| ready.is_readable) {
            let read = self.read(now);
            self.hang_up_if(now, read);
        }
        if pace.take(now) || now >= self.due {
            self.scan(now);
        }
        let written = self.write(now);
        self.hang_up_if(now, written);
        let checked = self.client.check(now).map_err(|error| error.to_string());
        self.hang_up_if(now, checked);
        self.wait_for_room()
    }

    fn dial(&mut self, now: Nanos) -> io::Result<()> {
        match self.dialler.turn(now) {
            None => {}
            Some(Ok(stream)) => {
                self.set.add(SOCKET, &stream, Interest::Read)?;
                self.interest = Interest::Read;
                self.stream = Some(stream);
                self.client.connected(now);
            }
            Some(Err(error)) => {
                let address = self.hosting.address;
                self.news.tell_line(format!(
                    "there is no dispatcher at {address} ({error}); start tickbus dispatch, or correct --dispatcher"
                ));
            }
        }
        Ok(())
    }

    fn read(&mut self, now: Nanos) -> Result<(), String> {
        let mut buffer = [0; 4096];
        // A dispatcher that never pauses must not keep the program from scanning.
        for _ in 0..16 {
            let Some(stream) = &mut self.stream else {
                break;
            };
            match stream.read(&mut buffer) {
                Ok(0) => return Err("the dispatcher has closed the connection".to_owned()),
                Ok(count) => self.hear(now, &buffer[..count])?,
                Err(error) if is_for_later(&error) => break,
                Err(error) => return Err(format!("the connection broke ({error})")),
            }
        }
        Ok(())
    }

    fn hear(&mut self, now: Nanos, bytes: &[u8]) -> Result<(), String> {
        let (arrived, news, counts) = (&mut self.arrived, &mut self.news, &mut self.counts);
        let name = &self.client.profile().name.clone();
        let address = self.hosting.address;
        let heard = self.client.hear(now, bytes, &mut |event| match event {
            Event::Value(channel, value) => arrived.push(Some((channel, value))),
            Event::Lost(channel) => arrived.push(Some((channel, Number::ZERO))),
            Event::LineEnd => arrived.push(None),
            Event::Identified => {
                counts.joined += 1;
                news.tell_line(format!("{name} has joined the dispatcher at {address}"));
            }
            Event::Connected(cable) => news.tell_cable(&cable.to_string(), "connected"),
            Event::Refused { cable, code, text } => {
                let what = cable.map(ToString::to_string);
                news.tell_cable(
                    what.as_deref().unwrap_or("a line"),
                    &format!("refused: {code} {text}"),
                );
            }
            Event::Device(_) | Event::ListEnd | Event::Settled => {}
        });
        let arrived = std::mem::take(&mut self.arrived);
        for line in arrived.split(Option::is_none) {
            let values = || line.iter().flatten();
            if values().any(|(channel, value)| self.terminal.would_lose_an_edge(*channel, value)) {
                // As if the scan had come between the two lines.
                self.scan(now);
                self.write(now)?;
            }
            for (channel, value) in values() {
                // A line can contain an input more than once.
                if self.terminal.would_lose_an_edge(*channel, value) {
                    self.scan(now);
                    self.write(now)?;
                }
                self.terminal.set(*channel, value);
            }
        }
        self.arrived = arrived;
        self.arrived.clear();
        heard.map_err(|error| error.to_string())
    }

    fn scan(&mut self, now: Nanos) {
        self.due = self.terminal.controller.scan(now, wall_time(&self.zone));
        self.terminal.changed.fill(false);
        self.counts.scans += 1;
        let (controller, client) = (&self.terminal.controller, &mut self.client);
        let mut set = |kind, number, value: f64| {
            // A number that is too large to send is skipped; the last one stays.
            if let Some(value) = Number::of(value) {
                client.set(Channel { kind, number }, value);
            }
        };
        for (number, is_on) in (1..).zip(controller.outputs()) {
            let volts = if *is_on { ON_VOLTS } else { 0 };
            set(Kind::DigitalOutput, number, volts.into());
        }
        for (number, value) in (1..).zip(controller.analog_outputs()) {
            set(Kind::AnalogOutput, number, *value);
        }
    }

    fn write(&mut self, now: Nanos) -> Result<(), String> {
        let Some(stream) = &mut self.stream else {
            return Ok(());
        };
        self.client.turn(now);
        while !self.client.to_write().is_empty() {
            match stream.write(self.client.to_write()) {
                Ok(count) => self.client.wrote(now, count),
                Err(error) if is_for_later(&error) => break,
                Err(error) => return Err(format!("the connection broke ({error})")),
            }
        }
        Ok(())
    }

    fn wait_for_room(&mut self) -> io::Result<()> {
        let Some(stream) = &self.stream else {
            return Ok(());
        };
        let interest = if self.client.to_write().is_empty() {
            Interest::Read
        } else {
            Interest::ReadWrite
        };
        if self.interest != interest {
            self.set.change(SOCKET, stream, interest)?;
            self.interest = interest;
        }
        Ok(())
    }

    fn hang_up_if(&mut self, now: Nanos, result: Result<(), String>) {
        let Err(why) = result else { return };
        let Some(stream) = self.stream.take() else {
            return;
        };
        self.set.remove(SOCKET, &stream);
        self.dialler.pause(now);
        self.news.tell_line(format!("disconnected: {why}"));
        self.news.cables.clear();
        self.terminal.pull_all_cables();
    }
}

/// The controller's terminals: volts and numbers.
struct Terminal {
    controller: Controller,
    inputs: Vec<bool>,
    /// The inputs that have switched since the last scan.
    changed: Vec<bool>,
}

impl Terminal {
    fn new(controller: Controller) -> Self {
        let count = controller.terminals().inputs;
        Self {
            controller,
            inputs: vec![false; count],
            changed: vec![false; count],
        }
    }

    /// Returns the new state of an input.
    fn is_on(&self, number: u16, value: &Number) -> bool {
        level(value.to_f64()).unwrap_or(self.inputs[usize::from(number) - 1])
    }

    /// Returns true if this input would switch for the second time since the last scan.
    fn would_lose_an_edge(&self, channel: Channel, value: &Number) -> bool {
        let Channel { kind, number } = channel;
        let place = usize::from(number).wrapping_sub(1);
        kind == Kind::DigitalInput
            && self.changed[place]
            && self.is_on(number, value) != self.inputs[place]
    }

    fn set(&mut self, channel: Channel, value: &Number) {
        let Channel { kind, number } = channel;
        if kind == Kind::AnalogInput {
            self.controller
                .set_analog_input(number.into(), value.to_f64());
        } else {
            let is_on = self.is_on(number, value);
            self.switch(number.into(), is_on);
        }
    }

    fn switch(&mut self, number: usize, is_on: bool) {
        let place = number - 1;
        self.changed[place] |= self.inputs[place] != is_on;
        self.inputs[place] = is_on;
        self.controller.set_input(number, is_on);
    }

    fn pull_all_cables(&mut self) {
        for number in 1..=self.inputs.len() {
            self.switch(number, false);
        }
        for number in 1..=self.controller.terminals().analog_inputs {
            self.controller.set_analog_input(number, 0.0);
        }
    }
}

/// The last reports, so that they are not repeated.
#[derive(Default)]
struct News {
    line: String,
    cables: Vec<(String, String)>,
}

impl News {
    fn tell_line(&mut self, line: String) {
        if self.line != line {
            say(&line);
            self.line = line;
        }
    }

    fn tell_cable(&mut self, cable: &str, state: &str) {
        let known = self.cables.iter_mut().find(|(known, _)| known == cable);
        match known {
            Some((_, known)) if known == state => return,
            Some((_, known)) => state.clone_into(known),
            None => self.cables.push((cable.to_owned(), state.to_owned())),
        }
        say(&format!("{cable}: {state}"));
    }
}

/// Returns the day of the week and the time of day in a time zone.
fn wall_time(zone: &TimeZone) -> WallTime {
    let now = system_time();
    let seconds = i64::try_from(now.as_secs()).unwrap_or_default();
    let Ok(timestamp) = Timestamp::from_second(seconds) else {
        return WallTime::default();
    };
    let local = zone.to_datetime(timestamp);
    let day = local.weekday().to_monday_zero_offset();
    let since_midnight = Duration::new(
        u64::from(local.hour().unsigned_abs()) * 3600
            + u64::from(local.minute().unsigned_abs()) * 60
            + u64::from(local.second().unsigned_abs()),
        now.subsec_nanos(),
    );
    WallTime {
        day: usize::from(day.unsigned_abs()),
        time: Nanos(i64::try_from(since_midnight.as_nanos()).unwrap_or_default()),
    }
}

#[cfg(test)]
mod tests;
