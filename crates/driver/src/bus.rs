//! Creates the bus that a driver.cfg describes, and the PLC program behind it if one is hosted.

use std::path::Path;
use std::sync::Arc;

use tickbus_base::time::Clock;
use tickbus_bus_modbus::{ModbusClient, ModbusServer};
use tickbus_bus_plugin as plugin;
use tickbus_bus_s7::{S7Client, S7Server};
use tickbus_bus_socket::Socket;
use tickbus_driver_cfg::Options;
use tickbus_driver_cfg::loopback::{Mode, Options as LoopbackOptions, Peer};
use tickbus_fieldbus::loopback::{self, FreeLoopback, SteppedLoopback, private_link};
use tickbus_fieldbus::{Bus, Free, Role};
use tickbus_image::signal::Area;
use tickbus_plc as plc;

use super::DriverError;
use super::frames::area_bytes;
use super::host::{HostTally, HostThread, Hosted, SteppedHost, Tally};
use super::replay::{Replay, ReplayTally};
use tickbus_driver_cfg::Config;

/// What is at the other end, within this process: a PLC program or a recording.
#[derive(Debug)]
pub(super) enum Program {
    Thread(Box<HostThread>),
    Stepped(Arc<Tally>),
    Replay(Arc<ReplayTally>),
}

/// The counters of such a program, readable from any thread.
#[derive(Clone, Debug)]
pub(super) enum ProgramTally {
    Thread(HostTally),
    Stepped(Arc<Tally>),
    Replay(Arc<ReplayTally>),
}

impl Program {
    pub(super) fn tally(&self) -> ProgramTally {
        match self {
            Self::Thread(host) => ProgramTally::Thread(host.told.clone()),
            Self::Stepped(tally) => ProgramTally::Stepped(Arc::clone(tally)),
            Self::Replay(tally) => ProgramTally::Replay(Arc::clone(tally)),
        }
    }
}

impl ProgramTally {
    /// Appends the counters, one `key=value` per line.
    pub(super) fn write(&self, text: &mut String) {
        match self {
            Self::Thread(host) => host.write(text),
            Self::Stepped(tally) => tally.write(text),
            Self::Replay(tally) => tally.write(text),
        }
    }
}

/// Creates the bus that `config` names, and starts the hosted program at its other end, if any.
pub(super) fn open(
    config: &Config,
    clock: &Arc<dyn Clock>,
) -> Result<(Bus, Option<Program>), DriverError> {
    match &config.bus {
        Options::Loopback(options) => open_loopback(config, options, clock),
        Options::Socket(options) => {
            let cycle = config.timing.cycle;
            let socket = Socket::new(options, &config.table, config.role, cycle, &config.axes);
            Ok((Bus::Free(Box::new(socket)), None))
        }
        Options::S7Server(options) => {
            let server = S7Server::new(options, &config.table, config.role, &config.name);
            Ok((Bus::Free(Box::new(server)), None))
        }
        Options::S7Client(options) => {
            let cycle = config.timing.cycle;
            let client = S7Client::new(options, &config.table, config.role, cycle);
            Ok((Bus::Free(Box::new(client)), None))
        }
        Options::Plugin(options) => Ok((Bus::Free(open_plugin(config, options)?), None)),
        Options::ModbusServer(options) => {
            let server = ModbusServer::new(options, &config.table, config.role, &config.name);
            Ok((Bus::Free(Box::new(server)), None))
        }
        Options::ModbusClient(options) => {
            let cycle = config.timing.cycle;
            let client = ModbusClient::new(options, &config.table, config.role, cycle);
            Ok((Bus::Free(Box::new(client)), None))
        }
        Options::OpcuaClient(_) | Options::OpcuaServer(_) => {
            Ok((Bus::Free(open_opcua(config)?), None))
        }
    }
}

fn open_plugin(config: &Config, options: &plugin::Options) -> Result<Box<dyn Free>, DriverError> {
    let line = plugin::Line {
        name: &config.name,
        directory: config.folder(),
        role: config.role,
        table: &config.table,
        cycle: config.timing.cycle,
        max_age: config.timing.max_age,
    };
    plugin::open(options, line).map_err(|refusal| {
        let named = |what| format!("{}: {what}", config.path.display());
        match refusal {
            plugin::Refusal::Config(what) => DriverError::Config(named(what)),
            plugin::Refusal::Unsupported(what) => DriverError::Unsupported(named(what)),
        }
    })
}

#[cfg(feature = "opcua")]
fn open_opcua(config: &Config) -> Result<Box<dyn Free>, DriverError> {
    use tickbus_bus_opcua as opcua;

    let line = opcua::Line {
        name: &config.name,
        id: config.id,
        directory: config.folder(),
        role: config.role,
        table: &config.table,
        cycle: config.timing.cycle,
    };
    let refused = |what| DriverError::Config(format!("{}: {what}", config.path.display()));
    match &config.bus {
        Options::OpcuaClient(options) => {
            let client = opcua::Client::new(options, line).map_err(refused)?;
            Ok(Box::new(client))
        }
        Options::OpcuaServer(options) => Ok(Box::new(opcua::Server::new(options, line))),
        other => unreachable!("{} is another room's", other.kind()),
    }
}

#[cfg(not(feature = "opcua"))]
fn open_opcua(config: &Config) -> Result<Box<dyn Free>, DriverError> {
    Err(DriverError::Unsupported(format!(
        "{}: bus kind \"{}\" is not in this build of tickbus; use the library of a `make dist`, which has it, \
         or build with `cargo build --release --features opcua`",
        config.path.display(),
        config.bus.kind()
    )))
}

fn open_loopback(
    config: &Config,
    options: &LoopbackOptions,
    clock: &Arc<dyn Clock>,
) -> Result<(Bus, Option<Program>), DriverError> {
    let cycle = config.timing.cycle.unwrap_or(loopback::CYCLE);
    let (name, program_options, scan) = match (&options.peer, options.mode) {
        (Peer::Link(name), Mode::Free) => {
            return Ok((Bus::Free(Box::new(FreeLoopback::named(name, cycle))), None));
        }
        (Peer::Link(name), Mode::Stepped) => {
            return Ok((Bus::Stepped(Box::new(SteppedLoopback::named(name))), None));
        }
        (Peer::Replay(file), _) => {
            let (replay, tally) = Replay::open(config, &config.folder().join(file))?;
            return Ok((Bus::Stepped(Box::new(replay)), Some(Program::Replay(tally))));
        }
        (
            Peer::Program {
                name,
                options,
                scan,
            },
            _,
        ) => (name, options, *scan),
    };
    let folder = config.path.parent().unwrap_or(Path::new(""));
    let mut program = tickbus_programs::program_beside(folder, name, program_options)
        .map_err(|source| program_error(config, source))?;
    check_fit(config, &mut *program, Role::Controller)?;
    let scan = plc::interval(&*program, scan);
    if options.mode == Mode::Stepped {
        let (host, tally) = SteppedHost::new(program, config, scan);
        return Ok((Bus::Stepped(Box::new(host)), Some(Program::Stepped(tally))));
    }
    let sizes =
        |station| [Area::Input, Area::Output].map(|area| area_bytes(&config.table, station, area));
    let stations = 0..config.table.stations.len();
    let sizes: Vec<(usize, usize)> = stations.map(|station| sizes(station).into()).collect();
    let (device, controller) = private_link(&sizes);
    let bus = |end| Box::new(FreeLoopback::over(end, cycle));
    let title = format!("plc {}", program.name());
    let hosted = Hosted {
        program,
        interval: scan,
        tape: None,
    };
    let clock = Arc::clone(clock);
    let bus_of_program = bus(controller);
    let host = HostThread::start(
        hosted,
        title,
        config,
        Role::Controller,
        bus_of_program,
        clock,
    )?;
    Ok((
        Bus::Free(bus(device)),
        Some(Program::Thread(Box::new(host))),
    ))
}

fn program_error(config: &Config, source: plc::ProgramError) -> DriverError {
    let file = config.path.display().to_string();
    DriverError::Program { file, source }
}

/// Checks that the program, at the end with `role`, finds the image that it needs.
pub(super) fn check_fit(
    config: &Config,
    program: &mut dyn plc::Program,
    role: Role,
) -> Result<(), DriverError> {
    let name = program.name().to_owned();
    let refused = |what: String| DriverError::Config(format!("{}: {what}", config.path.display()));
    let stations = &config.table.stations;
    if stations.len() > 1 && program.for_another_station().is_none() {
        return Err(refused(format!(
            "the PLC program \"{name}\" serves one station, but this driver has {}; use one \
             driver.cfg per station",
            stations.len()
        )));
    }
    program
        .fit(&config.table, config.addressing)
        .map_err(|source| program_error(config, source))?;
    let (writes, reads) = role.areas();
    let needs = [
        (reads, program.input_bytes()),
        (writes, program.output_bytes()),
    ];
    for (station, (area, needs)) in stations.iter().flat_map(|s| needs.map(|need| (s, need))) {
        let has = station.bytes(area);
        if has < needs {
            return Err(refused(format!(
                "the PLC program \"{name}\" works on {needs} bytes of {area}, but the signals of \
                 this driver cover {has}; complete the signal table"
            )));
        }
    }
    Ok(())
}

#[cfg(all(test, not(feature = "opcua")))]
mod tests {
    use super::*;
    use crate::Driver;
    use tickbus_base::time::Manual;

    #[test]
    fn a_bus_that_is_not_in_this_build_says_how_to_get_it() {
        for table in [
            "kind = \"opcua-client\"\nurl = \"opc.tcp://127.0.0.1\"",
            "kind = \"opcua-server\"\nanonymous = true",
        ] {
            let text = format!(
                "[driver]\nid = 1\nname = \"x\"\n[fieldbus]\n{table}\n\
                 [[signal]]\nname = \"s\"\naddress = \"%QX0.0\"\n"
            );
            let config = Config::parse("driver.cfg", &text).expect("a right file");
            let error = Driver::open(config, Manual::new()).expect_err("it is not there");
            assert_eq!(error.code(), crate::Code::Unsupported);
            let told = error.to_string();
            for part in ["driver.cfg: ", "opcua-", "--features opcua", "make dist"] {
                assert!(told.contains(part), "\"{part}\" in {told}");
            }
        }
    }
}
