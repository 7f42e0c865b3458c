//! The picture as text again.

use quick_xml::escape::{escape, partial_escape};

use super::tree::{Child, Element};

/// The SVG, newly written without any part of the original text.
pub(super) fn svg(root: &Element) -> String {
    let mut text = String::new();
    write(root, true, &mut text);
    text.push('\n');
    text
}

fn write(element: &Element, is_root: bool, text: &mut String) {
    text.push('<');
    text.push_str(element.name);
    if is_root {
        text.push_str(" xmlns=\"http://www.w3.org/2000/svg\"");
    }
    for (name, value) in &element.attributes {
        text.push(' ');
        text.push_str(name);
        text.push_str("=\"");
        push(&escape(value.as_str()), text);
        text.push('"');
    }
    if element.children.is_empty() {
        text.push_str("/>");
        return;
    }
    text.push('>');
    for child in &element.children {
        match child {
            Child::Element(child) => write(child, false, text),
            Child::Text(words) => push(&partial_escape(words.as_str()), text),
        }
    }
    text.push_str("</");
    text.push_str(element.name);
    text.push('>');
}

/// Adds a text without the characters that XML does not have, not even escaped.
fn push(words: &str, text: &mut String) {
    text.extend(words.chars().filter(|c| !matches!(c, '\0'..='\u{8}' | '\u{b}' | '\u{c}' | '\u{e}'..='\u{1f}' | '\u{fffe}' | '\u{ffff}')));
}
