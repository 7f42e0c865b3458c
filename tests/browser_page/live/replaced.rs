//! A page whose address another program gets.

use super::{Machine, open};
use crate::Lab;

#[test]
fn a_page_becomes_that_of_the_program_which_has_its_address_now() {
    let mut machine = Machine::tank();
    let browser = open(&machine, 1280, 800);
    browser.run("sessionStorage.setItem('list-own', 'null'); window.isFirst = true");
    machine.kill();
    let mut lab = Lab::at(machine.page());
    let _pump = lab.join("VP PUMP Q01");
    let live = "document.getElementById('link')?.textContent === 'live' && document.getElementById('title').textContent";
    browser.wait(&format!(
        "{live} === 'Patch bay' && document.querySelector('.client')"
    ));
    let kept = browser.run("return [sessionStorage.getItem('list-own'), window.isFirst ?? null]");
    assert_eq!(kept, serde_json::json!(["null", null]));
    lab.kill();
    machine.restart();
    browser.wait(&format!("{live} === 'Tank' && plant.signals.length === 4"));
}
