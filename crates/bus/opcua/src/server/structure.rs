//! A structure or union that is encoded with its right length.

use std::io::{self, Write};

use opcua::types::custom::DynamicStructure;
use opcua::types::{
    BinaryEncodable, Context, ContextOwned, EncodingResult, ExpandedMessageInfo, ExpandedNodeId,
    UaNullable,
};

/// A structure of the crate. async-opcua 0.19 states too large a length for one with an array of structures inside, so the
/// length here is that of the bytes.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Exact(pub(super) DynamicStructure);

impl BinaryEncodable for Exact {
    fn byte_len(&self, context: &Context<'_>) -> usize {
        let mut counter = Counter(0);
        // A structure that cannot be encoded fails in `encode` as well.
        let _ = self.0.encode(&mut counter, context);
        counter.0
    }

    fn encode<S: Write + ?Sized>(
        &self,
        stream: &mut S,
        context: &Context<'_>,
    ) -> EncodingResult<()> {
        self.0.encode(stream, context)
    }
}

impl UaNullable for Exact {
    fn is_ua_null(&self) -> bool {
        self.0.is_ua_null()
    }
}

impl ExpandedMessageInfo for Exact {
    fn full_type_id(&self) -> ExpandedNodeId {
        self.0.full_type_id()
    }

    fn full_json_type_id(&self) -> ExpandedNodeId {
        self.0.full_json_type_id()
    }

    fn full_xml_type_id(&self) -> ExpandedNodeId {
        self.0.full_xml_type_id()
    }

    fn full_data_type_id(&self) -> ExpandedNodeId {
        self.0.full_data_type_id()
    }
}

/// Counts bytes, and forgets them.
struct Counter(usize);

impl Write for Counter {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0 += bytes.len();
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// The number of the member that a union has, from 1; 0 for none. The crate shows it in the encoding alone, as its first four
/// bytes (OPC 10000-6, 5.2.8).
pub(super) fn selected(union: &DynamicStructure) -> Option<u32> {
    let context = ContextOwned::default();
    let bytes = union.encode_to_vec(&context.context());
    Some(u32::from_le_bytes(*bytes.first_chunk()?))
}
