//! The value of a variable that is an array or a structure, as a tree whose leaves can be signals.

use std::sync::Arc;

use opcua::types::custom::{DataTypeTree, DynamicStructure, StructTypeInfo};
use opcua::types::{
    Array, ByteString, DateTime, ExpandedNodeId, ExtensionObject, Guid, LocalizedText, NodeId,
    QualifiedName, StatusCode, UAString, Variant, VariantScalarTypeId, VariantTypeId,
};

use crate::Step;

/// The most elements of an array with signals.
const LONGEST: usize = 10_000;

/// The most values, structures and arrays in a variable with signals.
const MOST: usize = 100_000;

/// A value, or a part of it.
#[derive(Clone, Debug)]
pub(super) enum Content {
    /// A value without members.
    Leaf(Variant),
    /// The elements of an array.
    List(VariantScalarTypeId, Vec<Content>),
    /// The members of a structure.
    Structure(Arc<StructTypeInfo>, Vec<Content>),
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
                Ok(Self::List(of_type, vec![element; length]))
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
            match member.map_err(|why| format!("{}: {why}", field.name))? {
                // async-opcua 0.19 states a wrong length for them.
                Self::List(VariantScalarTypeId::ExtensionObject, _) => Err(format!(
                    "{}: an array of structures within a structure cannot have signals",
                    field.name
                )),
                member => Ok(member),
            }
        });
        let members = members.collect::<Result<_, _>>()?;
        Ok(Self::Structure(Arc::clone(info), members))
    }

    /// The number of values, structures and arrays.
    fn count(&self) -> usize {
        match self {
            Self::Leaf(_) => 1,
            Self::List(_, members) | Self::Structure(_, members) => {
                1 + members.iter().map(Self::count).sum::<usize>()
            }
        }
    }

    /// The indices of the member that `steps` name. An array without a stated length grows to have it.
    ///
    /// # Errors
    ///
    /// There is no such member.
    pub(super) fn find(&mut self, steps: &[Step], has_length: bool) -> Result<Vec<usize>, String> {
        let Some((step, rest)) = steps.split_first() else {
            return match self {
                Self::Leaf(_) => Ok(Vec::new()),
                Self::List(..) => Err("an array is not a single value".to_owned()),
                Self::Structure(..) => Err("a structure is not a single value".to_owned()),
            };
        };
        let (at, member, has_length) = match (self, step) {
            (Self::List(of_type, elements), Step::Element(at)) => {
                if *at >= elements.len() {
                    let length = elements.len();
                    let Some(zero) = zero(*of_type).filter(|_| !has_length && *at < LONGEST) else {
                        return Err(format!("the last element is [{}]", length.max(1) - 1));
                    };
                    elements.resize(at + 1, Self::Leaf(zero));
                }
                (*at, &mut elements[*at], true)
            }
            (Self::Structure(info, members), Step::Member(name)) => {
                let Some(at) = info.index_by_name.get(name) else {
                    let names = info.fields.iter().map(|field| field.name.as_str());
                    let names = names.collect::<Vec<_>>().join(", ");
                    return Err(format!("the members are {names}"));
                };
                let sizes = info.fields[*at].array_dimensions.as_ref();
                let has_length = sizes.is_some_and(|sizes| sizes.iter().any(|size| *size > 0));
                (*at, &mut members[*at], has_length)
            }
            (Self::List(..), Step::Member(_)) => {
                return Err("an array has elements: [0]".to_owned());
            }
            (Self::Structure(..), Step::Element(_)) => {
                return Err("a structure has members: .name".to_owned());
            }
            (Self::Leaf(_), _) => return Err("a single value has no members".to_owned()),
        };
        let mut indices = vec![at];
        indices.extend(member.find(rest, has_length)?);
        Ok(indices)
    }

    /// All members are found: an array without any can have any length.
    pub(super) fn close(&mut self) {
        match self {
            Self::Leaf(_) => {}
            Self::List(of_type, elements) if elements.is_empty() => {
                let none = Array::new(*of_type, Vec::new());
                *self = Self::Leaf(none.map_or(Variant::Empty, Variant::from));
            }
            Self::List(_, members) | Self::Structure(_, members) => {
                members.iter_mut().for_each(Self::close);
            }
        }
    }

    /// The leaf with these indices.
    pub(super) fn leaf(&mut self, indices: &[usize]) -> &mut Variant {
        match (self, indices.split_first()) {
            (Self::Leaf(value), _) => value,
            (Self::List(_, members) | Self::Structure(_, members), Some((at, rest))) => {
                members[*at].leaf(rest)
            }
            _ => unreachable!("indices were found in this value"),
        }
    }

    /// The value as clients read it.
    pub(super) fn variant(&self, tree: &Arc<DataTypeTree>) -> Variant {
        let all = |members: &[Self]| members.iter().map(|member| member.variant(tree)).collect();
        match self {
            Self::Leaf(value) => value.clone(),
            Self::List(of_type, elements) => {
                let values: Vec<Variant> = all(elements);
                Array::new(*of_type, values).map_or(Variant::Empty, Variant::from)
            }
            Self::Structure(info, members) => {
                let made =
                    DynamicStructure::new_struct(Arc::clone(info), Arc::clone(tree), all(members));
                made.map_or(Variant::Empty, |made| ExtensionObject::new(made).into())
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
            (Self::List(of_type, elements), Variant::Array(array)) => {
                let is_list = array
                    .dimensions
                    .as_ref()
                    .is_none_or(|sizes| sizes.len() == 1);
                if array.value_type != *of_type || !is_list {
                    return mismatch;
                }
                if elements.len() != array.values.len() {
                    return mismatch;
                }
                let pairs = elements.iter_mut().zip(&array.values);
                pairs.into_iter().try_for_each(|(of, value)| of.take(value))
            }
            // A ByteString is an array of bytes, too (OPC 10000-4, 5.10.4).
            (Self::List(VariantScalarTypeId::Byte, elements), Variant::ByteString(bytes)) => {
                let bytes = bytes.value.as_deref().unwrap_or_default();
                if elements.len() != bytes.len() {
                    return mismatch;
                }
                for (of, byte) in elements.iter_mut().zip(bytes) {
                    *of = Self::Leaf((*byte).into());
                }
                Ok(())
            }
            (Self::Structure(info, members), Variant::ExtensionObject(object)) => {
                let written = object.inner_as::<DynamicStructure>();
                let is_same = object
                    .data_type()
                    .is_some_and(|id| id.node_id == info.node_id);
                match written.map(DynamicStructure::values).filter(|_| is_same) {
                    Some(values) if values.len() == members.len() => {
                        let mut pairs = members.iter_mut().zip(values);
                        pairs.try_for_each(|(of, value)| of.take(value))
                    }
                    _ => mismatch,
                }
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
        let Self::List(of_type, elements) = self else {
            return Err(StatusCode::BadIndexRangeNoData);
        };
        let Some(range) = elements.get_mut(first..=last) else {
            return Err(StatusCode::BadIndexRangeNoData);
        };
        let mut part = Self::List(*of_type, range.to_vec());
        part.take(written)?;
        if let Self::List(_, taken) = part {
            range.clone_from_slice(&taken);
        }
        Ok(())
    }
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
