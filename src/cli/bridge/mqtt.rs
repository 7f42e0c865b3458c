//! `tickbus bridge mqtt FILE`: the topics of an MQTT broker as the channels of a client of the dispatcher.

use std::path::PathBuf;

use super::say;
use crate::cli::Outcome;
use tickbus_base::time::Stop;
use tickbus_bridge::mqtt::Map;

/// Publish inputs to an MQTT broker, and set outputs from it.
///
/// The map file assigns channels to topics; docs/dispatcher.md has an example. The bridge reconnects when the broker or
/// the dispatcher was gone.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// The map file: broker, dispatcher, and a topic for each channel.
    file: PathBuf,
}

pub(super) fn run(arguments: &Arguments, stop: &Stop) -> Outcome {
    match Map::load(&arguments.file) {
        Ok(map) => carry(map, stop),
        Err(mistakes) => {
            eprintln!("{mistakes}\nbridge: failed mistakes={}", mistakes.len());
            Outcome::WrongInput
        }
    }
}

#[cfg(feature = "mqtt")]
fn carry(map: Map, stop: &Stop) -> Outcome {
    use tickbus_base::time::Monotonic;
    use tickbus_bridge::mqtt::{Hosting, Mapping, run};

    let failed = |reason: String| {
        say(&format!("failed reason={reason:?}"));
        Outcome::BusFailed
    };
    let mut mapping = match Mapping::new(map) {
        Ok(mapping) => mapping,
        Err(mistake) => return failed(mistake.to_string()),
    };
    let hosting = Hosting {
        clock: Monotonic::shared(),
        stop,
        news: &mut say,
    };
    if let Err(error) = run(&mut mapping, hosting) {
        if error.kind() == std::io::ErrorKind::InvalidInput {
            eprintln!("bridge: {error}");
            return Outcome::WrongInput;
        }
        return failed(format!(
            "the system has no more sockets or threads: {error}"
        ));
    }
    let traffic = mapping.traffic();
    say(&format!(
        "ok published={} received={} refused={} overtaken={}",
        traffic.published, traffic.received, traffic.refused, traffic.overtaken
    ));
    Outcome::Done
}

#[cfg(not(feature = "mqtt"))]
fn carry(_map: Map, _stop: &Stop) -> Outcome {
    say("failed reason=\"this tickbus was built without MQTT; build it with --features mqtt\"");
    Outcome::WrongInput
}
