//! GSD files: which device a station is, by its maker.
//!
//! The file is read line by line, and keywords that say nothing of identity or modules are skipped: a device may
//! describe parameters and diagnosis in ways that no slave has to know.

use std::fmt;

use tickbus_base::Mistake;
use tickbus_base::toml_text::{did_you_mean, shown};

use crate::Identity;
use crate::configuration::Configuration;
use crate::telegram::DATA_LIMIT;

/// What a GSD file says that a station needs.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[allow(
    clippy::struct_excessive_bools,
    reason = "the standard's own flags, independent of each other"
)]
pub struct Gsd {
    /// The maker.
    pub vendor: String,
    /// The device.
    pub model: String,
    /// The number of its kind.
    pub ident: u16,
    /// Its modules, in the order of the file.
    pub modules: Vec<Module>,
    /// The slots that take certain modules alone.
    pub slots: Vec<Slot>,
    /// Whether its modules are chosen, and not fixed.
    pub modular: bool,
    /// The most modules.
    pub max_module: Option<usize>,
    /// Whether it supports SYNC.
    pub sync: bool,
    /// Whether it supports FREEZE.
    pub freeze: bool,
    /// Whether it takes telegrams without outputs in CLEAR.
    pub fail_safe: bool,
    /// Whether it has the parameter octets of DPV1.
    pub dpv1: bool,
}

/// A module that a device can have.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Module {
    /// Its name.
    pub name: String,
    /// Its identifiers.
    pub identifiers: Vec<u8>,
    /// The number by which slots refer to it.
    pub reference: Option<u32>,
}

/// A slot, and the modules that fit there.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Slot {
    /// From 1.
    pub number: u32,
    /// The numbers of the modules.
    pub modules: Vec<u32>,
}

/// A mistake in a GSD file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GsdError {
    /// The line, from 1; `None` for the file as a whole.
    pub line: Option<usize>,
    /// What is wrong.
    pub what: String,
}

impl fmt::Display for GsdError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(line) = self.line {
            write!(f, "line {line}: ")?;
        }
        f.write_str(&self.what)
    }
}

impl std::error::Error for GsdError {}

/// A line with the lines that continue it, without its comment.
struct Line {
    number: usize,
    text: String,
}

impl Line {
    fn wrong(&self, what: impl Into<String>) -> GsdError {
        GsdError {
            line: Some(self.number),
            what: what.into(),
        }
    }

    /// A key and what stands behind `=`; the key is in lower case and has no index.
    fn setting(&self) -> Option<(String, &str)> {
        let (key, value) = self.text.split_once('=')?;
        if key.contains('"') {
            return None;
        }
        Some((key.trim().to_ascii_lowercase(), value.trim()))
    }

    fn number(&self, text: &str) -> Result<u32, GsdError> {
        let text = text.trim();
        let hex = text.strip_prefix("0x").or_else(|| text.strip_prefix("0X"));
        let read = match hex {
            Some(hex) => u32::from_str_radix(hex, 16),
            None => text.parse(),
        };
        read.map_err(|_| self.wrong(format!("\"{}\" is no number", shown(text))))
    }

    fn flag(&self, text: &str) -> Result<bool, GsdError> {
        Ok(self.number(text)? != 0)
    }

    /// Text in quotes, and what stands behind it.
    fn quoted<'t>(&self, text: &'t str) -> Result<(String, &'t str), GsdError> {
        let inner = text.trim_start().strip_prefix('"');
        let parts = inner.and_then(|inner| inner.split_once('"'));
        let (name, rest) = parts.ok_or_else(|| self.wrong("there is no name in quotes"))?;
        Ok((name.trim().to_owned(), rest))
    }

    fn octets(&self, text: &str) -> Result<Vec<u8>, GsdError> {
        let numbers = text.split(',').filter(|number| !number.trim().is_empty());
        let octets = numbers.map(|number| {
            let octet = self.number(number)?;
            u8::try_from(octet).map_err(|_| self.wrong(format!("{octet} is more than an octet")))
        });
        octets.collect()
    }

    /// The numbers of a list, or of a range.
    fn references(&self, text: &str) -> Result<Vec<u32>, GsdError> {
        if let Some((first, last)) = text.split_once('-') {
            let (first, last) = (self.number(first)?, self.number(last)?);
            if last.saturating_sub(first) > 0xFFFF {
                return Err(self.wrong("the range has more than 65536 numbers"));
            }
            return Ok((first..=last).collect());
        }
        let numbers = text.split(',').filter(|number| !number.trim().is_empty());
        numbers.map(|number| self.number(number)).collect()
    }
}

/// The lines behind `#Profibus_DP`. A backslash at the end of a line continues it, a semicolon begins a comment.
fn lines(text: &str) -> Result<Vec<Line>, GsdError> {
    let mut all: Vec<Line> = Vec::new();
    let (mut has_begun, mut continues) = (false, false);
    for (index, raw) in text.lines().enumerate() {
        let mut in_quotes = false;
        let end = raw.find(|c| {
            in_quotes ^= c == '"';
            c == ';' && !in_quotes
        });
        let line = raw[..end.unwrap_or(raw.len())].trim();
        if !has_begun {
            has_begun = line.eq_ignore_ascii_case("#profibus_dp");
            continue;
        }
        let (line, goes_on) = match line.strip_suffix('\\') {
            Some(line) => (line, true),
            None => (line, false),
        };
        match all.last_mut() {
            Some(last) if continues => last.text.push_str(line),
            _ if line.is_empty() && !goes_on => {}
            _ => all.push(Line {
                number: index + 1,
                text: line.to_owned(),
            }),
        }
        continues = goes_on;
    }
    if !has_begun {
        return Err(GsdError {
            line: None,
            what: "there is no line \"#Profibus_DP\": it is no GSD file of a DP slave".to_owned(),
        });
    }
    Ok(all)
}

impl Gsd {
    /// Reads the bytes of a file, which are UTF-8 or, as in most, Latin-1.
    ///
    /// # Errors
    ///
    /// It is no GSD file, or the first mistake in what a station needs of it.
    pub fn read(bytes: &[u8]) -> Result<Self, GsdError> {
        let text = match std::str::from_utf8(bytes) {
            Ok(text) => text.trim_start_matches('\u{FEFF}').to_owned(),
            Err(_) => bytes.iter().copied().map(char::from).collect(),
        };
        let mut gsd = Self::default();
        let mut ident = None;
        let mut open: Option<Module> = None;
        for line in lines(&text)? {
            if line.text.eq_ignore_ascii_case("EndModule") {
                gsd.modules.extend(open.take());
                continue;
            }
            let Some((key, value)) = line.setting() else {
                // The reference of a module is a number in a line of its own.
                if let Some(module) = &mut open
                    && module.reference.is_none()
                    && line.text.starts_with(|c: char| c.is_ascii_digit())
                {
                    module.reference = Some(line.number(&line.text)?);
                }
                continue;
            };
            match key.as_str() {
                "module" => {
                    let (name, rest) = line.quoted(value)?;
                    let identifiers = line.octets(rest)?;
                    if open.is_some() {
                        return Err(line.wrong("the module before has no \"EndModule\""));
                    }
                    open = Some(Module {
                        name,
                        identifiers,
                        reference: None,
                    });
                }
                // All others in a module are its own.
                _ if open.is_some() => {}
                "vendor_name" => gsd.vendor = line.quoted(value)?.0,
                "model_name" => gsd.model = line.quoted(value)?.0,
                "ident_number" => {
                    let number = line.number(value)?;
                    let wrong = || line.wrong("Ident_Number is more than 0xFFFF");
                    ident = Some(u16::try_from(number).map_err(|_| wrong())?);
                }
                "modular_station" => gsd.modular = line.flag(value)?,
                "max_module" => gsd.max_module = usize::try_from(line.number(value)?).ok(),
                "sync_mode_supp" => gsd.sync = line.flag(value)?,
                "freeze_mode_supp" => gsd.freeze = line.flag(value)?,
                "fail_safe" => gsd.fail_safe = line.flag(value)?,
                "dpv1_slave" => gsd.dpv1 = line.flag(value)?,
                key => {
                    if let Some(number) = key.strip_prefix("slot(") {
                        let number = line.number(number.trim_end_matches(')'))?;
                        // Behind the name stand the module that it has by default, and those that fit.
                        let (_, rest) = line.quoted(value)?;
                        let rest = rest.trim();
                        let (_, fitting) = rest.split_once([' ', '\t']).unwrap_or((rest, rest));
                        gsd.slots.push(Slot {
                            number,
                            modules: line.references(fitting)?,
                        });
                    }
                }
            }
        }
        gsd.ident = ident.ok_or_else(|| GsdError {
            line: None,
            what: "there is no Ident_Number".to_owned(),
        })?;
        Ok(gsd)
    }

    /// The device with these modules in its slots, by their names; a device whose modules are fixed needs none.
    ///
    /// # Errors
    ///
    /// It does not have one of them, or not in that slot, or not so many.
    pub fn identity(&self, chosen: &[String]) -> Result<Identity, Mistake> {
        let modules = if chosen.is_empty() && !self.modular {
            self.modules.iter().collect()
        } else {
            let names = (1..).zip(chosen);
            names
                .map(|(slot, name)| self.module(slot, name))
                .collect::<Result<Vec<_>, _>>()?
        };
        if modules.is_empty() {
            let what = format!("\"{}\" needs its modules", shown(&self.model));
            let first = self.modules.first().map_or("…", |module| &module.name);
            let right = format!(
                "write their names, such as modules = [\"{}\"]",
                shown(first)
            );
            return Err(Mistake::new(what, right));
        }
        if let Some(most) = self.max_module
            && modules.len() > most
        {
            return Err(Mistake::new(
                format!("there are {} modules", modules.len()),
                format!("\"{}\" has at most {most}", shown(&self.model)),
            ));
        }
        let slots = modules
            .iter()
            .map(|module| (&*module.name, &*module.identifiers));
        let configuration = Configuration::of_modules(slots)
            .map_err(|why| Mistake::new(why, "correct the GSD file"))?;
        let most = configuration.inputs().max(configuration.outputs());
        if most > DATA_LIMIT {
            return Err(Mistake::new(
                format!("the modules have {most} bytes in one direction"),
                format!("a station has at most {DATA_LIMIT}"),
            ));
        }
        Ok(Identity {
            ident: self.ident,
            configuration,
            sync: self.sync,
            freeze: self.freeze,
            fail_safe: self.fail_safe,
            dpv1: self.dpv1,
        })
    }

    fn module(&self, slot: u32, name: &str) -> Result<&Module, Mistake> {
        let found = self.modules.iter().find(|module| module.name == name);
        let Some(module) = found else {
            let names: Vec<&str> = self.modules.iter().map(|m| m.name.as_str()).collect();
            return Err(Mistake::new(
                format!(
                    "\"{}\" has no module \"{}\"",
                    shown(&self.model),
                    shown(name)
                ),
                did_you_mean(name, "modules", &names),
            ));
        };
        let fits = |slot: &Slot| module.reference.is_some_and(|n| slot.modules.contains(&n));
        match self.slots.iter().find(|own| own.number == slot) {
            Some(own) if !fits(own) => Err(Mistake::new(
                format!(
                    "\"{}\" does not fit into slot {slot} of \"{}\"",
                    shown(name),
                    shown(&self.model)
                ),
                "take one of those that its GSD file lists for the slot",
            )),
            _ => Ok(module),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A modular device: comments, continued lines, texts that look like keywords.
    const REMOTE_IO: &str = include_str!("../../../tests/gsd/remote_io.gsd");

    /// A device of one fixed module.
    const ENCODER: &str = include_str!("../../../tests/gsd/encoder.gsd");

    /// The bytes of a file as most makers write them.
    fn latin_1(text: &str) -> Vec<u8> {
        let text = text.replace('\n', "\r\n");
        let octets = text.chars().map(|c| u8::try_from(c).expect("Latin-1"));
        octets.collect()
    }

    fn names(names: &[&str]) -> Vec<String> {
        names.iter().map(|name| (*name).to_owned()).collect()
    }

    #[test]
    fn a_modular_device_is_read_with_all_its_modules() {
        let gsd = Gsd::read(REMOTE_IO.as_bytes()).expect("a right file");
        assert_eq!(Gsd::read(&latin_1(REMOTE_IO)), Ok(gsd.clone()));
        assert_eq!((gsd.vendor.as_str(), gsd.ident), ("Prüfstand", 0x0B1C));
        assert_eq!(gsd.model, "Remote I/O; 4 slots");
        assert!(gsd.modular && gsd.sync && gsd.freeze && gsd.dpv1 && !gsd.fail_safe);
        assert_eq!(gsd.modules.len(), 4);
        assert_eq!(gsd.modules[3].identifiers, [0xC1, 0x43, 0x81, 0xAA]);
        let identity = gsd
            .identity(&names(&["Head", "2 words in", "2 words out"]))
            .expect("modules that it has");
        assert_eq!(identity.ident, 0x0B1C);
        assert_eq!(identity.configuration.bytes(), [0x00, 0x51, 0x61]);
        let sizes = |identity: &Identity| {
            let own = &identity.configuration;
            (own.inputs(), own.outputs())
        };
        assert_eq!(sizes(&identity), (4, 4));
        let axis = gsd.identity(&names(&["Head", "Axis"])).expect("fits");
        assert_eq!(sizes(&axis), (2, 8));
    }

    #[test]
    fn a_device_with_fixed_modules_needs_none_to_be_named() {
        let gsd = Gsd::read(ENCODER.as_bytes()).expect("a right file");
        let identity = gsd.identity(&[]).expect("its own");
        assert_eq!(identity.configuration.bytes(), [0xF1]);
        assert!(identity.fail_safe);
    }

    #[test]
    fn modules_that_do_not_fit_are_refused_with_what_does() {
        let gsd = Gsd::read(REMOTE_IO.as_bytes()).expect("a right file");
        let refused = |modules: &[&str]| {
            let mistake = gsd.identity(&names(modules)).expect_err("refused");
            format!("{}; {}", mistake.what, mistake.right)
        };
        assert!(
            refused(&[])
                .contains("needs its modules; write their names, such as modules = [\"Head\"]")
        );
        assert!(refused(&["Head", "2 word in"]).contains("did you mean \"2 words in\"?"));
        let why = refused(&["Axis"]);
        assert!(why.contains("\"Axis\" does not fit into slot 1"), "{why}");
        let many = ["Head", "Axis", "Axis", "Axis", "Axis"];
        assert!(
            refused(&many).contains("there are 5 modules; \"Remote I/O; 4 slots\" has at most 4")
        );
    }

    #[test]
    fn mistakes_name_the_line() {
        for (text, words) in [
            ("GSD_Revision=3", "no line \"#Profibus_DP\""),
            (
                "#Profibus_DP\nVendor_Name=\"x\"",
                "there is no Ident_Number",
            ),
            (
                "#Profibus_DP\n\nIdent_Number=0x12345",
                "line 3: Ident_Number",
            ),
            (
                "#Profibus_DP\nIdent_Number=twelve",
                "line 2: \"twelve\" is no number",
            ),
            (
                "#Profibus_DP\nModule=\"a\" 0x150\n",
                "line 2: 336 is more than an octet",
            ),
            (
                "#Profibus_DP\nModule=\"a\" 0x50\nModule=\"b\" 0x50",
                "line 3: the module before has no \"EndModule\"",
            ),
            (
                "#Profibus_DP\nModule=a 0x50",
                "line 2: there is no name in quotes",
            ),
            (
                "#Profibus_DP\nSlot(1)=\"x\" 1 0-99999999",
                "line 2: the range",
            ),
        ] {
            let why = Gsd::read(text.as_bytes()).expect_err(words).to_string();
            assert!(why.contains(words), "{why}");
        }
    }

    #[test]
    fn no_piece_of_a_file_makes_it_panic() {
        for file in [REMOTE_IO, ENCODER].map(latin_1) {
            for length in 0..file.len() {
                let _ = Gsd::read(&file[..length]);
                let _ = Gsd::read(&file[length..]);
            }
        }
    }
}
