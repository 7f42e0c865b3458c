//! Ladder and function block diagrams of `PLCopen` XML, written as Structured Text.
//!
//! The order of evaluation is that of the generator of Beremiz and OpenPLC Editor, so a diagram does here what it does
//! when its own editor compiles it: elements with an `executionOrderId` come first, in that order; then outputs and
//! coils, then blocks without a reader, each from top to bottom and from left to right. An output first evaluates the
//! blocks that its wires lead to. A block runs once in a scan; an element that asks for its outputs afterwards, or from
//! inside a loop, reads the values of the last time.

mod elements;
mod infer;
mod order;
mod read;
mod signature;
#[cfg(test)]
mod tests;
mod write;

pub(crate) use read::read;
pub(crate) use signature::{Library, Signature, Type};
pub(crate) use write::{Unit, Written, write};
