//! `namespaces`: the URIs of a device's namespaces, in the order of their numbers.

use tickbus_base::toml_text::{Shape, Value, shown};

/// The first number of a device's namespace; 0 and 1 are those of OPC UA and of the server itself.
pub(crate) const FIRST: u16 = 2;

/// The last number that a node id in a driver.cfg can have at a server.
pub(crate) const LAST: u16 = 255;

/// The URI of namespace 0.
pub(crate) const UA: &str = "http://opcfoundation.org/UA/";

/// The longest URI, in characters.
const LONGEST: usize = 200;

const URI: Shape = Shape::Label(LONGEST);

/// The shape of the key.
pub(crate) const NAMESPACES: Shape = Shape::List(&URI, 1, (LAST - FIRST + 1) as usize);

/// The most `NodeSet2` files.
const FILES: usize = 50;

/// The longest path of one.
const PATH: usize = 500;

const FILE: Shape = Shape::Label(PATH);

/// The shape of the key `nodeset`.
pub(crate) const NODESET: Shape = Shape::Any(&[FILE, Shape::List(&FILE, 1, FILES)]);

/// Reads one path, or a list of them.
pub(crate) fn read_nodesets(value: &Value<'_>) -> Option<Vec<String>> {
    const RIGHT: &str =
        "write the name of a file, such as \"machine.NodeSet2.xml\", or a list of them";
    if value.as_text().is_some() {
        return value.label(PATH, RIGHT).map(|name| vec![name.to_owned()]);
    }
    let list = value.list(RIGHT)?;
    if !(1..=FILES).contains(&list.len()) {
        value.wrong(
            format!("there are {} files", list.len()),
            format!("write 1 to {FILES}"),
        );
        return None;
    }
    let names = list
        .iter()
        .map(|name| name.label(PATH, RIGHT).map(str::to_owned));
    names.collect::<Vec<_>>().into_iter().collect()
}

/// Reads the URIs.
pub(crate) fn read_namespaces(value: &Value<'_>) -> Option<Vec<String>> {
    const RIGHT: &str =
        "write the URIs from namespace 2 on, such as [\"http://opcfoundation.org/UA/DI/\"]";
    let list = value.list(RIGHT)?;
    let most = usize::from(LAST - FIRST + 1);
    if list.len() > most {
        value.wrong(
            format!("there are {} namespaces", list.len()),
            format!("write at most {most}"),
        );
        return None;
    }
    let mut uris: Vec<String> = Vec::new();
    let mut all_right = true;
    for element in &list {
        let Some(uri) = element.label(LONGEST, RIGHT) else {
            all_right = false;
            continue;
        };
        if uris.iter().any(|other| other == uri) {
            element.wrong(
                format!("\"{}\" is there twice", shown(uri)),
                "name each once",
            );
            all_right = false;
        } else if uri == UA || uri.starts_with("urn:tickbus:") {
            element.wrong(
                format!("\"{}\" is no namespace of a device", shown(uri)),
                "begin with the URI that the device has as number 2",
            );
            all_right = false;
        }
        uris.push(uri.to_owned());
    }
    all_right.then_some(uris)
}
