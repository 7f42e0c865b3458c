//! Programs that are refused.

use super::{line, refused};

#[test]
fn what_cannot_be_prepared_is_told_with_its_place() {
    let with = |declared: &str| line(&format!("VAR {declared} END_VAR"), "RETURN;");
    let saying = |statements: &str| line("VAR x : TIME; n : INT; END_VAR", statements);
    for (text, says) in [
        (
            with("t : TONR;"),
            "line.st:2:9: TONR runs on a clock of its own; use TON, ",
        ),
        (
            with("t : ARRAY [1..2] OF TON_TIME;"),
            "line.st:2:25: TON_TIME runs on a clock",
        ),
        (
            with("m : MC_MoveAbsolute;"),
            "line.st:2:9: the type MC_MoveAbsolute is in none of these sources; also pass its source file",
        ),
        (
            with("t : Standard.TON;"),
            "line.st:2:9: the type Standard is in none",
        ),
        (
            saying("x := TIME();"),
            "line.st:3:6: TIME() reads the clock of the PLC; measure with a TON",
        ),
        (
            saying("n := SysTimeRtcGet(1);"),
            "SysTimeRtcGet() reads the clock",
        ),
        (
            saying("n := Stamp(1);"),
            "line.st:3:6: Stamp is in none of these sources; also pass",
        ),
        (
            saying("\"DB1\".TON(IN := TRUE);"),
            "line.st:3:7: this calls the TON of a timer of TIA Portal",
        ),
        (
            saying("{x = __CURRENT_TIME;}\nn := 1;"),
            "line.st:3:1: this pragma reads the time",
        ),
        (
            saying("{n = read_clock();}\nn := 1;"),
            "line.st:3:1: this pragma holds code, which may read the clock of the PLC; if it reads no clock, name the \
             unit: --no-clock one",
        ),
        (
            "{int n = 1;}\n".to_owned() + &saying("n := 1;"),
            "line.st:1:1: this pragma holds code, which may read the clock of the PLC; take it out",
        ),
        (
            line("VAR control : PID; END_VAR", "control();"),
            "takes its cycle as an input has to be named: --no-clock PID",
        ),
        (
            saying("LD n\nADD 1\nST n"),
            "line.st:3:1: these statements are in IL; write them in Structured Text",
        ),
        (
            saying("go: LD n"),
            "line.st:3:1: these statements are in IL",
        ),
        (
            saying("n := 1; (* a (* b *) n := 2; // *)"),
            "line.st:3:14: a comment begins within a comment",
        ),
        (
            saying("n := 'open"),
            "line.st:3:6: what begins here has no end",
        ),
        (
            with("Tickbus_Now : TIME;"),
            "line.st:2:5: the name Tickbus_Now is reserved by tickbus",
        ),
        (
            saying("n := 1; (*tickbus}*)"),
            "line.st:3:9: this program was prepared before; take that out first, with --undo",
        ),
    ] {
        refused(&text, says);
    }
}

#[test]
fn classes_are_refused() {
    let with = |block: &str| block.to_owned() + &line("VAR f : F; END_VAR", "f();");
    for (block, says) in [
        (
            "FUNCTION_BLOCK F EXTENDS TON\nEND_FUNCTION_BLOCK\n",
            "line.st:1:18: EXTENDS belongs to a class; methods, properties and inheritance are not prepared",
        ),
        (
            "FUNCTION_BLOCK F IMPLEMENTS I\nVAR t : ARRAY [1..2] OF TON; END_VAR\nEND_FUNCTION_BLOCK\n",
            "line.st:1:18: IMPLEMENTS belongs",
        ),
        (
            "FUNCTION_BLOCK ABSTRACT F\nVAR n : INT; END_VAR\nEND_FUNCTION_BLOCK\n",
            "line.st:1:16: ABSTRACT belongs",
        ),
        (
            "FUNCTION_BLOCK F\nVAR n : INT; END_VAR\nn := 1;\nMETHOD PUBLIC Run : BOOL\nVAR_INST t : TON; END_VAR\nt();\nEND_METHOD\nEND_FUNCTION_BLOCK\n",
            "line.st:4:1: METHOD belongs",
        ),
        (
            "FUNCTION_BLOCK F\nPROPERTY P : INT\nGET\nEND_GET\nEND_PROPERTY\nEND_FUNCTION_BLOCK\n",
            "line.st:2:1: PROPERTY belongs",
        ),
        (
            "FUNCTION_BLOCK F\nRETURN;\nVAR t : TON; END_VAR\nEND_FUNCTION_BLOCK\n",
            "line.st:3:1: VAR stands among statements; declare variables before",
        ),
        (
            "FUNCTION_BLOCK F\nVAR n : INT; END_VAR\nn := 1;\nACTION x: n := 2; END_ACTION\nEND_FUNCTION_BLOCK\n",
            "line.st:4:19: END_ACTION stands among statements",
        ),
    ] {
        refused(&with(block), says);
    }
}

#[test]
fn clocks_behind_a_dot_are_told() {
    let saying = |statements: &str| line("VAR n : INT; END_VAR", statements);
    refused(
        &saying("n := SysTimeRtc.SysTimeRtcGet(n);"),
        "line.st:3:17: SysTimeRtcGet() reads the clock of the PLC",
    );
    refused(
        &saying("n := Tc2_System.F_GetSystemTime();"),
        "F_GetSystemTime() reads",
    );
    refused(
        &saying("n := Tc2_MC2.Read[n].Inner(n);"),
        "line.st:3:6: Tc2_MC2 is not declared in these sources; also pass",
    );
    refused(&saying("\"DB1\".Inner(n);"), "\"DB1\" is not declared");
}

#[test]
fn a_program_of_a_task_has_no_other_caller() {
    let saying = |statements: &str| line("VAR n : INT; END_VAR", statements);
    refused(
        &saying("n := 1; two();"),
        "line.st:3:9: two is called here, and a task runs it too; call it or give it a task",
    );
    refused(&saying("Two.act();"), "line.st:3:1: Two is called here");
    // A variable of that name is a different thing.
    let block = "FUNCTION_BLOCK Own VAR n : INT; END_VAR n := 1; END_FUNCTION_BLOCK\n";
    let text = block.to_owned() + &line("VAR two : Own; END_VAR", "two();");
    super::prepared_text(&text, &super::Settings::default());
}

#[test]
fn what_cannot_be_prepared_of_a_chart_is_told() {
    let saying = |statements: &str| line("VAR x : TIME; n : INT; END_VAR", statements);
    for (associations, says) in [
        (
            "move(L, T#3s);",
            "line.st:3:24: the PLC times this L itself",
        ),
        (
            "x(P);",
            "line.st:3:21: x would be on for a cycle of the PLC",
        ),
    ] {
        let chart = format!(
            "INITIAL_STEP one: {associations} END_STEP\nTRANSITION FROM one TO one := TRUE; END_TRANSITION\nACTION move: n := 1; END_ACTION"
        );
        refused(&saying(&chart), says);
    }
    let timed =
        "INITIAL_STEP one: END_STEP\nTRANSITION FROM one TO one := one.T > T#1s; END_TRANSITION";
    refused(
        &saying(timed),
        "line.st:4:31: the PLC measures one.T itself",
    );
    let stray =
        "INITIAL_STEP one: END_STEP\nn := 2;\nTRANSITION FROM one TO one := TRUE; END_TRANSITION";
    refused(
        &saying(stray),
        "line.st:4:1: n stands in a chart, outside of its parts; put statements into an ACTION",
    );
    let graphical = "INITIAL_STEP one: END_STEP\nTRANSITION FROM one TO one: LD n END_TRANSITION";
    refused(
        &saying(graphical),
        "line.st:4:1: the condition of this transition is not in Structured Text",
    );
}

#[test]
fn what_cannot_be_prepared_of_a_configuration_is_told() {
    let saying = |statements: &str| line("VAR x : TIME; n : INT; END_VAR", statements);
    for (text, says) in [
        (
            saying("n := 1;").replace("T#30ms", "T#500us"),
            "the interval T#500us is not a whole number of milliseconds",
        ),
        (
            saying("n := 1;").replace("INTERVAL := T#30ms", "SINGLE := x"),
            "this task starts at an event",
        ),
        (
            saying("n := 1;").replace("WITH slow", "WITH slaw"),
            "there is no task slaw",
        ),
        (
            saying("n := 1;").replace(": two;", ": one;"),
            "one runs in two tasks; give each task a program of its own",
        ),
        (
            saying("n := 1;").replace(": one;", ": one(f WITH slow);"),
            "line.st:13:29: a block of this program runs in a task of its own",
        ),
        (
            saying("n := 1;").replace(": two;", ": six;"),
            "the program six is in none of these sources",
        ),
        (
            saying("n := 1;").replace("END_RESOURCE", "END_RESOURCE\nRESOURCE x ON y"),
            "this is a second resource",
        ),
        (
            saying("n := 1;").replace("CONFIGURATION", "NAMESPACE"),
            "line.st:9:1: unexpected \"NAMESPACE\"; PROGRAM, ",
        ),
        (
            saying("n := 1;").replace("PROGRAM two", "PROGRAM 1x"),
            "line.st:5:9: expected a name, found \"1x\"",
        ),
        (
            saying("n := 1;").replace("END_CONFIGURATION", ""),
            "plant has no END_CONFIGURATION",
        ),
        (
            saying("n := 1;").replacen("END_PROGRAM", "", 2),
            "one has no END_PROGRAM",
        ),
        (
            "PROGRAM x\nRETURN;\nEND_PROGRAM".to_owned(),
            "line.st: there is no CONFIGURATION; also pass the source file",
        ),
        (
            saying("n := 1;\0"),
            "line.st:3:8: this file is not UTF-8 text; save it as UTF-8",
        ),
    ] {
        refused(&text, says);
    }
}
