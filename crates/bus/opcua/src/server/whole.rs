//! Variables whose elements or members are signals.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use opcua::types::custom::{DataTypeTree, DynamicTypeLoader, ParentIds};
use opcua::types::{
    ContextOwned, DecodingOptions, ExtensionObject, NamespaceMap, NumericRange, StatusCode,
    TypeLoaderCollection, Variant,
};

use tickbus_image::signal::SignalTable;

use super::content::Content;
use crate::values;

/// All such variables of a server.
#[derive(Debug)]
pub(super) struct Wholes {
    /// By the signal that comes first, by which a whole is known.
    of: HashMap<usize, Whole>,
    /// The first signal of the whole that each member belongs to.
    first: HashMap<usize, usize>,
    tree: Arc<DataTypeTree>,
}

/// One variable.
#[derive(Debug)]
struct Whole {
    members: Vec<Member>,
    content: Mutex<Content>,
}

/// A signal within a variable.
#[derive(Clone, Debug)]
pub(super) struct Member {
    pub(super) signal: usize,
    /// The indices of the signal's value in the variable's.
    pub(super) at: Vec<usize>,
}

/// A value that a client wrote.
#[derive(Debug)]
pub(super) struct Written {
    /// The signals that it contains, with their bits.
    pub(super) signals: Vec<(usize, u64)>,
    /// The variable's value after the write.
    content: Content,
}

impl Default for Wholes {
    fn default() -> Self {
        Self::new(DataTypeTree::new(ParentIds::new()))
    }
}

impl Whole {
    fn content(&self) -> MutexGuard<'_, Content> {
        // A value is replaced as a whole, or a leaf of it, so a poisoned lock is safe to use.
        self.content.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Wholes {
    /// No variables yet; `tree` has the structures of all that will be added.
    pub(super) fn new(tree: DataTypeTree) -> Self {
        Self {
            of: HashMap::new(),
            first: HashMap::new(),
            tree: Arc::new(tree),
        }
    }

    /// Adds a variable.
    pub(super) fn add(&mut self, members: Vec<Member>, content: Content) {
        let first = members.iter().map(|member| member.signal).min();
        let first = first.expect("a line made it");
        let each = members.iter().map(|member| (member.signal, first));
        self.first.extend(each);
        let content = Mutex::new(content);
        self.of.insert(first, Whole { members, content });
    }

    /// Reads structures that clients write; `None` if there are only arrays of plain values.
    pub(super) fn loader(&self) -> Option<Arc<DynamicTypeLoader>> {
        let has_structures = !self.tree.encoding_to_data_type().is_empty();
        has_structures.then(|| Arc::new(DynamicTypeLoader::new(Arc::clone(&self.tree))))
    }

    /// The first signal of the variable that has this one as a member; `None` for a signal with its own variable.
    pub(super) fn first(&self, signal: usize) -> Option<usize> {
        self.first.get(&signal).copied()
    }

    /// The signals of the variable that is known by its `first` one; that alone if it is no member.
    pub(super) fn signals(&self, first: usize) -> Vec<usize> {
        let members = self.of.get(&first).map(|whole| &whole.members[..]);
        let members = members.map(|members| members.iter().map(|member| member.signal).collect());
        members.unwrap_or_else(|| vec![first])
    }

    /// Sets the value of a member.
    pub(super) fn set(&self, signal: usize, value: Variant) {
        let whole = self.first(signal).and_then(|first| self.of.get(&first));
        let member = whole.and_then(|whole| {
            let member = whole
                .members
                .iter()
                .find(|member| member.signal == signal)?;
            Some((whole, member))
        });
        if let Some((whole, member)) = member {
            *whole.content().leaf(&member.at) = value;
        }
    }

    /// The value of the variable that is known by its `first` signal.
    pub(super) fn value(&self, first: usize) -> Option<Variant> {
        let whole = self.of.get(&first)?;
        Some(whole.content().variant(&self.tree))
    }

    /// Checks a value that a client writes to such a variable; `None` if `first` has a variable of its own.
    pub(super) fn judge(
        &self,
        table: &SignalTable,
        first: usize,
        (range, value): (&NumericRange, Option<&Variant>),
    ) -> Option<Result<Written, StatusCode>> {
        let whole = self.of.get(&first)?;
        let mut content = whole.content().clone();
        let Some(value) = value else {
            return Some(Err(StatusCode::BadTypeMismatch));
        };
        let value = &self.own(value);
        let (taken, indices) = match range {
            NumericRange::None => (content.take(value), 0..=usize::MAX),
            NumericRange::Index(at) => {
                let at = *at as usize;
                (content.take_range(at, at, value), at..=at)
            }
            NumericRange::Range(first, last) => {
                let (first, last) = (*first as usize, *last as usize);
                (content.take_range(first, last, value), first..=last)
            }
            NumericRange::MultipleRanges(_) => return Some(Err(StatusCode::BadIndexRangeNoData)),
        };
        if let Err(status) = taken {
            return Some(Err(status));
        }
        let mut signals = Vec::new();
        for member in &whole.members {
            if !member.at.first().is_some_and(|at| indices.contains(at)) {
                continue;
            }
            let data_type = table.signals[member.signal].data_type;
            match values::bits(data_type, content.leaf(&member.at)) {
                Some(bits) => signals.push((member.signal, bits)),
                None => return Some(Err(StatusCode::BadTypeMismatch)),
            }
        }
        Some(Ok(Written { signals, content }))
    }

    /// A value whose structures are all of this server's tree: the crate reads those of the standard, also as members of
    /// others, as types of its own.
    fn own(&self, value: &Variant) -> Variant {
        match value {
            Variant::ExtensionObject(object) => {
                self.own_structure(object).unwrap_or_else(|| value.clone())
            }
            Variant::Array(array) => {
                let mut array = array.clone();
                for element in &mut array.values {
                    *element = self.own(element);
                }
                Variant::Array(array)
            }
            _ => value.clone(),
        }
    }

    fn own_structure(&self, object: &ExtensionObject) -> Option<Variant> {
        let body = object.body.as_ref()?;
        let mut loaders = TypeLoaderCollection::new_empty();
        loaders.add_type_loader(DynamicTypeLoader::new(Arc::clone(&self.tree)));
        let options = DecodingOptions::default();
        let context = ContextOwned::new(NamespaceMap::default(), loaders, options);
        let context = context.context();
        let mut bytes = Vec::new();
        body.encode_binary(&mut bytes, &context).ok()?;
        let id = body.data_type_id().node_id;
        let read = context.load_from_binary(&id, &mut bytes.as_slice(), None);
        Some(read.ok()?.into())
    }

    /// Accepts a value that was [judged](Self::judge); returns the variable's whole value.
    pub(super) fn accept(&self, first: usize, written: Written) -> Option<Variant> {
        let whole = self.of.get(&first)?;
        let value = written.content.variant(&self.tree);
        *whole.content() = written.content;
        Some(value)
    }
}
