//! An SVG as a tree of drawing elements.

use std::collections::BTreeSet;

use quick_xml::events::{BytesStart, Event};
use quick_xml::name::{Namespace, ResolveResult};
use quick_xml::reader::NsReader;
use tickbus_base::Mistake;

use super::{Notes, css, names, short};

const SVG: &str = "http://www.w3.org/2000/svg";
const XLINK: &str = "http://www.w3.org/1999/xlink";

/// The deepest nesting of elements, and the most elements: beyond these, browsers get slow or fail.
const DEEPEST: usize = 100;
const MOST: usize = 50_000;

/// An element that draws.
#[derive(Debug)]
pub(super) struct Element {
    pub(super) name: &'static str,
    pub(super) attributes: Vec<(String, String)>,
    /// The attributes `data-tb-…`: the rest of the name, and the value.
    pub(super) bound: Vec<(String, String)>,
    pub(super) children: Vec<Child>,
    /// The line where the element begins, from 1.
    pub(super) line: usize,
}

#[derive(Debug)]
pub(super) enum Child {
    Element(Element),
    Text(String),
}

impl Element {
    /// The value of an attribute.
    pub(super) fn get(&self, name: &str) -> Option<&str> {
        let found = self.attributes.iter().find(|(it, _)| it == name);
        found.map(|(_, value)| &**value)
    }

    fn set(&mut self, name: &str, value: String) {
        self.attributes.retain(|(it, _)| it != name);
        self.attributes.push((name.to_owned(), value));
    }

    /// The child elements.
    pub(super) fn elements(&self) -> impl Iterator<Item = &Self> {
        self.children.iter().filter_map(|child| match child {
            Child::Element(element) => Some(element),
            Child::Text(_) => None,
        })
    }
}

/// Reads an SVG, and leaves out everything that does not draw.
pub(super) fn read(text: &str, notes: &mut Notes) -> Result<Element, Mistake> {
    let mut reader = NsReader::from_str(text);
    let mut lines = Lines {
        text,
        at: 0,
        line: 1,
    };
    let mut building = Building {
        notes,
        open: Vec::new(),
        root: None,
        skipped: 0,
        elements: 0,
        entities: BTreeSet::new(),
    };
    loop {
        let begin = reader.buffer_position();
        let (namespace, event) = match reader.read_resolved_event() {
            Ok((namespace, event)) => (of(&namespace), event),
            Err(error) => {
                let line = lines.of(reader.error_position());
                return Err(Mistake::new(
                    format!("the picture is not well-formed at line {line}: {error}"),
                    "save it as a plain SVG",
                ));
            }
        };
        let line = lines.of(begin);
        match event {
            Event::Start(start) => building.begin(&reader, namespace, &start, line)?,
            Event::Empty(start) => {
                building.begin(&reader, namespace, &start, line)?;
                building.end();
            }
            Event::End(_) => building.end(),
            Event::Text(text) => building.text(&text.xml10_content()),
            Event::CData(text) => building.text(&text.xml10_content()),
            Event::GeneralRef(entity) => building.entity(&entity, line),
            Event::DocType(text) if text.contains("<!ENTITY") => {
                building
                    .notes
                    .leave_out(line, "the entities of the DOCTYPE");
            }
            Event::DocType(_) | Event::Comment(_) | Event::Decl(_) | Event::PI(_) => {}
            Event::Eof => break,
        }
    }
    let is_whole = building.open.is_empty() && building.skipped == 0;
    building.root.filter(|_| is_whole).ok_or_else(|| {
        Mistake::new(
            "the picture is no SVG, or breaks off",
            "it begins with <svg xmlns=\"http://www.w3.org/2000/svg\"> and ends with </svg>",
        )
    })
}

/// Finds the lines of byte offsets, which must be requested in ascending order.
struct Lines<'t> {
    text: &'t str,
    at: usize,
    line: usize,
}

impl Lines<'_> {
    /// The line of a byte offset, from 1.
    fn of(&mut self, offset: u64) -> usize {
        let offset = usize::try_from(offset)
            .unwrap_or(usize::MAX)
            .min(self.text.len());
        let passed = self
            .text
            .as_bytes()
            .get(self.at..offset)
            .unwrap_or_default();
        self.line += passed.split(|byte| *byte == b'\n').count() - 1;
        self.at = self.at.max(offset);
        self.line
    }
}

/// The owner of an element.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Owner {
    Svg,
    /// An editor: only the editor needs the element.
    Editor,
    Other,
}

fn of(namespace: &ResolveResult<'_>) -> Owner {
    match namespace {
        // Without a namespace, or with one written as an entity, SVG is meant.
        ResolveResult::Unbound => Owner::Svg,
        ResolveResult::Bound(Namespace(name)) if *name == SVG || name.starts_with('&') => {
            Owner::Svg
        }
        ResolveResult::Bound(Namespace(name)) if names::is_editors(name) => Owner::Editor,
        ResolveResult::Bound(_) | ResolveResult::Unknown(_) => Owner::Other,
    }
}

struct Building<'n> {
    notes: &'n mut Notes,
    /// The open elements, from the root to the current one.
    open: Vec<Element>,
    root: Option<Element>,
    /// The number of open elements that are left out, with their contents.
    skipped: usize,
    elements: usize,
    /// Entities noted so far.
    entities: BTreeSet<String>,
}

impl Building<'_> {
    fn begin(
        &mut self,
        reader: &NsReader<&[u8]>,
        owner: Owner,
        start: &BytesStart<'_>,
        line: usize,
    ) -> Result<(), Mistake> {
        if self.skipped > 0 {
            self.skipped += 1;
            return Ok(());
        }
        self.elements += 1;
        if self.elements > MOST || self.open.len() >= DEEPEST {
            return Err(Mistake::new(
                format!(
                    "the picture has more than {MOST} elements, or more than {DEEPEST} within each other, at line {line}"
                ),
                "draw it with fewer elements, or embed a part of it as an image",
            ));
        }
        let local = start.local_name();
        // A link's target is left out, but its content stays.
        let name = if local.as_ref() == "a" {
            Some("g")
        } else {
            names::element(local.as_ref())
        };
        let (Owner::Svg, Some(name)) = (owner, name) else {
            if owner != Owner::Editor && local.as_ref() != "metadata" {
                let what = format!("<{}>", short(start.name().as_ref()));
                self.notes.leave_out(line, &what);
            }
            self.skipped = 1;
            return Ok(());
        };
        if self.open.is_empty() && (name != "svg" || self.root.is_some()) {
            return Err(Mistake::new(
                format!("the picture begins with <{}>", short(start.name().as_ref())),
                "the outermost element of an SVG is <svg>",
            ));
        }
        let mut element = Element {
            name,
            attributes: Vec::new(),
            bound: Vec::new(),
            children: Vec::new(),
            line,
        };
        let mut reference = None;
        if start
            .attributes()
            .flatten()
            .any(|it| it.key.as_ref() == "data-tb-still")
        {
            self.skipped = 1;
            return Ok(());
        }
        for attribute in start.attributes() {
            let Ok(attribute) = attribute else {
                self.notes
                    .leave_out(line, "an attribute that is not well-formed");
                continue;
            };
            let Some(value) = self.value(&attribute.value, line) else {
                self.notes
                    .leave_out(line, "an attribute that is not well-formed");
                continue;
            };
            let (namespace, local) = reader.resolver().resolve_attribute(attribute.key);
            let is_xlink = matches!(namespace, ResolveResult::Bound(Namespace(XLINK)));
            let is_own = attribute.key.prefix().is_none();
            let is_reference = local.as_ref() == "href"
                && (is_xlink || is_own || attribute.key.as_ref() == "xlink:href");
            if is_reference {
                // The newer attribute takes precedence over the older one.
                if is_own || reference.is_none() {
                    reference = Some(value);
                }
            } else if is_own {
                self.attribute(&mut element, local.as_ref(), value);
            }
        }
        if let Some(reference) = reference {
            self.refer(&mut element, reference);
        }
        self.open.push(element);
        Ok(())
    }

    /// An attribute's value with escapes resolved; `None` if that fails.
    fn value(&mut self, raw: &str, line: usize) -> Option<String> {
        let mut unknown = None;
        let value = quick_xml::escape::unescape_with(raw, |entity| {
            quick_xml::escape::resolve_predefined_entity(entity).or_else(|| {
                unknown = Some(entity.to_owned());
                Some("")
            })
        });
        let value = value.ok()?.into_owned();
        if let Some(entity) = unknown {
            self.unknown(&entity, line);
        }
        Some(value)
    }

    fn attribute(&mut self, element: &mut Element, name: &str, value: String) {
        let line = element.line;
        if let Some(what) = name.strip_prefix("data-tb-") {
            element.bound.push((what.to_owned(), value));
        } else if name == "style" {
            let found = css::attributes(&value, |value| {
                let what = format!("a style that loads something: {}", short(value));
                self.notes.leave_out(line, &what);
            });
            // A style takes precedence over an attribute of the same name.
            for (name, value) in found {
                element.set(name, value);
            }
        } else if !names::is_attribute(name) {
            if name.to_ascii_lowercase().starts_with("on") {
                let what = format!("the event handler {}", short(name));
                self.notes.leave_out(line, &what);
            }
        } else if !css::is_harmless(&value) && !matches!(name, "id" | "class" | "aria-label" | "d")
        {
            let what = format!("{}={}", short(name), short(&value));
            self.notes.leave_out(line, &what);
        } else if element.get(name).is_none() {
            element.set(name, value);
        }
    }

    /// A reference within the picture, or an embedded image.
    fn refer(&mut self, element: &mut Element, reference: String) {
        let is_image = element.name == "image" && {
            let begins = ["png", "jpeg", "jpg", "gif", "webp"];
            let data = reference.trim_start().strip_prefix("data:image/");
            data.is_some_and(|data| {
                begins.iter().any(|kind| {
                    data.strip_prefix(kind)
                        .is_some_and(|rest| rest.starts_with(';'))
                })
            })
        };
        if reference.starts_with('#') || is_image {
            element.set("href", reference);
        } else {
            let what = format!("a reference to {}", short(&reference));
            self.notes.leave_out(element.line, &what);
        }
    }

    fn end(&mut self) {
        if self.skipped > 0 {
            self.skipped -= 1;
            return;
        }
        let Some(mut element) = self.open.pop() else {
            return;
        };
        if element.name == "style" {
            let sheet: String = element
                .children
                .iter()
                .map(|child| match child {
                    Child::Text(text) => &**text,
                    Child::Element(_) => "",
                })
                .collect();
            if !css::is_harmless(&sheet) {
                self.notes.leave_out(
                    element.line,
                    "a style sheet that loads something, or has rules beginning with @",
                );
                return;
            }
            element.children = vec![Child::Text(sheet)];
        }
        match self.open.last_mut() {
            Some(parent) => parent.children.push(Child::Element(element)),
            None => self.root = Some(element),
        }
    }

    fn text(&mut self, text: &str) {
        if self.skipped > 0 {
            return;
        }
        let Some(element) = self
            .open
            .last_mut()
            .filter(|element| names::has_text(element.name))
        else {
            return;
        };
        match element.children.last_mut() {
            Some(Child::Text(before)) => before.push_str(text),
            _ => element.children.push(Child::Text(text.to_owned())),
        }
    }

    /// A character written by its number or name; entities that the DOCTYPE declares are not accepted.
    fn entity(&mut self, entity: &quick_xml::events::BytesRef<'_>, line: usize) {
        let known = quick_xml::escape::resolve_predefined_entity(entity);
        if let Some(text) = known {
            self.text(text);
        } else if let Ok(Some(c)) = entity.resolve_char_ref() {
            self.text(c.encode_utf8(&mut [0; 4]));
        } else {
            self.unknown(entity, line);
        }
    }

    fn unknown(&mut self, entity: &str, line: usize) {
        if self.skipped == 0
            && self.entities.len() < super::MOST_NOTES
            && self.entities.insert(entity.to_owned())
        {
            let what = format!("the entity &{};", short(entity));
            self.notes.leave_out(line, &what);
        }
    }
}
