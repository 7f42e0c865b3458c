//! The elements and properties that a picture may have.

/// Elements that draw, or that drawing elements refer to.
const ELEMENTS: &[&str] = &[
    "circle",
    "clipPath",
    "defs",
    "desc",
    "ellipse",
    "feBlend",
    "feColorMatrix",
    "feComponentTransfer",
    "feComposite",
    "feConvolveMatrix",
    "feDiffuseLighting",
    "feDisplacementMap",
    "feDistantLight",
    "feDropShadow",
    "feFlood",
    "feFuncA",
    "feFuncB",
    "feFuncG",
    "feFuncR",
    "feGaussianBlur",
    "feMerge",
    "feMergeNode",
    "feMorphology",
    "feOffset",
    "fePointLight",
    "feSpecularLighting",
    "feSpotLight",
    "feTile",
    "feTurbulence",
    "filter",
    "g",
    "image",
    "line",
    "linearGradient",
    "marker",
    "mask",
    "path",
    "pattern",
    "polygon",
    "polyline",
    "radialGradient",
    "rect",
    "stop",
    "style",
    "svg",
    "switch",
    "symbol",
    "text",
    "textPath",
    "title",
    "tspan",
    "use",
];

/// Properties of a style that are attributes, too.
const PROPERTIES: &[&str] = &[
    "alignment-baseline",
    "baseline-shift",
    "clip-path",
    "clip-rule",
    "color",
    "color-interpolation",
    "color-interpolation-filters",
    "direction",
    "display",
    "dominant-baseline",
    "fill",
    "fill-opacity",
    "fill-rule",
    "filter",
    "flood-color",
    "flood-opacity",
    "font-family",
    "font-size",
    "font-size-adjust",
    "font-stretch",
    "font-style",
    "font-variant",
    "font-weight",
    "image-rendering",
    "letter-spacing",
    "lighting-color",
    "marker-end",
    "marker-mid",
    "marker-start",
    "mask",
    "mask-type",
    "opacity",
    "overflow",
    "paint-order",
    "shape-rendering",
    "stop-color",
    "stop-opacity",
    "stroke",
    "stroke-dasharray",
    "stroke-dashoffset",
    "stroke-linecap",
    "stroke-linejoin",
    "stroke-miterlimit",
    "stroke-opacity",
    "stroke-width",
    "text-anchor",
    "text-decoration",
    "text-rendering",
    "unicode-bidi",
    "vector-effect",
    "visibility",
    "word-spacing",
    "writing-mode",
];

/// The known name that equals `name`: a string of the list, never one of the file.
fn find(list: &'static [&'static str], name: &str) -> Option<&'static str> {
    let at = list.binary_search(&name).ok()?;
    Some(list[at])
}

/// An element that draws.
pub(super) fn element(name: &str) -> Option<&'static str> {
    find(ELEMENTS, name)
}

/// A property that is an attribute, too.
pub(super) fn property(name: &str) -> Option<&'static str> {
    find(PROPERTIES, name)
}

/// True for elements whose text counts.
pub(super) fn has_text(element: &str) -> bool {
    matches!(
        element,
        "text" | "tspan" | "textPath" | "title" | "desc" | "style"
    )
}

/// True if an attribute without a prefix may stay: it can neither run nor load anything on its own. References in its
/// value are checked elsewhere.
pub(super) fn is_attribute(name: &str) -> bool {
    let is_plain = name
        .bytes()
        .all(|byte| byte.is_ascii_alphanumeric() || byte == b'-');
    let lower = name.to_ascii_lowercase();
    let is_kept_away = lower.starts_with("on")
        || lower.starts_with("xmlns")
        || lower.starts_with("data-")
        || matches!(
            &*lower,
            "style"
                | "href"
                | "src"
                | "srcset"
                | "action"
                | "formaction"
                | "attributename"
                | "ping"
                | "target"
        );
    is_plain && !is_kept_away
}

/// True if a namespace belongs to an editor: its contents concern only the editor.
pub(super) fn is_editors(namespace: &str) -> bool {
    [
        "http://www.inkscape.org/",
        "http://sodipodi.sourceforge.net/",
        "http://creativecommons.org/",
        "http://web.resource.org/cc/",
        "http://purl.org/dc/",
        "http://www.w3.org/1999/02/22-rdf-syntax-ns#",
        "http://ns.adobe.com/",
        "http://www.bohemiancoding.com/",
        "http://www.serif.com/",
        "http://www.figma.com/",
        "http://www.corel.com/",
        "http://boxy-svg.com",
        "http://www.openswatchbook.org/",
    ]
    .iter()
    .any(|known| namespace.starts_with(known))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_lists_are_in_their_order() {
        assert!(ELEMENTS.is_sorted() && PROPERTIES.is_sorted());
        assert_eq!(element("clipPath"), Some("clipPath"));
        for name in [
            "script",
            "foreignObject",
            "animate",
            "set",
            "a",
            "iframe",
            "SCRIPT",
            "feImage",
        ] {
            assert_eq!(element(name), None, "{name}");
        }
    }

    #[test]
    fn an_attribute_that_acts_is_none() {
        for name in [
            "onload", "ONCLICK", "href", "style", "src", "data-x", "x:y", "xmlns", "",
        ] {
            assert!(!is_attribute(name) || name.is_empty(), "{name}");
        }
        for name in [
            "d",
            "viewBox",
            "stroke-width",
            "gradientUnits",
            "x1",
            "id",
            "class",
        ] {
            assert!(is_attribute(name), "{name}");
        }
    }
}
