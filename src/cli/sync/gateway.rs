//! `tickbus sync gateway FILE`: a real PLC, on any bus, as a client of a run.

use std::num::NonZeroU32;
use std::path::PathBuf;
use std::sync::Arc;

use super::{report, say, stop_on_ctrl_c};
use crate::cli::Outcome;
use crate::cli::host::{PageAddress, page_address, show, span};
use tickbus_base::time::{Clock as _, Monotonic, Nanos};
use tickbus_driver_cfg::{CommandLineEnd, Config, Kinds};
use tickbus_fieldbus::{LinkState, Role};
use tickbus_gateway::{Gateway, GatewayOptions};
use tickbus_virtual_time::Meeting;

/// The interval at which the state of the PLC's line is checked until there is one.
const LOOK: Nanos = Nanos::from_millis(10);

/// Let a real PLC take part in a run, over its own bus.
///
/// The driver.cfg is the one of the machine's end of that bus, with the signals sync.go, sync.time and sync.done;
/// docs/sdsp.md tells what the PLC does with them. All other signals are variables of the run, by their names.
#[derive(Debug, clap::Args)]
pub(in crate::cli) struct Arguments {
    /// The driver.cfg of the PLC's bus.
    file: PathBuf,

    /// Where the server of the run listens.
    #[arg(long, value_name = "HOST:PORT|unix:PATH", value_parser = address)]
    server: Meeting,

    /// The PLC's name in the run [default: the driver's, with " PLC" behind it].
    #[arg(long, value_name = "NAME")]
    client: Option<String>,

    /// How many steps of the server one step of the PLC takes.
    #[arg(long, value_name = "NUMBER", default_value = "1")]
    multiple: NonZeroU32,

    /// Serve the live page, and print its address; without HOST:PORT, at the address in the page table of FILE, or at
    /// 127.0.0.1:20080.
    #[arg(long, value_name = "HOST:PORT", num_args = 0..=1, default_missing_value = "", value_parser = page_address)]
    page: Option<PageAddress>,

    /// How long the PLC may take for a step, and the PLC and the server to appear at first.
    #[arg(long, value_name = "TIME", default_value = "10s", value_parser = span)]
    timeout: Nanos,
}

/// Reads the address of a run's server.
pub(super) fn address(text: &str) -> Result<Meeting, String> {
    let meeting: Meeting = text.parse().map_err(|wrong| format!("{wrong}"))?;
    meeting.check_dialled().map_err(|wrong| wrong.to_string())?;
    Ok(meeting)
}

pub(super) fn run(arguments: &Arguments, kinds: &'static Kinds) -> Outcome {
    let asked = CommandLineEnd {
        role: Role::Device,
        moved: false,
    };
    let mut config = match Config::load_as(&arguments.file, Some(asked), kinds) {
        Ok(config) => config,
        Err(mistakes) => {
            eprintln!("{mistakes}\nsync: failed mistakes={}", mistakes.len());
            return Outcome::WrongInput;
        }
    };
    if let Some(page) = &arguments.page {
        page.ask(&mut config);
    }
    let options = GatewayOptions {
        client: arguments.client.clone(),
        multiple: arguments.multiple,
        timeout: arguments.timeout,
    };
    let Some(stop) = stop_on_ctrl_c() else {
        return Outcome::BusFailed;
    };
    let clock = Monotonic::shared();
    let mut gateway = match Gateway::open(&config, options, Arc::clone(&clock) as _, &stop) {
        Ok(gateway) => gateway,
        Err(error) => {
            eprintln!("sync: {error}");
            return if error.is_wrong_input() {
                Outcome::WrongInput
            } else {
                Outcome::BusFailed
            };
        }
    };
    let _place = match show("sync", &config, || gateway.watch()) {
        Ok(place) => place,
        Err(outcome) => return outcome,
    };
    while gateway.link().state == LinkState::Closed && !stop.is_stopped() {
        clock.wait_until(clock.now() + LOOK, &stop);
    }
    say(&format!("the line of the PLC: {}", gateway.link().reason));
    if let Err(why) = gateway.await_plc() {
        say(&format!("failed reason=\"{why}\""));
        return Outcome::BusFailed;
    }
    say("the PLC is there");
    let outcome = gateway.take_part(&arguments.server);
    gateway.close();
    report(outcome)
}
