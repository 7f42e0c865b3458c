//! The elements of a diagram and their wires.

use std::collections::HashMap;

/// A diagram.
#[derive(Debug, Default)]
pub(crate) struct Diagram {
    pub(crate) elements: Vec<Element>,
    /// The index of each `localId`.
    pub(crate) by_id: HashMap<u64, usize>,
}

/// An element of a diagram.
#[derive(Debug)]
pub(crate) struct Element {
    /// The `localId`, which wires refer to.
    pub(crate) id: u64,
    /// The position in the file, in bytes.
    pub(crate) at: usize,
    /// The position in the drawing.
    pub(crate) position: (i64, i64),
    /// The `executionOrderId`; 0 if there is none.
    pub(crate) order: u64,
    pub(crate) kind: Kind,
}

/// The kind of an element, and its parts.
#[derive(Debug)]
pub(crate) enum Kind {
    /// The left power rail, which is always on.
    Rail,
    Contact {
        variable: String,
        input: Pin,
    },
    Coil {
        variable: String,
        input: Pin,
    },
    Block {
        name: String,
        /// The instance of a function block; `None` for a function.
        instance: Option<String>,
        inputs: Vec<Pin>,
        outputs: Vec<Pin>,
    },
    Input {
        expression: String,
        is_negated: bool,
    },
    Output {
        expression: String,
        input: Pin,
    },
    InOut {
        expression: String,
        input: Pin,
        is_negated: bool,
    },
    Connector {
        name: String,
        input: Pin,
    },
    Continuation {
        name: String,
    },
    Jump {
        label: String,
        input: Pin,
    },
    Label {
        name: String,
    },
    Return {
        input: Pin,
    },
}

impl Kind {
    /// The pins that wires lead to.
    pub(crate) fn inputs(&self) -> &[Pin] {
        use std::slice::from_ref;
        match self {
            Self::Contact { input, .. }
            | Self::Coil { input, .. }
            | Self::Output { input, .. }
            | Self::InOut { input, .. }
            | Self::Connector { input, .. }
            | Self::Jump { input, .. }
            | Self::Return { input } => from_ref(input),
            Self::Block { inputs, .. } => inputs,
            Self::Rail | Self::Input { .. } | Self::Continuation { .. } | Self::Label { .. } => &[],
        }
    }

    /// The number of the pins that wires come from.
    pub(crate) fn outputs(&self) -> usize {
        match self {
            Self::Block { outputs, .. } => outputs.len(),
            Self::Output { .. }
            | Self::Connector { .. }
            | Self::Jump { .. }
            | Self::Label { .. }
            | Self::Return { .. } => 0,
            _ => 1,
        }
    }
}

/// A pin of an element.
#[derive(Debug, Default)]
pub(crate) struct Pin {
    /// The parameter of a block; empty elsewhere.
    pub(crate) name: String,
    pub(crate) at: usize,
    /// The position relative to its element.
    pub(crate) position: (i64, i64),
    pub(crate) modifier: Modifier,
    pub(crate) wires: Vec<Wire>,
    /// The value that is written at the pin, in place of a wire.
    pub(crate) expression: Option<String>,
}

impl Pin {
    /// True if the pin has a value.
    pub(crate) fn is_connected(&self) -> bool {
        !self.wires.is_empty() || self.expression.is_some()
    }
}

/// A wire that ends at a pin.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Wire {
    /// The element at which the wire begins.
    pub(crate) id: u64,
    /// The parameter of that element.
    pub(crate) parameter: String,
    /// The position in the drawing at which the wire begins.
    pub(crate) from: Option<(i64, i64)>,
    pub(crate) at: usize,
}

/// A change of a value on its way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Modifier {
    #[default]
    Plain,
    Negated,
    Set,
    Reset,
    Rising,
    Falling,
}
