//! `tickbus play RUN FILE`: a recording is the machine.

mod player;

use std::path::PathBuf;
use std::sync::Arc;

use super::Outcome;
use super::host::{self, Job, span};
use player::{AtEnd, Player};
use tickbus_base::time::Nanos;
use tickbus_driver_cfg::{CommandLineEnd, Config, Kinds};
use tickbus_fieldbus::Role;
use tickbus_plc::Program as _;
use tickbus_record::FileClaim;

/// Play the %I of a recording to the PLC, as the machine of a bus.
///
/// The first tick of the recording is played at once, and every other one at the same distance from it as it was recorded: by the clock, or on a bus with virtual time by that. At the end of the recording the command ends with the exit code 0. --record FILE records what the PLC answers.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// The recording, whose name ends in .vcd or .csv.
    #[arg(value_name = "RUN")]
    recording: PathBuf,

    /// The driver.cfg of the device.
    file: PathBuf,

    /// The interval at which the recording is looked at.
    #[arg(long, value_name = "TIME", default_value = "1ms", value_parser = span)]
    tick: Nanos,

    /// Begin again at the end of the recording, one tick after its last one.
    #[arg(long = "loop", conflicts_with = "hold")]
    again: bool,

    /// Keep the last values at the end of the recording, until stopped.
    #[arg(long)]
    hold: bool,

    /// Begin when the PLC is there; the fail-safe values of FILE come before that.
    #[arg(long)]
    wait: bool,

    #[command(flatten)]
    host: host::Hosting,
}

pub(super) fn run(arguments: &Arguments, kinds: &'static Kinds) -> Outcome {
    const TITLE: &str = "play";
    let format = &arguments.host.format;
    let role = Role::Device;
    let asked = CommandLineEnd { role, moved: true };
    let config = match Config::load_as(&arguments.file, Some(asked), kinds) {
        Ok(config) => config,
        Err(mistakes) => return format.refuse(TITLE, &mistakes),
    };
    let wrong = |why: &dyn std::fmt::Display| {
        format.fail(TITLE, &format!("{TITLE}: {why}"), Outcome::WrongInput)
    };
    // Keeps the recording of this run from being written over the one that is played.
    let _claim = match FileClaim::to_replay(&arguments.recording) {
        Ok(claim) => claim,
        Err(error) => return wrong(&error),
    };
    let at_end = match (arguments.again, arguments.hold) {
        (true, _) => AtEnd::Again,
        (_, true) => AtEnd::Hold,
        _ => AtEnd::End,
    };
    let table = Arc::new(config.table);
    let opened = Player::open(&arguments.recording, &table, at_end, arguments.wait);
    let (player, unknown) = match opened {
        Ok(opened) => opened,
        Err(error) => return wrong(&error),
    };
    for line in unknown.lines() {
        // The recording is played even if the reader of stdout is gone.
        let _ = arguments.host.say(&format!("{TITLE}: {line}\n"));
    }
    let report = player.report().expect("a player has one");
    let job = Job {
        has_replies: false,
        bus: None,
        title: TITLE,
        file: &arguments.file,
        kinds,
        role,
        program: Box::new(player),
        interval: arguments.tick,
        keeps_lists: true,
    };
    match host::run(job, &arguments.host) {
        // The bus has not failed: the recording is damaged.
        Outcome::BusFailed if report.failure().is_some() => Outcome::WrongInput,
        outcome => outcome,
    }
}
