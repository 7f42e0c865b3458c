//! `tickbus dispatch`: the dispatcher of a virtual laboratory.

use std::io::{self, Write as _};
use std::path::PathBuf;

use super::Outcome;
use super::host::span;
use tickbus_base::os::raise_open_files;
use tickbus_base::time::{Monotonic, Nanos, Stop};
use tickbus_dispatcher::tcp::{Hosting, Listener};
use tickbus_dispatcher::{Dispatcher, OnLoss, PatchFile, Settings};
use tickbus_fieldbus::tcp::Address;

/// Serve a virtual laboratory: controllers and machines join over lines of text, and are patched together.
///
/// Clients are programs of your own, or telnet; docs/dispatcher.md tells what they may say.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// Where clients connect; port 0 lets the system choose one. 127.0.0.1 is this machine alone, 0.0.0.0 all of its
    /// networks.
    #[arg(long, value_name = "HOST:PORT", default_value = "127.0.0.1:20070", value_parser = address)]
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
}

fn address(text: &str) -> Result<Address, String> {
    text.parse()
        .map_err(|mistake: tickbus_base::Mistake| mistake.to_string())
}

/// Prints a line. If the reader of stdout is gone, the laboratory goes on.
fn say(line: &str) {
    let mut out = io::stdout().lock();
    let _ = writeln!(out, "dispatch: {line}").and_then(|()| out.flush());
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
    let stop = Stop::new();
    if let Err(error) = ctrlc::set_handler({
        let stop = stop.clone();
        move || stop.stop()
    }) {
        eprintln!("dispatch: Ctrl-C cannot be caught: {error}");
        return Outcome::BusFailed;
    }
    raise_open_files();
    let failed = |reason: String| {
        say(&format!("failed reason=\"{reason}\""));
        Outcome::BusFailed
    };
    let listener = match Listener::bind(&arguments.listen) {
        Ok(listener) => listener,
        Err(error) => {
            let address = &arguments.listen;
            return failed(format!(
                "cannot listen on {address} ({error}); end the program that has this port, or give another --listen"
            ));
        }
    };
    let connections = patch.len();
    say(&format!(
        "{connections} connections from {}",
        arguments.patch.display()
    ));
    say(&format!("listening on {}", listener.address()));
    let settings = Settings {
        idle: arguments.idle,
        on_loss: if arguments.hold {
            OnLoss::Hold
        } else {
            OnLoss::FailSafe
        },
        ..Settings::default()
    };
    let mut dispatcher = Dispatcher::new(settings, patch);
    let hosting = Hosting {
        clock: &*Monotonic::shared(),
        stop: &stop,
        door: None,
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
