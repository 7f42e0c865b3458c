//! An FMU in place of the machine.

use std::path::Path;
use std::sync::Arc;

use tickbus_base::Mistake;
use tickbus_base::toml_text::{Mistakes, Table, Value, nearest, shown};
use tickbus_driver::Driver;
use tickbus_driver_cfg::Config;
use tickbus_fmi::foreign::{ForeignVariable, Join, Machine, MachineOptions, Map, Unpacked};
use tickbus_fmi::{Value as FmuValue, ValueType};
use tickbus_image::signal::{SignalTable, Slot};

use super::test::TextPosition;

/// An FMU, and the assignment of its variables to signals.
#[derive(Clone, Debug)]
pub(super) struct Plant {
    /// Unpacked once for all tests of a file.
    fmu: Arc<Unpacked>,
    join: Join,
    options: MachineOptions,
    /// The FMU's position in the test file.
    pub(super) place: TextPosition,
}

impl Plant {
    /// True if each run has a process of its own.
    pub(super) const fn is_isolated(&self) -> bool {
        self.options.isolated
    }

    /// The names of the FMU's faults.
    pub(super) fn fault_names(&self) -> Vec<String> {
        self.fmu.model.fault_names()
    }

    /// The faults of the FMU that are on or off, and that no signal sets.
    pub(super) fn switches(&self) -> Vec<String> {
        self.fmu.model.fault_switches(&self.join)
    }

    /// Checks a fault of the FMU.
    ///
    /// # Errors
    ///
    /// The FMU has no such fault.
    pub(super) fn check_fault(&self, name: &str, value: f64) -> Result<(), Mistake> {
        self.fmu.model.check_fault(name, value)
    }

    /// The variable with this name, if it is a number that can be set before a run, with its unit, and its value if the map
    /// has one.
    ///
    /// # Errors
    ///
    /// The FMU has no such parameter.
    pub(super) fn parameter(&self, name: &str) -> Result<(usize, String, Option<f64>), Mistake> {
        let model = &self.fmu.model;
        let is_real = |one: &ForeignVariable| {
            matches!(
                one.value_type,
                Some(ValueType::Float32 | ValueType::Float64)
            )
        };
        let is_joined = |index| {
            let mut joined = self.join.inputs.iter().chain(&self.join.outputs);
            joined.any(|joined| joined.variable == index)
        };
        let found = model.position(name);
        let Some(index) = found.filter(|index| !is_joined(*index)) else {
            let names = model.variables.iter().filter(|one| is_real(one));
            let near = nearest(name, names.map(|one| &*one.name));
            let right = near.map_or_else(
                || "name one of its parameters, as its modelDescription.xml has them".to_owned(),
                |near| format!("did you mean \"{near}\"?"),
            );
            let what = if found.is_some() {
                format!("\"{}\" is joined with a signal", shown(name))
            } else {
                format!("the FMU has no variable \"{}\"", shown(name))
            };
            return Err(Mistake::new(what, right));
        };
        let variable = &model.variables[index];
        if !is_real(variable) {
            return Err(Mistake::new(
                format!("\"{}\" is of type {}", shown(name), variable.type_name),
                "only floating point numbers can be fitted",
            ));
        }
        if variable.is_element() {
            return Err(Mistake::new(
                format!("\"{}\" is an element of an array", shown(name)),
                "only scalar variables can be fitted",
            ));
        }
        let mut set = self.join.parameters.iter().filter(|(at, _)| *at == index);
        let set = set.find_map(|(_, values)| values.first());
        let unit = variable.unit.clone().unwrap_or_default();
        Ok((index, unit, set.map(|value| value.real())))
    }

    /// This FMU with other values of some variables.
    pub(super) fn with(&self, values: &[(usize, f64)]) -> Self {
        let mut plant = self.clone();
        let parameters = &mut plant.join.parameters;
        parameters.retain(|(at, _)| values.iter().all(|(other, _)| at != other));
        let values = values.iter();
        parameters.extend(values.map(|(at, value)| (*at, vec![FmuValue::Real(*value)])));
        plant
    }

    /// Starts a run of the FMU without a driver; sets `slots` to the initial sensor values.
    pub(super) fn start_alone(
        &self,
        table: &SignalTable,
        slots: &mut [Slot],
    ) -> Result<Machine, String> {
        let machine = Machine::open(&self.fmu, &self.join, table, self.options, slots);
        machine.map_err(|failure| failure.to_string())
    }

    /// Starts a run of the FMU, with its faults in the driver; sets `slots` to the initial sensor values.
    pub(super) fn start(
        &self,
        table: &SignalTable,
        driver: &mut Driver,
        slots: &mut [Slot],
    ) -> Result<Machine, String> {
        let declared = driver.declare_model_faults(self.fmu.model.fault_names());
        declared.map_err(|mistake| mistake.to_string())?;
        self.start_alone(table, slots)
    }
}

/// The keys of `[machine]` for an FMU, as written.
pub(super) struct FmuKeys<'a> {
    fmu: Option<Value<'a>>,
    map: Option<Value<'a>>,
    isolated: Option<Value<'a>>,
}

impl<'a> FmuKeys<'a> {
    pub(super) fn take(table: &mut Table<'a>) -> Self {
        Self {
            fmu: table.take("fmu"),
            map: table.take("map"),
            isolated: table.take("isolated"),
        }
    }

    /// Reads the keys, and the files that they name. The second result has the mistakes in those files.
    pub(super) fn read(self, config: &Config, folder: &Path) -> (Option<Plant>, Option<Mistakes>) {
        let Some(value) = &self.fmu else {
            for (key, value) in [("map", &self.map), ("isolated", &self.isolated)] {
                if let Some(value) = value {
                    let what = format!("\"{key}\" stands without \"fmu\"");
                    value.wrong(what, "name the FMU, or remove it");
                }
            }
            return (None, None);
        };
        let isolated = self.isolated.as_ref().and_then(Value::boolean);
        let path = |value: &Value<'_>, right: &str| Some(folder.join(value.text(right)?));
        let Some(file) = path(value, "write the path of an FMU, as seen from this file") else {
            return (None, None);
        };
        let map = self.map.as_ref();
        let map = map.map(|value| path(value, "write the path of a map, as seen from this file"));
        let mut fmu = match Unpacked::open(&file) {
            Ok(fmu) => fmu,
            Err(mistakes) => return (None, Some(mistakes)),
        };
        let map = match map {
            None => Map::default(),
            Some(None) => return (None, None),
            Some(Some(file)) => match Map::load(&file, &mut fmu.model, config) {
                Ok(map) => map,
                Err(mistakes) => return (None, Some(mistakes)),
            },
        };
        match Join::of(config, &fmu.model, &map) {
            Ok(join) => {
                let plant = Plant {
                    fmu: Arc::new(fmu),
                    join,
                    options: MachineOptions {
                        isolated: isolated.unwrap_or_default(),
                        ..MachineOptions::default()
                    },
                    place: value.place(),
                };
                (Some(plant), None)
            }
            Err(mistake) => {
                value.refuse(mistake);
                (None, None)
            }
        }
    }
}
