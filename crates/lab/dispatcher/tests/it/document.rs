//! Replays the sessions in docs/dispatcher.md.

use std::net::SocketAddr;

use crate::common::Lab;

#[test]
fn the_first_lesson_goes_as_it_is_written() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../docs/dispatcher.md");
    let document = std::fs::read_to_string(path).expect("the document");
    let mut lab = Lab::new();
    let mut seats = Vec::new();
    let (lesson, _) = document
        .split_once("\n## A Java simulator joins\n")
        .expect("the section behind it");
    for block in lesson.split("```text\n> ").skip(1) {
        let (block, _) = block.split_once("\n```").expect("an end");
        let port = 51204 + 2 * u16::try_from(seats.len()).expect("few");
        let peer = SocketAddr::from(([127, 0, 0, 1], port));
        let seat = lab
            .dispatcher
            .connected(lab.now, peer)
            .expect("there is room");
        seats.push(seat);
        for step in block.split("\n> ") {
            let mut lines = step.lines();
            let heard = lab.ask(seat, lines.next().expect("what is said"));
            assert_eq!(heard, lines.collect::<Vec<_>>());
        }
    }
    let [pump, logo] = *seats else {
        panic!("{} clients", seats.len());
    };
    lab.say(pump, "P Q1=24");
    assert_eq!(lab.hear(logo), ["P I1=24"]);
    lab.dispatcher.gone(pump);
    assert_eq!(lab.hear(logo), ["P I1=0"]);
}
