//! For CODESYS and TwinCAT: a list of global variables, two functions and two programs, in one file of
//! `PLCopen` XML.

mod link;
mod modbus;
mod parts;
mod socket;
mod tcpip;

use super::life::{self, ALIVE, Life};
use super::registers::{BITS_OF, REAL_OF, kind};
use super::{comment, copies, records, remark, taken, temporaries};
use crate::exported::Exported;
use crate::plcopen::{Kind, Project, Unit, Variable, variable};
use crate::record::{PlacedSignal, Record, block_prefix};
use crate::{Export, File, head};
use parts::Link;
use tickbus_driver_cfg::Config;
use tickbus_image::signal::DataType;

/// The target editor: both read the same XML, but have different libraries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Editor {
    /// CODESYS V3, and editors made from it.
    Codesys,
    /// TwinCAT 3.
    TwinCat,
}

impl Editor {
    const fn name(self) -> &'static str {
        match self {
            Self::Codesys => "CODESYS V3 and editors made from it",
            Self::TwinCat => "TwinCAT 3",
        }
    }

    const fn import(self) -> &'static str {
        match self {
            Self::Codesys => "Select the application, then Project > Import PLCopenXML",
            Self::TwinCat => "Right-click the PLC project > Import PLCopenXML",
        }
    }
}

const COMPILED: &str = "Its XML was checked against PLCopen's schema, and its statements are read by the parser of another \
                        project in our tests; it was never compiled in the editor.";

/// The files for `config`.
#[expect(clippy::too_many_lines, reason = "the files in their order")]
pub(crate) fn export(config: &Config, editor: Editor) -> Export {
    let prefix = block_prefix(&config.name);
    let list = format!("{prefix}_io");
    let (begin, end) = (format!("{prefix}_begin"), format!("{prefix}_end"));
    // In Modbus each station starts at its own register; a record over TCP has no gaps.
    let aligned = match Exported::of(&config.bus) {
        Exported::ModbusServer(_) | Exported::ModbusClient(_) => 2,
        Exported::Loopback
        | Exported::Socket(_)
        | Exported::S7Server(_)
        | Exported::S7Client(_)
        | Exported::OpcuaClient
        | Exported::OpcuaServer(_)
        | Exported::ByHand => 1,
    };
    let mut link = Link::of(config, editor, &list);
    let declared = [&list, &begin, &end].map(String::clone);
    let own = link.globals.iter().map(|own| own.name.clone());
    let fixed = [REAL_OF, BITS_OF].map(str::to_owned);
    let life_names = life::declared(config);
    let mut names = taken(
        declared
            .into_iter()
            .chain(own)
            .chain(fixed)
            .chain(life_names),
    );
    let records = records(config, aligned, &mut names);
    let [bring, take] = if link.is_by_name {
        Default::default()
    } else {
        copies(
            &records,
            &|name| format!("{list}.{name}"),
            &|register| format!("{list}.In[{register}]"),
            &|register| format!("{list}.Out[{register}]"),
        )
    };
    let is_known = link.globals.iter().any(|own| own.name == ALIVE);
    let life = Life::of(
        config,
        &records,
        &kind,
        &|name| format!("{list}.{name}"),
        [&format!("{list}.{ALIVE}"), &format!("{list}.Simulated")],
        is_known,
    );
    if life.is_beating() && !is_known {
        link.globals.push(Variable {
            comment: "the heartbeat of the simulation was seen lately".to_owned(),
            ..variable(ALIVE, Kind::Basic("BOOL"))
        });
    }
    let is_real = |place: &PlacedSignal<'_>| place.data_type() == DataType::Real;
    let mut units = Vec::new();
    let mut places = records.iter().flat_map(|record| &record.places);
    if !link.is_by_name && places.any(is_real) {
        units.extend(functions());
    }
    let mut lines = link.before.lines.clone();
    lines.extend(simulated(
        &list,
        &bring,
        "copy the real inputs into the same variables here",
    ));
    lines.extend(life.before.clone());
    let mut locals = link.before.locals.clone();
    locals.extend(life.locals.iter().map(|(name, kind)| {
        let kind = if *kind == "TON" {
            Kind::Block(kind)
        } else {
            Kind::Basic(kind)
        };
        variable(name, kind)
    }));
    units.push(Unit {
        name: begin.clone(),
        returns: None,
        inputs: Vec::new(),
        locals,
        lines,
        comment: "The first program of the task: the simulated inputs come into their variables."
            .to_owned(),
    });
    let mut lines = life.after.clone();
    lines.extend(simulated(
        &list,
        &take,
        "copy the variables to the real outputs here; while simulated they stay as they are",
    ));
    lines.extend(link.after.lines.clone());
    let needed = if link.is_by_name {
        Vec::new()
    } else {
        temporaries(&records[1])
    };
    let mut locals: Vec<Variable> = needed
        .into_iter()
        .map(|(name, kind)| variable(name, Kind::Basic(kind)))
        .collect();
    locals.extend(link.after.locals.clone());
    units.push(Unit {
        name: end.clone(),
        returns: None,
        inputs: Vec::new(),
        locals,
        lines,
        comment: "The last program of the task: the outputs go to the simulation.".to_owned(),
    });
    let mut about = head(
        config,
        "The PLC's half of a simulated machine.",
        editor.name(),
        COMPILED,
    );
    about.extend(Record::stations_aligned(&config.table, aligned));
    let project = Project {
        name: prefix.clone(),
        comment: about.join("\n"),
        units,
        globals: (list.clone(), globals(&records, &link)),
    };
    let mut steps = vec![format!(
        "{}: {prefix}.xml. It brings the list {list}, the programs {begin} and {end}, and what they call.",
        editor.import()
    )];
    steps.extend(link.steps);
    steps.push(format!(
        "In the task of your program, call {begin} first and {end} last."
    ));
    steps.push(if link.is_by_name {
        format!(
            "Your program reads and writes {list}.NAME, which OPC UA carries at any time. While {list}.Simulated is TRUE, the \
             real inputs and outputs are left out; FALSE is its start value."
        )
    } else {
        format!(
            "Your program reads and writes {list}.NAME. While {list}.Simulated is TRUE, they come from the simulation and go \
             to it; while it is FALSE, its start value, neither is copied."
        )
    });
    let mut readme = about;
    readme.push(String::new());
    let numbered = steps.iter().enumerate();
    readme.extend(numbered.map(|(number, step)| format!("{}. {step}", number + 1)));
    readme.push(String::new());
    let file = |name: String, text: String| File { name, text };
    Export {
        files: vec![
            file(format!("{prefix}.xml"), project.text()),
            file(format!("{prefix}_README.txt"), readme.join("\r\n")),
        ],
        notes: link.notes,
    }
}

/// A REAL from its bits and back: the same memory, viewed as both types.
fn functions() -> [Unit; 2] {
    [
        (REAL_OF, "REAL", "bits", "DWORD", "A REAL out of its bits."),
        (BITS_OF, "DWORD", "number", "REAL", "The bits of a REAL."),
    ]
    .map(|(name, returns, input, kind, comment)| Unit {
        name: name.to_owned(),
        returns: Some(returns),
        inputs: vec![variable(input, Kind::Basic(kind))],
        locals: vec![variable("same", Kind::Pointer(returns))],
        lines: vec![
            format!("same := ADR({input});"),
            format!("{name} := same^;"),
        ],
        comment: comment.to_owned(),
    })
}

fn globals(records: &[Record<'_>; 2], link: &Link) -> Vec<Variable> {
    let remarked = |name: &str, kind: Kind, comment: &str| Variable {
        comment: comment.to_owned(),
        ..variable(name, kind)
    };
    let mut all = vec![remarked(
        "Simulated",
        Kind::Basic("BOOL"),
        "TRUE: the simulation stands in for the machine",
    )];
    all.extend(link.globals.clone());
    for (record, name, way) in [(&records[0], "In", "from"), (&records[1], "Out", "to")] {
        let count = record.bytes.div_ceil(2);
        if count > 0 && !link.is_by_name {
            let comment = format!(
                "registers {way} the simulation: n holds bytes 2n and 2n + 1 of the record, the first one is the high byte"
            );
            all.push(remarked(name, Kind::Array(count, "WORD"), &comment));
        }
    }
    let places = records.iter().flat_map(|record| &record.places);
    all.extend(places.map(|place| {
        let kind = Kind::Basic(kind(place).name());
        remarked(&place.name, kind, &remark(place))
    }));
    all
}

/// The statements while the simulation is used, and the place for the user's own statements otherwise.
fn simulated(list: &str, lines: &[String], other: &str) -> Vec<String> {
    let mut all = vec![format!("IF {list}.Simulated THEN")];
    all.extend(lines.iter().map(|line| format!("    {line}")));
    if lines.is_empty() {
        all.push("    ;".to_owned());
    }
    all.push("ELSE".to_owned());
    all.push(format!(
        "    ; {}",
        comment(&format!("Not simulated: {other}."))
    ));
    all.push("END_IF;".to_owned());
    all
}
