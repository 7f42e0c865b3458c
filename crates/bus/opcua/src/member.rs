//! Elements of arrays and members of structures, as written behind a node id: `ns=2;i=6001[3].position`.

/// One step from a value to a part of it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Step {
    /// An element of an array, from 0.
    Element(usize),
    /// A member of a structure.
    Member(String),
}

/// Splits a node id with a number from the steps behind it. A text is left whole: it can have the same characters, and
/// the address space decides what is a node.
pub(crate) fn split(text: &str) -> (&str, &str) {
    let begin = match text.split_once(';') {
        Some((namespace, _)) if text.starts_with("ns") => namespace.len() + 1,
        _ => 0,
    };
    let Some(digits) = text[begin..].strip_prefix("i=") else {
        return (text, "");
    };
    let steps = digits
        .find(['[', '.'])
        .map(|at| text.len() - digits.len() + at);
    text.split_at(steps.unwrap_or(text.len()))
}

/// The places at which the steps behind a text can begin, the last one first.
#[cfg(any(feature = "opcua", test))]
pub(crate) fn begins(text: &str) -> impl Iterator<Item = usize> {
    let places = text.match_indices(['[', '.']);
    let places: Vec<usize> = places.map(|(at, _)| at).collect();
    places.into_iter().rev().filter(|at| *at > 0)
}

/// Reads steps; `None` for other texts.
pub(crate) fn steps(text: &str) -> Option<Vec<Step>> {
    let mut rest = text;
    let mut steps = Vec::new();
    while !rest.is_empty() {
        if let Some(inner) = rest.strip_prefix('[') {
            let (digits, behind) = inner.split_once(']')?;
            let is_plain = digits.bytes().all(|byte| byte.is_ascii_digit());
            steps.push(Step::Element(digits.parse().ok().filter(|_| is_plain)?));
            rest = behind;
        } else {
            let inner = rest.strip_prefix('.')?;
            let end = inner.find(['[', '.']).unwrap_or(inner.len());
            let (name, behind) = inner.split_at(end);
            if name.is_empty() {
                return None;
            }
            steps.push(Step::Member(name.to_owned()));
            rest = behind;
        }
    }
    Some(steps)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_stand_behind_a_node_id() {
        for (text, node, behind) in [
            ("ns=2;i=6001[3].x", "ns=2;i=6001", "[3].x"),
            (
                "nsu=http://a.b/c;i=7.pos[0]",
                "nsu=http://a.b/c;i=7",
                ".pos[0]",
            ),
            ("i=7", "i=7", ""),
            ("ns=2;s=A.B[1]", "ns=2;s=A.B[1]", ""),
        ] {
            assert_eq!(split(text), (node, behind), "{text}");
        }
        let member = |name: &str| Step::Member(name.to_owned());
        assert_eq!(
            steps("[3].x.y[0]"),
            Some(vec![
                Step::Element(3),
                member("x"),
                member("y"),
                Step::Element(0)
            ])
        );
        for wrong in [
            "[",
            "[]",
            "[-1]",
            "[+1]",
            ".",
            "..x",
            "x",
            "[0]x",
            "[99999999999999999999]",
        ] {
            assert_eq!(steps(wrong), None, "{wrong}");
        }
        assert_eq!(begins("A.B[1]").collect::<Vec<_>>(), [3, 1]);
    }
}
