//! Live pictures: any SVG, made harmless, with elements bound to signals.
//!
//! [`read`] parses an SVG and writes it again from known parts: elements and attributes that draw. Scripts, event
//! handlers, references to other files, foreign objects, entities and everything unknown are left out, and listed in
//! [`Picture::left_out`]. The attributes `data-tb-…` become bindings: each is parsed once, here, and appears in the
//! result as JSON, so that the script on the page needs no parser. docs/live-page.md has their grammar.

mod binding;
mod css;
mod load;
mod names;
mod tree;
mod write;

use tickbus_base::Mistake;

/// The largest picture, in bytes.
pub const LIMIT: usize = 4 << 20;

/// A harmless picture.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    /// The SVG. Bound elements have a list of bindings in `data-tb`.
    pub svg: String,
    /// The parts that were left out, in words; without those that only editors need.
    pub left_out: Vec<String>,
    /// Wrong bindings, each with its line and the remedy. They have no effect.
    pub mistakes: Vec<String>,
}

/// Makes an SVG harmless and reads its bindings to `signals`, the names of a driver's signals.
///
/// # Errors
///
/// The text is no SVG, or larger than [`LIMIT`].
pub fn read(text: &str, signals: &[&str]) -> Result<Picture, Mistake> {
    if text.len() > LIMIT {
        return Err(Mistake::new(
            format!("the picture has {} bytes", text.len()),
            format!("at most {LIMIT} are read; draw it with fewer points, or embed smaller images"),
        ));
    }
    let mut notes = Notes::default();
    let mut root = tree::read(text, &mut notes)?;
    load::limit(&mut root, &mut notes);
    binding::bind(&mut root, signals, &mut notes);
    Ok(Picture {
        svg: write::svg(&root),
        left_out: notes.left_out,
        mistakes: notes.mistakes,
    })
}

/// The most notes of one kind.
const MOST_NOTES: usize = 100;

/// The notes about a picture.
#[derive(Debug, Default)]
struct Notes {
    left_out: Vec<String>,
    mistakes: Vec<String>,
}

impl Notes {
    fn leave_out(&mut self, line: usize, what: &str) {
        note(&mut self.left_out, line, what);
    }

    fn mistake(&mut self, line: usize, mistake: &str) {
        note(&mut self.mistakes, line, mistake);
    }
}

fn note(notes: &mut Vec<String>, line: usize, what: &str) {
    match notes.len() {
        0..MOST_NOTES => notes.push(format!("line {line}: {what}")),
        MOST_NOTES => notes.push("and more".to_owned()),
        _ => {}
    }
}

/// The beginning of a text that may be long, for quoting.
fn short(text: &str) -> String {
    const MOST: usize = 60;
    match text.char_indices().nth(MOST) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text.to_owned(),
    }
}

#[cfg(test)]
mod tests;
