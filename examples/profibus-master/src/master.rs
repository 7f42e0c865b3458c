//! The master, polled for one data exchange at a time.

use std::path::Path;

use profirust::dp::{DpMaster, Peripheral, PeripheralEvent, PeripheralHandle, PeripheralOptions};
use profirust::fdl::{FdlActiveStation, ParametersBuilder};
use profirust::time::{Duration, Instant};

use crate::abi::{Exchanged, Failure};
use crate::dp_phy::Pty;
use crate::project::Project;

/// The pause between two looks at the line.
const REST: std::time::Duration = std::time::Duration::from_micros(50);

pub(crate) struct Master {
    phy: Pty,
    fdl: FdlActiveStation,
    dp: DpMaster<'static>,
    station: PeripheralHandle,
    /// True if a request may be under way with the outputs of an earlier exchange.
    is_behind: bool,
}

impl Master {
    /// Opens the line; the station sends `inputs` bytes and receives `outputs`.
    pub(crate) fn open(
        port: &Path,
        file: &Path,
        (inputs, outputs): (usize, usize),
    ) -> Result<Self, Failure> {
        let project = Project::read(file).map_err(Failure::Config)?;
        let baud = project.baud().map_err(Failure::Config)?;
        let folder = file.parent().unwrap_or(Path::new(""));
        let device = project.device(folder).map_err(Failure::Config)?;
        let phy = Pty::open(port, baud)
            .map_err(|error| Failure::Link(format!("cannot open {}: {error}", port.display())))?;
        let bus = &project.bus;
        let mut dp = DpMaster::new(vec![]);
        let options = PeripheralOptions {
            ident_number: device.ident,
            // Leaking is fine: the plug-in lives as long as its process, and opens its line only a few times.
            user_parameters: Some(device.parameters.leak()),
            config: Some(device.config.leak()),
            max_tsdr: bus.slot_bits - 15,
            ..PeripheralOptions::default()
        };
        let images = (vec![0; inputs], vec![0; outputs]);
        let station = Peripheral::new(project.station.address, options, images.0, images.1);
        let station = dp.add(station.with_diag_buffer(vec![0; 64]));
        let mut parameters = ParametersBuilder::new(bus.master, baud);
        parameters
            .slot_bits(bus.slot_bits)
            .max_retry_limit(3)
            .highest_station_address(bus.master + 1)
            .watchdog_timeout(Duration::from_millis(bus.watchdog_ms.into()));
        let mut fdl = FdlActiveStation::new(parameters.build_verified(&dp));
        fdl.set_online();
        dp.enter_operate();
        Ok(Self {
            phy,
            fdl,
            dp,
            station,
            is_behind: true,
        })
    }

    /// Exchanges data with the station once; `None` if it did not answer in time.
    pub(crate) fn exchange(
        &mut self,
        outputs: &[u8],
        inputs: &mut [u8],
        patience: std::time::Duration,
    ) -> Result<Option<Exchanged>, Failure> {
        let own = self.dp.get_mut(self.station).pi_q_mut();
        own.copy_from_slice(outputs);
        let limit = std::time::Instant::now() + patience;
        while std::time::Instant::now() < limit {
            self.fdl.poll(Instant::now(), &mut self.phy, &mut self.dp);
            if let Some(error) = self.phy.broke.take() {
                return Err(Failure::Link(format!("the line is gone: {error}")));
            }
            match self.dp.take_last_events().peripheral {
                Some((_, PeripheralEvent::DataExchanged)) => {
                    inputs.copy_from_slice(self.dp.get_mut(self.station).pi_i());
                    let is_sent = !std::mem::take(&mut self.is_behind);
                    return Ok(Some(Exchanged { is_sent }));
                }
                Some((_, PeripheralEvent::ConfigError)) => {
                    return Err(Failure::Refused("the station has other modules".into()));
                }
                Some((_, PeripheralEvent::ParameterError)) => {
                    return Err(Failure::Refused("the station is another device".into()));
                }
                _ => {}
            }
            std::thread::sleep(REST);
        }
        self.is_behind = true;
        Ok(None)
    }
}
