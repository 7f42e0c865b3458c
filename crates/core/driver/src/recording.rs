//! Recordings of a driver's ticks and of a hosted program's scans.

use std::sync::Arc;

use tickbus_base::time::Clock;
use tickbus_image::signal::Area;
use tickbus_record::{Columns, Recorder, Rows, When};

use super::{DriverError, SlotMap};
use tickbus_driver_cfg::Config;

/// Starts the recording that `config` asks for. The values of the area `sent` have not passed the codec yet.
pub(super) fn recorder(
    config: &Config,
    slots: &SlotMap,
    sent: Option<Area>,
    lossless: bool,
    clock: &Arc<dyn Clock>,
) -> Result<Option<Recorder>, DriverError> {
    let wanted = config.record.as_ref();
    let Some(options) = wanted.filter(|options| options.when == When::Always) else {
        return Ok(None);
    };
    let columns = Columns::new(
        &config.name,
        config.role.name(),
        &config.table,
        &slots.edges,
    );
    let rows = match sent {
        Some(area) => Rows::sending(columns, &config.table, area),
        None => columns.into(),
    };
    let recorder = Recorder::start(options, config.folder(), rows, lossless, clock)?;
    Ok(Some(recorder))
}
