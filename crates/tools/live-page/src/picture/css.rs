//! Styles: which parts of them may stay.

use super::names;

/// True if a value, or a whole style sheet, loads nothing from outside the picture.
pub(super) fn is_harmless(text: &str) -> bool {
    // An escape can spell anything that is searched for here; no drawing program needs one.
    if text.contains(['\\', '@', '<']) {
        return false;
    }
    // An apparent comment may be part of a text, and then hides nothing: both readings count.
    [text, &without_comments(text)]
        .iter()
        .all(|text| loads_nothing(&text.to_ascii_lowercase()))
}

fn loads_nothing(text: &str) -> bool {
    let loads = [
        "image(",
        "image-set(",
        "src(",
        "element(",
        "expression(",
        "paint(",
        "javascript:",
        "-moz-binding",
        "behavior:",
    ];
    let local = text.match_indices("url(").all(|(at, found)| {
        let rest = text[at + found.len()..].trim_start();
        rest.trim_start_matches(['"', '\'']).starts_with('#')
    });
    local && !loads.iter().any(|word| text.contains(word))
}

/// The text without its comments.
fn without_comments(text: &str) -> String {
    let mut kept = String::with_capacity(text.len());
    let mut rest = text;
    while let Some((before, after)) = rest.split_once("/*") {
        kept.push_str(before);
        rest = after.split_once("*/").map_or("", |(_, behind)| behind);
    }
    kept.push_str(rest);
    kept
}

/// The names that a value refers to by `url(#name)`.
pub(super) fn references(value: &str) -> impl Iterator<Item = &str> {
    value.split("url(").skip(1).filter_map(|rest| {
        let name = rest.trim_start().trim_start_matches(['"', '\'']);
        let name = name.strip_prefix('#')?;
        Some(name.split(['"', '\'', ')', ' ']).next().unwrap_or_default())
    })
}

/// The declarations of a style attribute: name and value.
pub(super) fn declarations(style: &str) -> Vec<(&str, &str)> {
    let mut found = Vec::new();
    let (mut begin, mut depth, mut quote) = (0, 0_usize, None);
    let ends = style.char_indices().chain([(style.len(), ';')]);
    for (at, c) in ends {
        match (quote, c) {
            (Some(open), c) if c == open => quote = None,
            (None, '"' | '\'') if at < style.len() => quote = Some(c),
            (None, '(') => depth += 1,
            (None, ')') => depth = depth.saturating_sub(1),
            (None, ';') if depth == 0 || at == style.len() => {
                if let Some((name, value)) = style[begin..at].split_once(':') {
                    let value = value.trim();
                    let value = value.strip_suffix("!important").unwrap_or(value).trim_end();
                    found.push((name.trim(), value));
                }
                begin = at + 1;
            }
            _ => {}
        }
    }
    found
}

/// The declarations of a style attribute as attributes. `leave_out` gets the rest.
pub(super) fn attributes(
    style: &str,
    mut leave_out: impl FnMut(&str),
) -> Vec<(&'static str, String)> {
    let mut found = Vec::new();
    for (name, value) in declarations(style) {
        let name = name.to_ascii_lowercase();
        // One property for all three, as Inkscape writes it.
        let names: &[&str] = if name == "marker" {
            &["marker-start", "marker-mid", "marker-end"]
        } else {
            &[&name]
        };
        for name in names.iter().filter_map(|name| names::property(name)) {
            if is_harmless(value) {
                found.push((name, value.to_owned()));
            } else {
                leave_out(value);
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_loads_is_not_harmless() {
        for text in [
            "#fff",
            "url(#a)",
            "url( '#a' )",
            "url(\"#a\") none",
            "rotate(3 4 5)",
            ".a{fill:url(#b)}",
            "'Segoe UI', sans-serif",
        ] {
            assert!(is_harmless(text), "{text}");
        }
        for text in [
            "url(http://evil.example/x.png)",
            "url(#a) url(//evil.example)",
            "URL(data:image/svg+xml,x)",
            "u\\72l(http://evil.example)",
            "@import 'http://evil.example'",
            "image-set('x' 1x)",
            "src('x')",
            "url(/*#*/x)",
            "url(/*x*/#a)",
            "'/*' url(x) '*/'",
            "url(",
            "</style><script>",
        ] {
            assert!(!is_harmless(text), "{text}");
        }
    }

    #[test]
    fn a_style_becomes_attributes() {
        let mut left_out = Vec::new();
        let found = attributes(
            "fill: #fff ; stroke:url(#a);filter:url('x;y');-inkscape-font-specification:'a;b'; font-family:'A;B'!important;marker:none",
            |value| left_out.push(value.to_owned()),
        );
        let found: Vec<(&str, &str)> = found
            .iter()
            .map(|(name, value)| (*name, &**value))
            .collect();
        assert_eq!(
            found,
            [
                ("fill", "#fff"),
                ("stroke", "url(#a)"),
                ("font-family", "'A;B'"),
                ("marker-start", "none"),
                ("marker-mid", "none"),
                ("marker-end", "none")
            ]
        );
        assert_eq!(left_out, ["url('x;y')"]);
        assert_eq!(
            references("a url(#b) url( \"#c\" ) url(d)").collect::<Vec<_>>(),
            ["b", "c"]
        );
    }
}
