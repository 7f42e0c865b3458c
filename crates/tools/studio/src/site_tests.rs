//! Questions that are under way, and what they exclude.

use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};

use tickbus_driver_cfg::Kind;
use tickbus_live_page::Options;

use super::*;

static KINDS: Kinds = Kinds::new(&[Kind::of::<tickbus_bus_socket::Options>()]);

const FILE: &str = "[driver]\nid = 1\nname = \"T\"\n[fieldbus]\nkind = \"socket\"\naddress = \"127.0.0.1:0\"\n\
                    [[signal]]\nname = \"A\"\naddress = \"%IX0.0\"\n";

/// A program that does nothing.
struct Nothing;

impl tickbus_plc::Program for Nothing {
    fn name(&self) -> &'static str {
        "nothing"
    }

    fn input_bytes(&self) -> usize {
        0
    }

    fn output_bytes(&self) -> usize {
        0
    }

    fn scan(&mut self, _: &mut tickbus_plc::Scan<'_>) {}
}

fn studio() -> (tempfile::TempDir, Studio) {
    let folder = tempfile::tempdir().expect("there is room");
    let path = folder.path().join("driver.cfg");
    fs::write(&path, FILE).expect("there is room");
    let studio = Studio::open(Settings {
        path,
        kinds: &KINDS,
        machine: Box::new(|_| {
            Ok(crate::Opened {
                program: Box::new(Nothing),
                options: Options {
                    grace: None,
                    picture: None,
                    lists: None,
                },
            })
        }),
    });
    (folder, studio.expect("the file can be read"))
}

#[test]
fn a_line_does_not_start_while_it_is_examined() {
    let (_folder, studio) = studio();
    let asking = Asking::begin(&studio.0, Question::Line).expect("nothing is under way");
    let why = studio.start().expect_err("the port is needed");
    assert!(why.contains("is examined at the moment"), "{why}");
    let (status, why) = Asking::begin(&studio.0, Question::Line)
        .err()
        .expect("one at a time");
    assert_eq!(status, 409);
    assert!(why.contains("stop it"), "{why}");
    drop(asking);
    assert_eq!(studio.start(), Ok(()));
    // A search needs no line.
    let search = Asking::begin(&studio.0, Question::Network(Vec::new()));
    assert_eq!(studio.start(), Ok(()));
    drop(search);
    assert!(studio.close().is_none());
}

#[test]
fn a_question_that_panics_is_over() {
    let (_folder, studio) = studio();
    let asking = Asking::begin(&studio.0, Question::Line).expect("nothing is under way");
    let ended = catch_unwind(AssertUnwindSafe(move || {
        let _asking = asking;
        panic!("expected by this test");
    }));
    assert!(ended.is_err());
    assert!(!studio.0.room().explored.is_examining());
    assert!(Asking::begin(&studio.0, Question::Line).is_ok());
}
