//! Comments within comments, and blocks that take their cycle.

use super::*;

#[test]
fn comments_within_comments_are_read_as_the_compiler_does() {
    let with = |comment: &str, comments| {
        let text = line("VAR t : TON; END_VAR", &format!("t(); {comment}"));
        let settings = Settings {
            comments,
            ..Settings::default()
        };
        prepare(&[source(&text)], &settings)
    };
    let made = with("(* a (* b *) c *)", None).expect("nested");
    let told = "line.st:3:6: a comment is within a comment: compile with the option for that (-n of iec2c)";
    assert_eq!(made.notes, [told]);
    let made = with("(* a (* b *)", None).expect("flat");
    assert_eq!(made.notes, Vec::<String>::new());
    let doubtful = "(* a (* b *) t(PT := T#1s); // *)";
    with(doubtful, None).expect_err("both ways are possible");
    for comments in [Comments::Flat, Comments::Nested] {
        with(doubtful, Some(comments)).expect("prepared");
    }
    // In a text and behind // nothing begins.
    with("// (* a", None).expect("prepared");
    let told = with("(* a", None).expect_err("no end")[0].to_string();
    assert!(
        told.contains("line.st:3:6: what begins here has no end"),
        "{told}"
    );
}

#[test]
fn a_pid_that_is_told_its_cycle_needs_no_clock() {
    let with = |call: &str| {
        prepare(
            &[source(&line("VAR p : PID; q : RAMP; END_VAR", call))],
            &Settings::default(),
        )
    };
    let made = with("p(AUTO := TRUE, CYCLE := T#20ms); q(CYCLE := T#10ms);").expect("prepared");
    let told = "line.st:3:17: CYCLE is T#20ms, and the task of this program runs it every 10 ms: the block counts another \
                time, with the original too";
    assert_eq!(made.notes, [told]);
    let made = with("p(AUTO := TRUE, CYCLE := T#5ms + T#5ms);").expect("prepared");
    assert_eq!(made.notes, Vec::<String>::new());
    for call in ["p(CYCLE := T#10ms); p();", "q();"] {
        let told = with(call).expect_err("a clock")[0].to_string();
        assert!(
            told.contains("line.st:2:9: PID runs on a clock of its own"),
            "{told}"
        );
    }
}
