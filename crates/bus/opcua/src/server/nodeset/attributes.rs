//! Attributes and texts of elements in `NodeSet2` files.

use std::str::FromStr;

use opcua::types::LocalizedText;
use roxmltree::Node;
use tickbus_base::toml_text::shown;

use super::child;

pub(super) fn flag(element: Node<'_, '_>, name: &str, usual: bool) -> bool {
    let text = element.attribute(name);
    text.map_or(usual, |text| matches!(text.trim(), "true" | "1"))
}

pub(super) fn number<T: FromStr>(element: Node<'_, '_>, name: &str, usual: T) -> Result<T, String> {
    let Some(text) = element.attribute(name) else {
        return Ok(usual);
    };
    let wrong = |_| format!("{name} \"{}\" is no number that fits", shown(text));
    text.trim().parse().map_err(wrong)
}

pub(super) fn dimensions(element: Node<'_, '_>) -> Result<Option<Vec<u32>>, String> {
    let text = element.attribute("ArrayDimensions").unwrap_or_default();
    if text.trim().is_empty() {
        return Ok(None);
    }
    let sizes = text.split(',').map(|size| size.trim().parse::<u32>());
    let sizes = sizes.collect::<Result<_, _>>();
    let wrong = |_| format!("ArrayDimensions \"{}\" is no list of numbers", shown(text));
    sizes.map(Some).map_err(wrong)
}

/// The first text of that name: files have the one without a locale, or in English, first.
pub(super) fn localized(element: Node<'_, '_>, name: &str) -> Option<LocalizedText> {
    let text = child(element, name)?;
    let locale = text.attribute("Locale").unwrap_or_default();
    Some(LocalizedText::new(locale, text.text().unwrap_or_default()))
}
