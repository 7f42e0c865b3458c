//! `NodeSet2` files: a maker's address space, in the XML of OPC 10000-6, annex F.

mod attributes;
mod item;
mod types;
mod value;

use std::collections::{HashMap, HashSet};
use std::path::Path;
use std::sync::Arc;

use opcua::types::{
    DataEncoding, DataValue, NodeClass, NodeId, NumericRange, ReferenceTypeId, TimestampsToReturn,
    Variant,
};
use opcua_server::address_space::{AddressSpace, HasNodeId, ImportedItem, NodeType, Variable};
use roxmltree::{Document, Node, ParsingOptions};
use tickbus_base::Mistake;
use tickbus_base::os::return_freed_memory;
use tickbus_base::toml_text::shown;

use crate::namespaces::UA;

pub(crate) use types::Types;

/// The longest file, in bytes.
const LONGEST: u64 = 64 << 20;

/// The most elements, texts and comments of a file.
const ELEMENTS: u32 = 4_000_000;

/// The remedy for a file that cannot be read.
const RIGHT: &str = "name the NodeSet2.xml of the device's maker, after those that it requires";

/// The files of a server, in the order in which each finds what it requires.
#[derive(Clone, Debug, Default)]
pub(crate) struct NodeSets {
    files: Vec<Arc<File>>,
}

#[derive(Debug)]
struct File {
    name: String,
    text: Packed,
    /// The URIs of its namespaces from number 1 on.
    uris: Vec<String>,
}

/// A text, deflated: nodes are made again whenever the server inside restarts, and XML shrinks to a tenth.
#[derive(Debug)]
struct Packed {
    bytes: Vec<u8>,
    length: usize,
}

impl Packed {
    /// Fast: the higher levels save little more of XML.
    const LEVEL: u8 = 1;

    fn new(text: &str) -> Self {
        Self {
            bytes: miniz_oxide::deflate::compress_to_vec(text.as_bytes(), Self::LEVEL),
            length: text.len(),
        }
    }

    fn text(&self) -> String {
        let mut text = vec![0; self.length];
        let parts = std::iter::once(&*self.bytes);
        miniz_oxide::inflate::decompress_slice_iter_to_slice(&mut text, parts, false, true)
            .expect("it was packed here");
        String::from_utf8(text).expect("it was a text")
    }
}

impl NodeSets {
    /// Reads the files, relative to `folder`.
    ///
    /// # Errors
    ///
    /// A file cannot be read, is no `NodeSet`, or contradicts itself.
    pub(crate) fn load(folder: &Path, names: &[String]) -> Result<Self, Mistake> {
        let mut files = Vec::new();
        let mut known: HashSet<String> = HashSet::from([UA.to_owned()]);
        for name in names {
            let text = read(&folder.join(name), name)?;
            let (uris, requires) = {
                let document = parse(name, &text)?;
                heads(document.root_element())
            };
            known.extend(uris.iter().cloned());
            if let Some(missing) = requires.iter().find(|uri| !known.contains(*uri)) {
                return Err(Mistake::new(
                    format!("{name} requires the model \"{}\"", shown(missing)),
                    "name the file of that model before it: nodeset = [\"…\", \"…\"]",
                ));
            }
            files.push(Arc::new(File {
                name: name.clone(),
                text: Packed::new(&text),
                uris,
            }));
        }
        Ok(Self { files })
    }

    /// The URIs of the namespaces, without that of OPC UA, in the order of the files.
    pub(crate) fn uris(&self) -> Vec<String> {
        let mut uris: Vec<String> = Vec::new();
        for uri in self.files.iter().flat_map(|file| &file.uris) {
            if uri != UA && !uris.contains(uri) {
                uris.push(uri.clone());
            }
        }
        uris
    }

    /// Passes on every node with its references; `index` is the number of a namespace in the server. Nodes of OPC UA's
    /// own namespace are left out.
    ///
    /// # Errors
    ///
    /// A node contradicts the format.
    fn each(
        &self,
        index: impl Fn(&str) -> Option<u16>,
        mut take: impl FnMut(ImportedItem),
    ) -> Result<(), Mistake> {
        for file in &self.files {
            let text = file.text.text();
            let document = parse(&file.name, &text)?;
            let reader = item::Reader::new(document.root_element(), &file.uris, &index);
            for element in document.root_element().children() {
                let item = reader.item(element).map_err(|what| {
                    let at = document.text_pos_at(element.range().start);
                    Mistake::new(
                        format!("{}:{}:{}: {what}", file.name, at.row, at.col),
                        "correct the file, or ask its maker",
                    )
                })?;
                if let Some(item) = item
                    && item.node.node_id().namespace != 0
                {
                    take(item);
                }
            }
        }
        Ok(())
    }

    /// Adds all nodes to an address space that has their namespaces.
    ///
    /// # Errors
    ///
    /// As for [`check`](Self::check).
    pub(crate) fn build(
        &self,
        space: &mut AddressSpace,
        index: impl Fn(&str) -> Option<u16>,
    ) -> Result<(), Mistake> {
        let mut types = Types::default();
        self.each(index, |item| {
            // Of two nodes with one id the first counts; files of one model repeat some.
            if !space.node_exists(item.node.node_id()) {
                types.take(&item);
                space.import_node(item);
            }
        })?;
        types.define(space);
        if !self.files.is_empty() {
            // The parsed trees of the files were several times as large as the nodes.
            return_freed_memory();
        }
        Ok(())
    }

    /// The nodes that signals can be, and the types, which are checked.
    ///
    /// # Errors
    ///
    /// A node contradicts the format, or types are subtypes of each other.
    pub(crate) fn check(
        &self,
        index: impl Fn(&str) -> Option<u16>,
    ) -> Result<(HashMap<NodeId, Target>, Types), Mistake> {
        let mut types = Types::default();
        let mut targets = HashMap::new();
        // A type can state several, and the crate takes any of them.
        let mut supertypes: HashMap<NodeId, Vec<NodeId>> = HashMap::new();
        self.each(index, |item| {
            let id = item.node.node_id().clone();
            types.take(&item);
            let is_type = !matches!(
                item.node.node_class(),
                NodeClass::Object | NodeClass::Variable | NodeClass::Method | NodeClass::View
            );
            for reference in &item.references {
                if !is_type || reference.type_id != ReferenceTypeId::HasSubtype {
                    continue;
                }
                let (sub, of) = if reference.is_forward {
                    (reference.target_id.clone(), id.clone())
                } else {
                    (id.clone(), reference.target_id.clone())
                };
                supertypes.entry(sub).or_default().push(of);
            }
            let target = match &item.node {
                NodeType::Variable(variable) if variable.value_rank() != -1 => {
                    Target::List(List::of(variable))
                }
                NodeType::Variable(variable) => Target::Variable(variable.data_type()),
                NodeType::Method(_) => Target::Method,
                _ => Target::Other,
            };
            targets.entry(id).or_insert(target);
        })?;
        if let Some(id) = circle(&supertypes) {
            return Err(Mistake::new(
                format!("the type {id} is, over others, a subtype of its own"),
                "correct the file, or ask its maker",
            ));
        }
        Ok((targets, types))
    }
}

/// A variable with an array.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct List {
    pub(crate) data_type: NodeId,
    pub(crate) rank: i32,
    /// The stated sizes; 0 where any is possible.
    pub(crate) sizes: Vec<u32>,
    /// The number of elements in the file.
    pub(crate) length: u32,
}

impl List {
    fn of(variable: &Variable) -> Self {
        let value = match &variable.value(
            TimestampsToReturn::Neither,
            &NumericRange::None,
            &DataEncoding::Binary,
            0.0,
        ) {
            DataValue {
                value: Some(Variant::Array(array)),
                ..
            } => array.values.len(),
            _ => 0,
        };
        Self {
            data_type: variable.data_type(),
            rank: variable.value_rank(),
            sizes: variable.array_dimensions().unwrap_or_default(),
            length: u32::try_from(value).unwrap_or(u32::MAX),
        }
    }
}

/// The use of a node for a signal.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Target {
    /// A variable with values of this type.
    Variable(NodeId),
    /// A variable with an array of values, whose elements can be signals.
    List(List),
    /// A variable that has the signal as an element or a member.
    Member,
    /// A method, whose call is a pulse of a BOOL.
    Method,
    /// A node without a value.
    Other,
}

/// A type that is a subtype of itself, over any of its supertypes.
fn circle(supertypes: &HashMap<NodeId, Vec<NodeId>>) -> Option<&NodeId> {
    let mut sound: HashSet<&NodeId> = HashSet::new();
    for begin in supertypes.keys() {
        if sound.contains(begin) {
            continue;
        }
        // The types on the way, and how many supertypes of each were looked at.
        let mut way = vec![(begin, 0)];
        let mut passed = HashSet::from([begin]);
        while let Some((at, looked)) = way.last_mut() {
            let at = *at;
            let next = supertypes.get(at).and_then(|all| all.get(*looked));
            *looked += 1;
            match next {
                Some(next) if sound.contains(next) => {}
                Some(next) if !passed.insert(next) => return Some(next),
                Some(next) => way.push((next, 0)),
                None => {
                    sound.insert(at);
                    way.pop();
                }
            }
        }
    }
    None
}

fn read(path: &Path, name: &str) -> Result<String, Mistake> {
    let cannot = |error: std::io::Error| {
        Mistake::new(
            format!("\"{name}\" cannot be read: {error}"),
            "name a file relative to the folder of this one",
        )
    };
    let size = std::fs::metadata(path).map_err(cannot)?.len();
    if size > LONGEST {
        return Err(Mistake::new(
            format!("\"{name}\" has {} MB", size >> 20),
            format!("name a file of at most {} MB", LONGEST >> 20),
        ));
    }
    std::fs::read_to_string(path).map_err(cannot)
}

fn parse<'t>(name: &str, text: &'t str) -> Result<Document<'t>, Mistake> {
    let options = ParsingOptions {
        nodes_limit: ELEMENTS,
        ..ParsingOptions::default()
    };
    let text = text.trim_start_matches('\u{feff}');
    let document = Document::parse_with_options(text, options);
    let document = document.map_err(|error| {
        let at = error.pos();
        Mistake::new(format!("{name}:{}:{}: {error}", at.row, at.col), RIGHT)
    })?;
    let root = document.root_element().tag_name().name();
    if root != "UANodeSet" {
        let what = format!(
            "{name} begins with <{}>, and a NodeSet with <UANodeSet>",
            shown(root)
        );
        return Err(Mistake::new(what, RIGHT));
    }
    Ok(document)
}

/// The URIs of a file's namespaces, and those of the models that it requires.
fn heads(root: Node<'_, '_>) -> (Vec<String>, Vec<String>) {
    let below = |name: &'static str| {
        let found = root
            .children()
            .filter(move |child| child.has_tag_name_of(name));
        found.flat_map(|child| child.children())
    };
    let uris = below("NamespaceUris").filter(Node::is_element);
    let uris = uris
        .filter_map(|uri| uri.text())
        .map(|uri| uri.trim().to_owned());
    let models = below("Models").flat_map(|model| model.children());
    let requires = models.filter_map(|required| required.attribute("ModelUri"));
    (uris.collect(), requires.map(str::to_owned).collect())
}

/// A tag in any XML namespace, because files differ.
trait TagName {
    fn has_tag_name_of(&self, name: &str) -> bool;
}

impl TagName for Node<'_, '_> {
    fn has_tag_name_of(&self, name: &str) -> bool {
        self.is_element() && self.tag_name().name() == name
    }
}

/// The first element of that name.
fn child<'a, 't>(of: Node<'a, 't>, name: &str) -> Option<Node<'a, 't>> {
    of.children().find(|child| child.has_tag_name_of(name))
}

/// The text of the first element of that name.
fn text_of<'a>(of: Node<'a, '_>, name: &str) -> Option<&'a str> {
    child(of, name)?.text().map(str::trim)
}

#[cfg(test)]
mod tests;
