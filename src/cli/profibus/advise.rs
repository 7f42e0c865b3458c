//! `tickbus profibus advise FILE`: measures how fast this machine answers, and advises a slot time.

use std::fs;
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::time::Duration;

use crate::cli::Outcome;
use tickbus_base::os::PseudoTerminal;
use tickbus_base::time::{Clock as _, Monotonic, Nanos, TimeHistogram};
use tickbus_bus_profibus::Options;
use tickbus_bus_profibus::advice::{advise, table};
use tickbus_bus_profibus::telegram::{Control, Frame};
use tickbus_driver::Driver;
use tickbus_driver_cfg::{Config, Kinds};

/// At this rate the idle time before an answer, which does not count, is short.
const BAUD: u32 = 500_000;

/// The longest time to wait for an answer.
const PATIENCE: Duration = Duration::from_millis(200);

/// The pause between two requests.
const PAUSE: Duration = Duration::from_micros(500);

/// Measure how fast this machine answers, and print which `MaxTsdr` and slot time the PLC's project should have.
///
/// The stations of FILE answer on a pseudo-terminal, so no line is needed. What the real port adds is taken from its
/// driver, if that says it.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// The driver.cfg with the "profibus-device".
    file: PathBuf,

    /// How many requests are answered.
    #[arg(long, value_name = "NUMBER", default_value_t = 5000, value_parser = clap::value_parser!(u32).range(1..))]
    count: u32,
}

pub(super) fn run(arguments: &Arguments, kinds: &'static Kinds) -> Outcome {
    let mut config = match Config::load(&arguments.file, kinds) {
        Ok(config) => config,
        Err(mistakes) => {
            eprintln!("{mistakes}\nprofibus: failed mistakes={}", mistakes.len());
            return Outcome::WrongInput;
        }
    };
    let kind = config.bus.kind();
    let Some(options) = config.bus.downcast_mut::<Options>() else {
        eprintln!("profibus: the bus is \"{kind}\"; name the driver.cfg of a \"profibus-device\"");
        return Outcome::WrongInput;
    };
    let Some(address) = options.stations().next().map(|station| station.address) else {
        eprintln!("profibus: there is no station; write address = 3 and its gsd");
        return Outcome::WrongInput;
    };
    let (held_back, port) = held_back(Path::new(&options.line.device));
    let line = PseudoTerminal::open().map(|(line, device)| {
        options.line.device = device.display().to_string();
        options.line.settings.baud = BAUD;
        // The latest answer that the rate used here allows.
        options.line.max_tsdr = u16::MAX;
        line
    });
    config.record = None;
    config.faults.clear();
    let replies = match line.and_then(|line| measure(config, line, address, arguments.count)) {
        Ok(replies) => replies,
        Err(error) => {
            eprintln!("profibus: the time of an answer cannot be measured: {error}");
            return Outcome::BusFailed;
        }
    };
    let _ = write!(
        io::stdout().lock(),
        "from the last byte of a request to the first of its answer, on a pseudo-terminal:\n{}\
         {} requests, median {}, 99.9 % within {}, longest {}\n{port}\n\n{}",
        replies.chart(),
        replies.count(),
        replies.quantile(0.5).rounded(),
        replies.quantile(0.999).rounded(),
        replies.longest().rounded(),
        table(&advise(&replies, held_back)),
    );
    Outcome::Done
}

/// Returns how long the driver of a port holds bytes back, and a line about it.
fn held_back(device: &Path) -> (Nanos, String) {
    let name = fs::canonicalize(device).ok();
    let name = name.as_deref().and_then(Path::file_name);
    let shown = device.display();
    let Some(name) = name else {
        return (
            Nanos::ZERO,
            format!("{shown} is not there now, and adds nothing to this"),
        );
    };
    let file = Path::new("/sys/bus/usb-serial/devices")
        .join(name)
        .join("latency_timer");
    let timer = fs::read_to_string(file).ok();
    match timer.and_then(|text| text.trim().parse().ok()) {
        Some(millis) => (
            Nanos::from_millis(millis),
            format!("{shown} holds bytes back for up to {millis} ms more (latency_timer)"),
        ),
        None => (
            Nanos::ZERO,
            format!(
                "{shown} does not say what it adds; leave room for that, above all with a USB adapter"
            ),
        ),
    }
}

fn measure(
    config: Config,
    mut line: PseudoTerminal,
    address: u8,
    count: u32,
) -> io::Result<TimeHistogram> {
    let clock = Monotonic::shared();
    let failed = |error: &dyn std::fmt::Display| io::Error::other(error.to_string());
    let driver = Driver::open(config, clock.clone()).map_err(|error| failed(&error))?;
    let mut request = Vec::new();
    Frame {
        destination: address,
        source: if address == 2 { 1 } else { 2 },
        control: Control(0x40 | Control::FDL_STATUS),
        dsap: None,
        ssap: None,
        data: &[],
    }
    .append(&mut request);
    let mut replies = TimeHistogram::new();
    let mut answer = [0; 64];
    // The station listens first, and the port may not be open yet.
    let mut vain = 0;
    while replies.count() < u64::from(count) {
        // Taken before writing: the answer may have arrived when the call returns.
        let sent = clock.now();
        line.write_all(&request)?;
        if line.read_within(&mut answer, PATIENCE)? > 0 {
            replies.record(clock.now() - sent);
            // Reads the rest of an answer that arrives in pieces.
            while line.read_within(&mut answer, PAUSE)? > 0 {}
        } else {
            // Once the station has answered, a missing answer counts as one that came too late.
            if replies.count() > 0 {
                replies.record(clock.now() - sent);
            }
            vain += 1;
            if vain > 20 {
                let link = driver.link();
                return Err(failed(&format!(
                    "the station does not answer; {}",
                    link.reason
                )));
            }
        }
    }
    driver.close();
    Ok(replies)
}
