//! Writes the GSD file of a machine of one's own.

use crate::configuration::{SlotModule, hex};
use crate::rates::RATES;
use crate::station::Identity;
use crate::telegram::DATA_LIMIT;

/// The longest name that every tool takes, in characters.
const NAME_LIMIT: usize = 32;

/// The longest slot time that a master can have, in bits: an answer has to come earlier.
const SLOT_TIME_LIMIT: u64 = 16_383;

/// Rates above are not for software behind a serial port.
const SOFTWARE_LIMIT: u32 = 500_000;

/// A kind of device that nobody else has described.
pub(crate) struct Machine<'a> {
    /// Its name.
    pub(crate) model: &'a str,
    /// The rate of its line, and the longest wait before an answer there, in bits.
    pub(crate) baud: u32,
    pub(crate) max_tsdr: u16,
    /// Its stations, at least one: address, name, and what they are.
    pub(crate) stations: Vec<(u8, &'a str, Identity)>,
}

impl Machine<'_> {
    /// The file.
    pub(crate) fn write(&self) -> String {
        let mut out = String::new();
        let mut line = |text: &str| {
            out.push_str(text);
            out.push('\n');
        };
        let own = &self.stations[0].2;
        let model = plain(self.model);
        line("#Profibus_DP");
        line(&format!(
            "; \"{model}\" as tickbus simulates it, written by \"tickbus gsd\"."
        ));
        line("; The modules of each station, from slot 1 on:");
        let modules = self.modules();
        let name_of = |module: &SlotModule| {
            let found = modules
                .iter()
                .position(|own| own.identifiers == module.identifiers);
            let number = found.expect("all modules are in the list");
            name(number + 1, module)
        };
        for (address, name, identity) in &self.stations {
            let names: Vec<String> = identity
                .configuration
                .modules()
                .iter()
                .map(&name_of)
                .collect();
            line(&format!(
                "; station {address} \"{}\": {}",
                plain(name),
                names.join("; ")
            ));
        }
        line("GSD_Revision=3");
        line("Vendor_Name=\"tickbus\"");
        line(&format!("Model_Name=\"{model}\""));
        line("Revision=\"V1.0\"");
        line(&format!("Ident_Number=0x{:04X}", own.ident));
        for text in [
            "Protocol_Ident=0",
            "Station_Type=0",
            "FMS_supp=0",
            "Hardware_Release=\"none\"",
            "Software_Release=\"V1.0\"",
        ] {
            line(text);
        }
        for (name, wait) in self.waits() {
            line(&format!("{name}_supp=1"));
            line(&format!("MaxTsdr_{name}={wait}"));
        }
        for text in [
            "Redundancy=0",
            "Repeater_Ctrl_Sig=0",
            "24V_Pins=0",
            "Implementation_Type=\"software\"",
        ] {
            line(text);
        }
        line(&format!("Freeze_Mode_supp={}", u8::from(own.freeze)));
        line(&format!("Sync_Mode_supp={}", u8::from(own.sync)));
        line("Auto_Baud_supp=0");
        line("Set_Slave_Add_supp=0");
        line(&format!("Fail_Safe={}", u8::from(own.fail_safe)));
        // In units of 100 µs: a millisecond, which the bus's thread needs under load.
        line("Min_Slave_Intervall=10");
        line(&format!("Max_Diag_Data_Len={DATA_LIMIT}"));
        line("Slave_Family=3");
        line("User_Prm_Data_Len=0");
        line("Modular_Station=1");
        let most = |of: fn(&Identity) -> usize| {
            let counts = self.stations.iter().map(|(.., identity)| of(identity));
            counts.max().unwrap_or(0)
        };
        let inputs = |identity: &Identity| identity.configuration.inputs();
        let outputs = |identity: &Identity| identity.configuration.outputs();
        let both = |identity: &Identity| {
            identity.configuration.inputs() + identity.configuration.outputs()
        };
        line(&format!(
            "Max_Module={}",
            most(|identity| identity.configuration.modules().len())
        ));
        line(&format!("Max_Input_Len={}", most(inputs)));
        line(&format!("Max_Output_Len={}", most(outputs)));
        line(&format!("Max_Data_Len={}", most(both)));
        for (number, module) in (1..).zip(&modules) {
            let identifiers = hex(&module.identifiers).replace(' ', ",0x");
            line(&format!("Module=\"{}\" 0x{identifiers}", name_of(module)));
            line(&number.to_string());
            line("EndModule");
        }
        out
    }

    /// All different modules of its stations.
    fn modules(&self) -> Vec<&SlotModule> {
        let mut all: Vec<&SlotModule> = Vec::new();
        for (.., identity) in &self.stations {
            for module in identity.configuration.modules() {
                if !all
                    .iter()
                    .any(|other| other.identifiers == module.identifiers)
                {
                    all.push(module);
                }
            }
        }
        all
    }

    /// The rates that it supports, by their names, with the longest wait in bits: at least the standard's, and no shorter
    /// in time than on its own line.
    fn waits(&self) -> impl Iterator<Item = (&'static str, u64)> {
        RATES.iter().filter_map(|rate| {
            let own = u64::from(self.max_tsdr) * u64::from(rate.baud);
            let wait = own.div_ceil(self.baud.into()).max(rate.max_tsdr.into());
            let is_feasible = rate.baud <= SOFTWARE_LIMIT && wait < SLOT_TIME_LIMIT;
            (is_feasible || rate.baud == self.baud).then_some((rate.name, wait))
        })
    }
}

/// The name of a module, the `number`th of its file.
fn name(number: usize, module: &SlotModule) -> String {
    let (inputs, outputs) = (module.inputs.len(), module.outputs.len());
    match module.identifiers[..] {
        [one] if one & 0x30 != 0 => {
            let count = (one & 0x0F) + 1;
            let unit = if one & 0x40 == 0 { "byte" } else { "word" };
            let plural = if count == 1 { "" } else { "s" };
            let way = ["in", "out", "in and out"][usize::from(one >> 4 & 3) - 1];
            let consistent = if one & 0x80 == 0 { "" } else { ", consistent" };
            format!("{count} {unit}{plural} {way}{consistent}")
        }
        _ => format!("module {number}: {inputs} in, {outputs} out"),
    }
}

/// Text that every tool takes, in quotes.
fn plain(text: &str) -> String {
    let kept = |c: char| {
        if c == ' ' || c.is_ascii_graphic() && !"\"'@;\\~".contains(c) {
            c
        } else {
            '_'
        }
    };
    text.chars().take(NAME_LIMIT).map(kept).collect()
}
