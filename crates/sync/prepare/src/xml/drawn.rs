//! Bodies in LD and FBD.

use std::collections::HashSet;

use roxmltree::Node;
use tickbus_base::toml_text::shown;

use super::nodes::{child, named};
use super::{Project, declared};
use crate::check::{MEASURE, World, check_callers, check_statements, check_words, reads_clock};
use crate::code::Code;
use crate::diagram::{self, Written};
use crate::outline;
use crate::words;

/// The body of a unit that is a diagram.
pub(super) fn drawn<'a, 'i>(body: Node<'a, 'i>) -> Option<Node<'a, 'i>> {
    child(body, "LD").or_else(|| child(body, "FBD"))
}

impl Project<'_, '_> {
    /// The diagram in the body of a unit as Structured Text; `None` if mistakes were reported.
    pub(super) fn written(&self, unit: Node<'_, '_>, body: Node<'_, '_>) -> Option<Written> {
        let name = unit.attribute("name").unwrap_or_default();
        let text_of = |node: Node<'_, '_>| self.masked(node);
        let diagram = diagram::read(body, name, &text_of, self.wrong)?;
        let variables = declared::variables(unit);
        let unit = diagram::Unit {
            name,
            variables: &variables,
            library: &self.library,
        };
        diagram::write(&diagram, &unit, self.wrong)
    }

    /// Reports clocks that a diagram reads, and what may read one.
    pub(super) fn check_drawn(
        &self,
        body: Node<'_, '_>,
        known: &HashSet<String>,
        world: &World,
        is_run: &impl Fn(&str) -> bool,
    ) {
        for block in named(body, "block") {
            let name = block.attribute("typeName").unwrap_or_default();
            let at = block.range().start;
            if block
                .attribute("instanceName")
                .is_some_and(|name| !name.is_empty())
            {
                // The type of the variable decides, and was checked.
                self.check_instance(block);
                continue;
            }
            let is_known = world.types.contains(&name.to_uppercase());
            if is_known || words::is_standard_function(name) {
                continue;
            }
            let id = block.attribute("localId").unwrap_or("?");
            if words::is_clock(name) {
                self.wrong.report(at, reads_clock(name), MEASURE);
            } else {
                let what = format!(
                    "{}, block {}, is in none of these sources",
                    shown(name),
                    shown(id)
                );
                let right = "add it to the project; if it comes from a library and reads no clock, name it with --no-clock";
                self.wrong.report(at, what, right);
            }
        }
        for element in ["expression", "variable"] {
            let texts = named(body, element).filter(|node| node.first_child().is_some());
            // A pin of a block is called variable, too.
            for node in texts.filter(|node| node.children().all(|child| child.is_text())) {
                let Some((text, start)) = self.masked(node) else {
                    continue;
                };
                let code = Code::part(&text, start);
                if outline::endless(&code).is_some() {
                    let what = "the comment or text that begins here has no end";
                    self.wrong.report(start, what, "end it");
                    continue;
                }
                check_words(&code, self.wrong);
                let all = 0..code.tokens.len();
                check_statements(&code, &all, known, world, self.wrong);
                check_callers(&code, &all, known, is_run, self.wrong);
            }
        }
    }

    /// Reports a block that is drawn as another type than its variable has.
    fn check_instance(&self, block: Node<'_, '_>) {
        let Some(unit) = block
            .ancestors()
            .find(|node| node.has_tag_name("pou") || node.tag_name().name() == "pou")
        else {
            return;
        };
        let name = block.attribute("instanceName").unwrap_or_default();
        let drawn = block.attribute("typeName").unwrap_or_default();
        let variables = declared::variables(unit);
        let declared = variables
            .get(&name.to_uppercase())
            .and_then(diagram::Type::name);
        if let Some(declared) = declared.filter(|one| !one.eq_ignore_ascii_case(drawn)) {
            let what = format!(
                "{} is drawn as {}, and declared as {declared}",
                shown(name),
                shown(drawn)
            );
            self.wrong.report(
                block.range().start,
                what,
                "draw it again, or declare it as it is drawn",
            );
        }
    }
}
