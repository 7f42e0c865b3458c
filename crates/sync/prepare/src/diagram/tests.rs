//! Diagrams as statements.

use crate::{Settings, Source, prepare, structured_text, undo};

/// A project whose only program has this body, and the variables of `LOCALS`.
fn project(body: &str) -> String {
    let variables: String = [
        ("a b c d x y", "<BOOL/>"),
        ("n m", "<INT/>"),
        ("pause total", "<TIME/>"),
        ("t", "<derived name=\"TON\"/>"),
        ("s", "<derived name=\"SR\"/>"),
        ("own", "<derived name=\"Own\"/>"),
        (
            "list",
            "<array><dimension lower=\"1\" upper=\"3\"/><baseType><INT/></baseType></array>",
        ),
    ]
    .iter()
    .flat_map(|(names, kind)| {
        names
            .split(' ')
            .map(move |name| format!("<variable name=\"{name}\"><type>{kind}</type></variable>"))
    })
    .collect();
    format!(
        "<project xmlns=\"http://www.plcopen.org/xml/tc6_0200\"><types><pous>\
         <pou name=\"Own\" pouType=\"functionBlock\"><interface><inputVars><variable name=\"go\"><type><BOOL/></type></variable>\
         </inputVars><outputVars><variable name=\"count\"><type><INT/></type></variable></outputVars>\
         <inOutVars><variable name=\"both\"><type><INT/></type></variable></inOutVars></interface>\
         <body><ST><p>count := both;</p></ST></body></pou>\
         <pou name=\"Twice\" pouType=\"function\"><interface><returnType><INT/></returnType><inputVars><variable name=\"of\"><type><INT/></type>\
         </variable></inputVars><outputVars><variable name=\"odd\"><type><BOOL/></type></variable></outputVars></interface>\
         <body><ST><p>Twice := 2 * of;</p></ST></body></pou>\
         <pou name=\"main\" pouType=\"program\"><interface><localVars>{variables}</localVars></interface>\
         <body>{body}</body></pou></pous></types><instances><configurations><configuration name=\"c\"><resource name=\"r\">\
         <task name=\"fast\" interval=\"T#10ms\" priority=\"0\"><pouInstance name=\"i\" typeName=\"main\"/></task>\
         </resource></configuration></configurations></instances></project>"
    )
}

fn source(text: &str) -> Source {
    let bytes = text.as_bytes().to_vec();
    let name = "plc.xml".to_owned();
    Source { name, bytes }
}

/// The statements of a body, one in a line, without the blanks before them.
#[track_caller]
fn statements(body: &str) -> Vec<String> {
    let text = structured_text(&source(&project(body)));
    let text = text.unwrap_or_else(|mistakes| panic!("{mistakes}"));
    let (_, rest) = text.split_once("PROGRAM main").expect("the program");
    let (body, _) = rest.split_once("END_PROGRAM").expect("its end");
    let body = body.rsplit("END_VAR\n").next().unwrap_or_default();
    let lines = body.lines().map(|line| line.trim().to_owned());
    lines.filter(|line| !line.is_empty()).collect()
}

#[track_caller]
fn refused(body: &str, says: &str) {
    let mistakes = structured_text(&source(&project(body))).expect_err(says);
    let told = mistakes.to_string();
    assert!(told.contains(says), "expected {says}, found {told}");
    // The same when the program is prepared.
    let mistakes = prepare(&[source(&project(body))], &Settings::default()).expect_err(says);
    let told: Vec<String> = mistakes.iter().map(ToString::to_string).collect();
    assert!(
        told.join("\n").contains(says),
        "expected {says}, found {told:?}"
    );
}

/// The wires to a pin: from these elements, and with a dot from their parameter.
fn pin(from: &str) -> String {
    let wires = from
        .split_whitespace()
        .map(|from| match from.split_once('.') {
            Some((id, parameter)) => {
                format!("<connection refLocalId=\"{id}\" formalParameter=\"{parameter}\"/>")
            }
            None => format!("<connection refLocalId=\"{from}\"/>"),
        });
    let wires: String = wires.collect();
    format!("<connectionPointIn>{wires}</connectionPointIn>")
}

fn rail(id: u32) -> String {
    format!("<leftPowerRail localId=\"{id}\"><connectionPointOut/></leftPowerRail>")
}

fn contact(id: u32, variable: &str, more: &str, from: &str) -> String {
    format!(
        "<contact localId=\"{id}\" {more}>{}<connectionPointOut/><variable>{variable}</variable></contact>",
        pin(from)
    )
}

/// A coil at a height in the drawing.
fn coil(id: u32, y: u32, variable: &str, more: &str, from: &str) -> String {
    format!(
        "<coil localId=\"{id}\" {more}><position x=\"9\" y=\"{y}\"/>{}<variable>{variable}</variable></coil>",
        pin(from)
    )
}

fn input(id: u32, expression: &str) -> String {
    format!("<inVariable localId=\"{id}\"><expression>{expression}</expression></inVariable>")
}

fn output(id: u32, y: u32, expression: &str, more: &str, from: &str) -> String {
    format!(
        "<outVariable localId=\"{id}\" {more}><position x=\"9\" y=\"{y}\"/>{}<expression>{expression}</expression></outVariable>",
        pin(from)
    )
}

/// A block: its attributes, inputs such as `IN=1 PT=2`, and outputs.
fn block(id: u32, more: &str, inputs: &str, outputs: &str) -> String {
    let inputs = inputs.split_whitespace().map(|input| {
        let (name, from) = input.split_once('=').unwrap_or((input, ""));
        let (name, negated) = match name.strip_prefix('!') {
            Some(name) => (name, "negated=\"true\""),
            None => (name, ""),
        };
        let from = from.replace(',', " ");
        format!(
            "<variable formalParameter=\"{name}\" {negated}>{}</variable>",
            pin(&from)
        )
    });
    let outputs = outputs.split_whitespace().map(|name| {
        format!("<variable formalParameter=\"{name}\"><connectionPointOut/></variable>")
    });
    format!(
        "<block localId=\"{id}\" {more}><inputVariables>{}</inputVariables><inOutVariables/><outputVariables>{}</outputVariables></block>",
        inputs.collect::<String>(),
        outputs.collect::<String>()
    )
}

fn ld(parts: &[String]) -> String {
    format!("<LD>{}</LD>", parts.concat())
}

fn fbd(parts: &[String]) -> String {
    format!("<FBD>{}</FBD>", parts.concat())
}

#[test]
fn a_ladder_is_ands_and_ors() {
    let made = statements(&ld(&[
        rail(1),
        contact(2, "a", "", "1"),
        contact(3, "b", "negated=\"true\"", "1"),
        contact(4, "c", "", "2 3"),
        contact(5, "d", "", "2 3"),
        coil(7, 90, "y", "negated=\"true\"", "2"),
        coil(6, 10, "x", "", "4 5"),
        "<rightPowerRail localId=\"8\"/><comment localId=\"9\"/>".to_owned(),
    ]));
    assert_eq!(
        made,
        ["x := (c OR d) AND (a OR NOT (b));", "y := NOT (a);"],
        "from top to bottom"
    );
}

#[test]
fn coils_store_and_contacts_see_edges() {
    let made = statements(&ld(&[
        rail(1),
        contact(2, "a", "edge=\"rising\"", "1"),
        coil(3, 10, "x", "storage=\"set\"", "2"),
        contact(4, "b", "edge=\"falling\"", "1"),
        coil(5, 30, "x", "storage=\"reset\"", "4"),
        coil(6, 50, "y", "edge=\"rising\"", "1"),
    ]));
    assert_eq!(
        made,
        [
            "tickbus_edge_1(CLK := a);",
            "IF tickbus_edge_1.Q THEN x := TRUE; END_IF;",
            "tickbus_edge_2(CLK := b);",
            "IF tickbus_edge_2.Q THEN x := FALSE; END_IF;",
            "tickbus_edge_3(CLK := TRUE);",
            "y := tickbus_edge_3.Q;",
        ]
    );
}

#[test]
fn blocks_run_once_before_their_readers() {
    let made = statements(&fbd(&[
        input(1, "a"),
        input(2, "T#1s"),
        block(
            3,
            "typeName=\"TON\" instanceName=\"t\"",
            "!IN=1 PT=2",
            "Q ET",
        ),
        output(4, 50, "x", "", "3.Q"),
        output(5, 10, "total", "", "3.ET"),
        block(6, "typeName=\"SR\" instanceName=\"s\"", "S1=3.Q R=1", "Q1"),
    ]));
    assert_eq!(
        made,
        [
            "t(IN := NOT (a), PT := T#1s);",
            "total := t.ET;",
            "x := t.Q;",
            "s(S1 := t.Q, R := a);",
        ]
    );
}

#[test]
fn an_order_comes_before_positions_and_is_not_broken_by_readers() {
    let made = statements(&fbd(&[
        input(1, "a"),
        block(
            3,
            "typeName=\"TON\" instanceName=\"t\" executionOrderId=\"2\"",
            "IN=6.Q1",
            "Q",
        ),
        block(
            6,
            "typeName=\"SR\" instanceName=\"s\" executionOrderId=\"3\"",
            "S1=1",
            "Q1",
        ),
        output(4, 5, "x", "executionOrderId=\"1\"", "1"),
    ]));
    assert_eq!(made, ["x := a;", "t(IN := s.Q1);", "s(S1 := a);"]);
}

#[test]
fn results_of_functions_have_variables_of_their_type() {
    let body = fbd(&[
        input(1, "n"),
        input(2, "5"),
        block(3, "typeName=\"ADD\"", "IN1=1 IN2=2", "OUT"),
        block(4, "typeName=\"GT\"", "IN1=3 IN2=1", "OUT"),
        output(5, 10, "x", "", "4"),
        input(6, "pause"),
        block(7, "typeName=\"MUL\"", "IN1=6 IN2=1", "OUT"),
        output(8, 30, "total", "", "7"),
        block(9, "typeName=\"Twice\"", "of=10", "OUT odd"),
        input(10, "list[n]"),
        output(11, 50, "y", "", "9.odd"),
        block(12, "typeName=\"SEL\"", "G=14 IN0=1 IN1=2", "OUT"),
        output(13, 70, "m", "", "12"),
        input(14, "a"),
    ]);
    assert_eq!(
        statements(&body),
        [
            "tickbus_wire_3 := ADD(n, 5);",
            "tickbus_wire_4 := GT(tickbus_wire_3, n);",
            "x := tickbus_wire_4;",
            "tickbus_wire_7 := MUL(pause, n);",
            "total := tickbus_wire_7;",
            "tickbus_wire_9 := Twice(of := list[n], odd => tickbus_wire_9_odd);",
            "y := tickbus_wire_9_odd;",
            "tickbus_wire_12 := SEL(a, n, 5);",
            "m := tickbus_wire_12;",
        ]
    );
    let text = structured_text(&source(&project(&body))).expect("text");
    for declared in [
        "tickbus_wire_3 : INT;",
        "tickbus_wire_4 : BOOL;",
        "tickbus_wire_7 : TIME;",
        "tickbus_wire_9 : INT;",
        "tickbus_wire_9_odd : BOOL;",
        "tickbus_wire_12 : INT;",
    ] {
        assert!(text.contains(declared), "{declared}\n{text}");
    }
}

#[test]
fn an_output_stays_while_its_block_is_not_enabled() {
    let made = statements(&fbd(&[
        input(1, "n"),
        input(2, "a"),
        block(3, "typeName=\"ADD\"", "EN=2 IN1=1 IN2=1", "ENO OUT"),
        output(4, 10, "m", "", "3.OUT"),
        output(5, 20, "x", "", "3.ENO"),
    ]));
    assert_eq!(
        made,
        [
            "tickbus_wire_3 := ADD(EN := a, IN1 := n, IN2 := n, ENO => tickbus_wire_3_ENO);",
            "IF tickbus_wire_3_ENO THEN m := tickbus_wire_3; END_IF;",
            "IF tickbus_wire_3_ENO THEN x := tickbus_wire_3_ENO; END_IF;",
        ]
    );
}

#[test]
fn a_loop_through_a_block_reads_the_last_scan() {
    let made = statements(&fbd(&[
        block(1, "typeName=\"TON\" instanceName=\"t\"", "!IN=2", "Q"),
        block(2, "typeName=\"OR\"", "IN1=1.Q IN2=3", "OUT"),
        input(3, "a"),
        output(4, 10, "x", "", "2"),
    ]));
    assert_eq!(
        made,
        [
            "t(IN := NOT (tickbus_wire_2));",
            "tickbus_wire_2 := OR(t.Q, a);",
            "x := tickbus_wire_2;",
        ]
    );
}

#[test]
fn what_a_block_changes_is_a_variable() {
    let made = statements(&fbd(&[
        input(1, "n"),
        block(
            2,
            "typeName=\"Own\" instanceName=\"own\"",
            "go=3 both=1",
            "count both",
        ),
        input(3, "a"),
        output(4, 10, "m", "", "2.both"),
    ]));
    assert_eq!(made, ["own(go := a, both := n);", "m := n;"]);
}

#[test]
fn connectors_are_wires() {
    let connector = |id, name: &str, from| {
        format!(
            "<connector localId=\"{id}\" name=\"{name}\">{}</connector>",
            pin(from)
        )
    };
    let made = statements(&fbd(&[
        input(1, "a"),
        connector(2, "K", "1"),
        "<continuation localId=\"3\" name=\"k\"><connectionPointOut/></continuation>".to_owned(),
        output(4, 10, "x", "storage=\"set\"", "3"),
    ]));
    assert_eq!(made, ["IF a THEN x := TRUE; END_IF;"]);
}

#[test]
fn connectors_that_double_each_other_are_refused_before_memory_ends() {
    let mut body = vec![input(1, "a")];
    let mut from = "1".to_owned();
    for id in (10..800).step_by(10) {
        body.push(format!(
            "<connector localId=\"{id}\" name=\"K{id}\">{}</connector>",
            pin(&from)
        ));
        for continued in [id + 1, id + 2] {
            body.push(format!(
                "<continuation localId=\"{continued}\" name=\"K{id}\"><connectionPointOut/></continuation>"
            ));
        }
        from = format!("{} {}", id + 1, id + 2);
    }
    body.push(output(4, 10, "x", "", &from));
    refused(&fbd(&body), "the diagram has too many ways");
}

#[test]
fn an_input_of_a_block_without_a_name_is_refused() {
    let made = block(2, "typeName=\"Foreign\" instanceName=\"f\"", "=1", "");
    refused(
        &fbd(&[input(1, "a"), made]),
        "an input of Foreign has no name",
    );
}

#[test]
fn a_jump_skips_networks_and_a_return_the_rest() {
    let made = statements(&ld(&[
        rail(1),
        contact(2, "a", "", "1"),
        format!(
            "<jump localId=\"3\" label=\"end\"><position x=\"5\" y=\"10\"/>{}</jump>",
            pin("2")
        ),
        coil(4, 40, "x", "", "5"),
        contact(5, "b", "", "1").replace(
            "<connectionPointIn>",
            "<position x=\"1\" y=\"40\"/><connectionPointIn>",
        ),
        "<label localId=\"6\" label=\"END\"><position x=\"1\" y=\"60\"/></label>".to_owned(),
        format!(
            "<return localId=\"7\"><position x=\"5\" y=\"80\"/>{}</return>",
            pin("8")
        ),
        contact(8, "c", "negated=\"true\"", "1").replace(
            "<connectionPointIn>",
            "<position x=\"1\" y=\"80\"/><connectionPointIn>",
        ),
        coil(9, 100, "y", "", "1"),
    ]));
    assert_eq!(
        made,
        [
            "tickbus_jump_3 := FALSE;",
            "tickbus_jump_3 := a;",
            "IF NOT (tickbus_jump_3) THEN",
            "x := b;",
            "END_IF;",
            "IF NOT (c) THEN RETURN; END_IF;",
            "y := TRUE;",
        ]
    );
}

#[test]
fn comparisons_survive_the_references_of_xml() {
    let made = statements(&fbd(&[
        input(1, "n &lt;&gt; m"),
        output(2, 10, "x", "", "1"),
    ]));
    assert_eq!(made, ["x := n <> m;"]);
}

#[test]
#[expect(clippy::too_many_lines, reason = "a list of mistakes")]
fn what_a_diagram_gets_wrong_is_told_with_its_element() {
    for (parts, says) in [
        (
            vec![coil(6, 10, "x", "", "99")],
            "main, element 6: a wire begins at 99, which is no element with an output",
        ),
        (
            vec![coil(6, 10, "x", "", "1"), coil(1, 10, "y", "", "6")],
            "is in a loop without a function block or a variable",
        ),
        (
            vec![
                contact(1, "a", "", "2"),
                contact(2, "b", "", "1"),
                coil(3, 1, "x", "", "1"),
            ],
            "main, element 1: this element is in a loop",
        ),
        (
            vec![contact(1, "a", "", ""), coil(3, 1, "x", "", "1")],
            "main, element 1: nothing leads to this contact",
        ),
        (
            vec![input(1, "n"), input(2, "m"), output(3, 1, "n", "", "1 2")],
            "main, element 3: 2 wires lead to one INT",
        ),
        (
            vec![rail(1), coil(3, 1, "x", "negated=\"maybe\"", "1")],
            "main, element 3: negated is maybe; write true or false",
        ),
        (
            vec![
                rail(1),
                coil(3, 1, "x", "negated=\"true\" storage=\"set\"", "1"),
            ],
            "two of negated, storage and edge are given",
        ),
        (
            vec![rail(1), coil(3, 1, "x", "edge=\"up\"", "1")],
            "the edge up is unknown",
        ),
        (vec![rail(1), rail(1)], "another element has this localId"),
        (
            vec![rail(1), coil(3, 1, "x; y := 1", "", "1")],
            "is no variable and no value",
        ),
        (
            vec![
                input(1, "a"),
                block(
                    2,
                    "typeName=\"Own\" instanceName=\"own\"",
                    "stop=1",
                    "count",
                ),
            ],
            "main, element 2: Own has no parameter stop",
        ),
        (
            vec![
                input(1, "a"),
                block(2, "typeName=\"Own\"", "go=1", "count"),
                output(3, 1, "n", "", "2"),
            ],
            "Own is a function block, and has no instance here",
        ),
        (
            vec![block(
                2,
                "typeName=\"Own\" instanceName=\"own\"",
                "both",
                "both",
            )],
            "nothing leads to both, which the block changes",
        ),
        (
            vec![
                input(1, "5"),
                block(2, "typeName=\"ADD\"", "IN1=1 IN2=1", "OUT"),
                coil(3, 1, "x", "", "4"),
                block(4, "typeName=\"GT\"", "IN1=2 IN2=1", "OUT"),
            ],
            "the type of the result of ADD is unknown",
        ),
        (
            vec![
                rail(1),
                "<jump localId=\"3\" label=\"L\"><connectionPointIn/></jump>".to_owned(),
            ],
            "there is no label L",
        ),
        (
            vec!["<step localId=\"1\"/>".to_owned()],
            "step is no element of LD or FBD",
        ),
        (
            vec!["<block localId=\"x\"/>".to_owned()],
            "there is no number localId",
        ),
    ] {
        refused(&fbd(&parts), says);
    }
}

#[test]
fn a_diagram_without_a_measure_is_refused() {
    let deep: Vec<String> = (2..300)
        .map(|id| contact(id, "a", "", &(id - 1).to_string()))
        .chain([rail(1), coil(1000, 1, "x", "", "299")])
        .collect();
    refused(&ld(&deep), "more than 200 elements are in a row");
    // Each contact behind both of the stage before, and each stage with another third one.
    let wide: Vec<String> = (1..40)
        .flat_map(|stage| {
            let id = stage * 10;
            let before = if stage == 1 {
                "1".to_owned()
            } else {
                format!("{} {}", id - 10, id - 9)
            };
            let other = format!("{before} 1");
            [
                contact(id, "a", "", &before),
                contact(id + 1, "b", "", &other),
            ]
        })
        .chain([rail(1), coil(1000, 1, "x", "", "390 391")])
        .collect();
    refused(&ld(&wide), "the diagram has too many ways");
}

#[test]
fn a_prepared_diagram_waits_for_its_step_and_comes_back() {
    let body = fbd(&[
        input(1, "a"),
        block(3, "typeName=\"TON\" instanceName=\"t\"", "IN=1 PT=2", "Q"),
        input(2, "T#1s"),
        block(5, "typeName=\"NE\"", "IN1=6 IN2=6", "OUT"),
        input(6, "n"),
        output(4, 10, "x", "", "3.Q 5"),
    ]);
    // A block of the project keeps its diagram.
    let inner = "<localVars><variable name=\"late\"><type><derived name=\"TOF\"/></type></variable></localVars></interface>";
    let own = fbd(&[block(
        1,
        "typeName=\"TOF\" instanceName=\"late\"",
        "IN PT",
        "Q",
    )]);
    let text = project(&body).replacen("</interface>", inner, 1).replacen(
        "<ST><p>count := both;</p></ST>",
        &own,
        1,
    );
    let made = prepare(&[source(&text)], &Settings::default());
    let made = made.unwrap_or_else(|mistakes| panic!("{}", mistakes[0]));
    let bytes = made.files[0].clone();
    let name = String::new();
    assert_eq!(undo(&Source { name, bytes }), Ok(text.into_bytes()));
    let made = String::from_utf8(made.files[0].clone()).expect("text");
    for piece in [
        "<ST><xhtml xmlns=\"http://www.w3.org/1999/xhtml\">IF NOT tickbus_simulated OR tickbus_execute_fast THEN\n  t(IN := a, PT := T#1s);\n",
        "<variable name=\"tickbus_wire_5\">",
        "--><block localId=\"1\" typeName=\"TICKBUS_TOF\" instanceName=\"late\"><!--tickbus}-->",
        "<derived name=\"TICKBUS_TON\"/>",
    ] {
        assert!(made.contains(piece), "{piece}\n{made}");
    }
    let text = structured_text(&source(&made)).expect("text");
    assert!(text.contains("  late : TICKBUS_TOF;"), "{text}");
}

#[test]
fn a_pid_with_its_cycle_is_accepted_and_compared_with_the_task() {
    let with = |cycle: &str| {
        let body = fbd(&[
            input(1, cycle),
            block(2, "typeName=\"PID\" instanceName=\"p\"", "CYCLE=1", "XOUT"),
        ]);
        let declared =
            "<localVars><variable name=\"p\"><type><derived name=\"PID\"/></type></variable>";
        project(&body).replacen("<localVars>", declared, 1)
    };
    let made = prepare(&[source(&with("T#20ms"))], &Settings::default()).expect("prepared");
    assert!(
        made.notes[0].contains("main: CYCLE is T#20ms, and the task"),
        "{:?}",
        made.notes
    );
    let made = prepare(&[source(&with("T#10ms"))], &Settings::default()).expect("prepared");
    assert_eq!(made.notes, Vec::<String>::new());
    let without = with("T#10ms").replace("\"CYCLE\"", "\"AUTO\"");
    let told = prepare(&[source(&without)], &Settings::default()).expect_err("a clock");
    assert!(
        told[0]
            .to_string()
            .contains("PID runs on a clock of its own")
    );
}
