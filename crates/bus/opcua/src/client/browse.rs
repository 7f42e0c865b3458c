//! Browsing the server: the nodes in a folder, and how each becomes a signal.

use std::collections::{BTreeMap, BTreeSet};
use std::str::FromStr as _;

use opcua::client::Session;
use opcua::types::{
    AttributeId, BrowseDescription, BrowseDescriptionResultMask, BrowseDirection, BrowseResult,
    ByteString, DataTypeId, DataValue, ExpandedNodeId, Identifier as NodeIdentifier, NodeClass,
    NodeClassMask, NodeId, ObjectId, ReadValueId, ReferenceDescription, ReferenceTypeId, Variant,
    VariantScalarTypeId,
};

use super::connect;
use super::examine::{Line, Met, meet};
use super::feed::Notification;
use super::nodes::{self, READS, Server, WRITES};
use crate::pki::meaning;
use crate::values::{of_data_type_id, of_scalar};
use crate::{ClientOptions, Identifier, Namespace, NodeName};
use tickbus_base::toml_text::{printable, shown};
use tickbus_fieldbus::examine::{Examination, Verdict};
use tickbus_fieldbus::{ADDRESS_LIMIT, Browsing, Listing, Place, Tag, Wanted};
use tickbus_image::signal::DataType;

/// The most nodes of one folder.
const MOST: usize = 2000;

/// The most references that the server is asked for at once.
const PART: u32 = 500;

/// The most questions about one folder: a server may answer each with nothing and say that there is more.
const ROUNDS: usize = 100;

/// The most nodes in one Read: small servers refuse more values.
const TOGETHER: usize = 20;

/// The longest name and comment of a server, in characters.
const LONGEST: usize = 300;

/// The attributes that are read of each variable.
const ATTRIBUTES: [AttributeId; 4] = [
    AttributeId::DataType,
    AttributeId::ValueRank,
    AttributeId::UserAccessLevel,
    AttributeId::Description,
];

/// Why a folder has no contents.
enum Trouble {
    /// The connection is gone.
    Lost(String),
    /// The server does not list this folder.
    Refused(String),
}

/// Connects, and opens the folders that `browsing` wants.
pub(crate) fn browse(
    options: &ClientOptions,
    examination: &mut Examination<'_>,
    browsing: &mut dyn Browsing,
) -> Result<(), String> {
    let Some(met) = meet(options, examination) else {
        return Err(refusal(examination));
    };
    let ended = serve(&met, browsing);
    let Met { line, session, .. } = met;
    line.reactor
        .farewell(connect::FAREWELL, connect::close(session));
    ended
}

/// The evidence of the step that has failed, and what to do.
fn refusal(examination: &Examination<'_>) -> String {
    let mut steps = examination.steps.iter();
    match steps.find(|step| step.verdict == Verdict::Fail) {
        // The evidence of some steps has the remedy already.
        Some(step) if step.next.is_empty() || step.evidence.contains("; ") => step.evidence.clone(),
        Some(step) => format!("{}; {}", step.evidence, step.next),
        None => "there is no connection; examine the line".to_owned(),
    }
}

fn serve(met: &Met<'_>, browsing: &mut dyn Browsing) -> Result<(), String> {
    let Met {
        line,
        session,
        server,
        ..
    } = met;
    let mut news = Vec::new();
    loop {
        match browsing.wanted() {
            Wanted::End => return Ok(()),
            Wanted::Folder(id) => {
                let found = match node(&id) {
                    Ok(folder) => Folder {
                        line,
                        session,
                        server,
                    }
                    .contents(&folder),
                    Err(why) => Err(Trouble::Refused(why)),
                };
                match found {
                    Ok(listing) => browsing.found(&id, Ok(listing)),
                    Err(Trouble::Refused(why)) => browsing.found(&id, Err(why)),
                    Err(Trouble::Lost(why)) => return Err(why),
                }
            }
            Wanted::Rest(until) => {
                line.reactor.wait(&*line.clock, until);
                line.inbox.take(&mut news);
                // The next folder needs another session.
                if news
                    .drain(..)
                    .any(|news| matches!(news, Notification::Ended(_)))
                {
                    return Ok(());
                }
            }
        }
    }
}

/// The node with this id; the outermost folder without one.
fn node(id: &str) -> Result<NodeId, String> {
    if id.is_empty() {
        return Ok(ObjectId::ObjectsFolder.into());
    }
    let (namespace, identifier) = match id.strip_prefix("ns=").and_then(|it| it.split_once(';')) {
        Some((index, rest)) => (index.parse().ok(), rest),
        None => (Some(0), id),
    };
    let is_whole = identifier.is_char_boundary(identifier.len().min(2));
    let identifier = Some(identifier).filter(|_| is_whole);
    let identifier = identifier.and_then(|text| NodeIdentifier::from_str(text).ok());
    match (namespace, identifier) {
        (Some(namespace), Some(identifier)) => Ok(NodeId {
            namespace,
            identifier,
        }),
        _ => Err(format!(
            "\"{}\" is no node id; open the folder above it again",
            shown(id)
        )),
    }
}

/// A session that looks into folders.
#[derive(Clone, Copy)]
struct Folder<'a> {
    line: &'a Line<'a>,
    session: &'a Session,
    server: &'a Server,
}

impl Folder<'_> {
    fn contents(self, folder: &NodeId) -> Result<Listing, Trouble> {
        let (references, has_more) = self.references(folder)?;
        let mut known = BTreeSet::new();
        let mut entries = Vec::new();
        for reference in references {
            let node = self.resolved(&reference.node_id);
            // Two references of different types may lead to one node.
            if known.insert(node.to_string()) {
                entries.push((node, reference));
            }
        }
        let told = if has_more || entries.len() > MOST {
            format!(
                "the folder has more than {MOST} nodes, of which these are the first; write the node of another one into \
                 the table"
            )
        } else {
            String::new()
        };
        entries.truncate(MOST);
        // What the server says of itself is hardly ever wanted.
        let own: NodeId = ObjectId::Server.into();
        entries.sort_by_key(|(node, _)| *node == own);
        let mut facts = self.facts(&entries)?.into_iter();
        let tags = entries.iter().map(|(node, reference)| {
            let fact = facts.next().unwrap_or_default();
            self.tag(node, reference, fact)
        });
        Ok(Listing {
            tags: tags.collect(),
            told,
        })
    }

    /// The references of a folder to what is in it, and whether there are more.
    fn references(self, folder: &NodeId) -> Result<(Vec<ReferenceDescription>, bool), Trouble> {
        let classes = NodeClassMask::OBJECT | NodeClassMask::VARIABLE | NodeClassMask::METHOD;
        let wanted = BrowseDescription {
            node_id: folder.clone(),
            browse_direction: BrowseDirection::Forward,
            reference_type_id: ReferenceTypeId::HierarchicalReferences.into(),
            include_subtypes: true,
            node_class_mask: classes.bits(),
            result_mask: BrowseDescriptionResultMask::all().bits(),
        };
        let mut found = Vec::new();
        let mut answer = self.line.drive(self.session.browse(&[wanted], PART, None));
        for _ in 0..ROUNDS {
            let BrowseResult {
                status_code,
                continuation_point,
                references,
            } = match answer {
                Some(Ok(results)) => results.into_iter().next().unwrap_or_default(),
                Some(Err(error)) => return Err(lost(&meaning(error.status()))),
                None => return Err(lost("no answer")),
            };
            if status_code.is_bad() {
                return Err(Trouble::Refused(format!(
                    "the server does not list this folder ({}); open the one above it again",
                    meaning(status_code)
                )));
            }
            found.extend(references.unwrap_or_default());
            if continuation_point.is_null_or_empty() {
                return Ok((found, false));
            }
            let next: [ByteString; 1] = [continuation_point];
            if found.len() >= MOST {
                // The server may keep few of them. If this fails, they end with the session.
                let _ = self.line.drive(self.session.browse_next(true, &next));
                return Ok((found, true));
            }
            answer = self.line.drive(self.session.browse_next(false, &next));
        }
        Ok((found, true))
    }

    fn resolved(self, id: &ExpandedNodeId) -> NodeId {
        let mut node = id.node_id.clone();
        let uri = id.namespace_uri.as_ref();
        let known = self.server.namespaces.iter().position(|known| known == uri);
        if let Some(index) = known.and_then(|index| u16::try_from(index).ok()) {
            node.namespace = index;
        }
        node
    }

    /// Reads attributes of nodes; the answers have their order.
    fn read(self, wanted: &[ReadValueId], each: usize) -> Result<Vec<DataValue>, Trouble> {
        let mut read = Vec::new();
        for part in wanted.chunks(TOGETHER * each) {
            let values = self.line.drive(nodes::read(self.session, part));
            match values {
                Some(Ok(values)) => read.extend(values),
                Some(Err(error)) => return Err(Trouble::Lost(format!("{error}; browse again"))),
                None => return Err(lost("no answer")),
            }
        }
        Ok(read)
    }

    /// The facts of each node beside its name.
    fn facts(self, entries: &[(NodeId, ReferenceDescription)]) -> Result<Vec<Facts>, Trouble> {
        let wanted = entries.iter().flat_map(|(node, _)| {
            ATTRIBUTES.map(|attribute| ReadValueId::new(node.clone(), attribute))
        });
        let wanted: Vec<ReadValueId> = wanted.collect();
        let values = self.read(&wanted, ATTRIBUTES.len())?;
        let facts = values.chunks(ATTRIBUTES.len()).map(Facts::of);
        let mut facts: Vec<Facts> = facts.collect();
        self.ask_values(entries, &mut facts)?;
        self.name_types(&mut facts)?;
        Ok(facts)
    }

    /// Reads the values of those whose declared type leaves theirs open.
    fn ask_values(
        self,
        entries: &[(NodeId, ReferenceDescription)],
        facts: &mut [Facts],
    ) -> Result<(), Trouble> {
        let open = facts.iter().enumerate();
        let open = open.filter(|(index, fact)| {
            entries[*index].1.node_class == NodeClass::Variable
                && fact.reads
                && fact.rank < 0
                && !fact.is_settled()
        });
        let open: Vec<usize> = open.map(|(index, _)| index).collect();
        let wanted = open
            .iter()
            .map(|index| ReadValueId::new_value(entries[*index].0.clone()));
        let values = self.read(&wanted.collect::<Vec<_>>(), 1)?;
        for (index, value) in open.into_iter().zip(values) {
            facts[index].sees(value.value.as_ref());
        }
        Ok(())
    }

    /// Asks for the names of types that are the server's own.
    fn name_types(self, facts: &mut [Facts]) -> Result<(), Trouble> {
        let own: BTreeMap<String, NodeId> = facts
            .iter()
            .filter(|fact| fact.declared.as_data_type_id().is_err() && !fact.declared.is_null())
            .map(|fact| (fact.declared.to_string(), fact.declared.clone()))
            .collect();
        let wanted = own
            .values()
            .map(|id| ReadValueId::new(id.clone(), AttributeId::DisplayName));
        let values = self.read(&wanted.collect::<Vec<_>>(), 1)?;
        let names: BTreeMap<&String, String> = own
            .keys()
            .zip(&values)
            .map(|(id, value)| (id, text(value)))
            .collect();
        for fact in facts {
            if let Some(name) = names.get(&fact.declared.to_string())
                && !name.is_empty()
            {
                fact.type_name.clone_from(name);
            }
        }
        Ok(())
    }

    fn tag(self, node: &NodeId, reference: &ReferenceDescription, fact: Facts) -> Tag {
        let shown = plain(reference.display_name.text.as_ref());
        let name = if shown.is_empty() {
            plain(reference.browse_name.name.as_ref())
        } else {
            shown
        };
        let is_variable = reference.node_class == NodeClass::Variable;
        let is_elsewhere = reference.node_id.server_index != 0;
        let signal = match reference.node_class {
            _ if is_elsewhere => Some(Err("the node is in another server".to_owned())),
            NodeClass::Variable => Some(self.place(node, &fact)),
            NodeClass::Method => Some(Err(
                "this is a method, and a client only reads and writes variables".to_owned(),
            )),
            _ => None,
        };
        let has_parts = is_variable && (fact.form() != Form::Single);
        Tag {
            name,
            id: node.to_string(),
            opens: !is_elsewhere && (has_parts || reference.node_class == NodeClass::Object),
            type_name: match (is_variable, fact.form() == Form::Array) {
                (false, _) => String::new(),
                (true, false) => fact.type_name,
                (true, true) => format!("{}[]", fact.type_name),
            },
            is_readable: is_variable && fact.reads,
            is_writable: is_variable && fact.writes,
            comment: fact.comment,
            signal,
        }
    }

    /// How a variable becomes a signal.
    fn place(self, node: &NodeId, fact: &Facts) -> Result<Place, String> {
        if fact.form() == Form::Array {
            return Err("this is an array; its elements are signals if the PLC shows each as a node of its own: open it".to_owned());
        }
        if fact.form() == Form::Structure {
            return Err("this is a structure; its members are signals if the PLC shows each as a node of its own: open it".to_owned());
        }
        if !fact.reads && !fact.writes {
            return Err(
                "this user may neither read nor write the node; give it the right in the PLC"
                    .to_owned(),
            );
        }
        let data_type = fact.data_type.ok_or_else(|| match &*fact.type_name {
            "" => "the server does not say which type it has".to_owned(),
            name => format!(
                "signals are BOOL, whole numbers and floating-point numbers, and this is {name}"
            ),
        })?;
        Ok(Place {
            at: self.written(node)?,
            data_type,
        })
    }

    /// The node as a driver.cfg names it: by the URI of its namespace, which stays when the server is extended.
    fn written(self, node: &NodeId) -> Result<String, String> {
        let identifier = match &node.identifier {
            NodeIdentifier::Numeric(number) => Identifier::Number(*number),
            NodeIdentifier::String(name) => Identifier::Text(name.as_ref().to_owned()),
            _ => return Err(
                "its node id is a GUID or a byte string, and tickbus has texts and numbers only"
                    .to_owned(),
            ),
        };
        let uri = self.server.namespaces.get(usize::from(node.namespace));
        let uri = uri.filter(|uri| node.namespace > 1 && !uri.is_empty() && !uri.contains(';'));
        let by_index = Namespace::Index(node.namespace);
        let namespaces = uri.cloned().map(Namespace::Uri);
        let mut spellings = namespaces.into_iter().chain([by_index]).map(|namespace| {
            let identifier = identifier.clone();
            NodeName {
                namespace,
                identifier,
            }
        });
        let fits = |name: &NodeName| {
            let text = name.to_string();
            text.parse().as_ref() == Ok(name)
                && text.chars().count() <= ADDRESS_LIMIT
                && text.trim() == text
                && printable(&text) == text
        };
        spellings.find(fits).map(|name| name.to_string()).ok_or_else(|| {
            "its node id is too long, or has blanks or control characters that a driver.cfg cannot have".to_owned()
        })
    }
}

fn lost(why: &str) -> Trouble {
    Trouble::Lost(format!(
        "the server does not answer any more ({why}); see whether it runs, and browse again"
    ))
}

/// How many values a variable has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Form {
    Single,
    Array,
    Structure,
}

/// The facts of a node, as its server states them.
#[derive(Clone, Debug)]
struct Facts {
    declared: NodeId,
    type_name: String,
    /// Below 0 for a single value, or for one that may be.
    rank: i32,
    reads: bool,
    writes: bool,
    comment: String,
    data_type: Option<DataType>,
    form: Form,
}

impl Default for Facts {
    fn default() -> Self {
        Self::of(&[])
    }
}

impl Facts {
    /// The facts in the values of [`ATTRIBUTES`].
    fn of(values: &[DataValue]) -> Self {
        let value = |index: usize| values.get(index).and_then(|value| value.value.as_ref());
        let declared = match value(0) {
            Some(Variant::NodeId(id)) => (**id).clone(),
            _ => NodeId::null(),
        };
        let standard = declared.as_data_type_id().ok();
        // A server that does not say what a user may do lets it read.
        let access = match value(2) {
            Some(Variant::Byte(access)) => *access,
            _ => READS,
        };
        Self {
            type_name: standard.map(|id| format!("{id:?}")).unwrap_or_default(),
            rank: match value(1) {
                Some(Variant::Int32(rank)) => *rank,
                _ => -1,
            },
            reads: access & READS != 0,
            writes: access & WRITES != 0,
            comment: values.get(3).map(text).unwrap_or_default(),
            data_type: standard.and_then(of_data_type_id),
            form: match standard {
                Some(DataTypeId::Structure) => Form::Structure,
                _ => Form::Single,
            },
            declared,
        }
    }

    /// The form by the declared rank, or else by the present value.
    const fn form(&self) -> Form {
        if self.rank >= 0 {
            Form::Array
        } else {
            self.form
        }
    }

    /// True if the declared type says what the values are.
    fn is_settled(&self) -> bool {
        let may_be_array = self.rank != -1;
        let is_plain = self
            .declared
            .as_data_type_id()
            .is_ok_and(|id| (1..=23).contains(&(id as u32)) && id != DataTypeId::Structure);
        is_plain && !may_be_array
    }

    /// Takes the type of the present value.
    fn sees(&mut self, value: Option<&Variant>) {
        match value {
            Some(Variant::Array(_)) => self.form = Form::Array,
            Some(Variant::ExtensionObject(_)) => self.form = Form::Structure,
            Some(value) => {
                let scalar: Option<VariantScalarTypeId> = value.scalar_type_id();
                self.data_type = scalar.and_then(of_scalar);
                if let (true, Some(scalar)) = (self.type_name.is_empty(), scalar) {
                    self.type_name = format!("{scalar:?}");
                }
            }
            None => {}
        }
    }
}

/// The text of a value that is one, perhaps with a language.
fn text(value: &DataValue) -> String {
    match &value.value {
        Some(Variant::LocalizedText(text)) => plain(text.text.as_ref()),
        Some(Variant::String(text)) => plain(text.as_ref()),
        _ => String::new(),
    }
}

/// A text of the server as it is shown: in one line, and not longer than people read.
fn plain(text: &str) -> String {
    printable(&text.chars().take(LONGEST).collect::<String>())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_node_is_found_by_the_id_that_it_was_shown_with() {
        for text in [
            "i=85",
            "ns=3;s=\"DB\".\"a;b\"",
            "ns=2;i=7",
            "ns=4;b=AAEC",
            "ns=2;g=09087e75-8e5e-499b-954f-f2a9603db28a",
        ] {
            let id = node(text).expect(text);
            assert_eq!(node(&id.to_string()), Ok(id));
        }
        assert_eq!(node(""), Ok(ObjectId::ObjectsFolder.into()));
        for text in ["x", "ns=2", "ns=2;", "ns=70000;s=a", "é", "a€", "ns=1;i=x"] {
            assert!(node(text).is_err(), "{text}");
        }
    }

    #[test]
    fn a_name_has_no_control_characters_and_an_end() {
        assert_eq!(plain("a\nb"), "a\\nb");
        assert_eq!(plain(&"x".repeat(1000)).len(), LONGEST);
    }
}
