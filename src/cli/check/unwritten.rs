//! The inputs of the PLC that nobody writes, and replies for them.

use std::collections::HashSet;
use std::fmt::Write as _;
use std::path::PathBuf;

use tickbus_base::toml_text::{Mistakes, load_text};
use tickbus_driver_cfg::Config;
use tickbus_fieldbus::Role;
use tickbus_fmi::foreign::{Join, Map, Unpacked};
use tickbus_image::signal::{Area, DataType};
use tickbus_import::{Point, propose};

/// The files of those that write `%I` signals apart from the driver.
#[derive(Debug, clap::Args)]
pub(super) struct Writers {
    /// With --unwritten: the simulator's control table, whose rows write some of them.
    #[arg(long, value_name = "FILE", requires = "unwritten")]
    table: Option<PathBuf>,

    /// With --unwritten: the FMU of the machine, whose outputs write some of them.
    #[arg(long, value_name = "FILE", requires = "unwritten")]
    fmu: Option<PathBuf>,
}

/// The `%I` signals that neither the driver makes (replies, axes, heartbeats) nor one of `writers` writes, with proposals
/// for them; empty at the PLC's end.
///
/// # Errors
///
/// The control table or the FMU cannot be read.
pub(super) fn report(config: &Config, writers: &Writers) -> Result<String, Mistakes> {
    let signals = &config.table.signals;
    if config.role == Role::Controller {
        return Ok(String::from(
            "unwritten: this end is the PLC, which reads %I\n",
        ));
    }
    let made = config.replies.iter().flat_map(|reply| &reply.outputs);
    let mut written: HashSet<usize> = made.copied().collect();
    written.extend(config.made_signals().into_iter().map(|(signal, _)| signal));
    if let Some(table) = &writers.table {
        let text = load_text(table)?;
        let names = destinations(&text, config.id);
        written.extend(names.filter_map(|name| config.table.position(name)));
    }
    if let Some(fmu) = &writers.fmu {
        let fmu = Unpacked::open(fmu)?;
        // An FMU of which no variable is a signal writes none.
        let join = Join::of(config, &fmu.model, &Map::default());
        let outputs = join.into_iter().flat_map(|join| join.outputs);
        written.extend(outputs.map(|joined| joined.signal));
    }
    let inputs = signals.iter().enumerate();
    let inputs = inputs.filter(|(_, signal)| signal.area == Area::Input);
    let count = inputs.clone().count();
    let open: Vec<_> = inputs
        .filter(|(index, _)| !written.contains(index))
        .collect();
    let mut out = String::new();
    for (_, signal) in &open {
        // Writing to a string cannot fail.
        let _ = writeln!(
            out,
            "unwritten {:9} {}",
            signal.address().to_string(),
            signal.name
        );
    }
    let points = signals.iter().enumerate().map(|(index, signal)| Point {
        name: &signal.name,
        comment: signal.comment(),
        is_input: signal.area == Area::Input,
        is_bool: signal.data_type == DataType::Bool,
        is_written: written.contains(&index),
    });
    let points: Vec<Point<'_>> = points.collect();
    let proposals = propose(&points);
    let made: usize = proposals.iter().map(|proposal| proposal.makes.len()).sum();
    for proposal in &proposals {
        let _ = write!(out, "\n{}", proposal.section);
    }
    let _ = writeln!(
        out,
        "\nunwritten: {} of {count} inputs, replies proposed for {made}",
        open.len()
    );
    Ok(out)
}

/// The signals of the driver `id` that rows of a control table write: the last column of each, such as `4711:Jam`.
fn destinations(text: &str, id: i32) -> impl Iterator<Item = &str> {
    let rows = text
        .lines()
        .filter(|line| !line.trim_start().starts_with('#'));
    rows.filter_map(move |row| {
        let (driver, name) = row.rsplit_once('|')?.1.trim().split_once(':')?;
        (driver.trim().parse::<i32>() == Ok(id)).then(|| name.trim())
    })
}
