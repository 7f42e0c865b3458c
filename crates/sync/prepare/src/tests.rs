//! Whole programs, prepared and undone.

mod accepted;
mod refused;

use super::*;
use proptest::prelude::*;
use std::path::{Path, PathBuf};

fn source(text: &str) -> Source {
    let bytes = text.as_bytes().to_vec();
    let name = "line.st".to_owned();
    Source { name, bytes }
}

fn prepared_text(text: &str, settings: &Settings) -> String {
    let made = prepare(&[source(text)], settings);
    let made = made.unwrap_or_else(|mistakes| panic!("{}\n{text}", mistakes[0]));
    String::from_utf8(made.files.into_iter().next().expect("one")).expect("text")
}

fn undone(text: &str) -> String {
    let bytes = undo(&source(text)).unwrap_or_else(|mistakes| panic!("{mistakes}\n{text}"));
    String::from_utf8(bytes).expect("text")
}

#[track_caller]
fn refused(text: &str, says: &str) {
    let mistakes = prepare(&[source(text)], &Settings::default()).expect_err(text);
    let all: Vec<String> = mistakes.iter().map(ToString::to_string).collect();
    let all = all.join("\n");
    assert!(all.contains(says), "expected {says}, found {all}");
}

/// Programs `one` (every 10 ms) and `two` (every 30 ms) in a configuration, with `declarations` and `statements` in `one`.
fn line(declarations: &str, statements: &str) -> String {
    format!(
        "PROGRAM one\n{declarations}\n{statements}\nEND_PROGRAM\nPROGRAM two\nVAR lamp AT %QX0.0 : BOOL; END_VAR\nlamp := TRUE;\n\
         END_PROGRAM\nCONFIGURATION plant\nRESOURCE cpu ON PLC\nTASK fast(INTERVAL := T#10ms, PRIORITY := 0);\n\
         TASK slow(INTERVAL := T#30ms, PRIORITY := 1);\nPROGRAM a WITH fast : one;\nPROGRAM b WITH slow : two;\n\
         END_RESOURCE\nEND_CONFIGURATION\n"
    )
}

#[test]
fn a_prepared_program_is_the_original_with_marked_changes() {
    let text = line(
        "VAR t : TON; END_VAR",
        "  t(IN := TRUE, PT := T#1s); // beam\n",
    );
    let addresses = Addresses {
        go: Some("%ID0".to_owned()),
        ms: Some("%ID1".to_owned()),
        done: Some("%QD0".to_owned()),
        ..Addresses::default()
    };
    let made = prepared_text(
        &text,
        &Settings {
            addresses,
            ..Settings::default()
        },
    );
    let (blocks, rest) = made
        .split_once("END_PROGRAM\n(*tickbus}*)")
        .expect("blocks come first");
    for piece in [
        "FUNCTION_BLOCK TICKBUS_TON",
        "FUNCTION_BLOCK TICKBUS_SCHEDULER",
        "PROGRAM TICKBUS_SCHEDULE\n",
    ] {
        assert!(blocks.contains(piece), "{piece}\n{blocks}");
    }
    assert!(
        !blocks.contains("TICKBUS_TP") && !blocks[12..].contains("(*"),
        "{blocks}"
    );
    assert!(
        blocks.contains("    go AT %ID0 : UDINT;\n  END_VAR\n  VAR\n    ms AT %ID1 : UDINT;"),
        "{blocks}"
    );
    assert!(
        blocks.contains("  tickbus_execute_slow := handshake.STEPPING AND ms MOD 30 = 0;\n"),
        "{blocks}"
    );
    let right = "PROGRAM one(*{tickbus*)\n  VAR_EXTERNAL\n    tickbus_simulated : BOOL;\n    tickbus_execute_fast : BOOL;\n  \
        END_VAR(*tickbus}*)\nVAR t : (*{tickbus TON*)TICKBUS_TON(*tickbus}*); END_VAR\n  (*{tickbus*)IF NOT tickbus_simulated OR \
        tickbus_execute_fast THEN\n  (*tickbus}*)t(IN := TRUE, PT := T#1s);(*{tickbus*)\n  END_IF;(*tickbus}*) // beam\n\n\
        END_PROGRAM\n";
    assert!(rest.starts_with(right), "{rest}");
    for piece in [
        "CONFIGURATION plant(*{tickbus*)\n  VAR_GLOBAL\n    tickbus_now : TIME;\n    tickbus_simulated : BOOL := TRUE;\n    \
         tickbus_execute_fast : BOOL;\n    tickbus_execute_slow : BOOL;\n  END_VAR(*tickbus}*)\n",
        "(*{tickbus TASK fast%28INTERVAL := T#10ms, PRIORITY := 0%29;*)TASK tickbus_cycle(INTERVAL := T#10ms, PRIORITY := 1);(*tickbus}*)\n",
        "(*{tickbus TASK slow%28INTERVAL := T#30ms, PRIORITY := 1%29;*)(*tickbus}*)\n",
        "(*{tickbus*)PROGRAM tickbus_first WITH tickbus_cycle : TICKBUS_SCHEDULE;\n(*tickbus}*)PROGRAM a WITH \
         (*{tickbus fast*)tickbus_cycle(*tickbus}*) : one;\n",
    ] {
        assert!(rest.contains(piece), "{piece}\n{rest}");
    }
    assert_eq!(undone(&made), text);
}

#[test]
fn a_chart_waits_for_its_signal_in_each_action_and_transition() {
    let chart = "INITIAL_STEP rest: move(N); END_STEP\nSTEP work: move(P); lamp(S); END_STEP\n\
        TRANSITION (PRIORITY := 1) FROM rest TO work := start; END_TRANSITION\nTRANSITION FROM work TO rest := NOT start; END_TRANSITION\n\
        ACTION move: count := count + 1; END_ACTION";
    let text = line("VAR start, lamp : BOOL; count : INT; END_VAR", chart);
    let made = prepared_text(&text, &Settings::default());
    let gate = "NOT tickbus_simulated OR tickbus_execute_fast";
    for piece in [
        format!(
            "FROM rest TO work := (*{{tickbus*)({gate}) AND ((*tickbus}}*)start(*{{tickbus*))(*tickbus}}*); END"
        ),
        format!(
            "(*{{tickbus*)IF {gate} THEN (*tickbus}}*)count := count + 1;(*{{tickbus*) END_IF;(*tickbus}}*)"
        ),
    ] {
        assert!(made.contains(&piece), "{piece}\n{made}");
    }
    assert_eq!(made.matches(gate).count(), 3);
    assert_eq!(undone(&made), text);
}

#[test]
fn odd_texts_survive() {
    let plain = line(
        "VAR t : TP; END_VAR",
        "t(IN := TRUE); (* it's \"so\" *)\n{pragma}// Größe µ",
    );
    for text in [
        plain.clone(),
        plain.replace('\n', "\r\n"),
        plain.replace('\n', "\r"),
        format!("\u{FEFF}{plain}"),
        plain.replace('\n', " \t\n\n").to_lowercase(),
        plain.trim_end().to_owned(),
    ] {
        let made = prepared_text(&text, &Settings::default());
        assert_eq!(undone(&made), text);
        assert_eq!(made.starts_with('\u{FEFF}'), text.starts_with('\u{FEFF}'));
        let mixed = made.replace("\r\n", "");
        assert!(
            !text.contains("\r\n") || !mixed.contains('\n'),
            "line ends are mixed: {made:?}"
        );
    }
    let latin: Vec<u8> = plain.chars().map(|c| c as u8).collect();
    assert!(std::str::from_utf8(&latin).is_err());
    let source = Source {
        name: "a.st".to_owned(),
        bytes: latin.clone(),
    };
    let made = prepare(&[source], &Settings::default()).expect("prepared");
    let bytes = made.files[0].clone();
    assert!(bytes.windows(5).any(|window| window == b"Gr\xF6\xDFe"));
    assert_eq!(
        undo(&Source {
            name: String::new(),
            bytes
        }),
        Ok(latin)
    );
}

#[test]
fn a_timer_of_the_programs_own_is_no_timer_of_the_standard() {
    let own = "FUNCTION_BLOCK TP\nVAR n : INT; END_VAR\nn := 1;\nEND_FUNCTION_BLOCK\n";
    let text = own.to_owned() + &line("VAR t : TP; END_VAR", "t();");
    let made = prepared_text(&text, &Settings::default());
    assert!(!made.contains("TICKBUS_TP"));
}

#[test]
fn a_member_of_a_structure_is_no_type() {
    let recipe = "TYPE Recipe : STRUCT ton : TIME; inner : STRUCT Stamp : INT; END_STRUCT; END_STRUCT; END_TYPE\n";
    let text = recipe.to_owned() + &line("VAR r : Recipe; t : TON; END_VAR", "t(PT := r.ton);");
    let made = prepared_text(&text, &Settings::default());
    assert!(
        made.contains(" t : (*{tickbus TON*)TICKBUS_TON(*tickbus}*);"),
        "{made}"
    );
    assert_eq!(undone(&made), text);
    let text = recipe.to_owned() + &line("VAR n : INT; END_VAR", "n := Stamp(1);");
    refused(&text, "Stamp is in none");
    let two = "TYPE A : STRUCT n : INT END_STRUCT; B : (ton, tof); END_TYPE\n";
    let made = prepared_text(
        &(two.to_owned() + &line("VAR a : A; b : B; END_VAR", "RETURN;")),
        &Settings::default(),
    );
    assert!(made.contains("VAR a : A; b : B;"), "{made}");
    let extended = "TYPE A EXTENDS TON : STRUCT n : INT; END_STRUCT; END_TYPE\n".to_owned();
    let made = prepared_text(
        &(extended + &line("VAR t : TON; END_VAR", "t();")),
        &Settings::default(),
    );
    assert!(made.contains("VAR t : (*{tickbus TON"), "{made}");
}

#[test]
fn nobody_vouches_for_a_timer_that_is_replaced() {
    let settings = Settings {
        no_clock: vec!["Ton".to_owned()],
        ..Settings::default()
    };
    let mistakes = prepare(&[source(&line("VAR t : TON; END_VAR", "t();"))], &settings);
    let all = mistakes.expect_err("TON")[0].to_string();
    assert!(
        all.contains("--no-clock: Ton runs on the clock of the PLC; leave it out"),
        "{all}"
    );
}

#[test]
fn variables_named_like_parts_of_a_chart_make_no_chart() {
    for name in [
        "step",
        "action",
        "initial_step",
        "transition",
        "method",
        "var_speed",
    ] {
        let text = line(
            &format!("VAR {name} : INT; END_VAR"),
            &format!("{name} := {name} + 1;"),
        );
        let made = prepared_text(&text, &Settings::default());
        let wrapped = format!("tickbus_execute_fast THEN\n(*tickbus}}*){name} := ");
        assert!(made.contains(&wrapped), "{made}");
        refused(
            &text.replace(" + 1", " + F(TIME())"),
            "TIME() reads the clock",
        );
    }
    let text = line("VAR action : Chosen; END_VAR", "action(n := 1);");
    let block = "FUNCTION_BLOCK Chosen VAR_INPUT n : INT; END_VAR END_FUNCTION_BLOCK\n";
    let made = prepared_text(&(block.to_owned() + &text), &Settings::default());
    assert!(made.contains("THEN\n(*tickbus}*)action("), "{made}");
}

#[test]
fn a_body_of_pragmas_gets_a_controller() {
    let text = line("VAR n : INT; END_VAR", "{n++;}");
    let settings = Settings {
        no_clock: vec!["One".to_owned()],
        ..Settings::default()
    };
    let made = prepared_text(&text, &settings);
    assert!(
        made.contains("(*{tickbus*)IF NOT tickbus_simulated OR tickbus_execute_fast THEN\n(*tickbus}*){n++;}(*{tickbus*)\nEND_IF;"),
        "{made}"
    );
    assert_eq!(undone(&made), text);
    let chart = "INITIAL_STEP one: move(N); END_STEP\nTRANSITION FROM one TO one := TRUE; END_TRANSITION\nACTION move: {n++;} END_ACTION";
    let made = prepared_text(&line("VAR n : INT; END_VAR", chart), &settings);
    assert!(made.contains("THEN (*tickbus}*){n++;}"), "{made}");
}

#[test]
fn the_clock_of_oscat_becomes_virtual_time() {
    let clock = "FUNCTION T_PLC_MS : UDINT\nVAR tx : UDINT; END_VAR\ntx := 0;\n{extern unsigned long __tick;\nTX = __tick}\n\
        T_PLC_MS := tx;\nEND_FUNCTION\n";
    let text = clock.to_owned() + &line("VAR n : UDINT; END_VAR", "n := T_PLC_MS();");
    let made = prepared_text(&text, &Settings::default());
    assert!(
        made.contains("*){extern TIME *__GET_GLOBAL_TICKBUS_NOW(void);"),
        "{made}"
    );
    assert_eq!(undone(&made), text);
    let other = text.replace("T_PLC_MS", "T_PLC");
    refused(&other, "line.st:4:1: this pragma reads the time of the PLC");
}

#[test]
fn go_and_done_have_second_copies_where_addresses_are_stated() {
    let [go, go_end, done_end] = ["%ID0", "%ID8", "%QD8"].map(|text| Some(text.to_owned()));
    let addresses = Addresses {
        go,
        go_end,
        done_end,
        ..Addresses::default()
    };
    let settings = Settings {
        addresses,
        ..Settings::default()
    };
    let made = prepared_text(&line("", "RETURN;"), &settings);
    for piece in [
        "  VAR\n    go_end AT %ID8 : UDINT;\n  END_VAR\n  VAR\n    done_end AT %QD8 : UDINT;\n",
        "  handshake(SIMULATED := tickbus_simulated, GO := SEL(go = go_end, UDINT#0, go), MS := ms);\n",
        "  done := handshake.DONE;\n  done_end := handshake.DONE;\n",
    ] {
        assert!(made.contains(piece), "{piece}\n{made}");
    }
}

#[test]
fn calls_behind_a_dot_are_taken_from_what_the_sources_declare() {
    let block = "FUNCTION_BLOCK Cell VAR_OUTPUT inner : Part; END_VAR END_FUNCTION_BLOCK\n\
        FUNCTION_BLOCK Part VAR n : INT; END_VAR n := 1; END_FUNCTION_BLOCK\nVAR_GLOBAL shared : Cell; END_VAR\n";
    let calls = "cells[n + f(1)].inner(); shared.inner(); pointer^.inner(); List.inner();";
    let declared =
        "VAR cells : ARRAY [1..2] OF Cell; n : INT; pointer : REF_TO Cell; f : Part; END_VAR";
    let no_clock = vec!["List".to_owned()];
    let settings = Settings {
        no_clock,
        ..Settings::default()
    };
    let text = block.to_owned() + &line(declared, calls);
    assert_eq!(undone(&prepared_text(&text, &settings)), text);
    refused(&text, "line.st:6:60: List is not declared in these sources");
}

#[test]
fn names_of_tasks_become_names_of_signals() {
    let named = |first: &str, second: &str| {
        let text = line("", "RETURN;")
            .replace("fast", first)
            .replace("slow", second);
        let made = prepared_text(&text, &Settings::default());
        assert_eq!(undone(&made), text);
        let start = made
            .find("VAR_EXTERNAL\n    tickbus_now")
            .expect("the scheduler's program");
        let lines = made[start..].lines().skip(3).take(2);
        lines
            .map(|line| line.trim().replace("tickbus_execute_", ""))
            .collect::<String>()
    };
    assert_eq!(named("_fast", "a__b_"), "fast : BOOL;a_b : BOOL;");
    assert_eq!(named("fast", "Fast_"), "fast : BOOL;Fast_2 : BOOL;");
    assert_eq!(named("главная", "б"), "task : BOOL;task_2 : BOOL;");
}

#[test]
fn sources_in_other_encodings_get_what_they_can_hold() {
    let whole = line("", "RETURN;").replace("fast", "главная");
    let at = whole.find("CONFIGURATION").expect("there is one");
    let mut latin = whole.as_bytes()[..at].to_vec();
    latin.extend(b"(* \xB5s *)");
    let first = Source {
        name: "a.st".to_owned(),
        bytes: latin.clone(),
    };
    let made = prepare(&[first, source(&whole[at..])], &Settings::default()).expect("prepared");
    let bytes = made.files[0].clone();
    let made = Source {
        name: "a.st".to_owned(),
        bytes,
    };
    assert!(is_prepared(&made));
    assert_eq!(undo(&made), Ok(latin));
    encode("ж".to_owned(), Encoding::Latin1).expect_err("not in Latin-1");
}

#[test]
fn names_of_variables_that_are_put_in_are_no_types() {
    let block =
        |name: &str| format!("FUNCTION_BLOCK {name} VAR n : INT; END_VAR END_FUNCTION_BLOCK\n");
    refused(
        &(block("Ms") + &line("VAR m : Ms; END_VAR", "m();")),
        "line.st:1:16: tickbus puts in a variable named Ms, too; choose another name",
    );
    refused(
        &("TYPE Done : INT; END_TYPE\n".to_owned() + &line("", "RETURN;")),
        "line.st:1:6: tickbus puts in a variable named Done",
    );
    let text =
        block("Clock") + &block("since") + &line("VAR c : Clock; done : BOOL; END_VAR", "c();");
    assert_eq!(undone(&prepared_text(&text, &Settings::default())), text);
}

#[test]
fn blocks_that_the_user_vouches_for_are_taken() {
    let text = line("VAR f : Filter; END_VAR", "f(); Reset(1);");
    refused(&text, "Filter is in none");
    let no_clock = vec!["filter".to_owned(), "RESET".to_owned()];
    let made = prepared_text(
        &text,
        &Settings {
            no_clock,
            ..Settings::default()
        },
    );
    assert_eq!(undone(&made), text);
}

#[test]
fn an_address_that_is_taken_is_told() {
    let addresses = Addresses {
        done: Some("%qx0.0".to_owned()),
        ..Addresses::default()
    };
    let text = line("", "RETURN;");
    let mistakes = prepare(
        &[source(&text)],
        &Settings {
            addresses,
            ..Settings::default()
        },
    );
    let told = mistakes.expect_err("taken")[0].to_string();
    assert_eq!(
        told,
        "line.st:6:13: the program uses %QX0.0 already; name a free address for the server's variable"
    );
}

#[test]
fn addresses_of_the_server_are_compared() {
    let with = |go: &str, ms: &str, done: &str| {
        let [go, ms, done] = [go, ms, done].map(|address| Some(address.to_owned()));
        let addresses = Addresses {
            go,
            ms,
            done,
            ..Addresses::default()
        };
        Settings {
            addresses,
            ..Settings::default()
        }
    };
    let told = |text: &str, settings: &Settings| {
        let mistakes = prepare(&[source(text)], settings).expect_err("addresses");
        mistakes
            .iter()
            .map(ToString::to_string)
            .collect::<Vec<_>>()
            .join("\n")
    };
    let text = line("", "RETURN;");
    assert_eq!(
        told(&text, &with("%ID0", "%id0", "%ID0")),
        "ms: go is at %id0 too; give each variable an address of its own\n\
         done: go is at %ID0 too; give each variable an address of its own\n\
         done: %ID0 is an input, and the PLC writes done; name an output, such as %QD100, or a marker"
    );
    let settings = with("%MD100", "%MD104", "%QD100");
    assert_eq!(
        told(&line("", "%MD100 := 5;"), &settings),
        "line.st:3:1: the program uses %MD100 already; name a free address for the server's variable"
    );
    let text = line("VAR w AT %QW200 : INT; END_VAR", "w := %QW200;");
    let made = prepare(&[source(&text)], &settings).expect("prepared");
    assert_eq!(
        made.notes,
        [
            "done at %QD100 and the program's %QW200 are the same memory on some PLCs: check that they are not on yours"
        ]
    );
}

#[test]
fn bare_carriage_returns_end_lines() {
    let text = line("VAR m : MC_Power; END_VAR", "RETURN;").replace('\n', "\r");
    refused(&text, "line.st:2:9: the type MC_Power");
    let text = line("VAR t : TON; END_VAR", "t();").replace('\n', "\r");
    assert_eq!(undone(&prepared_text(&text, &Settings::default())), text);
}

#[test]
fn programs_of_several_sources_belong_together() {
    let whole = line("VAR t : TON; c : Counter; END_VAR", "c();");
    let at = whole.find("CONFIGURATION").expect("there is one");
    let block = "FUNCTION_BLOCK Counter\nVAR t : TOF; END_VAR\nt();\nEND_FUNCTION_BLOCK\n";
    let sources = [source(&whole[..at]), source(&whole[at..]), source(block)];
    let made = prepare(&sources, &Settings::default()).expect("prepared");
    let texts: Vec<String> = (made.files.iter())
        .map(|file| String::from_utf8(file.clone()).expect("text"))
        .collect();
    assert!(texts[0].starts_with("PROGRAM one(*{tickbus*)"));
    assert!(texts[1].starts_with("(*{tickbus*)\nFUNCTION_BLOCK TICKBUS_TON"));
    assert!(texts[1].contains("TICKBUS_TOF"));
    assert!(texts[2].contains("VAR t : (*{tickbus TOF*)TICKBUS_TOF"));
    for (source, text) in sources.iter().zip(&texts) {
        assert_eq!(undone(text).as_bytes(), source.bytes);
    }
}

#[test]
fn a_program_without_a_task_runs_in_every_step() {
    let text = line("", "RETURN;").replace("PROGRAM b WITH slow", "PROGRAM b");
    let made = prepared_text(&text, &Settings::default());
    assert!(made.contains("  tickbus_execute := handshake.STEPPING;\n"));
    assert!(made.contains("PROGRAM b(*{tickbus*) WITH tickbus_cycle(*tickbus}*) : two;"));
    assert_eq!(undone(&made), text);
}

#[test]
fn a_note_tells_that_priorities_are_gone() {
    let text = line("", "RETURN;");
    let notes = |text: &str| {
        prepare(&[source(text)], &Settings::default())
            .expect("prepared")
            .notes
    };
    assert_eq!(notes(&text), Vec::<String>::new());
    let other = text.replace("PRIORITY := 0", "PRIORITY := 2");
    assert!(notes(&other)[0].contains("list it first"));
}

#[test]
fn there_is_nothing_to_undo_in_an_original() {
    let told = undo(&source("PROGRAM x"))
        .expect_err("an original")
        .to_string();
    assert!(told.starts_with("line.st: there is nothing to take out of this file; "));
    let told = undo(&source("x\n (*{tickbus*)"))
        .expect_err("damaged")
        .to_string();
    assert!(
        told.starts_with("line.st:2:2: the change that begins here has no end; "),
        "{told}"
    );
}

/// All sources in Structured Text of this project, without the links to some of them.
fn tree(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        let name = path
            .file_name()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned();
        if path.is_dir() && name != "target" && !name.starts_with('.') {
            tree(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "st") && !path.is_symlink()
        {
            found.push(path);
        }
    }
}

#[test]
fn every_program_of_this_project_is_prepared_and_taken_back() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../..");
    let mut paths = Vec::new();
    tree(&root, &mut paths);
    let mut refused = Vec::new();
    for path in paths {
        let bytes = std::fs::read(&path).expect("readable");
        let name = path.file_name().expect("a file").to_string_lossy();
        let name = name.into_owned();
        let source = |bytes| Source {
            name: name.clone(),
            bytes,
        };
        match prepare(&[source(bytes.clone())], &Settings::default()) {
            Ok(made) => assert_eq!(undo(&source(made.files[0].clone())), Ok(bytes), "{name}"),
            Err(_) => refused.push(name),
        }
    }
    refused.sort();
    // The blocks themselves, programs that already use them, and sources without a program.
    let right = [
        "action_control.st",
        "bench.st",
        "block.st",
        "example.st",
        "line_by_hand.st",
        "mixer.st",
        "scheduler.st",
        "timers.st",
        "valve.st",
    ];
    assert_eq!(refused, right);
}

/// Pieces of random texts and programs.
fn pieces() -> impl Strategy<Value = String> {
    let words = [
        "PROGRAM",
        "END_PROGRAM",
        "FUNCTION",
        "FUNCTION_BLOCK",
        "END_FUNCTION_BLOCK",
        "VAR",
        "VAR_GLOBAL",
        "END_VAR",
        "TYPE",
        "END_TYPE",
        "STRUCT",
        "CONFIGURATION",
        "END_CONFIGURATION",
        "RESOURCE",
        "END_RESOURCE",
        "ON",
        "TASK",
        "WITH",
        "INTERVAL",
        "PRIORITY",
        "SINGLE",
        "INITIAL_STEP",
        "STEP",
        "END_STEP",
        "TRANSITION",
        "FROM",
        "TO",
        "END_TRANSITION",
        "ACTION",
        "END_ACTION",
        "IF",
        "THEN",
        "END_IF",
        "TON",
        "TP",
        "BOOL",
        "T#10ms",
        "T#",
        "x",
        "y",
        "1",
        ":",
        ":=",
        ";",
        ",",
        "(",
        ")",
        "[",
        "]",
        ".",
        "%IX0.0",
        "(*",
        "*)",
        "{",
        "}",
        "'",
        "//",
        "\r\n",
        "\n",
        "ä",
        "\u{FEFF}",
    ];
    proptest::sample::select(words.to_vec()).prop_map(str::to_owned)
}

proptest! {
    #[test]
    fn no_soup_makes_it_panic(soup in proptest::collection::vec(pieces(), 0..40)) {
        let text = soup.join(" ");
        let _ = undo(&source(&text));
        if let Ok(made) = prepare(&[source(&text)], &Settings::default()) {
            let bytes = made.files[0].clone();
            let back = undo(&Source { name: String::new(), bytes });
            prop_assert_eq!(back, Ok(text.into_bytes()));
        }
    }

    #[test]
    fn no_bytes_make_it_panic(bytes in proptest::collection::vec(any::<u8>(), 0..60)) {
        let source = Source { name: String::new(), bytes };
        let _ = (undo(&source), prepare(&[source], &Settings::default()));
    }

    #[test]
    fn every_generated_program_comes_back(
        declared in proptest::collection::vec(
            proptest::sample::select(vec![
                "t : TON;", "a, b : TOF;", "x : ARRAY [0..3] OF TP := [4((PT := T#1s))];", "n : INT := 5; (* it's *)",
                "s : STRING[20] := 'TON (* $' *)';", "r : RTC; // {\n", "q AT %QX1.0 : BOOL;", "{p}", "\r\n", "\t",
            ]), 0..8),
        stated in proptest::collection::vec(
            proptest::sample::select(vec![
                "t(IN := TRUE);", "IF TRUE THEN n := n + 1; END_IF;", "RETURN;", "// end", "(* ; *)", "\n", "\r\n  ", "{p}",
                "s := '$'; END_PROGRAM';", "n := ABS(n) MOD 3;", ";",
            ]), 0..8),
        bom in any::<bool>(),
    ) {
        let declarations = format!("VAR t : TON; END_VAR VAR {}\nEND_VAR", declared.join(" "));
        let mut text = line(&declarations, &(stated.join(" ") + "\n"));
        if bom {
            text.insert(0, '\u{FEFF}');
        }
        let made = prepared_text(&text, &Settings::default());
        prop_assert_eq!(undone(&made), text);
    }
}
