//! The view of a script's hook during a call.

use std::collections::HashMap;

use rhai::Dynamic;
use tickbus_image::signal::DataType;

use crate::logic::Access;
use crate::{Step, Variable};

/// A copy of the data for one call: a script cannot borrow them.
#[derive(Default)]
pub(super) struct Frame {
    variables: Vec<Variable>,
    by_name: HashMap<String, usize>,
    values: Vec<u64>,
    writes: Vec<(usize, u64)>,
    is_committing: bool,
    /// The step, during a call.
    step: Option<Step>,
    reader: Option<String>,
}

impl Frame {
    /// Prepares the call of a hook.
    pub(super) fn enter(&mut self, access: &Access<'_>) {
        if self.variables.is_empty() {
            self.variables = access.data.variables().to_vec();
            let names = self.variables.iter().map(|variable| variable.name.clone());
            self.by_name = names.zip(0..).collect();
        }
        self.values.clear();
        let values = (0..self.variables.len()).map(|at| access.data.newest(at));
        self.values.extend(values);
        self.writes.clear();
        self.is_committing = access.data.is_committing();
        self.step = Some(access.step());
        self.reader = access.reader().map(str::to_owned);
    }

    /// The hook has ended: carries out its writes.
    pub(super) fn leave(&mut self, access: &mut Access<'_>) -> Result<(), String> {
        self.step = None;
        for (at, value) in self.writes.drain(..) {
            access.data.write_by_logic(at, value)?;
        }
        Ok(())
    }

    pub(super) fn step(&self) -> Result<Step, String> {
        let outside = "there are no data, and no time, before the run: use this in a hook";
        self.step.ok_or_else(|| outside.to_owned())
    }

    pub(super) fn reader(&self) -> Result<String, String> {
        self.step()?;
        let elsewhere = "only a hook of on_read has a reader";
        self.reader.clone().ok_or_else(|| elsewhere.to_owned())
    }

    fn find(&self, name: &str) -> Result<usize, String> {
        self.step()?;
        let found = self.by_name.get(name).copied();
        found.ok_or_else(|| format!("there is no variable \"{name}\""))
    }

    /// The value of a variable: BOOL as a boolean, REAL and LREAL as floats, all others as whole numbers of 64 bits.
    pub(super) fn get(&self, name: &str) -> Result<Dynamic, String> {
        let at = self.find(name)?;
        let raw = self.values[at];
        Ok(match self.variables[at].data_type {
            DataType::Bool => Dynamic::from_bool(raw != 0),
            DataType::Real => {
                let bits = u32::try_from(raw).expect("slots hold raw values");
                Dynamic::from_float(f32::from_bits(bits).into())
            }
            DataType::Lreal => Dynamic::from_float(f64::from_bits(raw)),
            _ => Dynamic::from_int(raw.cast_signed()),
        })
    }

    /// Writes a variable; a whole number is accepted for a float.
    pub(super) fn set(&mut self, name: &str, value: &Dynamic) -> Result<(), String> {
        let at = self.find(name)?;
        let data_type = self.variables[at].data_type;
        let raw = raw(data_type, value).ok_or_else(|| {
            format!("the variable \"{name}\" has the type {data_type} and cannot hold {value}")
        })?;
        self.writes.push((at, raw));
        if self.is_committing {
            self.values[at] = raw;
        }
        Ok(())
    }
}

fn raw(data_type: DataType, value: &Dynamic) -> Option<u64> {
    #[expect(clippy::cast_precision_loss, reason = "asked for as a float")]
    let float = || match value.as_float() {
        Ok(float) => Some(float),
        Err(_) => value.as_int().ok().map(|whole| whole as f64),
    };
    match data_type {
        DataType::Bool => value.as_bool().ok().map(u64::from),
        #[expect(clippy::cast_possible_truncation, reason = "a REAL has no more digits")]
        DataType::Real => float().map(|float| u64::from((float as f32).to_bits())),
        DataType::Lreal => float().map(f64::to_bits),
        _ => {
            let raw = value.as_int().ok()?.cast_unsigned();
            crate::is_raw(data_type, raw).then_some(raw)
        }
    }
}
