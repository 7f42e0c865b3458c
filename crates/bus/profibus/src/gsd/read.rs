//! Reads a GSD file, keyword by keyword.

use std::collections::BTreeMap;
use std::slice::Iter;
use std::sync::Arc;

use tickbus_base::toml_text::shown;
use tickbus_fieldbus::faults::AlarmKind;

use super::lines::{Line, Values, lines, wrong};
use super::{DiagnosisArea, Gsd, GsdError, Module, Slot};
use crate::acyclic::enable_bit;
use crate::rates::RATES;
use crate::user_parameters::{Allowed, LIMIT, Parameter, ParameterBlock, ParameterKind};

/// The most values, modules of a slot, and the like in one list.
const LIST_LIMIT: usize = 4096;

/// Blocks that do not concern a slave, each with its end.
const SKIPPED: [(&str, &str); 3] = [
    ("unitdiagtype", "EndUnitDiagType"),
    ("physical_interface", "End_Physical_Interface"),
    ("jokerblock_type", "End_Jokerblock_Type"),
];

/// The parameters of a device or a module, as read so far.
#[derive(Default)]
struct Open {
    /// As stated in the file.
    length: Option<usize>,
    /// The octets of `User_Prm_Data`, and the line.
    plain: Option<(Vec<u8>, usize)>,
    /// Offset, octets, and the line.
    constants: Vec<(usize, Vec<u8>, usize)>,
    /// Offset, number, and the line.
    references: Vec<(usize, u32, usize)>,
}

struct Reader<'l> {
    lines: Iter<'l, Line>,
    gsd: Gsd,
    ident: Option<u16>,
    own: Open,
    modules: Vec<Open>,
    parameters: BTreeMap<u32, Arc<Parameter>>,
    texts: BTreeMap<u32, Arc<BTreeMap<i64, String>>>,
    /// The supported rates, by their names, and the wait of each.
    supported: Vec<u32>,
    waits: BTreeMap<u32, u16>,
}

impl Gsd {
    /// Reads the bytes of a file, which are UTF-8 or, as in most files, Latin-1.
    ///
    /// # Errors
    ///
    /// The file is no GSD file, or has a mistake in the parts that describe a station; the first one is returned.
    pub fn read(bytes: &[u8]) -> Result<Self, GsdError> {
        let text = match std::str::from_utf8(bytes) {
            Ok(text) => text.trim_start_matches('\u{FEFF}').to_owned(),
            Err(_) => bytes.iter().copied().map(char::from).collect(),
        };
        let (lines, last) = lines(&text)?;
        let mut reader = Reader {
            lines: lines.iter(),
            gsd: Self::default(),
            ident: None,
            own: Open::default(),
            modules: Vec::new(),
            parameters: BTreeMap::new(),
            texts: BTreeMap::new(),
            supported: Vec::new(),
            waits: BTreeMap::new(),
        };
        while let Some(line) = reader.lines.next() {
            reader.statement(line)?;
        }
        reader.finish(last)
    }
}

impl Reader<'_> {
    fn statement(&mut self, line: &Line) -> Result<(), GsdError> {
        let (key, index, mut values) = line.setting();
        if self.own.statement(&key, index, values)? {
            return Ok(());
        }
        let gsd = &mut self.gsd;
        match key.as_str() {
            "vendor_name" => gsd.vendor = values.quoted()?,
            "model_name" => gsd.model = values.quoted()?,
            "ident_number" => self.ident = Some(number(values)?),
            "modular_station" => gsd.modular = flag(values)?,
            "max_module" => gsd.max_module = Some(count(values)?),
            "max_input_len" => gsd.max_inputs = Some(count(values)?),
            "max_output_len" => gsd.max_outputs = Some(count(values)?),
            "max_data_len" => gsd.max_data = Some(count(values)?),
            "max_user_prm_data_len" => gsd.max_parameters = Some(count(values)?),
            "max_diag_data_len" => gsd.max_diagnosis = Some(count(values)?),
            "min_slave_intervall" => gsd.min_slave_interval = Some(number(values)?),
            "sync_mode_supp" => gsd.sync = flag(values)?,
            "freeze_mode_supp" => gsd.freeze = flag(values)?,
            "fail_safe" => gsd.fail_safe = flag(values)?,
            "set_slave_add_supp" => gsd.set_slave_add = flag(values)?,
            "dpv1_slave" => gsd.dpv1 = flag(values)?,
            "ordernumber" => gsd.order = values.quoted()?,
            "c1_read_write_supp" => gsd.c1_read_write = flag(values)?,
            "c1_max_data_len" => gsd.c1_max_data = octet(values)?,
            "alarm_sequence_mode_count" => gsd.alarms.sequence = octet(values)?,
            "diagnostic_alarm_supp" => self.alarm(AlarmKind::Diagnosis, values)?,
            "process_alarm_supp" => self.alarm(AlarmKind::Process, values)?,
            "pull_plug_alarm_supp" => self.alarm(AlarmKind::Pull, values)?,
            "status_alarm_supp" => self.alarm(AlarmKind::Status, values)?,
            "update_alarm_supp" => self.alarm(AlarmKind::Update, values)?,
            "c2_read_write_supp" => gsd.c2_read_write = flag(values)?,
            "c2_max_data_len" => gsd.c2_max_data = octet(values)?,
            "c2_max_count_channels" => gsd.c2_channels = octet(values)?,
            "unit_diag_bit" => {
                let bit = index_of(index, values)?;
                gsd.diagnosis.bits.insert(bit, values.quoted()?);
            }
            "unit_diag_area" => self.diagnosis_area(line, values)?,
            "prmtext" => self.texts(line, values)?,
            "extuserprmdata" => self.parameter(line, values)?,
            "module" => self.module(line, values)?,
            "slot" => self.slot(index, values)?,
            key => match SKIPPED.iter().find(|(block, _)| *block == key) {
                Some((_, end)) => {
                    while !self.inner(line, end)?.setting().0.eq_ignore_ascii_case(end) {}
                }
                None => self.rate(key, values)?,
            },
        }
        Ok(())
    }

    /// A type of alarm that the device has, or has not.
    fn alarm(&mut self, kind: AlarmKind, values: Values<'_>) -> Result<(), GsdError> {
        if flag(values)? {
            self.gsd.alarms.types |= enable_bit(kind);
        }
        Ok(())
    }

    /// The next line of the block that begins in `opening` and must end with `end`.
    fn inner(&mut self, opening: &Line, end: &str) -> Result<&Line, GsdError> {
        let next = self.lines.next();
        next.ok_or_else(|| {
            let what = format!("the block that begins here has no \"{end}\"");
            wrong(opening.number, what, "add it; the file may be cut off")
        })
    }

    fn rate(&mut self, key: &str, values: Values<'_>) -> Result<(), GsdError> {
        let named = |name: &str| {
            let rate = RATES
                .iter()
                .find(|rate| rate.name.eq_ignore_ascii_case(name));
            rate.map(|rate| rate.baud)
        };
        if let Some(baud) = key.strip_suffix("_supp").and_then(named) {
            if flag(values)? {
                self.supported.push(baud);
            }
        } else if let Some(baud) = key.strip_prefix("maxtsdr_").and_then(named) {
            self.waits.insert(baud, number(values)?);
        }
        Ok(())
    }

    fn diagnosis_area(&mut self, line: &Line, mut values: Values<'_>) -> Result<(), GsdError> {
        let first = values.up_to(u32::MAX)?;
        let last = if values.eat('-') {
            values.up_to(u32::MAX)?
        } else {
            first
        };
        values.end()?;
        let mut area = DiagnosisArea {
            first,
            last,
            values: BTreeMap::new(),
        };
        loop {
            let (key, index, mut values) = self.inner(line, "Unit_Diag_Area_End")?.setting();
            match key.as_str() {
                "unit_diag_area_end" => break,
                "value" => {
                    let value = index_of(index, values)?;
                    area.values.insert(value, values.quoted()?);
                }
                _ => {}
            }
        }
        self.gsd.diagnosis.areas.push(area);
        Ok(())
    }

    fn texts(&mut self, line: &Line, mut values: Values<'_>) -> Result<(), GsdError> {
        let reference = values.up_to(u32::MAX)?;
        let mut texts = BTreeMap::new();
        loop {
            let (key, index, mut values) = self.inner(line, "EndPrmText")?.setting();
            match key.as_str() {
                "endprmtext" => break,
                "text" => {
                    let missing = values.wrong("there is no value", "write Text(0) = \"…\"");
                    let value = index.ok_or(missing)?.number()?;
                    texts.insert(value, values.quoted()?);
                }
                _ => {}
            }
        }
        self.texts.insert(reference, Arc::new(texts));
        Ok(())
    }

    /// `ExtUserPrmData`: the line with its kind and values comes first, keywords follow.
    fn parameter(&mut self, line: &Line, mut values: Values<'_>) -> Result<(), GsdError> {
        const END: &str = "EndExtUserPrmData";
        let reference = values.up_to(u32::MAX)?;
        let name = values.quoted()?;
        let mut described = self.inner(line, END)?.values();
        let kind = kind(&mut described)?;
        let default = described.number()?;
        let range = kind.range();
        if !range.contains(&default) {
            let what = format!("the default {default} does not fit its kind");
            let right = format!("write {} to {}", range.start(), range.end());
            return Err(described.wrong(what, right));
        }
        let mut parameter = Parameter {
            name,
            kind,
            default,
            allowed: allowed(described)?,
            texts: Arc::default(),
            is_changeable: true,
            is_visible: true,
        };
        loop {
            let (key, _, mut values) = self.inner(line, END)?.setting();
            match key.as_str() {
                "endextuserprmdata" => break,
                "prm_text_ref" => {
                    let texts = values.up_to(u32::MAX)?;
                    // Only people need the texts; a device works without them.
                    parameter.texts = self.texts.get(&texts).cloned().unwrap_or_default();
                }
                "changeable" => parameter.is_changeable = flag(values)?,
                "visible" => parameter.is_visible = flag(values)?,
                _ => {}
            }
        }
        self.parameters.insert(reference, Arc::new(parameter));
        Ok(())
    }

    fn module(&mut self, line: &Line, mut values: Values<'_>) -> Result<(), GsdError> {
        let mut module = Module {
            name: values.quoted()?,
            identifiers: values.octets()?,
            ..Module::default()
        };
        let mut open = Open::default();
        loop {
            let inner = self.inner(line, "EndModule")?;
            let (key, index, values) = inner.setting();
            match key.as_str() {
                "endmodule" => break,
                "module" => {
                    let what = format!("the module of line {} has no \"EndModule\"", line.number);
                    return Err(values.wrong(what, "add it before the next one"));
                }
                // The reference of a module is a number on a separate line.
                key if module.reference.is_none()
                    && values.is_empty()
                    && key.starts_with(|c: char| c.is_ascii_digit()) =>
                {
                    module.reference = Some(inner.values().up_to(u32::MAX)?);
                }
                key => {
                    open.statement(key, index, values)?;
                }
            }
        }
        self.gsd.modules.push(module);
        self.modules.push(open);
        Ok(())
    }

    fn slot(&mut self, index: Option<Values<'_>>, mut values: Values<'_>) -> Result<(), GsdError> {
        let number = index_of(index, values)?;
        let name = values.quoted()?;
        let default = values.up_to(u32::MAX)?;
        let mut fitting = Vec::new();
        while !values.is_empty() && fitting.len() < LIST_LIMIT {
            let first = values.up_to(u32::MAX)?;
            let last = if values.eat('-') {
                values.up_to(u32::MAX)?
            } else {
                first
            };
            fitting.push(first..=last);
            values.eat(',');
        }
        values.end()?;
        self.gsd.slots.push(Slot {
            number,
            name,
            default,
            fitting,
        });
        Ok(())
    }

    /// Finishes after the `last` line: resolves references.
    fn finish(mut self, last: usize) -> Result<Gsd, GsdError> {
        self.gsd.ident = self.ident.ok_or_else(|| {
            let right = "take the whole file; each device has one";
            wrong(last, "the file ends, and there is no Ident_Number", right)
        })?;
        // Newer keywords replace older ones.
        let own = &mut self.own;
        if !own.constants.is_empty() || !own.references.is_empty() {
            own.length = None;
        } else if let Some((octets, line)) = own.plain.take() {
            own.constants.push((0, octets, line));
        }
        self.gsd.parameters = self.own.block(&self.parameters)?;
        for (module, open) in self.gsd.modules.iter_mut().zip(&self.modules) {
            module.parameters = open.block(&self.parameters)?;
        }
        for rate in RATES {
            if self.supported.contains(&rate.baud) {
                let wait = self.waits.get(&rate.baud).copied();
                self.gsd
                    .rates
                    .insert(rate.baud, wait.unwrap_or(rate.max_tsdr));
            }
        }
        Ok(self.gsd)
    }
}

impl Open {
    /// Reads a keyword that devices and modules have in common; `false` if it is another one.
    fn statement(
        &mut self,
        key: &str,
        index: Option<Values<'_>>,
        mut values: Values<'_>,
    ) -> Result<bool, GsdError> {
        match key {
            "user_prm_data_len" | "ext_module_prm_data_len" => {
                let length = count(values)?;
                if length > LIMIT {
                    let what = format!("there are {length} octets of parameters");
                    return Err(values.wrong(what, format!("a telegram has at most {LIMIT}")));
                }
                self.length = Some(length);
            }
            "user_prm_data" => self.plain = Some((values.octets()?, values.line)),
            "ext_user_prm_data_const" => {
                let at = offset(index, values)?;
                self.constants.push((at, values.octets()?, values.line));
            }
            "ext_user_prm_data_ref" => {
                let at = offset(index, values)?;
                let reference = values.up_to(u32::MAX)?;
                values.end()?;
                self.references.push((at, reference, values.line));
            }
            _ => return Ok(false),
        }
        Ok(true)
    }

    fn block(&self, all: &BTreeMap<u32, Arc<Parameter>>) -> Result<Arc<ParameterBlock>, GsdError> {
        let mut reached = 0;
        let mut reach = |end: usize, line: usize| {
            let length = self.length.unwrap_or(LIMIT);
            if end > length {
                let what = format!("it reaches to octet {end}, and there are {length}");
                return Err(wrong(line, what, "correct its offset, or the length"));
            }
            reached = reached.max(end);
            Ok(())
        };
        let mut constants = Vec::new();
        for (at, octets, line) in &self.constants {
            reach(at + octets.len(), *line)?;
            constants.push((*at, octets.clone()));
        }
        let mut parameters = Vec::new();
        for (at, reference, line) in &self.references {
            let parameter = all.get(reference).ok_or_else(|| {
                let what = format!("there is no ExtUserPrmData = {reference}");
                wrong(*line, what, "add it, or refer to one that is there")
            })?;
            reach(at + parameter.kind.octets(), *line)?;
            parameters.push((*at, Arc::clone(parameter)));
        }
        Ok(Arc::new(ParameterBlock {
            length: self.length.unwrap_or(reached),
            constants,
            parameters,
        }))
    }
}

/// The offset in brackets after a keyword of parameters.
fn offset(index: Option<Values<'_>>, values: Values<'_>) -> Result<usize, GsdError> {
    Ok(index_of(index, values)? as usize)
}

/// The number in brackets after a keyword.
fn index_of(index: Option<Values<'_>>, values: Values<'_>) -> Result<u32, GsdError> {
    let missing = || values.wrong("there is no number in brackets", "write it, such as (0)");
    index.ok_or_else(missing)?.up_to(u32::MAX)
}

fn flag(mut values: Values<'_>) -> Result<bool, GsdError> {
    let flag = values.number()? != 0;
    values.end()?;
    Ok(flag)
}

fn octet(mut values: Values<'_>) -> Result<u8, GsdError> {
    let octet = values.octet()?;
    values.end()?;
    Ok(octet)
}

/// A number of octets or modules.
fn count(values: Values<'_>) -> Result<usize, GsdError> {
    number(values).map(usize::from)
}

fn number(mut values: Values<'_>) -> Result<u16, GsdError> {
    let number = values.up_to(0xFFFF)?;
    values.end()?;
    Ok(u16::try_from(number).expect("it is at most 0xFFFF"))
}

fn kind(values: &mut Values<'_>) -> Result<ParameterKind, GsdError> {
    let before = *values;
    let word = values.word().to_ascii_lowercase();
    let kind = match word.as_str() {
        "unsigned8" => ParameterKind::Unsigned(1),
        "unsigned16" => ParameterKind::Unsigned(2),
        "unsigned32" => ParameterKind::Unsigned(4),
        "signed8" => ParameterKind::Signed(1),
        "signed16" => ParameterKind::Signed(2),
        "signed32" => ParameterKind::Signed(4),
        "bit" | "bitarea" if values.eat('(') => {
            let first = values.octet()?;
            let last = if values.eat('-') {
                values.octet()?
            } else {
                first
            };
            if !values.eat(')') || first > last || last > 7 {
                let what = format!("the bits are {first} to {last}");
                return Err(before.wrong(
                    what,
                    "write bits of one octet, such as Bit(3) or BitArea(0-2)",
                ));
            }
            ParameterKind::Bits { first, last }
        }
        _ => {
            let what = format!("\"{}\" is no kind of parameter", shown(&word));
            let right = "write Unsigned8, Unsigned16, Unsigned32, Signed8, Signed16, Signed32, Bit(n) or BitArea(n-m)";
            return Err(before.wrong(what, right));
        }
    };
    Ok(kind)
}

/// The values after the default: a range, a list, or nothing.
fn allowed(mut values: Values<'_>) -> Result<Allowed, GsdError> {
    if values.is_empty() {
        return Ok(Allowed::Any);
    }
    let first = values.number()?;
    if values.eat('-') {
        let last = values.number()?;
        values.end()?;
        return Ok(Allowed::Range(first, last));
    }
    let mut list = vec![first];
    while values.eat(',') && list.len() < LIST_LIMIT {
        list.push(values.number()?);
    }
    values.end()?;
    Ok(Allowed::List(list))
}
