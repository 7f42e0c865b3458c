//! Blocks with an input `CYCLE` in projects as XML.

use roxmltree::Node;

use super::nodes::{child, named};
use super::{Body, Form, Project};
use crate::code::Code;
use crate::cycle;
use crate::plan::Plan;

impl Project<'_, '_> {
    /// True if the type of a variable is a block that has a clock in some libraries, and all calls of the variable set
    /// its `CYCLE`.
    pub(super) fn is_cycled(&self, derived: Node<'_, '_>) -> bool {
        let parent = |name: &'static str| {
            let mut all = derived.ancestors();
            all.find(move |node| node.tag_name().name() == name)
        };
        let (Some(variable), Some(unit)) = (parent("variable"), parent("pou")) else {
            return false;
        };
        let kind = derived.attribute("name").unwrap_or_default();
        let name = variable.attribute("name").unwrap_or_default();
        let is_plain = derived.parent().and_then(|node| node.parent()) == Some(variable);
        if !cycle::may_have_cycle(kind) || !is_plain {
            return false;
        }
        let blocks = named(unit, "block").filter(|block| {
            let instance = block.attribute("instanceName").unwrap_or_default();
            instance.eq_ignore_ascii_case(name)
        });
        let is_set = |block: Node<'_, '_>| {
            let mut pins = named(block, "variable").filter(|pin| {
                let name = pin.attribute("formalParameter").unwrap_or_default();
                name.eq_ignore_ascii_case("CYCLE")
            });
            pins.any(|pin| named(pin, "connection").next().is_some())
        };
        let mut is_called = false;
        for block in blocks {
            if !is_set(block) {
                return false;
            }
            is_called = true;
        }
        for statements in named(unit, "body").filter_map(|body| child(body, "ST")) {
            let Some((text, start)) = self.masked(statements) else {
                continue;
            };
            let code = Code::part(&text, start);
            let all = 0..code.tokens.len();
            let is_named = all
                .clone()
                .any(|at| code.is(at, name) && code.word(at + 1) == "(");
            if is_named && !cycle::is_cycled(&code, &all, name) {
                return false;
            }
            is_called |= is_named;
        }
        is_called
    }

    /// Remarks about literals for `CYCLE` that differ from the interval of their program.
    pub(super) fn cycles(&self, plan: &Plan, bodies: &[Body<'_, '_>]) -> Vec<String> {
        let mut found = Vec::new();
        for body in bodies {
            let name = body.unit.attribute("name").unwrap_or_default();
            let Some(interval) = plan.interval(&name.to_uppercase()) else {
                continue;
            };
            let (code, at) = match &body.form {
                Form::Text(bytes) => (Code::part(&self.text[bytes.clone()], bytes.start), None),
                Form::Drawn(diagram, written) => {
                    (Code::new(&written.statements), Some(diagram.range().start))
                }
                Form::Clock(..) => continue,
            };
            let all = 0..code.tokens.len();
            for (place, remark) in cycle::differing(&code, &all, interval) {
                let place = at.unwrap_or(place);
                found.push(crate::placed_remark(
                    self.wrong,
                    place,
                    &format!("{name}: {remark}"),
                ));
            }
        }
        found
    }
}
