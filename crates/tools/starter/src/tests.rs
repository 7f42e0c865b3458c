//! Every combination of answers gives files that are right.

use tickbus_driver_cfg::Config;
use tickbus_kinds::KINDS;
use tickbus_net::Address;

use super::{Answers, Language, NewFile, Plc, plan};

fn answers(plc: Plc, language: Language) -> Answers {
    Answers {
        name: "Line \"3\"".to_owned(),
        plc,
        address: plc.port().map(Address::local),
        language,
        signals: None,
        counts_elements: false,
        command: "tickbus".to_owned(),
        python: "python3".to_owned(),
        jar: None,
        c: None,
    }
}

fn text<'f>(files: &'f [NewFile], path: &str) -> &'f str {
    let file = files.iter().find(|file| file.path.as_os_str() == path);
    &file.unwrap_or_else(|| panic!("{path} in {files:?}")).text
}

#[test]
fn every_combination_has_a_driver_cfg_without_mistakes_a_test_and_a_readme_of_ten_lines() {
    for plc in Plc::ALL {
        for language in Language::ALL {
            let files = plan(&answers(plc, language), &KINDS).expect("it has no mistakes");
            let config = Config::parse("driver.cfg", text(&files, "driver.cfg"), &KINDS);
            let config = config.expect("it has no mistakes");
            assert_eq!(config.name, "Line \"3\"");
            assert_eq!(config.bus.kind(), plc.kind());
            assert_eq!(config.contradictions(), Vec::new());
            let readme = text(&files, "README.md");
            let lines = readme.lines().filter(|line| !line.is_empty());
            assert!(lines.count() <= 10, "{readme}");
            assert!(!readme.contains("{{"), "{readme}");
            let has_plc = files.iter().any(|file| file.path.starts_with("plc"));
            assert_eq!(has_plc, plc.target().is_some());
            text(&files, "tests/first.toml");
            let simulator = files.iter().filter(|file| {
                let name = file.path.to_string_lossy().into_owned();
                ["Machine.java", "machine.py", "machine.c"].contains(&name.as_str())
            });
            let simulators: Vec<&NewFile> = simulator.collect();
            assert_eq!(simulators.len(), usize::from(language != Language::Replies));
            assert!(simulators.iter().all(|file| !file.text.contains("{{")));
        }
    }
}

#[test]
fn the_variables_of_an_imported_list_are_unique_and_no_keywords() {
    let mut answers = answers(Plc::Modbus, Language::Java);
    let names = [
        "for",
        "For",
        "Level low",
        "level-low",
        "3 way",
        "Öl",
        "plc",
        "a T E X T",
    ];
    let signals = names
        .iter()
        .enumerate()
        .map(|(bit, name)| format!("\n[[signal]]\nname = \"{name}\"\naddress = \"%IX0.{bit}\"\n"));
    answers.signals = Some(signals.collect());
    let files = plan(&answers, &KINDS).expect("it has no mistakes");
    let java = text(&files, "Machine.java");
    for line in [
        "var for2 = plc.signal(\"for\");",
        "var for3 = plc.signal(\"For\");",
        "var levelLow = plc.signal(\"Level low\");",
        "var levelLow2 = plc.signal(\"level-low\");",
        "var signal3Way = plc.signal(\"3 way\");",
        "var l = plc.signal(\"Öl\");",
        "var plc2 = plc.signal(\"plc\");",
        "var aTEXT = plc.signal(\"a T E X T\");",
    ] {
        assert!(java.contains(line), "{line} in {java}");
    }
    assert!(text(&files, "tests/first.toml").contains("\"for\" = true"));
}

#[test]
fn a_list_that_does_not_fit_is_refused_with_its_mistakes() {
    let mut answers = answers(Plc::OpenPlc, Language::C);
    answers.signals = Some("\n[[signal]]\nname = \"A\"\naddress = \"%MX0.0\"\n".to_owned());
    let mistakes = plan(&answers, &KINDS).expect_err("%M is no input");
    assert!(mistakes.to_string().contains("%MX0.0"), "{mistakes}");
}

#[test]
fn a_name_ends_no_comment_and_no_text() {
    for name in ["a */ int x; /* b", "C:\\users\\N{x}", "\"\"\" + 1 + \"\"\""] {
        for language in [Language::Java, Language::Python, Language::C] {
            let mut answers = answers(Plc::None, language);
            name.clone_into(&mut answers.name);
            let files = plan(&answers, &KINDS).expect("it has no mistakes");
            let simulator = files.iter().find(|it| it.path.starts_with("machine.c"));
            let simulator =
                simulator.or_else(|| files.iter().find(|it| it.path.starts_with("machine.py")));
            let simulator =
                simulator.or_else(|| files.iter().find(|it| it.path.starts_with("Machine.java")));
            let simulator = &simulator.expect("there is a simulator").text;
            let line = simulator
                .lines()
                .find(|line| line.contains(": the simulated machine."));
            let line = line.expect("the name is told");
            assert!(!line.contains('\\'), "{line}");
            let ends = if language == Language::Python {
                "\"\"\""
            } else {
                "*/"
            };
            assert!(line.ends_with(ends), "{line}");
            let count = if language == Language::Python { 2 } else { 1 };
            assert_eq!(line.matches(ends).count(), count, "{line}");
            assert!(text(&files, "README.md").starts_with("# "));
            assert!(
                text(&files, "README.md").lines().nth(1) == Some(""),
                "one title"
            );
        }
    }
}

#[test]
fn names_of_signals_are_texts_of_every_language() {
    // As macOS writes an umlaut, with a soft hyphen, and what other languages escape.
    let name = "Tu\u{308}r\u{ad}\"C:\\new\" {x} %s 😀";
    let toml = name.replace('\\', "\\\\").replace('"', "\\\"");
    for (language, file) in [
        (Language::Java, "Machine.java"),
        (Language::Python, "machine.py"),
        (Language::C, "machine.c"),
    ] {
        let mut answers = answers(Plc::Modbus, language);
        answers.signals = Some(format!(
            "\n[[signal]]\nname = \"{toml}\"\naddress = \"%IX0.0\"\n"
        ));
        let files = plan(&answers, &KINDS).expect("it has no mistakes");
        let simulator = text(&files, file);
        assert!(simulator.contains(&format!("\"{toml}\"")), "{simulator}");
    }
}

#[test]
fn addresses_that_count_elements_keep_their_meaning() {
    let mut answers = answers(Plc::Codesys, Language::C);
    answers.signals =
        Some("\n[[signal]]\nname = \"Speed\"\naddress = \"%QW1\"\ntype = \"INT\"\n".to_owned());
    answers.counts_elements = true;
    let files = plan(&answers, &KINDS).expect("it has no mistakes");
    let config = Config::parse("driver.cfg", text(&files, "driver.cfg"), &KINDS);
    let config = config.expect("it has no mistakes");
    assert_eq!(config.table.signals[0].byte, 2);
}

#[test]
fn a_command_in_a_folder_with_a_blank_is_one_word() {
    let mut answers = answers(Plc::Modbus, Language::Replies);
    "/opt/my tools/tickbus".clone_into(&mut answers.command);
    let files = plan(&answers, &KINDS).expect("it has no mistakes");
    let readme = text(&files, "README.md");
    assert_eq!(
        readme.matches("'/opt/my tools/tickbus' ").count(),
        5,
        "{readme}"
    );
}
