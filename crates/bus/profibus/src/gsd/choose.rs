//! A device with the modules chosen for its slots.

use tickbus_base::Mistake;
use tickbus_base::toml_text::{did_you_mean, shown};

use super::{Gsd, Module};
use crate::Identity;
use crate::acyclic::{Acyclic, Nameplate};
use crate::configuration::{Configuration, hex};
use crate::telegram::DATA_LIMIT;
use crate::user_parameters::{LIMIT, UserParameters};

/// The most modules that a message names.
const SHOWN_MODULES: usize = 6;

impl Gsd {
    /// The device with these modules in its slots, by their names; a device with fixed modules needs none.
    ///
    /// # Errors
    ///
    /// The device lacks a module, or does not accept it in that slot, or the modules are too many or have too many
    /// bytes.
    pub fn identity(&self, chosen: &[String]) -> Result<Identity, Mistake> {
        let modules = self.modules(chosen)?;
        let slots = modules
            .iter()
            .map(|module| (&*module.name, &*module.identifiers));
        let configuration = Configuration::of_modules(slots)
            .map_err(|why| Mistake::new(why, "correct the GSD file"))?;
        let (inputs, outputs) = (configuration.inputs(), configuration.outputs());
        let mut user = UserParameters::default();
        user.push(None, &self.parameters);
        for (slot, module) in (1..).zip(&modules) {
            user.push(Some((slot, &module.name)), &module.parameters);
        }
        let limit = |own: Option<usize>| own.filter(|_| self.modular).unwrap_or(usize::MAX);
        let octets = "octets of the user's parameters";
        for (count, what, most) in [
            (
                inputs,
                "bytes of inputs",
                DATA_LIMIT.min(limit(self.max_inputs)),
            ),
            (
                outputs,
                "bytes of outputs",
                DATA_LIMIT.min(limit(self.max_outputs)),
            ),
            (inputs + outputs, "bytes in all", limit(self.max_data)),
            (
                user.defaults().len(),
                octets,
                LIMIT.min(limit(self.max_parameters)),
            ),
        ] {
            if count > most {
                return Err(Mistake::new(
                    format!("the modules have {count} {what}"),
                    format!("\"{}\" has at most {most}", shown(&self.model)),
                ));
            }
        }
        Ok(Identity {
            ident: self.ident,
            configuration,
            user,
            sync: self.sync,
            freeze: self.freeze,
            fail_safe: self.fail_safe,
            dpv1: self.dpv1,
            max_diagnosis: self.max_diagnosis.unwrap_or(DATA_LIMIT),
            acyclic: self.acyclic(),
        })
    }

    /// The acyclic services of the device, without records.
    fn acyclic(&self) -> Acyclic {
        let (class_1, class_2) = (self.c1_read_write, self.c2_read_write);
        let rooms = [(class_1, self.c1_max_data), (class_2, self.c2_max_data)];
        let rooms = rooms
            .into_iter()
            .filter_map(|(is_there, room)| (is_there && room > 0).then_some(room));
        Acyclic {
            class_1,
            alarms: self.alarms,
            connections: if class_2 { self.c2_channels.max(1) } else { 0 },
            max_data: rooms.min().unwrap_or(0),
            nameplate: Nameplate {
                order: if self.order.is_empty() {
                    self.model.clone()
                } else {
                    self.order.clone()
                },
                ..Nameplate::default()
            },
            ..Acyclic::default()
        }
    }

    fn modules(&self, chosen: &[String]) -> Result<Vec<&Module>, Mistake> {
        let most = self.max_module.unwrap_or(usize::MAX);
        // If only some of a device's modules fit at a time, they must be chosen in any case.
        let are_fixed = !self.modular && self.modules.len() <= most;
        let modules: Vec<&Module> = if chosen.is_empty() && are_fixed {
            self.modules.iter().collect()
        } else {
            let names = (1..).zip(chosen);
            names
                .map(|(slot, name)| self.module(slot, name))
                .collect::<Result<_, _>>()?
        };
        if modules.is_empty() {
            let what = format!("\"{}\" needs its modules", shown(&self.model));
            let right = format!("write their names, such as modules = [{}]", self.proposal());
            return Err(Mistake::new(what, right));
        }
        if modules.len() > most {
            return Err(Mistake::new(
                format!("there are {} modules", modules.len()),
                format!("\"{}\" has at most {most}", shown(&self.model)),
            ));
        }
        Ok(modules)
    }

    /// The names of the default modules of its slots, or of its first module.
    fn proposal(&self) -> String {
        let of_slot = |slot: &super::Slot| {
            let mut all = self.modules.iter();
            all.find(|module| module.reference == Some(slot.default))
        };
        let mut proposed: Vec<&Module> = self.slots.iter().map_while(of_slot).collect();
        if proposed.is_empty() {
            proposed.extend(self.modules.first());
        }
        quoted(proposed.into_iter())
    }

    /// The module with this name, or with this number (`#12`) if no module has that name.
    fn module(&self, slot: u32, name: &str) -> Result<&Module, Mistake> {
        let mut named: Vec<&Module> = self.modules.iter().filter(|m| m.name == name).collect();
        let number = name.strip_prefix('#').and_then(|text| text.parse().ok());
        if named.is_empty() && number.is_some() {
            named.extend(self.modules.iter().find(|m| m.reference == number));
        }
        if named.is_empty() {
            let names: Vec<&str> = self.modules.iter().map(|m| m.name.as_str()).collect();
            return Err(Mistake::new(
                format!(
                    "\"{}\" has no module \"{}\"",
                    shown(&self.model),
                    shown(name)
                ),
                did_you_mean(name, "modules", &names),
            ));
        }
        let own = self.slots.iter().find(|own| own.number == slot);
        let fits = |module: &&Module| {
            let allowed = |number| {
                own.is_some_and(|own| own.fitting.iter().any(|range| range.contains(&number)))
            };
            own.is_none() || module.reference.is_some_and(allowed)
        };
        named.retain(fits);
        let Some((module, others)) = named.split_first() else {
            return Err(Mistake::new(
                format!(
                    "\"{}\" does not fit into slot {slot} of \"{}\"",
                    shown(name),
                    shown(&self.model)
                ),
                format!(
                    "its GSD file allows {}",
                    quoted(self.modules.iter().filter(fits))
                ),
            ));
        };
        let is_same = |other: &&Module| {
            (&other.identifiers, &other.parameters) == (&module.identifiers, &module.parameters)
        };
        let Some(other) = others.iter().find(|other| !is_same(other)) else {
            return Ok(module);
        };
        let [first, second] = [*module, *other].map(|module| {
            let number = module.reference.map(|number| format!("\"#{number}\", "));
            format!("{}{}", number.unwrap_or_default(), hex(&module.identifiers))
        });
        let right = match (module.reference, other.reference) {
            (Some(one), Some(two)) if one != two => {
                "write the number of the one that the PLC's project has"
            }
            _ => "change the name of one in a copy of the GSD file",
        };
        Err(Mistake::new(
            format!(
                "\"{}\" has different modules \"{}\" ({first}; {second})",
                shown(&self.model),
                shown(name)
            ),
            right,
        ))
    }
}

/// The names of some modules, with a sign if there are more.
fn quoted<'m>(mut modules: impl Iterator<Item = &'m Module>) -> String {
    let names = modules.by_ref().take(SHOWN_MODULES);
    let names: Vec<String> = names
        .map(|module| format!("\"{}\"", shown(&module.name)))
        .collect();
    let more = if modules.next().is_some() {
        ", …"
    } else {
        ""
    };
    if names.is_empty() {
        return "none that it describes".to_owned();
    }
    format!("{}{more}", names.join(", "))
}
