//! A small interpreter of Structured Text, as parsed by another project's parser.
//!
//! The parser, iecst, does not support typed literals: `WORD#16#00FF` is read as `16#00FF`.

use std::collections::HashMap;

use iecst::{BinaryOp, Expr, ExprKind, Pou, Stmt, StmtKind, UnaryOp};
use tickbus::signal::DataType;

/// A value while a program runs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Value {
    Bool(bool),
    /// An integer or a bit string of a type; `None` for a literal.
    Whole(Option<DataType>, i128),
    Real(f32),
}

impl Value {
    /// A value of a type, from its bits.
    pub(crate) fn of_bits(data_type: DataType, bits: u64) -> Self {
        match data_type {
            DataType::Bool => Self::Bool(bits != 0),
            DataType::Real => Self::Real(f32::from_bits(u32::try_from(bits).expect("32 bits"))),
            // The sources handle an LREAL as its bits.
            DataType::Lreal => Self::Whole(Some(DataType::Lword), bits.into()),
            other => Self::Whole(Some(other), wrapped(other, bits.into())),
        }
    }

    /// The bits.
    pub(crate) fn bits(self) -> u64 {
        match self {
            Self::Bool(value) => value.into(),
            Self::Real(value) => value.to_bits().into(),
            Self::Whole(data_type, value) => {
                let width = data_type.expect("a type").width().bits();
                u64::try_from(value & ((1_i128 << width) - 1)).expect("at most 64 bits")
            }
        }
    }

    fn whole(self) -> i128 {
        match self {
            Self::Whole(_, value) => value,
            other => panic!("{other:?} is no whole number"),
        }
    }
}

/// A number reduced to the range of a type.
fn wrapped(data_type: DataType, value: i128) -> i128 {
    let bits = data_type.width().bits();
    let low = value & ((1_i128 << bits) - 1);
    if data_type.is_signed() && low >> (bits - 1) == 1 {
        low - (1 << bits)
    } else {
        low
    }
}

/// Variables by path, such as `io.In[3]`, and functions.
#[derive(Default)]
pub(crate) struct Machine {
    pub(crate) variables: HashMap<String, Value>,
    functions: HashMap<String, Pou>,
}

/// All program units of a source.
pub(crate) fn units(source: &str) -> Vec<Pou> {
    let mut plain = source.to_owned();
    for kind in ["DWORD", "LWORD", "WORD"] {
        plain = plain.replace(&format!("{kind}#"), "");
    }
    let mut units = Vec::new();
    let ends = ["END_FUNCTION\n", "END_PROGRAM\n"];
    let mut rest = plain.as_str();
    while let Some((at, end)) = ends
        .iter()
        .filter_map(|end| Some((rest.find(end)?, end)))
        .min()
    {
        let (unit, after) = rest.split_at(at + end.len());
        units.push(iecst::parse_pou(unit).unwrap_or_else(|error| panic!("{error}\n{unit}")));
        rest = after;
    }
    units
}

impl Machine {
    pub(crate) fn with_functions(units: &[Pou]) -> Self {
        let functions = units
            .iter()
            .map(|unit| (unit.name.clone(), unit.clone()))
            .collect();
        Self {
            variables: HashMap::new(),
            functions,
        }
    }

    pub(crate) fn run(&mut self, body: &[Stmt]) {
        for statement in body {
            match &statement.kind {
                StmtKind::Empty => {}
                StmtKind::Assignment { target, value } => {
                    let value = self.value(value);
                    let path = self.path(target);
                    let value = match (self.variables.get(&path), value) {
                        (Some(Value::Whole(data_type, _)), Value::Whole(_, number)) => {
                            Value::Whole(*data_type, number)
                        }
                        (_, value) => value,
                    };
                    self.variables.insert(path, value);
                }
                StmtKind::If {
                    condition,
                    then_body,
                    elsif_branches,
                    else_body,
                } => {
                    if self.value(condition) == Value::Bool(true) {
                        self.run(then_body);
                    } else if let Some((_, body)) = elsif_branches
                        .iter()
                        .find(|(condition, _)| self.value(condition) == Value::Bool(true))
                    {
                        self.run(body);
                    } else if let Some(body) = else_body {
                        self.run(body);
                    }
                }
                StmtKind::While { condition, body } => {
                    while self.value(condition) == Value::Bool(true) {
                        self.run(body);
                    }
                }
                other => panic!("{other:?}"),
            }
        }
    }

    fn path(&self, expression: &Expr) -> String {
        match &expression.kind {
            ExprKind::Ident(name) => name.clone(),
            ExprKind::MemberAccess { expr, member } => format!("{}.{member}", self.path(expr)),
            ExprKind::ArrayIndex { array, indices } => {
                format!("{}[{}]", self.path(array), self.value(&indices[0]).whole())
            }
            other => panic!("{other:?} is no variable"),
        }
    }

    fn value(&self, expression: &Expr) -> Value {
        match &expression.kind {
            ExprKind::IntLiteral(number) => Value::Whole(None, i128::from(*number)),
            #[expect(clippy::cast_possible_truncation, reason = "a REAL")]
            ExprKind::RealLiteral(number) => Value::Real(*number as f32),
            ExprKind::BoolLiteral(value) => Value::Bool(*value),
            ExprKind::Paren(inner) => self.value(inner),
            ExprKind::UnaryOp {
                op: UnaryOp::Not,
                expr,
            } => Value::Bool(self.value(expr) != Value::Bool(true)),
            ExprKind::BinaryOp { left, op, right } => {
                binary(self.value(left), *op, self.value(right))
            }
            ExprKind::FunctionCall { name, args } => {
                let arguments: Vec<Value> = args
                    .iter()
                    .map(|argument| self.value(argument.value.as_ref().expect("a value")))
                    .collect();
                self.call(name, &arguments)
            }
            _ => {
                let path = self.path(expression);
                *self
                    .variables
                    .get(&path)
                    .unwrap_or_else(|| panic!("{path} has no value"))
            }
        }
    }

    fn call(&self, name: &str, arguments: &[Value]) -> Value {
        if let Some(function) = self.functions.get(name) {
            let mut inside = Self {
                variables: HashMap::new(),
                functions: self.functions.clone(),
            };
            let mut arguments = arguments.iter();
            for variable in function.var_blocks.iter().flat_map(|block| &block.vars) {
                let data_type = format!("{:?}", variable.var_type.kind);
                let data_type = data_type.split('"').nth(1).expect("a type");
                let first = match data_type.parse::<DataType>().expect("an elementary type") {
                    DataType::Real => Value::Real(0.0),
                    DataType::Bool => Value::Bool(false),
                    other => Value::Whole(Some(other), 0),
                };
                let value = arguments.next().copied().unwrap_or(first);
                inside.variables.insert(variable.name.clone(), value);
            }
            inside.run(&function.body);
            return inside.variables[name];
        }
        let first = arguments[0];
        let shifted = |by: fn(u64, u32, u32) -> u64| {
            let Value::Whole(Some(data_type), _) = first else {
                panic!("{name} of {first:?}")
            };
            let width = u32::try_from(data_type.width().bits()).expect("small");
            let by = by(
                first.bits(),
                u32::try_from(arguments[1].whole()).expect("small"),
                width,
            );
            Value::Whole(Some(data_type), wrapped(data_type, by.into()))
        };
        match name {
            "SHL" => shifted(|bits, by, _| bits << by),
            "SHR" => shifted(|bits, by, _| bits >> by),
            "ROL" => shifted(|bits, by, width| bits << by | bits >> (width - by)),
            "ABS" => match first {
                Value::Real(number) => Value::Real(number.abs()),
                other => panic!("ABS of {other:?}"),
            },
            _ => {
                let (from, to) = name
                    .split_once("_TO_")
                    .unwrap_or_else(|| panic!("no function {name}"));
                let (from, to): (DataType, DataType) =
                    (from.parse().expect(name), to.parse().expect(name));
                match first {
                    #[expect(
                        clippy::cast_possible_truncation,
                        reason = "a REAL that is a whole number"
                    )]
                    Value::Real(number) => {
                        Value::Whole(Some(to), wrapped(to, number.round_ties_even() as i128))
                    }
                    #[expect(clippy::cast_precision_loss, reason = "as a controller converts it")]
                    Value::Whole(data_type, number) => {
                        assert!(
                            data_type.is_none_or(|data_type| data_type == from),
                            "{name} of {first:?}"
                        );
                        if to == DataType::Real {
                            Value::Real(number as f32)
                        } else {
                            Value::Whole(Some(to), wrapped(to, number))
                        }
                    }
                    Value::Bool(_) => panic!("{name} of a BOOL"),
                }
            }
        }
    }
}

fn binary(left: Value, op: BinaryOp, right: Value) -> Value {
    match (left, right) {
        (Value::Whole(one, left), Value::Whole(other, right)) => {
            assert!(
                one.is_none() || other.is_none() || one == other,
                "{one:?} {op:?} {other:?}"
            );
            let data_type = one.or(other);
            let number = match op {
                BinaryOp::And => left & right,
                BinaryOp::Or => left | right,
                BinaryOp::Add => left + right,
                BinaryOp::Sub => left - right,
                BinaryOp::Eq => return Value::Bool(left == right),
                BinaryOp::Ne => return Value::Bool(left != right),
                BinaryOp::Gt => return Value::Bool(left > right),
                BinaryOp::Lt => return Value::Bool(left < right),
                BinaryOp::Ge => return Value::Bool(left >= right),
                other => panic!("{other:?} of whole numbers"),
            };
            Value::Whole(data_type, number)
        }
        (Value::Real(left), Value::Real(right)) => match op {
            BinaryOp::Add => Value::Real(left + right),
            BinaryOp::Sub => Value::Real(left - right),
            BinaryOp::Mul => Value::Real(left * right),
            BinaryOp::Div => Value::Real(left / right),
            BinaryOp::Gt => Value::Bool(left > right),
            BinaryOp::Lt => Value::Bool(left < right),
            BinaryOp::Ge => Value::Bool(left >= right),
            other => panic!("{other:?} of reals"),
        },
        (Value::Bool(left), Value::Bool(right)) => Value::Bool(match op {
            BinaryOp::And => left & right,
            BinaryOp::Or => left | right,
            other => panic!("{other:?} of truths"),
        }),
        other => panic!("{op:?} of {other:?}"),
    }
}
