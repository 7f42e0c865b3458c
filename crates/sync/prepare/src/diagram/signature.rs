//! The parameters of blocks and functions, and the types of variables.

use std::collections::HashMap;

use crate::words;

/// The type of a value.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Type {
    /// By its name, in capitals.
    Named(String),
    Array(Box<Self>),
}

impl Type {
    pub(crate) fn named(name: &str) -> Self {
        Self::Named(match name.to_uppercase().as_str() {
            "TOD" => "TIME_OF_DAY".to_owned(),
            "DT" => "DATE_AND_TIME".to_owned(),
            other => other.to_owned(),
        })
    }

    pub(crate) fn name(&self) -> Option<&str> {
        match self {
            Self::Named(name) => Some(name),
            Self::Array(_) => None,
        }
    }

    pub(crate) fn is(&self, name: &str) -> bool {
        self.name() == Some(name)
    }
}

/// The parameters of a function or function block, their names in capitals.
#[derive(Clone, Debug, Default)]
pub(crate) struct Signature {
    pub(crate) is_block: bool,
    pub(crate) inputs: Vec<(String, Option<Type>)>,
    pub(crate) outputs: Vec<(String, Option<Type>)>,
    pub(crate) in_outs: Vec<(String, Option<Type>)>,
    pub(crate) result: Option<Type>,
}

impl Signature {
    /// The type of a parameter, if it is known.
    pub(crate) fn parameter(&self, name: &str) -> Option<&Type> {
        let mut all = self.parameters();
        let (_, kind) = all.find(|(one, _)| one.eq_ignore_ascii_case(name))?;
        kind.as_ref()
    }

    /// True if there is a parameter of this name.
    pub(crate) fn has(&self, name: &str) -> bool {
        let mut all = self.parameters();
        all.any(|(one, _)| one.eq_ignore_ascii_case(name))
    }

    fn parameters(&self) -> impl Iterator<Item = &(String, Option<Type>)> {
        let lists = [&self.inputs, &self.outputs, &self.in_outs];
        lists.into_iter().flatten()
    }
}

/// The blocks, functions and types that a project declares.
#[derive(Debug, Default)]
pub(crate) struct Library {
    /// By name, in capitals.
    pub(crate) units: HashMap<String, Signature>,
    /// The members of structures, by the name of the type in capitals.
    pub(crate) structures: HashMap<String, HashMap<String, Type>>,
    /// Other names of types.
    pub(crate) aliases: HashMap<String, Type>,
}

/// Function blocks of the standard: their inputs and outputs.
const BLOCKS: [(&str, &str, &str); 16] = [
    ("R_TRIG", "CLK:BOOL", "Q:BOOL"),
    ("F_TRIG", "CLK:BOOL", "Q:BOOL"),
    ("SR", "S1:BOOL R:BOOL", "Q1:BOOL"),
    ("RS", "S:BOOL R1:BOOL", "Q1:BOOL"),
    ("SEMA", "CLAIM:BOOL RELEASE:BOOL", "BUSY:BOOL"),
    ("CTU", "CU:BOOL R:BOOL PV:*", "Q:BOOL CV:*"),
    ("CTD", "CD:BOOL LD:BOOL PV:*", "Q:BOOL CV:*"),
    (
        "CTUD",
        "CU:BOOL CD:BOOL R:BOOL LD:BOOL PV:*",
        "QU:BOOL QD:BOOL CV:*",
    ),
    ("TON", "IN:BOOL PT:TIME", "Q:BOOL ET:TIME"),
    ("TOF", "IN:BOOL PT:TIME", "Q:BOOL ET:TIME"),
    ("TP", "IN:BOOL PT:TIME", "Q:BOOL ET:TIME"),
    ("RTC", "IN:BOOL PDT:DT", "Q:BOOL CDT:DT"),
    (
        "INTEGRAL",
        "RUN:BOOL R1:BOOL XIN:REAL X0:REAL CYCLE:TIME",
        "Q:BOOL XOUT:REAL",
    ),
    ("DERIVATIVE", "RUN:BOOL XIN:REAL CYCLE:TIME", "XOUT:REAL"),
    (
        "PID",
        "AUTO:BOOL PV:REAL SP:REAL X0:REAL KP:REAL TR:REAL TD:REAL CYCLE:TIME",
        "XOUT:REAL",
    ),
    (
        "RAMP",
        "RUN:BOOL X0:REAL X1:REAL TR:TIME CYCLE:TIME",
        "BUSY:BOOL XOUT:REAL",
    ),
];

impl Library {
    /// The signature of a block of the project or of the standard.
    pub(crate) fn signature(&self, name: &str) -> Option<Signature> {
        let name = name.to_uppercase();
        if let Some(found) = self.units.get(&name) {
            return Some(found.clone());
        }
        // CTU_DINT counts in DINT.
        let (base, count) = match name.rsplit_once('_') {
            Some((base, kind)) if base.starts_with("CT") => (base, kind),
            _ => (name.as_str(), "INT"),
        };
        let (_, inputs, outputs) = BLOCKS.iter().find(|(name, ..)| *name == base)?;
        let list = |text: &str| {
            let parts = text.split(' ').filter_map(|part| part.split_once(':'));
            let parts = parts.map(|(name, kind)| {
                let kind = if kind == "*" { count } else { kind };
                (name.to_owned(), Some(Type::named(kind)))
            });
            parts.collect()
        };
        Some(Signature {
            is_block: true,
            inputs: list(inputs),
            outputs: list(outputs),
            ..Signature::default()
        })
    }

    /// The type behind other names.
    pub(crate) fn resolved(&self, kind: &Type) -> Type {
        let mut kind = kind.clone();
        // A chain of names that is longer than this is a circle.
        for _ in 0..20 {
            match kind.name().and_then(|name| self.aliases.get(name)) {
                Some(next) => kind = next.clone(),
                None => break,
            }
        }
        kind
    }

    /// The type of a member of a structure or function block.
    pub(crate) fn member(&self, kind: &Type, member: &str) -> Option<Type> {
        let kind = self.resolved(kind);
        let name = kind.name()?;
        if let Some(members) = self.structures.get(name) {
            return members.get(&member.to_uppercase()).cloned();
        }
        let signature = self.signature(name)?;
        signature.parameter(member).cloned()
    }
}

/// The rule for the types of a standard function's parameters.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Rule {
    /// All inputs have one type, and the result has it too.
    Same,
    /// Like `Same`, and the first input has a separate type.
    SameButFirst,
    /// Like `Same` for the first input; the others have separate types.
    SameAsFirst,
    /// `ADD` and its like: times may be added to dates, and multiplied by numbers.
    Arithmetic,
    /// All inputs have one type, and the result is this.
    Compares,
    /// The result is this, whatever the inputs are.
    Gives(Type),
    /// The inputs say nothing about the result.
    Free,
}

/// The rule of a standard function; `None` if there is no function of that name.
pub(crate) fn rule(name: &str) -> Option<Rule> {
    let name = name.to_uppercase();
    let is_in = |list| words::is_in(list, &name);
    let gives = |kind| Some(Rule::Gives(Type::named(kind)));
    if is_in(
        "ABS SQRT LN LOG EXP SIN COS TAN ASIN ACOS ATAN ATAN2 AND OR XOR NOT MAX MIN LIMIT MOVE MOD CEIL FLOOR ROUND",
    ) {
        return Some(Rule::Same);
    }
    if is_in("ADD SUB MUL DIV") {
        return Some(Rule::Arithmetic);
    }
    if is_in("GT GE EQ LE LT NE") {
        return Some(Rule::Compares);
    }
    if is_in("SEL MUX") {
        return Some(Rule::SameButFirst);
    }
    if is_in("SHL SHR ROL ROR EXPT") {
        return Some(Rule::SameAsFirst);
    }
    if is_in("LEN FIND") {
        return gives("INT");
    }
    if is_in("LEFT RIGHT MID CONCAT INSERT DELETE REPLACE") {
        return gives("STRING");
    }
    if is_in(
        "ADD_TIME SUB_TIME MULTIME MUL_TIME DIVTIME DIV_TIME SUB_DATE_DATE SUB_TOD_TOD SUB_DT_DT",
    ) {
        return gives("TIME");
    }
    if is_in("ADD_TOD_TIME SUB_TOD_TIME DATE_AND_TIME_TO_TIME_OF_DAY") {
        return gives("TOD");
    }
    if is_in("ADD_DT_TIME SUB_DT_TIME CONCAT_DATE_TOD") {
        return gives("DT");
    }
    if name == "TRUNC" {
        return Some(Rule::Free);
    }
    if !words::is_standard_function(&name) {
        return None;
    }
    let target = match name.rsplit_once("_TO_") {
        // UINT_TO_BCD_WORD, WORD_BCD_TO_UINT
        Some((_, target)) => target.strip_prefix("BCD_").unwrap_or(target),
        None => name
            .strip_prefix("TO_")
            .or_else(|| name.strip_prefix("TRUNC_"))?,
    };
    words::is_elementary(target).then(|| Rule::Gives(Type::named(target)))
}
