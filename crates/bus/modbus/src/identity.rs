//! `[fieldbus.identity]`: how the device names itself.

use crate::identification::{OBJECTS, TEXT_LIMIT};
use crate::{Identification, PDU_LIMIT};
use tickbus_base::toml_text::{Key, Shape, Value};

/// The shape of a text in an answer.
const TEXT: Shape = Shape::Label(TEXT_LIMIT);

/// The run indicator of function 17 (Modbus Application Protocol V1.1b3, 6.13): the device runs.
const RUNS: u8 = 0xFF;

/// The keys: the objects of function 43/14 in the order of their numbers, then function 17.
pub(crate) const IDENTITY_KEYS: &[Key] = &[
    Key::new("vendor", TEXT, "VendorName, object 0 of function 43/14"),
    Key::new("product", TEXT, "ProductCode, object 1"),
    Key::new("revision", TEXT, "MajorMinorRevision, object 2"),
    Key::new("url", TEXT, "VendorUrl, object 3"),
    Key::new("name", TEXT, "ProductName, object 4"),
    Key::new("model", TEXT, "ModelName, object 5"),
    Key::new("application", TEXT, "UserApplicationName, object 6"),
    Key::new(
        "server_id",
        TEXT,
        "The answer to function 17, before the run indicator; without it function 17 is refused",
    ),
    Key::new(
        "server_data",
        TEXT,
        "The additional data of function 17, behind the run indicator",
    ),
];

/// Reads the table. Objects without a key are empty, and those from `url` on then do not exist.
pub(crate) fn read_identity(value: &Value<'_>) -> Option<Identification> {
    let mut table = value.table(
        "[fieldbus.identity]",
        "write a table such as { vendor = \"ACME\", product = \"PLC 7\", revision = \"1.2\" }",
    )?;
    let [texts @ .., server_id, server_data] = IDENTITY_KEYS else {
        unreachable!("the list above is not empty");
    };
    let mut text = |key: &Key| {
        let Some(value) = table.take(key.name) else {
            return Some(None);
        };
        let text = value.label(TEXT_LIMIT, "write the text in quotes, in ASCII")?;
        let shows = |c: char| matches!(c, ' '..='~');
        if let Some(other) = text.chars().find(|c| !shows(*c)) {
            value.wrong(
                format!("it has {other:?}"),
                "the standard has ASCII here, so write it without accents",
            );
            return None;
        }
        Some(Some(text.to_owned()))
    };
    let mut objects: [String; OBJECTS] = Default::default();
    let mut all_right = true;
    for (key, object) in texts.iter().zip(&mut objects) {
        match text(key) {
            Some(given) => *object = given.unwrap_or_default(),
            None => all_right = false,
        }
    }
    let (server_id, server_data) = (text(server_id), text(server_data));
    table.finish();
    let (server_id, server_data) = (server_id?, server_data?);
    if server_data.is_some() && server_id.is_none() {
        value.wrong(
            "\"server_data\" stands without \"server_id\"",
            "write server_id, which comes before it in the answer to function 17",
        );
        return None;
    }
    let data = server_data.unwrap_or_default();
    let server_id = server_id.map(|id| [id.as_bytes(), &[RUNS], data.as_bytes()].concat());
    let length = server_id.as_ref().map_or(0, Vec::len);
    if length > PDU_LIMIT - 2 {
        value.wrong(
            format!("the answer to function 17 has {length} characters"),
            format!("shorten server_id or server_data: {} fit", PDU_LIMIT - 2),
        );
        return None;
    }
    all_right.then_some(Identification { objects, server_id })
}
