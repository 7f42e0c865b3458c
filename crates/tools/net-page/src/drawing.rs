//! The check of a drawing: SVG with shapes and texts only, so that it cannot run anything, load anything, or style the
//! page.

use roxmltree::{Document, Node};

const SVG: &str = "http://www.w3.org/2000/svg";

const ELEMENTS: &[&str] = &[
    "svg", "g", "title", "path", "line", "polyline", "polygon", "rect", "circle", "ellipse",
    "text", "tspan",
];

const ATTRIBUTES: &[&str] = &[
    "class",
    "role",
    "aria-label",
    "width",
    "height",
    "viewBox",
    "transform",
    "d",
    "points",
    "x",
    "y",
    "x1",
    "y1",
    "x2",
    "y2",
    "cx",
    "cy",
    "r",
    "rx",
    "ry",
    "text-anchor",
    "data-place",
    "data-transition",
];

/// Says what is wrong with the drawing of a net of so many places and transitions.
pub(crate) fn check(svg: &str, places: usize, transitions: usize) -> Result<(), String> {
    let drawing = Document::parse(svg).map_err(|why| format!("is not SVG: {why}"))?;
    let root = drawing.root_element();
    if root.tag_name().name() != "svg" {
        return Err(format!(
            "begins with <{}>; expected <svg>",
            root.tag_name().name()
        ));
    }
    for node in root.descendants().filter(Node::is_element) {
        element(node, places, transitions)?;
    }
    Ok(())
}

fn element(node: Node<'_, '_>, places: usize, transitions: usize) -> Result<(), String> {
    let name = node.tag_name().name();
    if node.tag_name().namespace() != Some(SVG) || !ELEMENTS.contains(&name) {
        let expected = ELEMENTS.join(", ");
        return Err(format!("has the element <{name}>; expected {expected}"));
    }
    for attribute in node.attributes() {
        let key = attribute.name();
        if attribute.namespace().is_some() || !ATTRIBUTES.contains(&key) {
            return Err(format!(
                "has the attribute {key} of <{name}>; a drawing has shapes, texts and classes only"
            ));
        }
        let count = match key {
            "data-place" => places,
            "data-transition" => transitions,
            _ => continue,
        };
        let value = attribute.value();
        if !value.parse().is_ok_and(|index: usize| index < count) {
            return Err(format!(
                "has {key}=\"{value}\"; expected a number below {count}"
            ));
        }
    }
    Ok(())
}
