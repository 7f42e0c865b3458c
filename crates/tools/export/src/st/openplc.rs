//! One program for `OpenPLC` or anything else that compiles with `iec2c`.

mod hosted;
mod polled;
mod real;
mod served;
mod wired;

use super::{add, comment};
use crate::exported::Exported;
use crate::names::legal;
use crate::record::block_prefix;
use crate::{Export, File};
use tickbus_base::toml_text::Mistakes;
use tickbus_driver_cfg::Config;

const EDITOR: &str = "OpenPLC, or another editor that compiles with iec2c";

const COMPILED: &str =
    "Programs like this one are compiled by iec2c in our tests; no OpenPLC has run this one.";

/// The configuration and the resource. `OpenPLC` only looks for C files with these names.
const CONFIGURATION: [&str; 2] = ["Config0", "Res0"];

/// The task of the program.
const TASK: &str = "every_scan";

/// The source for `config`.
///
/// # Errors
///
/// `OpenPLC` does not support the bus at this end, or the image is too large for `OpenPLC`.
pub(crate) fn export(config: &Config) -> Result<Export, Mistakes> {
    let mut notes = Vec::new();
    let text = match Exported::of(&config.bus) {
        Exported::ModbusServer(options) => polled::text(config, options, &mut notes)?,
        Exported::ModbusClient(options) => served::text(config, options)?,
        Exported::Loopback | Exported::Socket(_) => hosted::text(config, &mut notes)?,
        Exported::S7Client(_) => {
            return Err(refusal(
                config,
                "OpenPLC's S7 server has words alone, and drops a byte that is written by itself",
            ));
        }
        Exported::S7Server(_) => {
            return Err(refusal(config, "OpenPLC makes no S7 connections by itself"));
        }
        Exported::OpcuaClient | Exported::OpcuaServer(_) => {
            return Err(refusal(
                config,
                "OpenPLC's OPC UA, where a version has it, names variables in a way of its own",
            ));
        }
        Exported::ByHand => {
            return Err(refusal(
                config,
                "OpenPLC does not know the bus of a vendor's library",
            ));
        }
    };
    let name = format!("{}.st", block_prefix(&config.name));
    Ok(Export {
        files: vec![File { name, text }],
        notes,
    })
}

/// The refusal of a bus that `OpenPLC` does not support at this end.
fn refusal(config: &Config, why: &str) -> Mistakes {
    Mistakes::of_file(
        &config.path.display().to_string(),
        format!(
            "the bus \"{}\" has no program for OpenPLC: {why}",
            config.bus.kind()
        ),
        "write kind = \"modbus-server\", which OpenPLC polls, \"modbus-client\", which reads and writes its registers, \
         or \"loopback\", which hosts the program without OpenPLC's runtime",
    )
}

/// The names of the program and its instance. The program's name must differ from the variables of all libraries: after
/// its declaration the name is a keyword.
fn program(config: &Config) -> [String; 2] {
    let prefix = block_prefix(&config.name);
    ["program", "instance"].map(|what| legal(&format!("{prefix}_{what}")))
}

/// All names that the text declares in addition to its signals and registers.
fn declared(config: &Config) -> impl Iterator<Item = String> {
    let fixed = [TASK, super::registers::REAL_OF, super::registers::BITS_OF];
    let fixed = fixed.into_iter().chain(CONFIGURATION).map(str::to_owned);
    fixed.chain(program(config))
}

/// The task that runs the program.
fn configuration(text: &mut String, config: &Config) {
    let [program, instance] = program(config);
    let [configuration, resource] = CONFIGURATION;
    for line in [
        "",
        &format!("CONFIGURATION {configuration}"),
        &format!("  RESOURCE {resource} ON PLC"),
        &format!("    TASK {TASK}(INTERVAL := T#10ms, PRIORITY := 0);"),
        &format!("    PROGRAM {instance} WITH {TASK} : {program};"),
        "  END_RESOURCE",
        "END_CONFIGURATION",
    ] {
        add(text, line);
    }
}

/// Lines of comment.
fn remarks(text: &mut String, lines: &[String]) {
    for line in lines {
        add(text, &comment(line));
    }
    add(text, "");
}

#[cfg(test)]
mod tests {
    use tickbus_bus_modbus as modbus;
    use tickbus_driver_cfg::{Kind, Kinds};

    use super::*;

    static KINDS: Kinds = Kinds::new(&[Kind::of::<modbus::ServerOptions>()]);

    #[test]
    fn a_signal_that_is_called_as_a_register_gets_another_name() {
        let text = "[driver]\nname = \"rig\"\nid = 1\n[fieldbus]\nkind = \"modbus-server\"\n\
                    [[signal]]\nname = \"in 1\"\naddress = \"%IX0.0\"\n\
                    [[signal]]\nname = \"motor\"\naddress = \"%IW2\"\n\
                    [[signal]]\nname = \"OUT_0\"\naddress = \"%QW0\"\n";
        let config = Config::parse("driver.cfg", text, &KINDS).expect("it is right");
        let text = export(&config)
            .expect("a program")
            .files
            .remove(0)
            .text
            .to_lowercase();
        for declared in ["in_0 at", "in_1 at", "in_1_2 : ", "out_0 at", "out_0_2 : "] {
            let count = text.matches(&format!("\n    {declared}")).count();
            assert_eq!(count, 1, "{declared}\n{text}");
        }
        for twice in ["in_1 : ", "out_0 : "] {
            assert!(!text.contains(&format!("\n    {twice}")), "{twice}\n{text}");
        }
    }
}
