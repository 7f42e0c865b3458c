//! Creates the bus that a driver.cfg describes, and the hosted PLC program behind it, if any.

use std::path::Path;
use std::sync::Arc;

use tickbus_base::time::{Clock, Nanos, Stop};
use tickbus_driver_cfg::loopback::{Mode, Options, Peer};
use tickbus_fieldbus::loopback::{self, FreeLoopback, private_link};
use tickbus_fieldbus::{Bus, Hosted, OpenError, Role, SwallowedSignals};
use tickbus_image::signal::Area;
use tickbus_plc as plc;

use super::DriverError;
use super::bus_handle::{OpenBus, SteppedBus};
use super::frames::area_bytes;
use super::host::{HostThread, OtherEnd, ScanSetup, SteppedHost, check_fit, program_error};
use super::replay::Replay;
use tickbus_driver_cfg::Config;

/// Creates the bus that `config` names and, if a program is hosted at its other end, starts it. `hosted` is a program
/// at this end. The stages of the line between this end and a hosted program count their swallowed changes into
/// `swallowed`.
pub(super) fn open(
    config: &Config,
    clock: &Arc<dyn Clock>,
    hosted: Option<Hosted<'_>>,
    swallowed: &SwallowedSignals,
) -> Result<(OpenBus, Option<OtherEnd>), DriverError> {
    if let Some(options) = config.bus.downcast_ref::<Options>() {
        match &options.peer {
            Peer::Link(_) => {}
            Peer::Replay(file) => {
                let (replay, scan_counters) = Replay::open(config, &config.folder().join(file))?;
                return Ok((
                    OpenBus::Stepped(SteppedBus::Replay(Box::new(replay))),
                    Some(OtherEnd::stepped(scan_counters)),
                ));
            }
            Peer::Program {
                name,
                options: given,
                scan,
            } => return open_hosted(config, options.mode, (name, given, *scan), clock, swallowed),
        }
    }
    let setup = config.bus_setup(clock, hosted);
    let bus = config.bus.open(&setup).map_err(|error| {
        let file = config.path.display().to_string();
        match error {
            OpenError::Config(mistake) => DriverError::Bus { file, mistake },
            OpenError::Unsupported(what) => DriverError::Unsupported(format!("{file}: {what}")),
        }
    })?;
    Ok((bus.into(), None))
}

/// Opens the loopback with a PLC program at its other end, given by its name, options and scan interval.
fn open_hosted(
    config: &Config,
    mode: Mode,
    (name, options, scan): (&str, &[(String, String)], Option<Nanos>),
    clock: &Arc<dyn Clock>,
    swallowed: &SwallowedSignals,
) -> Result<(OpenBus, Option<OtherEnd>), DriverError> {
    let cycle = config.timing.cycle.unwrap_or(loopback::CYCLE);
    let folder = config.path.parent().unwrap_or(Path::new(""));
    let programs = config.kinds.programs();
    let mut program = programs
        .make(folder, name, options)
        .map_err(|source| program_error(config, source))?;
    check_fit(config, &mut *program, Role::Controller)?;
    let scan = plc::interval(&*program, scan);
    swallowed.scanned_every(scan, Some(cycle).filter(|_| mode == Mode::Free));
    if mode == Mode::Stepped {
        let (host, scan_counters) = SteppedHost::new(program, config, scan, swallowed.counts());
        return Ok((
            OpenBus::Stepped(SteppedBus::Any(Box::new(host))),
            Some(OtherEnd::stepped(scan_counters)),
        ));
    }
    let sizes =
        |station| [Area::Input, Area::Output].map(|area| area_bytes(&config.table, station, area));
    let stations = 0..config.table.stations.len();
    let sizes: Vec<(usize, usize)> = stations.map(|station| sizes(station).into()).collect();
    let (device, controller) = private_link(&sizes);
    let bus = |end| Box::new(FreeLoopback::over(end, cycle));
    let hosted = ScanSetup {
        program,
        interval: scan,
        has_watchdog: true,
        recorder: None,
        swallowed: swallowed.clone(),
        own: None,
    };
    let line = (Bus::Free(bus(controller)), Stop::new());
    let host = HostThread::start(hosted, (config, Role::Controller), line, Arc::clone(clock))?;
    Ok((OpenBus::Free(bus(device)), Some(OtherEnd::on_thread(host))))
}
