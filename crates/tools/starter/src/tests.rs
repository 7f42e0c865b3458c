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
        command: "tickbus".to_owned(),
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
    let names = ["for", "For", "Level low", "level-low", "3 way", "Öl", "plc"];
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
