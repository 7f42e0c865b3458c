//! `tickbus dispatch`: the dispatcher of a virtual laboratory.

use std::io;
use std::path::PathBuf;
use std::thread;

use super::Outcome;
use super::host::span;
use super::lab::{self, address};
use tickbus_base::os::raise_open_files;
use tickbus_base::time::{Clock as _, Monotonic, Nanos, Stop, system_time};
use tickbus_dispatcher::tcp::{Hosting, Listener};
use tickbus_dispatcher::{Dispatcher, Door, Identity, OnLoss, PORT, PatchFile, Post, Settings};
use tickbus_dispatcher_zenoh::{Failure, Options, computer_name};
use tickbus_fieldbus::tcp::Address;

/// Serve a virtual laboratory: controllers and machines join over lines of text, and are patched together.
///
/// Clients are programs of your own, or telnet; docs/dispatcher.md tells what they may say.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// Where clients connect; port 0 lets the system choose one. 127.0.0.1 is this machine alone, 0.0.0.0 all of its
    /// networks.
    #[arg(long, value_name = "HOST:PORT", default_value_t = Address::local(PORT), value_parser = address)]
    listen: Address,

    /// The file in which connections survive a restart; it is made with the first one.
    #[arg(long, value_name = "FILE", default_value = "patch.toml")]
    patch: PathBuf,

    /// Leave an input its last value when its source is gone; without this it gets 0.
    #[arg(long)]
    hold: bool,

    /// Disconnect a client after this time without a line from it.
    #[arg(long, value_name = "TIME", default_value = "60s", value_parser = span)]
    idle: Nanos,

    /// Stop after this time; without it, on Ctrl-C.
    #[arg(long, value_name = "TIME", value_parser = span)]
    duration: Option<Nanos>,

    /// Join the dispatchers of other hosts into one laboratory, over Zenoh: clients and patches span hosts by name.
    #[arg(long)]
    zenoh: bool,

    /// Where a Zenoh router or another dispatcher listens, such as tcp/192.168.0.10:7447; may be given several times.
    /// Others in the local network are found by multicast.
    #[arg(long, value_name = "ENDPOINT", requires = "zenoh")]
    zenoh_connect: Vec<String>,

    /// Where Zenoh listens for other dispatchers, such as tcp/0.0.0.0:7447; without this, on a port that it chooses.
    #[arg(long, value_name = "ENDPOINT", requires = "zenoh")]
    zenoh_listen: Vec<String>,

    /// The name of the laboratory; dispatchers of other laboratories on the same network are not seen.
    #[arg(long, value_name = "NAME", requires = "zenoh", default_value = "lab")]
    lab: String,
    /// Serve the patch bay, a page on which the laboratory is seen and patched, and print its address.
    #[cfg(feature = "page")]
    #[arg(long, value_name = "HOST:PORT", num_args = 0..=1, default_missing_value = "127.0.0.1:20080", value_parser = address)]
    page: Option<Address>,
    /// The file in which the token of the page survives a restart; it is made if there is none.
    #[cfg(feature = "page")]
    #[arg(long, value_name = "FILE", requires = "page")]
    page_token_file: Option<PathBuf>,
}

fn say(line: &str) {
    lab::say("dispatch", line);
}

fn settings(arguments: &Arguments) -> Settings {
    Settings {
        idle: arguments.idle,
        on_loss: if arguments.hold {
            OnLoss::Hold
        } else {
            OnLoss::FailSafe
        },
        ..Settings::default()
    }
}

/// Connects the dispatcher to others of the same laboratory; returns the link to them.
fn join(
    arguments: &Arguments,
    dispatcher: &mut Dispatcher,
    door: &Door,
) -> Result<Box<dyn Post>, Failure> {
    let options = Options {
        laboratory: arguments.lab.clone(),
        connect: arguments.zenoh_connect.clone(),
        listen: arguments.zenoh_listen.clone(),
    };
    let joined = tickbus_dispatcher_zenoh::join(&options, door)?;
    let elapsed = u64::try_from(Monotonic::shared().now().0).unwrap_or_default();
    let since = u64::try_from(system_time().as_nanos()).unwrap_or_default();
    let since = since.saturating_sub(elapsed);
    let identity = Identity::new(joined.host, &computer_name(), since);
    let (lab, name) = (&arguments.lab, &identity.name);
    say(&format!("in the laboratory {lab} as {name}"));
    dispatcher.federate(identity);
    Ok(joined.post)
}

/// Serves the patch bay and prints its address.
#[cfg(feature = "page")]
fn serve_page(
    address: &Address,
    token_file: Option<&std::path::Path>,
    door: &Door,
) -> io::Result<tickbus_web::Serving> {
    let mut room = tickbus_web::Room::bind(address, tickbus_web::Limits::default())?;
    if let Some(file) = token_file {
        room.keep_token(file)?;
    }
    say(&format!("page at {}", room.url()));
    let site = tickbus_patch_bay::PatchBay::new(door.clone());
    room.serve(std::sync::Arc::new(site), Monotonic::shared())
}

/// Stops the dispatcher after `span`, unless the process ends earlier.
fn stop_after(span: Nanos, stop: &Stop) -> io::Result<()> {
    let stop = stop.clone();
    let clock = Monotonic::shared();
    let end = clock.now() + span;
    let timer = thread::Builder::new().name("tickbus-duration".to_owned());
    timer.spawn(move || {
        clock.wait_until(end, &Stop::new());
        stop.stop();
    })?;
    Ok(())
}

pub(super) fn run(arguments: &Arguments) -> Outcome {
    let file = PatchFile::new(&arguments.patch);
    let patch = match file.load() {
        Ok(patch) => patch,
        Err(mistakes) => {
            eprintln!("{mistakes}\ndispatch: failed mistakes={}", mistakes.len());
            return Outcome::WrongInput;
        }
    };
    let stop = match lab::until_ctrl_c("dispatch") {
        Ok(stop) => stop,
        Err(outcome) => return outcome,
    };
    if let Some(span) = arguments.duration
        && let Err(error) = stop_after(span, &stop)
    {
        eprintln!("dispatch: --duration cannot be kept: {error}");
        return Outcome::BusFailed;
    }
    raise_open_files();
    let failed = |reason: String| {
        say(&format!("failed reason=\"{reason}\""));
        Outcome::BusFailed
    };
    let mut listener = match Listener::bind(&arguments.listen) {
        Ok(listener) => listener,
        Err(error) => {
            let address = &arguments.listen;
            return failed(format!(
                "cannot listen on {address} ({error}); end the program that has this port, or give another --listen"
            ));
        }
    };
    let mut dispatcher = Dispatcher::new(settings(arguments), patch);
    let door = Door::new(&stop);
    if arguments.zenoh {
        match join(arguments, &mut dispatcher, &door) {
            Ok(post) => listener = listener.with_post(post),
            Err(Failure::Options(mistake)) => {
                eprintln!("dispatch: {mistake}");
                return Outcome::Usage;
            }
            Err(Failure::Network(reason)) => return failed(reason),
        }
    }
    let connections = dispatcher.patch().len();
    say(&format!(
        "{connections} connections from {}",
        arguments.patch.display()
    ));
    say(&format!("listening on {}", listener.address()));
    #[cfg(feature = "page")]
    let _serving = match &arguments.page {
        None => None,
        Some(address) => match serve_page(address, arguments.page_token_file.as_deref(), &door) {
            Ok(serving) => Some(serving),
            Err(error) => {
                return failed(format!(
                    "the page cannot be served on {address} ({error}); end the program that has this port, or give \
                     another --page"
                ));
            }
        },
    };
    let hosting = Hosting {
        clock: &*Monotonic::shared(),
        stop: &stop,
        door: Some(&door),
        patch_file: Some(&file),
        news: &mut say,
    };
    if let Err(error) = listener.run(&mut dispatcher, hosting) {
        return failed(format!("the system cannot wait for sockets: {error}"));
    }
    let traffic = dispatcher.traffic();
    say(&format!(
        "ok lines={} values={} overtaken={} refused={} connections={}",
        traffic.lines,
        traffic.values,
        traffic.overtaken,
        traffic.refused,
        dispatcher.patch().len()
    ));
    Outcome::Done
}
