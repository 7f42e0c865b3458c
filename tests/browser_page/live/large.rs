//! A driver of ten thousand signals on the live page.

use std::fmt::Write as _;

use super::{END, ENTER, Machine, open, wait_shown};
use crate::assert_quiet;

/// `count` signals, half of them `%I` words and half `%Q` bits.
fn many(count: usize) -> String {
    let mut text = String::new();
    for n in 0..count / 2 {
        let _ = writeln!(
            text,
            "[[signal]]\nname = \"Word {n}\"\naddress = \"%IW{}\"\ntype = \"INT\"\nunit = \"mm\"\n[[signal]]\nname = \"Bit {n}\"\naddress = \"%QX{}.{}\"",
            2 * n,
            n / 8,
            n % 8
        );
    }
    text
}

#[test]
fn ten_thousand_signals_are_scrolled_filtered_and_chosen() {
    let machine = Machine::new("modbus-server", "", &many(10_000));
    let browser = open(&machine, 1280, 800);
    let rows = "Array.from(document.querySelectorAll('.row.signal')).filter((it) => !it.hidden)";
    browser.wait("document.getElementById('found').textContent === '10,000 signals'");
    // Scrolls through all of them, a page in each frame.
    browser.run(
        "const list = document.getElementById('list'); for (let top = 0; top < list.scrollHeight; top += 5000) { list.scrollTop = top; \
         await new Promise((go) => requestAnimationFrame(go)); }",
    );
    let count = browser.run("return document.querySelectorAll('.row').length");
    assert!(
        count.as_i64() < Some(100),
        "only what is seen exists, not {count} rows"
    );
    let longest = browser.run("return tickbusPage.drawn.longest");
    println!("the longest picture while 10,000 signals were scrolled took {longest} ms");
    browser.run("document.getElementById('list').focus()");
    browser.keys(END);
    browser.wait("document.getElementById('chosen-name').textContent === 'Bit 4999'");
    browser.wait(&format!("{rows}.some((it) => it.parts.name.textContent === 'Bit 4999' && it.getAttribute('aria-selected') === 'true')"));
    // At the lower edge its trend opens in sight, and the row stays in sight when the axis takes a part of the window.
    let seen = |row: &str| {
        format!(
            "{rows}.concat(...document.querySelectorAll('.row.trend:not([hidden])')).some((it) => {row} && \
             it.getBoundingClientRect().bottom <= document.getElementById('list').getBoundingClientRect().bottom + 1)"
        )
    };
    browser.keys(ENTER);
    browser.wait(&seen("it.classList.contains('trend')"));
    browser.keys("a");
    browser.wait("document.querySelectorAll('#tracks li').length === 1");
    browser.wait(&seen("it.getAttribute('aria-selected') === 'true'"));
    browser.keys("/");
    browser.wait("document.activeElement.id === 'filter'");
    browser.keys("mm %iw9996");
    browser.wait("document.getElementById('found').textContent === '1 of 10,000 signals'");
    wait_shown(&browser, "Word 4998", "0.00mm");
    browser.run("document.getElementById('filter').select()");
    browser.keys("%qx0.3");
    browser.wait("document.getElementById('found').textContent === '1 of 10,000 signals'");
    machine.write("0", "3", "1");
    wait_shown(&browser, "Bit 3", "TRUE");
    browser.keys("?");
    browser.wait("document.getElementById('empty').textContent === 'No signal fits the filter.'");
    assert_quiet(&browser);
}
