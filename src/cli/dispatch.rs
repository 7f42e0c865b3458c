//! `tickbus dispatch`: the dispatcher of a virtual laboratory.

use std::io;
use std::path::PathBuf;
use std::thread;

use super::Outcome;
use super::host::span;
use super::lab::{self, address, key};
use tickbus_base::os::raise_open_files;
use tickbus_base::time::{Clock as _, Monotonic, Nanos, Stop, system_time};
use tickbus_dispatcher::tcp::{Hosting, Listener};
use tickbus_dispatcher::{
    Dispatcher, Door, Identity, Key, OnLoss, PORT, PatchFile, Post, Settings,
};
use tickbus_dispatcher_zenoh::{Failure, Options, computer_name};
use tickbus_net::Address;

/// Run a virtual laboratory: controllers and machines connect by a text protocol, and their channels are patched.
///
/// Clients are your own programs, or telnet; docs/dispatcher.md describes the protocol.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// The address to listen on; port 0 lets the system choose one. 127.0.0.1 accepts this machine only, 0.0.0.0 all
    /// networks.
    #[arg(long, value_name = "HOST:PORT", default_value_t = Address::local(PORT), value_parser = address)]
    listen: Address,

    /// The file that keeps the connections over a restart; it is created with the first one.
    #[arg(long, value_name = "FILE", default_value = "patch.toml")]
    patch: PathBuf,

    /// Keep the last value of an input whose source is gone [default: set it to 0].
    #[arg(long)]
    hold: bool,

    /// Disconnect a client that has sent no line for this time.
    #[arg(long, value_name = "TIME", default_value = "60s", value_parser = span)]
    idle: Nanos,

    /// Stop after this time [default: at Ctrl-C].
    #[arg(long, value_name = "TIME", value_parser = span)]
    duration: Option<Nanos>,

    /// The file with the key that each client states in its first line (KEY and the key): 16 to 128 characters.
    #[arg(long, value_name = "FILE", value_parser = key)]
    key_file: Option<Key>,

    /// Join dispatchers on other hosts into one laboratory, over Zenoh; patches name the clients of any host.
    #[arg(long)]
    zenoh: bool,

    /// The address of a Zenoh router or another dispatcher, such as tcp/192.168.0.10:7447; may be given several times.
    /// Dispatchers in the local network are found by multicast.
    #[arg(long, value_name = "ENDPOINT", requires = "zenoh")]
    zenoh_connect: Vec<String>,

    /// The address on which Zenoh listens for other dispatchers, such as tcp/0.0.0.0:7447 [default: a free port].
    #[arg(long, value_name = "ENDPOINT", requires = "zenoh")]
    zenoh_listen: Vec<String>,

    /// The name of the laboratory; dispatchers of other laboratories are ignored.
    #[arg(long, value_name = "NAME", requires = "zenoh", default_value = "lab")]
    lab: String,
    /// Serve the patch bay, a web page that shows and patches the laboratory, and print its address; without HOST:PORT,
    /// at 127.0.0.1:20080.
    #[cfg(feature = "page")]
    #[arg(long, value_name = "HOST:PORT", num_args = 0..=1, default_missing_value = "127.0.0.1:20080", value_parser = address)]
    page: Option<Address>,
    /// The file that keeps the page's token over a restart; it is created if it is missing.
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

/// The patch bay with the layout that is kept beside the patch.
#[cfg(feature = "page")]
fn patch_bay(patch: &std::path::Path, door: &Door) -> Result<tickbus_patch_bay::PatchBay, Outcome> {
    use tickbus_patch_bay::{LayoutRefused, PatchBay};

    let layout = PatchBay::layout_beside(patch);
    PatchBay::with_layout(door.clone(), &layout, |told| say(&told)).map_err(|refused| match refused
    {
        LayoutRefused::Mistakes(mistakes) => {
            eprintln!("{mistakes}\ndispatch: failed mistakes={}", mistakes.len());
            Outcome::WrongInput
        }
        LayoutRefused::System(error) => {
            say(&format!(
                "failed reason=\"the layout cannot be kept: {error}\""
            ));
            Outcome::BusFailed
        }
    })
}

/// Serves the patch bay and prints its address.
#[cfg(feature = "page")]
fn serve_page(
    address: &Address,
    token_file: Option<&std::path::Path>,
    site: tickbus_patch_bay::PatchBay,
) -> io::Result<tickbus_web::Serving> {
    let mut room = tickbus_web::Room::bind(address, tickbus_web::Limits::default())?;
    if let Some(file) = token_file {
        room.keep_token(file)?;
    }
    let invitation = room.invitation().for_terminal(crate::page::FLAG);
    lab::say_page("dispatch", &room.url(), &invitation);
    let pages = tickbus_web::Pages::of("Patch bay", std::sync::Arc::new(site));
    room.serve(pages, Monotonic::shared())
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
    if let Some(key) = &arguments.key_file {
        dispatcher.require(key.clone());
    }
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
        Some(address) => {
            let site = match patch_bay(&arguments.patch, &door) {
                Ok(site) => site,
                Err(outcome) => return outcome,
            };
            match serve_page(address, arguments.page_token_file.as_deref(), site) {
                Ok(serving) => Some(serving),
                Err(error) => {
                    return failed(format!(
                        "the page cannot be served on {address} ({error}); end the program that has this port, or give \
                         another --page"
                    ));
                }
            }
        }
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
    let wrong_keys = match dispatcher.wrong_keys() {
        0 => String::new(),
        count => format!(" wrong_keys={count}"),
    };
    say(&format!(
        "ok lines={} values={} overtaken={} refused={} connections={}{wrong_keys}",
        traffic.lines,
        traffic.values,
        traffic.overtaken,
        traffic.refused,
        dispatcher.patch().len()
    ));
    Outcome::Done
}
