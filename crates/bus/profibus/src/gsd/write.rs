//! Writes the GSD file of a user's own machine.

use crate::acyclic::Acyclic;
use crate::configuration::{SlotModule, hex};
use crate::rates::{RATES, SLOT_TIME_LIMIT};
use crate::station::Identity;
use crate::telegram::DATA_LIMIT;

/// The longest name that every tool accepts, in characters.
const NAME_LIMIT: usize = 32;

/// Higher rates are not for software behind a serial port.
const SOFTWARE_LIMIT: u32 = 500_000;

/// The time for the answer to a request for a record, in units of 10 ms: an answer is ready at once.
const RESPONSE: u16 = 10;

/// A kind of device that no maker has described.
pub(crate) struct Machine<'a> {
    /// The name.
    pub(crate) model: &'a str,
    /// The rate of its line, and the longest wait before an answer there, in bits.
    pub(crate) baud: u32,
    pub(crate) max_tsdr: u16,
    /// The stations, at least one: address, name and identity.
    pub(crate) stations: Vec<(u8, &'a str, Identity)>,
}

impl Machine<'_> {
    /// The text of the file.
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
        // All stations of one kind have the same services.
        let acyclic = &own.acyclic;
        // Revision 5 has the keywords of DP-V1 and of the nameplate.
        line(if acyclic.is_any() {
            "GSD_Revision=5"
        } else {
            "GSD_Revision=3"
        });
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
        // In units of 100 µs: a millisecond, which the bus thread needs under load.
        line("Min_Slave_Intervall=10");
        line(&format!("Max_Diag_Data_Len={DATA_LIMIT}"));
        line("Slave_Family=3");
        for text in services(acyclic) {
            line(&text);
        }
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

    /// All different modules of the stations.
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

    /// The rates that the machine supports, by their names, with the longest wait in bits: at least the standard's, and
    /// no shorter in time than on the machine's own line.
    fn waits(&self) -> impl Iterator<Item = (&'static str, u64)> {
        RATES.iter().filter_map(|rate| {
            let own = u64::from(self.max_tsdr) * u64::from(rate.baud);
            let wait = own.div_ceil(self.baud.into()).max(rate.max_tsdr.into());
            let is_feasible = rate.baud <= SOFTWARE_LIMIT && wait < u64::from(SLOT_TIME_LIMIT);
            (is_feasible || rate.baud == self.baud).then_some((rate.name, wait))
        })
    }
}

/// The lines about the parameters, and the services that these switch on.
fn services(acyclic: &Acyclic) -> Vec<String> {
    if !acyclic.is_any() {
        return vec!["User_Prm_Data_Len=0".to_owned()];
    }
    let room = acyclic.room();
    vec![
        // The octets of DPV1; the first enables the acyclic services.
        "User_Prm_Data_Len=3".to_owned(),
        "Ext_User_Prm_Data_Const(0)=0x80,0x00,0x00".to_owned(),
        "Max_User_Prm_Data_Len=3".to_owned(),
        "DPV1_Slave=1".to_owned(),
        "WD_Base_1ms_supp=1".to_owned(),
        "C1_Read_Write_supp=1".to_owned(),
        format!("C1_Max_Data_Len={room}"),
        format!("C1_Response_Timeout={RESPONSE}"),
        "Diagnostic_Alarm_supp=1".to_owned(),
        "Process_Alarm_supp=1".to_owned(),
        "Pull_Plug_Alarm_supp=1".to_owned(),
        "Status_Alarm_supp=1".to_owned(),
        "Update_Alarm_supp=1".to_owned(),
        format!("Alarm_Sequence_Mode_Count={}", acyclic.alarms.sequence),
        "Alarm_Type_Mode_supp=1".to_owned(),
        "Extra_Alarm_SAP_supp=1".to_owned(),
        "C2_Read_Write_supp=1".to_owned(),
        format!("C2_Max_Data_Len={room}"),
        format!("C2_Response_Timeout={RESPONSE}"),
        format!("C2_Max_Count_Channels={}", acyclic.connections),
        format!("Max_Initiate_PDU_Length={DATA_LIMIT}"),
        "Ident_Maintenance_supp=1".to_owned(),
    ]
}

/// The name of the `number`th module of a file.
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

/// Text that every tool accepts, in quotes.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::AlarmSupport;
    use crate::Gsd;
    use crate::configuration::Configuration;
    use crate::user_parameters::UserParameters;

    /// The stations of a user's machine: one with modules and one with sizes alone.
    fn machine() -> Machine<'static> {
        let own = |configuration| Identity {
            ident: 0x80E0,
            configuration,
            user: UserParameters::default(),
            sync: true,
            freeze: true,
            fail_safe: false,
            dpv1: false,
            max_diagnosis: 244,
            acyclic: crate::Acyclic::default(),
        };
        let modules = [0x50, 0x60, 0x50, 0x93, 0xC1, 0x43, 0x81, 0xAA];
        let conveyor = own(Configuration::of_bytes(&modules).expect("whole"));
        let drive = own(Configuration::of_sizes(20, 1));
        Machine {
            model: "Cell \"4\", Süd",
            baud: 19_200,
            max_tsdr: 900,
            stations: vec![(3, "conveyor", conveyor), (4, "drive", drive)],
        }
    }

    /// `TICKBUS_UPDATE=1` rewrites the golden file: review the difference.
    #[test]
    fn the_file_of_an_own_machine_is_golden_and_every_parser_reads_it() {
        let path = concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/../../../tests/gsd/own_machine.gsd"
        );
        let written = machine().write();
        if std::env::var_os("TICKBUS_UPDATE").is_some() {
            std::fs::write(path, &written).expect("the file is written");
        }
        assert_eq!(
            written,
            std::fs::read_to_string(path).expect("the golden file")
        );

        let own = Gsd::read(written.as_bytes()).expect("a right file");
        for (_, name, station) in machine().stations {
            let chosen: Vec<String> = {
                let line = written
                    .lines()
                    .find(|line| line.contains(&format!("\"{name}\": ")));
                let (_, modules) = line
                    .and_then(|line| line.split_once("\": "))
                    .expect("its modules");
                modules.split("; ").map(str::to_owned).collect()
            };
            let read = own
                .identity(&chosen)
                .expect("the modules that the comment names");
            assert_eq!(read.configuration.bytes(), station.configuration.bytes());
            assert_eq!((read.ident, read.sync, read.freeze), (0x80E0, true, true));
            assert_eq!(
                (read.user, read.fail_safe, read.dpv1),
                (UserParameters::default(), false, false)
            );
        }
        // 46.9 ms at 19.2 kbit/s; at 500 kbit/s that is more bits than a slot time can have.
        let waits: Vec<(u32, u16)> = own.rates.into_iter().collect();
        assert_eq!(
            waits,
            [
                (9_600, 450),
                (19_200, 900),
                (45_450, 2_131),
                (93_750, 4_395),
                (187_500, 8_790)
            ]
        );

        let theirs =
            gsd_parser::parser::parse(std::path::Path::new(path), &written).expect("they read it");
        assert_eq!(
            (theirs.ident_number, theirs.vendor.as_str()),
            (0x80E0, "tickbus")
        );
        assert_eq!(theirs.model, "Cell _4_, S_d");
        assert_eq!(
            (
                theirs.max_modules,
                theirs.max_input_length,
                theirs.max_output_length
            ),
            (5, 20, 10)
        );
        assert_eq!(
            (theirs.max_tsdr.b19200, theirs.max_tsdr.b187500),
            (900, 8_790)
        );
        assert!(theirs.freeze_mode_supported && theirs.sync_mode_supported && !theirs.fail_safe);
        let modules = theirs
            .available_modules
            .iter()
            .map(|module| (module.name.clone(), module.config.clone()));
        let ours = own
            .modules
            .iter()
            .map(|module| (module.name.clone(), module.identifiers.clone()));
        assert!(modules.eq(ours));
    }

    #[test]
    fn a_machine_with_records_says_so_and_both_parsers_read_it() {
        let mut machine = machine();
        for (.., identity) in &mut machine.stations {
            identity.acyclic = Acyclic {
                class_1: true,
                connections: 2,
                alarms: AlarmSupport::ALL,
                ..Acyclic::default()
            };
        }
        let written = machine.write();
        let own = Gsd::read(written.as_bytes()).expect("a right file");
        assert!(own.dpv1 && own.c1_read_write && own.c2_read_write);
        assert_eq!(
            (own.c1_max_data, own.c2_max_data, own.c2_channels),
            (240, 240, 2)
        );
        let read = own.identity(&["1 word in".to_owned()]).expect("a module");
        assert_eq!(read.user.defaults(), [0x80, 0, 0]);
        let acyclic = read.acyclic;
        assert_eq!(
            (acyclic.class_1, acyclic.connections, acyclic.room()),
            (true, 2, 240)
        );
        assert_eq!(acyclic.alarms, AlarmSupport::ALL);
        assert_eq!(acyclic.nameplate.order, "Cell _4_, S_d");
        let theirs = gsd_parser::parser::parse(std::path::Path::new("x.gsd"), &written);
        assert_eq!(theirs.expect("they read it").ident_number, 0x80E0);
    }
}
