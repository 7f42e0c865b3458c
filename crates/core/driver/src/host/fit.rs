//! Checks whether a program and a signal table fit.

use crate::DriverError;
use tickbus_base::Mistake;
use tickbus_driver_cfg::Config;
use tickbus_fieldbus::Role;
use tickbus_plc as plc;

/// Checks that the program, at the end with `role`, finds the image that it needs.
pub(crate) fn check_fit(
    config: &Config,
    program: &mut dyn plc::Program,
    role: Role,
) -> Result<(), DriverError> {
    let name = program.name().to_owned();
    let refused = |what: String, right: &str| DriverError::Fit {
        file: config.path.display().to_string(),
        mistake: Mistake::new(what, right),
    };
    let stations = &config.table.stations;
    if stations.len() > 1 && program.for_another_station(1).is_none() {
        return Err(refused(
            format!(
                "the PLC program \"{name}\" serves one station, but this driver has {}",
                stations.len()
            ),
            "use one driver.cfg per station",
        ));
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
            return Err(refused(
                format!(
                    "the PLC program \"{name}\" works on {needs} bytes of {area}, but the signals of \
                     this driver cover {has}"
                ),
                "complete the signal table",
            ));
        }
    }
    Ok(())
}

/// Creates the error for a program that does not exist or does not fit this driver.cfg.
pub(crate) fn program_error(config: &Config, source: plc::ProgramError) -> DriverError {
    let file = config.path.display().to_string();
    DriverError::Program { file, source }
}
