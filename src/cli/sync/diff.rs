//! `tickbus sync diff A B`: where two recorded runs part.

use std::path::PathBuf;

use crate::cli::{Outcome, print};
use tickbus_base::toml_text::shown;
use tickbus_virtual_time::{Compared, Difference, Parting, compare};

/// The most variables that are listed.
const MOST_LISTED: usize = 20;

/// Find the first step, variable and client at which two recorded runs part.
///
/// The recordings are made by tickbus sync --record. Exit code 1 if the runs differ, or if
/// both recordings are cut.
#[derive(Debug, clap::Args)]
pub(in crate::cli) struct Arguments {
    /// The recording of a run, a VCD file.
    #[arg(value_name = "A")]
    first: PathBuf,

    /// The recording of another run.
    #[arg(value_name = "B")]
    second: PathBuf,
}

pub(super) fn run(arguments: &Arguments) -> Outcome {
    let paths = [&*arguments.first, &*arguments.second];
    let compared = match compare(paths) {
        Ok(compared) => compared,
        Err(error) => {
            eprintln!("{error}\ndiff: failed mistakes=1");
            return Outcome::WrongInput;
        }
    };
    let names = paths.map(|path| path.display().to_string());
    let are_equal = compared.parting.is_none() && compared.declared.is_empty();
    match print("diff", &text(&compared, &names)) {
        Outcome::Done if !are_equal => Outcome::WrongInput,
        outcome => outcome,
    }
}

fn text(compared: &Compared, names: &[String; 2]) -> String {
    let mut lines = compared.notes.clone();
    lines.extend(compared.declared.iter().cloned());
    let steps = compared.steps;
    let hash = (compared.hash).map_or_else(String::new, |hash| format!(" hash={hash}"));
    let last = match &compared.parting {
        Some(Parting::Values {
            step,
            time,
            differences,
        }) => {
            list(*step, differences, names, &mut lines);
            let Difference {
                variable,
                client,
                values: [a, b],
            } = &differences[0];
            let client =
                (client.as_ref()).map_or_else(String::new, |name| format!(" client={name:?}"));
            let count = differences.len();
            format!(
                "parted step={step} time={time}{client} variable={variable:?} a={a} b={b} variables={count}"
            )
        }
        Some(Parting::End { shorter, steps }) => {
            lines.push(format!(
                "{} ends after step {steps}, and {} continues; up to there they are equal",
                names[*shorter],
                names[1 - shorter]
            ));
            format!("parted step={} reason=\"one ends\"", steps + 1)
        }
        Some(Parting::Cut { steps }) => {
            lines.push(format!(
                "both recordings are cut after step {steps}; up to there they are equal, and what followed is unknown"
            ));
            format!("unknown steps={steps} reason=\"both are cut\"")
        }
        Some(Parting::Hash { step }) => {
            lines.push(
                "all values are equal, and the trace hashes are not: there are other clients, multiples or orders, or \
                 a NaN has other bits"
                    .to_owned(),
            );
            format!("parted step={step} reason=\"trace hash\"")
        }
        None if !compared.declared.is_empty() => {
            let count = compared.declared.len();
            format!("parted reason=\"other variables\" differences={count} steps={steps}")
        }
        None => format!("equal steps={steps}{hash}"),
    };
    lines.push(last);
    let lines: Vec<String> = lines.iter().map(|line| format!("diff: {line}\n")).collect();
    lines.concat()
}

/// Lists what differs in the first step that does.
fn list(step: u64, differences: &[Difference], names: &[String; 2], lines: &mut Vec<String>) {
    lines.push(match step {
        0 => "the initial values differ".to_owned(),
        1 => "the initial values are equal; the values written in step 1 differ".to_owned(),
        step => format!(
            "all values up to step {} are equal; the values written in step {step} differ",
            step - 1
        ),
    });
    for difference in differences.iter().take(MOST_LISTED) {
        let Difference {
            variable,
            client,
            values: [a, b],
        } = difference;
        let writer = match client {
            Some(client) => format!("client \"{}\"", shown(client)),
            None => "the server's logic".to_owned(),
        };
        lines.push(format!(
            "  {writer} wrote \"{}\": {a} in {}, {b} in {}",
            shown(variable),
            names[0],
            names[1]
        ));
    }
    if let Some(more @ 1..) = differences.len().checked_sub(MOST_LISTED) {
        lines.push(format!("  and {more} variables more"));
    }
}
