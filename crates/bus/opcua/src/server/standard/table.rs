//! The nodes of namespace 0, as data: `nodes.bin` is a table of them, deflated, in OPC UA's own binary encoding.
//!
//! As code, which the crate `async-opcua-core-namespace` has, the same nodes take a third of the whole library. The test
//! below makes the table from that crate, and checks that both have the same nodes.

use opcua::types::{
    BinaryDecodable, Context, ContextOwned, DataTypeDefinition, DataValue, DateTime,
    DecodingOptions, ExtensionObject, NamespaceMap, NodeClass, NodeId, Variant,
};
use opcua_server::address_space::{
    Base, DataType, EventNotifier, ImportedItem, ImportedReference, Method, NodeType, Object,
    ObjectType, ReferenceType, Variable, VariableType,
};

static TABLE: &[u8] = include_bytes!("nodes.bin");

/// Passes on every node with its references. `time` is the timestamp of all values.
pub(super) fn read(time: DateTime, take: impl FnMut(ImportedItem)) {
    let table = miniz_oxide::inflate::decompress_to_vec(TABLE).expect("a test unpacks it");
    decode(&table, time, take);
}

fn decode(table: &[u8], time: DateTime, mut take: impl FnMut(ImportedItem)) {
    let context = context();
    let mut reader = Reader {
        rest: table,
        context: context.context(),
        time,
    };
    while !reader.rest.is_empty() {
        take(reader.item());
    }
}

/// The context of the encoding. It has no limits, which are for data from the network.
fn context() -> ContextOwned {
    let options = DecodingOptions {
        max_byte_string_length: usize::MAX,
        ..DecodingOptions::default()
    };
    ContextOwned::new_default(NamespaceMap::new(), options)
}

struct Reader<'a> {
    rest: &'a [u8],
    context: Context<'a>,
    time: DateTime,
}

impl Reader<'_> {
    fn get<T: BinaryDecodable>(&mut self) -> T {
        T::decode(&mut self.rest, &self.context).expect("a test reads the table")
    }

    fn optional<T: BinaryDecodable>(&mut self) -> Option<T> {
        self.get::<bool>().then(|| self.get())
    }

    fn item(&mut self) -> ImportedItem {
        let node = self.node();
        let references = (0..self.get::<u16>()).map(|_| ImportedReference {
            target_id: self.get(),
            type_id: self.get(),
            is_forward: self.get(),
        });
        ImportedItem {
            node,
            references: references.collect(),
        }
    }

    fn node(&mut self) -> NodeType {
        let class: NodeClass = self.get();
        let base = Base::new_full(
            self.get(),
            class,
            self.get(),
            self.get(),
            self.optional(),
            self.optional(),
            self.optional(),
        );
        match class {
            NodeClass::Object => {
                Object::new_full(base, EventNotifier::from_bits_truncate(self.get())).into()
            }
            NodeClass::ObjectType => ObjectType::new_full(base, self.get()).into(),
            NodeClass::ReferenceType => {
                ReferenceType::new_full(base, self.get(), self.get(), self.optional()).into()
            }
            NodeClass::Variable => Variable::new_full(
                base,
                self.get::<NodeId>(),
                self.get(),
                self.get(),
                self.value(),
                self.get(),
                self.get(),
                self.get(),
                self.optional(),
            )
            .into(),
            NodeClass::VariableType => VariableType::new_full(
                base,
                self.get(),
                self.get(),
                self.get(),
                self.get::<bool>().then(|| self.value()),
                self.get(),
            )
            .into(),
            NodeClass::DataType => {
                let (is_abstract, definition) = (self.get(), self.optional::<ExtensionObject>());
                let definition =
                    definition.and_then(|of| DataTypeDefinition::from_extension_object(of).ok());
                DataType::new_full(base, is_abstract, definition).into()
            }
            NodeClass::Method => Method::new_full(base, self.get(), self.get()).into(),
            NodeClass::View | NodeClass::Unspecified => unreachable!("a test reads the table"),
        }
    }

    fn value(&mut self) -> DataValue {
        match self.optional::<Variant>() {
            Some(value) => DataValue::new_at(value, self.time),
            None => DataValue::null(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use opcua::types::{
        AttributeId, BinaryEncodable, BrowseDirection, DataEncoding, NumericRange,
        TimestampsToReturn, WriteMask,
    };
    use opcua_core_namespace::CoreNamespace;
    use opcua_server::address_space::AddressSpace;
    use opcua_server::address_space::DefaultTypeTree;
    use opcua_server::address_space::{NodeSetImport, NodeSetNamespaceMapper};
    use std::collections::BTreeSet;
    use std::path::Path;

    /// Writes the table that [`Reader`] reads.
    struct Writer<'a> {
        table: Vec<u8>,
        context: Context<'a>,
    }

    impl Writer<'_> {
        fn put(&mut self, value: &impl BinaryEncodable) {
            value
                .encode(&mut self.table, &self.context)
                .expect("it has an encoding");
        }

        fn optional<T: BinaryEncodable>(&mut self, value: Option<&T>) {
            self.put(&value.is_some());
            if let Some(value) = value {
                self.put(value);
            }
        }

        fn item(&mut self, item: &ImportedItem) {
            self.node(&item.node);
            let count = u16::try_from(item.references.len()).expect("a few");
            self.put(&count);
            for reference in &item.references {
                self.put(&reference.target_id);
                self.put(&reference.type_id);
                self.put(&reference.is_forward);
            }
        }

        fn node(&mut self, node: &NodeType) {
            let base = node.as_node();
            self.put(&base.node_class());
            self.put(base.node_id());
            self.put(base.browse_name());
            self.put(base.display_name());
            self.optional(base.description());
            let bits = |mask: Option<WriteMask>| mask.map(|mask| mask.bits());
            self.optional(bits(base.write_mask()).as_ref());
            self.optional(bits(base.user_write_mask()).as_ref());
            match node {
                NodeType::Object(node) => self.put(&node.event_notifier().bits()),
                NodeType::ObjectType(node) => self.put(&node.is_abstract()),
                NodeType::ReferenceType(node) => {
                    self.put(&node.symmetric());
                    self.put(&node.is_abstract());
                    self.optional(node.inverse_name().as_ref());
                }
                NodeType::Variable(node) => {
                    self.put(&node.data_type());
                    self.put(&node.historizing());
                    self.put(&node.value_rank());
                    self.value(&attribute(&**node, AttributeId::Value).expect("it has one"));
                    self.put(&node.access_level().bits());
                    self.put(&node.user_access_level().bits());
                    self.put(&node.array_dimensions());
                    self.optional(node.minimum_sampling_interval().as_ref());
                }
                NodeType::VariableType(node) => {
                    self.put(node.data_type());
                    self.put(&node.is_abstract());
                    self.put(&node.value_rank());
                    self.put(&node.value().is_some());
                    if let Some(value) = node.value() {
                        self.value(value);
                    }
                    self.put(&node.array_dimensions());
                }
                NodeType::DataType(node) => {
                    self.put(&node.is_abstract());
                    let definition = node.data_type_definition().cloned();
                    let definition = definition.map(DataTypeDefinition::into_extension_object);
                    self.optional(definition.as_ref());
                }
                NodeType::Method(node) => {
                    self.put(&node.executable());
                    self.put(&node.user_executable());
                }
                NodeType::View(_) => panic!("the table cannot have views"),
            }
        }

        fn value(&mut self, value: &DataValue) {
            self.optional(value.value.as_ref());
        }
    }

    fn attribute(
        node: &dyn opcua_server::address_space::Node,
        id: AttributeId,
    ) -> Option<DataValue> {
        node.get_attribute(
            TimestampsToReturn::Both,
            id,
            &NumericRange::None,
            &DataEncoding::Binary,
        )
    }

    /// The nodes, as that crate has them as code.
    fn original(take: impl FnMut(ImportedItem)) {
        let mut namespaces = NamespaceMap::new();
        let mut map = NodeSetNamespaceMapper::new(&mut namespaces);
        CoreNamespace.register_namespaces(&mut map);
        CoreNamespace.load(&map).for_each(take);
    }

    /// With the variable `TICKBUS_UPDATE` it writes the table.
    #[test]
    fn the_table_has_the_nodes_of_the_crate() {
        let context = context();
        let mut writer = Writer {
            table: Vec::new(),
            context: context.context(),
        };
        original(|item| writer.item(&item));
        if std::env::var_os("TICKBUS_UPDATE").is_some() {
            let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/server/standard/nodes.bin");
            let packed = miniz_oxide::deflate::compress_to_vec(&writer.table, 10);
            std::fs::write(path, packed).expect("the sources can be written");
            return;
        }
        let table = miniz_oxide::inflate::decompress_to_vec(TABLE).expect("it is whole");
        assert!(
            table == writer.table,
            "with another version of the crate, run this test with TICKBUS_UPDATE=1"
        );
    }

    /// Every attribute as it goes to clients, and every reference in both directions.
    #[test]
    fn an_address_space_is_the_same_from_the_table_and_from_the_crate() {
        let mut spaces = [AddressSpace::new(), AddressSpace::new()];
        let mut ids = Vec::new();
        for space in &mut spaces {
            space.add_namespace("http://opcfoundation.org/UA/", 0);
        }
        let [old, new] = &mut spaces;
        original(|item| {
            ids.push(item.node.as_node().node_id().clone());
            assert!(old.import_node(item));
        });
        let mut count = 0;
        read(DateTime::endtimes(), |item| {
            count += 1;
            assert!(new.import_node(item));
        });
        assert!(count > 5000, "{count}");
        assert_eq!(count, ids.len());
        let types = DefaultTypeTree::new();
        let context = context();
        let encoded = |value: Option<DataValue>| {
            // The values' time is that of the import.
            let bytes = |value: &Variant| value.encode_to_vec(&context.context());
            value.map(|value| {
                (
                    value.value.as_ref().map(bytes),
                    value.status,
                    value.source_timestamp.is_some(),
                )
            })
        };
        for id in &ids {
            let [old, new] = [&spaces[0], &spaces[1]]
                .map(|space| space.find(id).expect("both have it").as_node());
            for at in 1..=27 {
                let at = AttributeId::from_u32(at).expect("it is an attribute");
                assert_eq!(
                    encoded(attribute(old, at)),
                    encoded(attribute(new, at)),
                    "{id} {at:?}"
                );
            }
            let [old, new] = [&spaces[0], &spaces[1]].map(|space| {
                let found = space.find_references(
                    id,
                    None::<(NodeId, bool)>,
                    &types,
                    BrowseDirection::Both,
                );
                let found = found.map(|of| format!("{of:?}"));
                found.collect::<BTreeSet<_>>()
            });
            assert_eq!(old, new, "{id}");
        }
    }
}
