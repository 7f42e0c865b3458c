use super::*;
use crate::{Declaration, Ended, Outcome, Participant, Settings, StartCondition, Step, in_process};
use tickbus_base::time::Nanos;

/// A tank that is filled by 1.5 a step, and records the values that it reads.
struct Tank(Vec<[u64; 3]>);

impl Participant for Tank {
    fn declare(&self) -> Declaration {
        let mut declaration = Declaration::new("tank");
        declaration.writes = vec![
            Variable::new("level", DataType::Real),
            Variable::new("steps", DataType::Udint),
        ];
        declaration.reads = ["full", "changes", "ms"].map(str::to_owned).to_vec();
        declaration
    }

    fn initial(&mut self, _: &mut [u64]) {}

    fn run(&mut self, step: Step, reads: &[u64], writes: &mut [u64]) -> Result<(), String> {
        self.0.push([reads[0], reads[1], reads[2]]);
        #[expect(clippy::cast_precision_loss, reason = "few steps")]
        let level = 1.5 * step.sequence as f32;
        writes[0] = u64::from(level.to_bits());
        writes[1] = step.sequence;
        Ok(())
    }
}

fn run(text: &str, tank: &mut Tank) -> Result<Outcome, Ended> {
    let one = StartCondition::Count(1);
    let settings = Settings {
        steps: Some(4),
        ..Settings::new(Nanos::from_millis(1), one)
    };
    let logic = parse("cell.rhai", text).unwrap_or_else(|why| panic!("{why}"));
    in_process::run(settings, vec![tank], logic)
}

const LOGIC: &str = r#"
variable("full", "BOOL");
variable("changes", "INT");
variable("ms", "LINT");
let changes = 10;
on_start(|| set("changes", 10));
on_time(|| set("ms", time() / 1000000));
on_change("level", || {
    changes += 1;
    set("changes", changes);
    set("full", get("level") > 4.0 && get("steps") >= 3);
});
on_read("full", || if reader() != "tank" { throw "who?" });
"#;

#[test]
fn a_script_sees_and_writes_what_rust_would() {
    let mut tank = Tank(Vec::new());
    let first = run(LOGIC, &mut tank).expect("it runs");
    assert_eq!(tank.0, [[0, 10, 0], [0, 11, 0], [0, 12, 1], [1, 13, 2]]);
    // A script keeps nothing between runs, and has no random numbers.
    let again = run(LOGIC, &mut Tank(Vec::new())).expect("it runs");
    assert_eq!(again, first);
}

#[test]
fn what_is_wrong_with_a_script_is_told_at_its_place() {
    for (text, part) in [
        ("let x = ;", "cell.rhai:1:9: "),
        (
            "\nvariable(\"a\", \"FLOAT\");",
            "cell.rhai:2:1: Runtime error: \"FLOAT\" is not an elementary",
        ),
        (
            "get(\"a\");",
            "cell.rhai:1:1: Runtime error: there are no data, and no time, before the run",
        ),
        ("loop { }", "cell.rhai:1:"),
        ("timestamp();", "timestamp"),
        ("eval(\"1\");", "eval"),
        (
            "sleep(1);",
            "cell.rhai:1:1: Runtime error: a script cannot sleep",
        ),
        ("sleep(1.5);", "a script cannot sleep"),
        (
            "variable(\"a\", \"BOOL\");\nvariable(\"a\", \"BOOL\");",
            "cell.rhai:2:1: Runtime error: the variable \"a\" is declared twice",
        ),
        (
            "variable(\"\", \"BOOL\");",
            "cell.rhai:1:1: Runtime error: the name \"\" of a variable is empty",
        ),
    ] {
        let told = parse("cell.rhai", text).expect_err(text).to_string();
        assert!(told.contains(part), "{part} in {told}");
    }
}

#[test]
fn a_hook_that_fails_or_never_ends_ends_the_run() {
    for (text, part) in [
        (
            "on_time(|| get(\"nothing\"));",
            "cell.rhai:4:12: Runtime error: there is no variable \"nothing\"",
        ),
        (
            "on_time(|| set(\"level\", 1.0));",
            "\"level\" is a client's",
        ),
        (
            "on_time(|| set(\"changes\", 40000));",
            "has the type INT and cannot hold 40000",
        ),
        (
            "on_time(|| set(\"full\", 1));",
            "has the type BOOL and cannot hold 1",
        ),
        (
            "on_time(|| reader());",
            "only a hook of on_read has a reader",
        ),
        ("on_time(|| loop { });", "Too many operations"),
        (
            "on_time(|| variable(\"late\", \"BOOL\"));",
            "at the top of the script",
        ),
        ("on_time(|| throw \"enough\");", "enough"),
    ] {
        let variables = "variable(\"full\", \"BOOL\");\nvariable(\"changes\", \"INT\");\nvariable(\"ms\", \"LINT\");\n";
        let ended = run(&format!("{variables}{text}"), &mut Tank(Vec::new()));
        let ended = ended.expect_err(text);
        assert_eq!(ended.cause, crate::Cause::Logic);
        assert!(ended.reason.contains(part), "{part} in {ended}");
    }
}

#[test]
fn the_documented_example_is_a_script() {
    let text = std::fs::read_to_string(concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../../docs/sdsp.md"
    ));
    let text = text.expect("it is there");
    let (_, rest) = text.split_once("```rust\n").expect("the example begins");
    let (script, _) = rest.split_once("```").expect("the example ends");
    parse("example", script).unwrap_or_else(|why| panic!("{why}"));
}
