//! The PLC's project, as far as it describes the line and the station.

use std::fs;
use std::path::Path;

use profirust::Baudrate;
use serde::Deserialize;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Project {
    pub(crate) bus: Bus,
    pub(crate) station: Station,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Bus {
    baud: u32,
    /// The master's address.
    pub(crate) master: u8,
    /// The time that the master waits for an answer, in bits.
    pub(crate) slot_bits: u16,
    pub(crate) watchdog_ms: u32,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Station {
    pub(crate) address: u8,
    gsd: String,
    modules: Vec<String>,
}

/// The station as its GSD file describes it.
#[derive(Debug)]
pub(crate) struct Device {
    pub(crate) ident: u16,
    pub(crate) parameters: Vec<u8>,
    pub(crate) config: Vec<u8>,
}

impl Project {
    pub(crate) fn read(file: &Path) -> Result<Self, String> {
        let name = file.display();
        let text = fs::read_to_string(file)
            .map_err(|error| format!("cannot read the project {name}: {error}"))?;
        let project: Self = toml::from_str(&text).map_err(|error| format!("{name}: {error}"))?;
        if project.bus.master >= 125 || !(10..=650_000).contains(&project.bus.watchdog_ms) {
            return Err(format!(
                "{name}: a master has an address from 0 to 124, and a watchdog from 10 to 650000 ms"
            ));
        }
        Ok(project)
    }

    /// Returns the rate, and checks the slot time against the shortest one for that rate.
    pub(crate) fn baud(&self) -> Result<Baudrate, String> {
        let rates = [
            (9_600, Baudrate::B9600, 100),
            (19_200, Baudrate::B19200, 100),
            (93_750, Baudrate::B93750, 100),
            (187_500, Baudrate::B187500, 100),
            (500_000, Baudrate::B500000, 200),
        ];
        let own = rates.into_iter().find(|(rate, ..)| *rate == self.bus.baud);
        let (_, baud, shortest) =
            own.ok_or_else(|| format!("the master has no rate of {} bit/s", self.bus.baud))?;
        if self.bus.slot_bits < shortest {
            let own = self.bus.slot_bits;
            return Err(format!("slot_bits is {own}, expected at least {shortest}"));
        }
        Ok(baud)
    }

    /// Looks the station up in its GSD file, which is next to the project.
    pub(crate) fn device(&self, folder: &Path) -> Result<Device, String> {
        let file = folder.join(&self.station.gsd);
        let name = file.display();
        let bytes =
            fs::read(&file).map_err(|error| format!("cannot read the GSD file {name}: {error}"))?;
        let text = String::from_utf8_lossy(&bytes);
        let gsd = gsd_parser::parser::parse(&file, &text).map_err(|error| error.to_string())?;
        let mut parameters = gsd_parser::PrmBuilder::new(&gsd.user_prm_data).into_bytes();
        let mut config = Vec::new();
        for wanted in &self.station.modules {
            let module = gsd.available_modules.iter();
            let module = module.clone().find(|module| module.name == *wanted);
            let module = module.ok_or_else(|| format!("{name} has no module \"{wanted}\""))?;
            config.extend(&module.config);
            parameters.extend(gsd_parser::PrmBuilder::new(&module.module_prm_data).into_bytes());
        }
        Ok(Device {
            ident: gsd.ident_number,
            parameters,
            config,
        })
    }
}
