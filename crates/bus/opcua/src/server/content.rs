//! The value of a variable that is an array or a structure, as a tree whose leaves can be signals.

use std::sync::Arc;

use opcua::types::custom::{DataTypeTree, DynamicStructure, StructTypeInfo};
use opcua::types::{
    Array, ByteString, DateTime, ExpandedNodeId, ExtensionObject, Guid, LocalizedText, NodeId,
    QualifiedName, StatusCode, StructureType, UAString, Variant, VariantScalarTypeId,
    VariantTypeId,
};

use super::structure::{Exact, selected};
use crate::Step;

/// The most elements of an array with signals.
const LONGEST: usize = 10_000;

/// The most values, structures and arrays in a variable with signals.
const MOST: usize = 100_000;

/// The name of the number that says which member a union has (OPC 10000-6, 5.2.8).
const SWITCH: &str = "SwitchField";

/// A value, or a part of it.
#[derive(Clone, Debug)]
pub(super) enum Content {
    /// A value without members.
    Leaf(Variant),
    /// The elements of an array.
    List(Elements),
    /// The members of a structure.
    Structure(Arc<StructTypeInfo>, Vec<Content>),
    /// A member of a structure that can be missing.
    Optional(Box<Content>, Presence),
    /// The number of the member that a union has, from 1 or 0 for none, and before that all members that it can have.
    Union(Arc<StructTypeInfo>, Vec<Content>),
}

/// The elements of an array.
#[derive(Clone, Debug)]
pub(super) struct Elements {
    of_type: VariantScalarTypeId,
    /// An element that is zero or empty.
    empty: Arc<Content>,
    all: Vec<Content>,
}

/// The presence of a member that can be missing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Presence {
    Missing,
    /// A client wrote it.
    Written,
    /// The member is or has a signal, and is always there.
    Signal,
}

/// The type of a variable or of a member.
pub(super) struct Shape<'a> {
    pub(super) data_type: &'a NodeId,
    pub(super) rank: i32,
    pub(super) dimensions: Option<&'a [u32]>,
}

impl Content {
    /// The value of a variable or member in which everything is zero or empty.
    ///
    /// # Errors
    ///
    /// The type is unknown, abstract, or has more than one dimension.
    pub(super) fn empty(shape: &Shape<'_>, tree: &DataTypeTree) -> Result<Self, String> {
        let of_type = tree.parent_ids().get_builtin_type(shape.data_type);
        let of_type = of_type.ok_or_else(|| format!("its type {} is unknown", shape.data_type))?;
        match shape.rank {
            ..=-1 => Self::single(of_type, shape.data_type, tree),
            0 | 1 => {
                let length = shape.dimensions.and_then(|sizes| sizes.first());
                let length = length.map_or(0, |length| *length as usize);
                if length > LONGEST {
                    return Err(format!("it has {length} elements; the most are {LONGEST}"));
                }
                let element = Self::single(of_type, shape.data_type, tree)?;
                bounded(element.count() * length)?;
                Ok(Self::List(Elements {
                    of_type,
                    all: vec![element.clone(); length],
                    empty: Arc::new(element),
                }))
            }
            rank => Err(format!("it has {rank} dimensions, and signals need one")),
        }
    }

    fn single(
        of_type: VariantScalarTypeId,
        data_type: &NodeId,
        tree: &DataTypeTree,
    ) -> Result<Self, String> {
        if of_type != VariantScalarTypeId::ExtensionObject {
            let zero = zero(of_type);
            return zero
                .map(Self::Leaf)
                .ok_or_else(|| format!("its type {data_type} leaves open what values are"));
        }
        let info = tree.get_struct_type(data_type);
        let info = info.ok_or_else(|| format!("its type {data_type} is unknown"))?;
        let mut count = 0;
        let members = info.fields.iter().map(|field| {
            let shape = Shape {
                data_type: &field.type_id,
                rank: field.value_rank,
                dimensions: field.array_dimensions.as_deref(),
            };
            let member = Self::empty(&shape, tree).and_then(|member| {
                count += member.count();
                bounded(count)?;
                Ok(member)
            });
            let member = member.map_err(|why| format!("{}: {why}", field.name))?;
            Ok(if field.is_optional {
                Self::Optional(Box::new(member), Presence::Missing)
            } else {
                member
            })
        });
        let mut members = members.collect::<Result<Vec<_>, String>>()?;
        if info.structure_type == StructureType::Union {
            members.push(Self::Leaf(0_u32.into()));
            return Ok(Self::Union(Arc::clone(info), members));
        }
        Ok(Self::Structure(Arc::clone(info), members))
    }

    /// The number of values, structures and arrays.
    fn count(&self) -> usize {
        match self {
            Self::Leaf(_) => 1,
            Self::Optional(member, _) => member.count(),
            Self::List(Elements { all, .. }) | Self::Structure(_, all) | Self::Union(_, all) => {
                1 + all.iter().map(Self::count).sum::<usize>()
            }
        }
    }

    /// The indices of the member that `steps` name. An array without a stated length grows to have it.
    ///
    /// # Errors
    ///
    /// There is no such member.
    pub(super) fn find(&mut self, steps: &[Step], has_length: bool) -> Result<Vec<usize>, String> {
        if let Self::Optional(member, presence) = self {
            *presence = Presence::Signal;
            return member.find(steps, has_length);
        }
        let Some((step, rest)) = steps.split_first() else {
            return match self {
                Self::List(..) => Err("an array is not a single value".to_owned()),
                Self::Structure(..) => Err("a structure is not a single value".to_owned()),
                Self::Union(..) => Err("a union is not a single value".to_owned()),
                _ => Ok(Vec::new()),
            };
        };
        let (at, member, has_length) = match (self, step) {
            (Self::List(Elements { empty, all, .. }), Step::Element(at)) => {
                if *at >= all.len() {
                    if has_length || *at >= LONGEST {
                        return Err(format!("the last element is [{}]", all.len().max(1) - 1));
                    }
                    bounded(empty.count() * (at + 1))?;
                    all.resize(at + 1, (**empty).clone());
                }
                (*at, &mut all[*at], true)
            }
            (Self::Union(info, all), Step::Member(name))
                if name == SWITCH && !info.index_by_name.contains_key(name) =>
            {
                let at = all.len() - 1;
                (at, &mut all[at], true)
            }
            (Self::Structure(info, members) | Self::Union(info, members), Step::Member(name)) => {
                let Some(at) = info.index_by_name.get(name) else {
                    let mut names: Vec<&str> = info
                        .fields
                        .iter()
                        .map(|field| field.name.as_str())
                        .collect();
                    if info.structure_type == StructureType::Union {
                        names.push(SWITCH);
                    }
                    return Err(format!("the members are {}", names.join(", ")));
                };
                let sizes = info.fields[*at].array_dimensions.as_ref();
                let has_length = sizes.is_some_and(|sizes| sizes.iter().any(|size| *size > 0));
                (*at, &mut members[*at], has_length)
            }
            (Self::List(..), Step::Member(_)) => {
                return Err("an array has elements: [0]".to_owned());
            }
            (Self::Structure(..) | Self::Union(..), Step::Element(_)) => {
                return Err("a structure has members: .name".to_owned());
            }
            _ => return Err("a single value has no members".to_owned()),
        };
        let mut indices = vec![at];
        indices.extend(member.find(rest, has_length)?);
        Ok(indices)
    }

    /// All members are found, at these `places`: an array without any can have any length, and a union has the only member
    /// with signals, unless its number is a signal.
    ///
    /// # Errors
    ///
    /// Signals are in two members of a union, and its number has no signal.
    pub(super) fn close(&mut self, places: &[&[usize]]) -> Result<(), String> {
        let of_member = |at: usize| -> Vec<&[usize]> {
            let places = places.iter().filter_map(|place| place.split_first());
            let places = places.filter(|(first, _)| **first == at);
            places.map(|(_, rest)| rest).collect()
        };
        match self {
            Self::Leaf(_) => {}
            Self::Optional(member, _) => member.close(places)?,
            Self::List(Elements { of_type, all, .. }) if all.is_empty() => {
                let none = Array::new(*of_type, Vec::new());
                *self = Self::Leaf(none.map_or(Variant::Empty, Variant::from));
            }
            Self::List(Elements { all, .. }) | Self::Structure(_, all) => {
                for (at, member) in all.iter_mut().enumerate() {
                    member.close(&of_member(at))?;
                }
            }
            Self::Union(info, all) => {
                let switch = all.len() - 1;
                let with_signals = (0..switch).filter(|at| !of_member(*at).is_empty());
                let with_signals: Vec<usize> = with_signals.collect();
                if of_member(switch).is_empty() {
                    if with_signals.len() > 1 {
                        return Err(format!(
                            "the union {} has one member at a time; give a signal to its .{SWITCH}, too",
                            info.name
                        ));
                    }
                    let number = with_signals.first().map_or(0, |at| at + 1);
                    all[switch] = Self::Leaf(u32::try_from(number).unwrap_or_default().into());
                }
                for (at, member) in all.iter_mut().enumerate() {
                    member.close(&of_member(at))?;
                }
            }
        }
        Ok(())
    }

    /// The leaf with these indices.
    pub(super) fn leaf(&mut self, indices: &[usize]) -> &mut Variant {
        match (self, indices.split_first()) {
            (Self::Leaf(value), _) => value,
            (Self::Optional(member, _), _) => member.leaf(indices),
            (
                Self::List(Elements { all, .. }) | Self::Structure(_, all) | Self::Union(_, all),
                Some((at, rest)),
            ) => all[*at].leaf(rest),
            _ => unreachable!("indices were found in this value"),
        }
    }

    /// The value as clients read it.
    pub(super) fn variant(&self, tree: &Arc<DataTypeTree>) -> Variant {
        let all = |members: &[Self]| members.iter().map(|member| member.variant(tree)).collect();
        match self {
            Self::Leaf(value) => value.clone(),
            Self::Optional(_, Presence::Missing) => Variant::Empty,
            Self::Optional(member, _) => member.variant(tree),
            Self::List(elements) => {
                let values: Vec<Variant> = all(&elements.all);
                Array::new(elements.of_type, values).map_or(Variant::Empty, Variant::from)
            }
            Self::Structure(info, members) => {
                let made =
                    DynamicStructure::new_struct(Arc::clone(info), Arc::clone(tree), all(members));
                made.map_or(Variant::Empty, |made| {
                    ExtensionObject::new(Exact(made)).into()
                })
            }
            Self::Union(info, members) => {
                let (info, tree_of) = (Arc::clone(info), Arc::clone(tree));
                let at = number(members).and_then(|number| Some((number, number.checked_sub(1)?)));
                let member = at.and_then(|(number, at)| {
                    let at = usize::try_from(at).ok()?;
                    let member = members.get(at).filter(|_| at + 1 < members.len())?;
                    Some((number, member.variant(tree)))
                });
                let made = match member {
                    Some((number, value)) => {
                        DynamicStructure::new_union(info, tree_of, value, number)
                    }
                    // No member, or a number that the machine made up.
                    None => Ok(DynamicStructure::new_null_union(info, tree_of)),
                };
                made.map_or(Variant::Empty, |made| {
                    ExtensionObject::new(Exact(made)).into()
                })
            }
        }
    }

    /// Takes a value that a client wrote.
    ///
    /// # Errors
    ///
    /// `BadTypeMismatch`, with this value partly changed, if the type or the length is another.
    pub(super) fn take(&mut self, written: &Variant) -> Result<(), StatusCode> {
        let mismatch = Err(StatusCode::BadTypeMismatch);
        match (self, written) {
            // A member with a signal that is left out keeps its value.
            (Self::Optional(_, presence), Variant::Empty) => {
                if *presence == Presence::Written {
                    *presence = Presence::Missing;
                }
                Ok(())
            }
            (Self::Optional(member, presence), written) => {
                member.take(written)?;
                if *presence == Presence::Missing {
                    *presence = Presence::Written;
                }
                Ok(())
            }
            (Self::List(Elements { of_type, all, .. }), Variant::Array(array)) => {
                let is_list = array
                    .dimensions
                    .as_ref()
                    .is_none_or(|sizes| sizes.len() == 1);
                if array.value_type != *of_type || !is_list {
                    return mismatch;
                }
                if all.len() != array.values.len() {
                    return mismatch;
                }
                let pairs = all.iter_mut().zip(&array.values);
                pairs.into_iter().try_for_each(|(of, value)| of.take(value))
            }
            // A ByteString is an array of bytes, too (OPC 10000-4, 5.10.4).
            (Self::List(Elements { of_type, all, .. }), Variant::ByteString(bytes))
                if *of_type == VariantScalarTypeId::Byte =>
            {
                let bytes = bytes.value.as_deref().unwrap_or_default();
                if all.len() != bytes.len() {
                    return mismatch;
                }
                for (of, byte) in all.iter_mut().zip(bytes) {
                    *of = Self::Leaf((*byte).into());
                }
                Ok(())
            }
            (Self::Structure(info, members), Variant::ExtensionObject(object)) => {
                match of_type(object, info).map(DynamicStructure::values) {
                    Some(values) if values.len() == members.len() => {
                        let mut pairs = members.iter_mut().zip(values);
                        pairs.try_for_each(|(of, value)| of.take(value))
                    }
                    _ => mismatch,
                }
            }
            (Self::Union(info, members), Variant::ExtensionObject(object)) => {
                let written = of_type(object, info);
                let Some((written, number)) = written.and_then(|it| Some((it, selected(it)?)))
                else {
                    return mismatch;
                };
                // The crate has checked the number.
                if let (Some(value), Some(at)) = (written.values().first(), number.checked_sub(1)) {
                    let at = usize::try_from(at).unwrap_or(usize::MAX);
                    let Some(member) = members.get_mut(at) else {
                        return mismatch;
                    };
                    member.take(value)?;
                }
                let switch = members.len() - 1;
                members[switch] = Self::Leaf(number.into());
                Ok(())
            }
            (Self::Leaf(value), written) if kind(value) == kind(written) => {
                *value = written.clone();
                Ok(())
            }
            _ => mismatch,
        }
    }

    /// Takes elements from `first` on, that a client wrote with an `IndexRange`.
    ///
    /// # Errors
    ///
    /// `BadTypeMismatch`, or `BadIndexRangeNoData` beyond the array's end.
    pub(super) fn take_range(
        &mut self,
        first: usize,
        last: usize,
        written: &Variant,
    ) -> Result<(), StatusCode> {
        let Self::List(elements) = self else {
            return Err(StatusCode::BadIndexRangeNoData);
        };
        let Some(range) = elements.all.get_mut(first..=last) else {
            return Err(StatusCode::BadIndexRangeNoData);
        };
        let mut part = Self::List(Elements {
            all: range.to_vec(),
            empty: Arc::clone(&elements.empty),
            of_type: elements.of_type,
        });
        part.take(written)?;
        if let Self::List(Elements { all, .. }) = part {
            range.clone_from_slice(&all);
        }
        Ok(())
    }
}

/// The number of the member that a union has, which is the last of `members`.
fn number(members: &[Content]) -> Option<u32> {
    match members.last()? {
        Content::Leaf(Variant::UInt32(number)) => Some(*number),
        _ => None,
    }
}

/// A structure that a client wrote, if it has this type.
fn of_type<'a>(object: &'a ExtensionObject, info: &StructTypeInfo) -> Option<&'a DynamicStructure> {
    let id = object.data_type()?;
    let written = object.inner_as::<DynamicStructure>();
    written.filter(|_| id.node_id == info.node_id)
}

/// Refuses a variable that would take too much memory: structures within structures multiply.
fn bounded(count: usize) -> Result<(), String> {
    if count > MOST {
        return Err(format!("it has more than {MOST} values"));
    }
    Ok(())
}

/// The type of a value, and true for an array.
fn kind(value: &Variant) -> Option<(VariantScalarTypeId, bool)> {
    match value.type_id() {
        VariantTypeId::Scalar(kind) => Some((kind, false)),
        VariantTypeId::Array(kind, _) => Some((kind, true)),
        VariantTypeId::Empty => None,
    }
}

/// The empty value of a type; `None` for one that leaves open what values are.
fn zero(of_type: VariantScalarTypeId) -> Option<Variant> {
    use VariantScalarTypeId as Id;
    Some(match of_type {
        Id::Boolean => false.into(),
        Id::SByte => 0_i8.into(),
        Id::Byte => 0_u8.into(),
        Id::Int16 => 0_i16.into(),
        Id::UInt16 => 0_u16.into(),
        Id::Int32 => 0_i32.into(),
        Id::UInt32 => 0_u32.into(),
        Id::Int64 => 0_i64.into(),
        Id::UInt64 => 0_u64.into(),
        Id::Float => 0_f32.into(),
        Id::Double => 0_f64.into(),
        Id::String => UAString::null().into(),
        Id::DateTime => DateTime::null().into(),
        Id::Guid => Guid::null().into(),
        Id::ByteString => ByteString::null().into(),
        Id::NodeId => NodeId::null().into(),
        Id::ExpandedNodeId => ExpandedNodeId::null().into(),
        Id::StatusCode => StatusCode::Good.into(),
        Id::QualifiedName => QualifiedName::null().into(),
        Id::LocalizedText => LocalizedText::null().into(),
        _ => return None,
    })
}
