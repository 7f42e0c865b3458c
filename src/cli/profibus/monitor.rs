//! `tickbus profibus monitor DEVICE`: shows who talks to whom.

use std::fs::File;
use std::io::{self, BufWriter, ErrorKind, Read as _, Write as _};
use std::path::{Path, PathBuf};

use crate::cli::Outcome;
use crate::cli::host::span;
use tickbus_base::os::{Interest, Marks, Parity, PollSet, SerialEar, SerialSettings};
use tickbus_base::time::{Clock as _, Monotonic, Nanos, Stop, system_time};
use tickbus_bus_profibus::monitor::{Heard, Monitor, words};
use tickbus_fieldbus::BusError;
use tickbus_net::serial;

/// The interval at which the table is printed.
const EVERY: Nanos = Nanos::from_secs(1);

/// The link type of pcap files with a private format. PROFIBUS has a registered one, 257, but Wireshark cannot open
/// files with it.
const LINKTYPE_USER0: u32 = 147;

/// Listen to a line: its stations, their states, and what goes wrong; never says a word itself.
///
/// Each second in which something happened, the stations are printed: how far each has come, requests, answers, those that
/// were missing, repeated or late, and how long answers took, as this machine saw it.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// The name of the serial port in the system.
    device: PathBuf,

    /// Bits per second.
    #[arg(long, value_name = "NUMBER", default_value_t = 19_200)]
    baud: u32,

    /// Print every telegram in words.
    #[arg(long)]
    telegrams: bool,

    /// Write every telegram in words to this file.
    #[arg(long, value_name = "FILE")]
    log: Option<PathBuf>,

    /// Write every telegram to this file, for Wireshark.
    #[arg(long, value_name = "FILE")]
    pcap: Option<PathBuf>,

    /// Stop after this time [default: at Ctrl-C].
    #[arg(long, value_name = "TIME", value_parser = span)]
    duration: Option<Nanos>,
}

pub(super) fn run(arguments: &Arguments) -> Outcome {
    match listen(arguments) {
        Ok(()) => Outcome::Done,
        Err(why) => {
            eprintln!("profibus: {why}");
            Outcome::BusFailed
        }
    }
}

/// The destinations of telegrams.
struct Keep {
    prints: bool,
    log: Option<BufWriter<File>>,
    pcap: Option<BufWriter<File>>,
}

fn listen(arguments: &Arguments) -> Result<(), String> {
    let settings = SerialSettings {
        baud: arguments.baud,
        parity: Parity::Even,
        two_stop_bits: false,
        seven_bits: false,
        rs485: false,
    };
    if arguments.baud == 0 {
        return Err("a line has a speed; write --baud 19200".to_owned());
    }
    let device = arguments.device.display().to_string();
    let failed = |error| BusError::from(error).to_string();
    let mut port = serial::listen(&device, settings, &*Monotonic::shared()).map_err(failed)?;
    let create = |file: &Option<PathBuf>| file.as_deref().map(create).transpose();
    let mut keep = Keep {
        prints: arguments.telegrams,
        log: create(&arguments.log)?,
        pcap: create(&arguments.pcap)?,
    };
    keep.begin().map_err(|error| error.to_string())?;
    let stop = Stop::new();
    let handler = {
        let stop = stop.clone();
        move || stop.stop()
    };
    ctrlc::set_handler(handler).map_err(|error| format!("Ctrl-C cannot be caught: {error}"))?;
    match watch(arguments, &mut port, &mut keep, &stop) {
        Err(Ending::Port(error)) => Err(failed(serial::gone(&device, error))),
        // The reader is gone: end as after Ctrl-C.
        Err(Ending::Output(error)) if error.kind() == ErrorKind::BrokenPipe => Ok(()),
        Err(Ending::Output(error)) => Err(format!("cannot write any more: {error}")),
        Ok(()) => Ok(()),
    }
}

/// Says why the monitor ends early.
enum Ending {
    Port(io::Error),
    Output(io::Error),
}

fn create(file: &Path) -> Result<BufWriter<File>, String> {
    let made = File::create(file).map(BufWriter::new);
    made.map_err(|error| format!("cannot write {}: {error}", file.display()))
}

fn watch(
    arguments: &Arguments,
    port: &mut SerialEar,
    keep: &mut Keep,
    stop: &Stop,
) -> Result<(), Ending> {
    let clock = Monotonic::shared();
    let begun = clock.now();
    let end = arguments.duration.map_or(Nanos::MAX, |span| begun + span);
    let mut set = PollSet::new(stop);
    set.add(0, port, Interest::Read).map_err(Ending::Port)?;
    let (mut marks, mut monitor) = (Marks::default(), Monitor::new(arguments.baud));
    let (mut next, mut told) = (begun + EVERY, String::new());
    let mut bytes = [0; 4096];
    while !stop.is_stopped() && clock.now() < end {
        set.wait(&*clock, next.min(end)).map_err(Ending::Port)?;
        let now = clock.now();
        match port.read(&mut bytes) {
            Ok(0) => return Err(Ending::Port(ErrorKind::UnexpectedEof.into())),
            Ok(count) => {
                let mut kept = Ok(());
                monitor.hear(now, marks.read(&bytes[..count]), |heard| {
                    if kept.is_ok() {
                        kept = keep.one(now - begun, heard);
                    }
                });
                kept.map_err(Ending::Output)?;
            }
            Err(error) if error.kind() == ErrorKind::WouldBlock => {}
            Err(error) => return Err(Ending::Port(error)),
        }
        if now >= next || now >= end {
            next = now + EVERY;
            let table = monitor.table();
            if table != told {
                let seconds = (now - begun).0 / 1_000_000_000;
                let shown = write!(io::stdout().lock(), "{seconds} s\n{table}\n");
                shown.map_err(Ending::Output)?;
                told = table;
            }
            keep.flush().map_err(Ending::Output)?;
        }
    }
    // Changes since the last table.
    let table = monitor.table();
    if table != told {
        write!(io::stdout().lock(), "{table}").map_err(Ending::Output)?;
    }
    keep.flush().map_err(Ending::Output)
}

impl Keep {
    /// Writes the header of the pcap file: nanoseconds, version 2.4.
    fn begin(&mut self) -> io::Result<()> {
        let Some(pcap) = &mut self.pcap else {
            return Ok(());
        };
        for word in [0xA1B2_3C4D, 0x0004_0002, 0, 0, 0xFFFF, LINKTYPE_USER0] {
            pcap.write_all(&u32::to_le_bytes(word))?;
        }
        Ok(())
    }

    fn one(&mut self, at: Nanos, heard: &Heard<'_>) -> io::Result<()> {
        if self.prints || self.log.is_some() {
            let said = heard.telegram.as_ref().map(words).unwrap_or_default();
            let both = if said.is_empty() || heard.note.is_empty() {
                ""
            } else {
                "  # "
            };
            let line = format!(
                "{:>14.6}  {said}{both}{}\n",
                at.as_micros() / 1e6,
                heard.note
            );
            if self.prints {
                io::stdout().lock().write_all(line.as_bytes())?;
            }
            if let Some(log) = &mut self.log {
                log.write_all(line.as_bytes())?;
            }
        }
        let Some(pcap) = self.pcap.as_mut().filter(|_| !heard.bytes.is_empty()) else {
            return Ok(());
        };
        let now = system_time();
        let length = u32::try_from(heard.bytes.len()).unwrap_or(u32::MAX);
        // The format stores seconds in 32 bits.
        let seconds = u32::try_from(now.as_secs()).unwrap_or(u32::MAX);
        for word in [seconds, now.subsec_nanos(), length, length] {
            pcap.write_all(&word.to_le_bytes())?;
        }
        pcap.write_all(heard.bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        for file in [&mut self.log, &mut self.pcap].into_iter().flatten() {
            file.flush()?;
        }
        Ok(())
    }
}
