//! `tickbus sync --record` and `tickbus sync diff` as processes.

use super::*;

/// Counts, from step `wrong` on by one more.
struct Miscounter(u64);

impl Participant for Miscounter {
    fn declare(&self) -> Declaration {
        let mut declaration = Declaration::new("a");
        declaration.writes = vec![
            Variable::new("count", DataType::Udint),
            Variable::new("half", DataType::Real),
        ];
        declaration
    }

    fn initial(&mut self, _: &mut [u64]) {}

    fn run(&mut self, step: Step, _: &[u64], writes: &mut [u64]) -> Result<(), String> {
        let count = step.sequence + u64::from(step.sequence >= self.0);
        writes[0] = count;
        writes[1] = u64::from((f32::from(u16::try_from(count).expect("few")) / 10.0).to_bits());
        Ok(())
    }
}

pub(super) fn diff(files: [&std::path::Path; 2]) -> (String, Option<i32>) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_tickbus"));
    let output = command.args(["sync", "diff"]).args(files).output();
    let output = output.expect("the tickbus program runs");
    let text = [output.stdout, output.stderr].concat();
    (String::from_utf8(text).expect("text"), output.status.code())
}

#[test]
fn two_recorded_runs_are_equal_or_part_at_a_step_a_variable_and_a_client() {
    let folder = tempfile::tempdir().expect("a folder");
    let run = |name: &str, wrong| {
        let file = folder.path().join(name);
        let text =
            "[sync]\nlisten = \"127.0.0.1:0\"\nuntil = \"40ms\"\nstep = \"1ms\"\nclients = 1\n";
        let path = file.display().to_string();
        let mut sync = Sync::start(text, &["--record", &path]);
        let address = sync.address();
        let outcome = tcp::join(&address, &mut Miscounter(wrong)).expect("it runs");
        assert_eq!(sync.end().1, Some(0));
        (file, outcome.hash)
    };
    let (a, hash) = run("a.vcd", 100);
    let (b, _) = run("b.vcd", 100);
    let (c, _) = run("c.vcd", 25);
    let (told, code) = diff([&a, &b]);
    assert_eq!(
        (told, code),
        (format!("diff: equal steps=40 hash={hash}\n"), Some(0))
    );
    // Both cut at the same row, as by a power failure.
    let text = std::fs::read_to_string(&a).expect("text");
    let at = text.find("#30000000").expect("the row of step 31");
    let cut = folder.path().join("cut.vcd");
    std::fs::write(&cut, &text[..at + 12]).expect("written");
    let (told, code) = diff([&cut, &cut]);
    assert_eq!(code, Some(1), "{told}");
    assert!(
        told.ends_with("diff: unknown steps=29 reason=\"both are cut\"\n"),
        "{told}"
    );
    let (told, code) = diff([&a, &c]);
    let [shown_a, shown_c] = [a.display(), c.display()];
    let expected = format!(
        "diff: all values up to step 24 are equal; the values written in step 25 differ\n\
         diff:   client \"a\" wrote \"count\": 25 in {shown_a}, 26 in {shown_c}\n\
         diff:   client \"a\" wrote \"half\": 2.5 in {shown_a}, 2.6 in {shown_c}\n\
         diff: parted step=25 time=24ms client=\"a\" variable=\"count\" a=25 b=26 variables=2\n"
    );
    assert_eq!((told, code), (expected, Some(1)));
    let (told, code) = diff([&a, &folder.path().join("none.vcd")]);
    assert!(
        told.ends_with("check the path and the name\ndiff: failed mistakes=1\n"),
        "{told}"
    );
    assert_eq!(code, Some(1));
}

#[test]
fn a_recording_that_cannot_be_made_is_told_before_anyone_joins() {
    let text = "[sync]\nlisten = \"127.0.0.1:0\"\nstep = \"1ms\"\nclients = 1\n";
    for (file, expected) in [
        ("/nowhere/run.vcd", "the recording cannot be made"),
        ("run.txt", "ends neither in .vcd nor in .csv"),
    ] {
        let mut sync = Sync::start(text, &["--record", file]);
        let mut told = String::new();
        let stderr = sync.child.stderr.take().expect("it is piped");
        std::io::Read::read_to_string(&mut BufReader::new(stderr), &mut told).expect("text");
        assert!(
            told.contains("sync: --record: ") && told.contains(expected),
            "{told}"
        );
        assert!(told.ends_with("sync: failed mistakes=1\n"), "{told}");
        assert_eq!(sync.end().1, Some(1));
    }
}
