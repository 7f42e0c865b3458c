//! Changes of a text that can be found and undone exactly.
//!
//! Inserted text is enclosed in two marks, and the first mark holds the text that was replaced:
//!
//! ```text
//! beam : (*{tickbus TON*)TICKBUS_TON(*tickbus}*);
//! ```
//!
//! In XML the marks are `<!--{tickbus ...-->` and `<!--tickbus}-->`. The rest of the text is unchanged. The text in a
//! mark is encoded, since editors disagree on the end of nested comments, and XML allows no `--` in a comment.

use std::fmt::Write as _;
use std::ops::Range;

use tickbus_base::Mistake;

/// The notation of the marks in a part of a text.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Marks {
    StructuredText,
    Xml,
}

impl Marks {
    const ALL: [Self; 2] = [Self::StructuredText, Self::Xml];

    /// The begin of the first mark, its end, and the second mark.
    fn texts(self) -> [&'static str; 3] {
        match self {
            Self::StructuredText => ["(*{tickbus", "*)", "(*tickbus}*)"],
            Self::Xml => ["<!--{tickbus", "-->", "<!--tickbus}-->"],
        }
    }
}

/// Changes of one text, in any order.
#[derive(Debug, Default)]
pub(crate) struct Edits(Vec<Edit>);

#[derive(Debug)]
struct Edit {
    range: Range<usize>,
    new: String,
    marks: Marks,
}

impl Edits {
    /// Replaces the text in `range` by `new`; ranges must not overlap. Several inserts at one place appear in the order
    /// of the calls.
    pub(crate) fn replace(&mut self, range: Range<usize>, new: impl Into<String>, marks: Marks) {
        let new = new.into();
        self.0.push(Edit { range, new, marks });
    }

    /// Inserts `new` at `at`.
    pub(crate) fn insert(&mut self, at: usize, new: impl Into<String>, marks: Marks) {
        self.replace(at..at, new, marks);
    }

    /// The changed text.
    pub(crate) fn apply(mut self, text: &str) -> String {
        // Text inserted at a place precedes text that replaces something there.
        self.0
            .sort_by_key(|edit| (edit.range.start, edit.range.end));
        let mut made = String::with_capacity(text.len() * 2);
        let mut copied = 0;
        for Edit { range, new, marks } in self.0 {
            let [begin, end, second] = marks.texts();
            made.push_str(&text[copied..range.start]);
            made.push_str(begin);
            if !range.is_empty() {
                made.push(' ');
                encode(&text[range.clone()], &mut made);
            }
            made.push_str(end);
            made.push_str(&new);
            made.push_str(second);
            copied = range.end;
        }
        made.push_str(&text[copied..]);
        made
    }
}

/// The offset of the first mark in `text`, if it has any.
pub(crate) fn marked(text: &str) -> Option<usize> {
    // Each mark contains this word: one search finds all of them.
    const WORD: &str = "tickbus";
    let marks = Marks::ALL.map(Marks::texts);
    let marks = marks.map(|[begin, _, second]| [begin, second]);
    let mut words = text.match_indices(WORD);
    words.find_map(|(at, _)| {
        marks.as_flattened().iter().find_map(|mark| {
            let start = at.checked_sub(mark.find(WORD)?)?;
            let rest = text.get(start..)?;
            rest.starts_with(mark).then_some(start)
        })
    })
}

/// The text as it was before its marked changes.
///
/// # Errors
///
/// The offset of a damaged mark, or of one without its counterpart.
pub(crate) fn undo(text: &str) -> Result<String, (usize, Mistake)> {
    let mut original = String::with_capacity(text.len());
    let mut at = 0;
    while let Some(found) = marked(&text[at..]) {
        original.push_str(&text[at..at + found]);
        at += found;
        let rest = &text[at..];
        let wrong = |what: &str| {
            let right = "put the mark back as it was, or begin with the original";
            Err((at, Mistake::new(what, right)))
        };
        let marks = Marks::ALL.map(Marks::texts);
        let kind = marks.iter().find(|[begin, ..]| rest.starts_with(begin));
        let Some([begin, end, second]) = kind else {
            return wrong("a change ends here that does not begin anywhere");
        };
        let rest = &rest[begin.len()..];
        let Some((held, changed)) = rest.split_once(end) else {
            return wrong("this mark has no end");
        };
        match held.strip_prefix(' ').map(decode) {
            Some(Some(held)) => original.push_str(&held),
            None if held.is_empty() => {}
            _ => return wrong("what this mark holds is damaged"),
        }
        let next = marked(changed);
        let Some(length) = next.filter(|at| changed[*at..].starts_with(second)) else {
            return wrong("the change that begins here has no end");
        };
        at = text.len() - changed.len() + length + second.len();
    }
    original.push_str(&text[at..]);
    Ok(original)
}

/// Encodes line ends, and characters with a meaning in comments of Structured Text or XML, as `%` and two digits.
fn encode(text: &str, into: &mut String) {
    for c in text.chars() {
        if c.is_ascii_control() || "%*(){}<>&-".contains(c) {
            write!(into, "%{:02X}", u32::from(c)).expect("a String takes all");
        } else {
            into.push(c);
        }
    }
}

fn decode(text: &str) -> Option<String> {
    let mut pieces = text.split('%');
    let mut decoded = pieces.next().unwrap_or_default().to_owned();
    for piece in pieces {
        let digits = piece.get(..2)?;
        let byte = u8::from_str_radix(digits, 16).ok()?;
        decoded.push(byte.is_ascii().then_some(char::from(byte))?);
        decoded.push_str(&piece[2..]);
    }
    Some(decoded)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_change_shows_what_it_replaced() {
        let mut edits = Edits::default();
        edits.replace(4..7, "TICKBUS_TON", Marks::StructuredText);
        edits.insert(7, " (* new *)", Marks::StructuredText);
        edits.insert(4, "a ", Marks::StructuredText);
        let made = edits.apply("t : TON;");
        assert_eq!(
            made,
            "t : (*{tickbus*)a (*tickbus}*)(*{tickbus TON*)TICKBUS_TON(*tickbus}*)(*{tickbus*) (* new *)(*tickbus}*);"
        );
        assert_eq!(undo(&made), Ok("t : TON;".to_owned()));
        // Other changes made since then stay.
        assert_eq!(
            undo(&made.replace("t :", "timer :")),
            Ok("timer : TON;".to_owned())
        );
    }

    #[test]
    fn damaged_marks_are_told() {
        for (text, at, what) in [
            ("a (*tickbus}*)", 2, "does not begin"),
            ("(*{tickbus*) x", 0, "has no end"),
            ("(*{tickbus x", 0, "this mark has no end"),
            ("(*{tickbus %4*)(*tickbus}*)", 0, "damaged"),
            ("(*{tickbus %FF*)(*tickbus}*)", 0, "damaged"),
            ("(*{tickbus %é*)(*tickbus}*)", 0, "damaged"),
            ("(*{tickbusx*)(*tickbus}*)", 0, "damaged"),
            (
                "(*{tickbus*)(*{tickbus*)(*tickbus}*)(*tickbus}*)",
                0,
                "no end",
            ),
            ("<!--{tickbus-->(*tickbus}*)", 0, "no end"),
        ] {
            let (place, mistake) = undo(text).expect_err(text);
            assert_eq!(place, at, "{text}");
            assert!(mistake.what.contains(what), "{text}: {}", mistake.what);
        }
    }

    proptest! {
        #[test]
        fn undone_changes_leave_no_trace(
            text in "(\\PC|[(*)<>!%\r\n-]){0,40}",
            places in proptest::collection::vec((any::<bool>(), 0_usize..40, 0_usize..6), 0..6),
        ) {
            let marks = |xml| if xml { Marks::Xml } else { Marks::StructuredText };
            let mut edits = Edits::default();
            let mut free = 0;
            let mut places = places;
            places.sort_by_key(|(_, at, _)| *at);
            for (xml, at, length) in places {
                let mut start = at.max(free).min(text.len());
                while !text.is_char_boundary(start) { start += 1 }
                let mut end = (start + length).min(text.len());
                while !text.is_char_boundary(end) { end += 1 }
                edits.replace(start..end, "new\r\n", marks(xml));
                free = end;
            }
            prop_assert_eq!(undo(&edits.apply(&text)), Ok(text));
        }

        #[test]
        fn no_text_makes_it_panic(text in "(\\PC|\\(\\*\\{tickbus|\\*\\)|\\(\\*tickbus\\}\\*\\)|<!--\\{tickbus|-->| |%){0,30}") {
            let _ = undo(&text);
        }
    }
}
