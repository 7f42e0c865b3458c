//! Projects as XML, prepared and undone; and our own blocks as XML.

use std::path::Path;

use crate::{Addresses, Prepared, SOURCES, Settings, Source, plcopen_xml, prepare, undo};
use proptest::prelude::*;
use roxmltree::Document;
use tickbus_base::toml_text::Mistakes;

/// As Beremiz and OpenPLC Editor write it, with what XML allows.
const PROJECT: &str = r#"<?xml version='1.0' encoding='utf-8'?>
<project xmlns:xhtml="http://www.w3.org/1999/xhtml" xmlns="http://www.plcopen.org/xml/tc6_0201">
  <!-- Größe > 1 -->
  <types>
    <dataTypes/>
    <pous>
      <pou name="feed" pouType="program">
        <interface>
          <localVars>
            <variable name="start" address="%IX8.0"><type><BOOL/></type></variable>
            <variable name="delay"><type><derived name="TON"/></type></variable>
            <variable name="pulse"><type><derived  name = 'TP' /></type></variable>
          </localVars>
        </interface>
        <body>
          <ST>
            <xhtml:p><![CDATA[  delay(IN := start, PT := T#1s); (* a <b> & c *)
  pulse(IN := delay.Q);]]></xhtml:p>
          </ST>
        </body>
      </pou>
      <pou name="press" pouType="program">
        <interface/>
        <body><ST><xhtml xmlns="http://www.w3.org/1999/xhtml">IF 1 &lt;&gt; 2 THEN RETURN; END_IF;</xhtml></ST></body>
      </pou>
    </pous>
  </types>
  <instances>
    <configurations>
      <configuration name="config">
        <resource name="cpu">
          <task name="slow" priority="1" interval="T#30ms">
            <pouInstance name="presser" typeName="press"/>
          </task>
          <task name="fast" priority="0" interval="T#10ms">
            <pouInstance name="feeder" typeName="feed"/>
          </task>
          <pouInstance name="again" typeName="feed"/>
        </resource>
      </configuration>
    </configurations>
  </instances>
</project>
"#;

/// With `feed` in one task only.
fn project() -> String {
    PROJECT.replace(
        "          <pouInstance name=\"again\" typeName=\"feed\"/>\n",
        "",
    )
}

fn source(text: &str) -> Source {
    let bytes = text.as_bytes().to_vec();
    let name = "plc.xml".to_owned();
    Source { name, bytes }
}

fn prepared(text: &str) -> Result<Prepared, Vec<Mistakes>> {
    let [go, ms, done] = ["%ID0", "%ID4", "%QD0"].map(|address| Some(address.to_owned()));
    let addresses = Addresses {
        go,
        ms,
        done,
        ..Addresses::default()
    };
    let settings = Settings {
        addresses,
        ..Settings::default()
    };
    prepare(&[source(text)], &settings)
}

#[track_caller]
fn prepared_text(text: &str) -> String {
    let made = prepared(text).unwrap_or_else(|mistakes| panic!("{}", mistakes[0]));
    let made = String::from_utf8(made.files[0].clone()).expect("text");
    Document::parse(&made).unwrap_or_else(|error| panic!("{error}\n{made}"));
    let back = undo(&source(&made)).unwrap_or_else(|mistakes| panic!("{mistakes}"));
    assert_eq!(String::from_utf8(back).expect("text"), text);
    made
}

#[track_caller]
fn refused(text: &str, says: &str) {
    let mistakes = prepared(text).expect_err(says);
    let all: Vec<String> = mistakes.iter().map(ToString::to_string).collect();
    let all = all.join("\n");
    assert!(all.contains(says), "expected {says}, found {all}");
}

#[test]
fn a_prepared_project_is_the_original_with_marked_changes() {
    let made = prepared_text(&project());
    for piece in [
        "<type><!--{tickbus %3Cderived name=\"TON\"/%3E--><derived name=\"TICKBUS_TON\"/><!--tickbus}--></type>",
        "<derived  name = 'TICKBUS_TP' />",
        "<![CDATA[  (*{tickbus*)IF NOT tickbus_simulated OR tickbus_execute_fast THEN (*tickbus}*)delay(IN",
        "pulse(IN := delay.Q);(*{tickbus*) END_IF;(*tickbus}*)]]>",
        "(*{tickbus*)IF NOT tickbus_simulated OR tickbus_execute_slow THEN (*tickbus}*)IF 1 &lt;&gt; 2",
        "<!--{tickbus %3Cinterface/%3E--><interface>\n<externalVars>\n",
        "<interface><!--{tickbus-->\n<externalVars>\n  <variable name=\"tickbus_simulated\">",
        "<pous><!--{tickbus-->\n<pou name=\"TICKBUS_TON\" pouType=\"functionBlock\">",
        "<variable name=\"go\" address=\"%ID0\">",
        "<task name=\"tickbus_cycle\" interval=\"T#10ms\" priority=\"1\">\n  <pouInstance name=\"tickbus_first\" \
         typeName=\"TICKBUS_SCHEDULE\"/>\n  <pouInstance name=\"presser\" typeName=\"press\"/>\n  <pouInstance name=\"feeder\" \
         typeName=\"feed\"/>\n</task><!--tickbus}-->",
        "<variable name=\"tickbus_simulated\">\n    <type>\n      <BOOL/>\n    </type>\n    <initialValue>\n      \
         <simpleValue value=\"TRUE\"/>",
        "handshake.STEPPING AND ms MOD 30 = 0;",
    ] {
        assert!(made.contains(piece), "{piece}\n{made}");
    }
    assert_eq!(
        made.matches("\n        <task").count() + made.matches("><task").count(),
        1,
        "{made}"
    );
}

#[test]
fn other_forms_of_a_project_survive() {
    let plain = project();
    prepared_text(&plain.replace('\n', "\r\n"));
    prepared_text(&format!("\u{FEFF}{plain}"));
    // CODESYS writes durations of XML, and no type of an instance.
    let codesys = plain
        .replace("T#10ms", "PT0.01S")
        .replace("T#30ms", "PT0.03S")
        .replace(
            "name=\"feeder\" typeName=\"feed\"",
            "name=\"feed\" typeName=\"\"",
        );
    assert!(prepared_text(&codesys).contains("interval=\"PT0.010S\""));
    let start = plain.find("          <task").expect("tasks");
    let end = plain.rfind("</task>").expect("tasks") + "</task>\n".len();
    let alone = "          <pouInstance name=\"a\" typeName=\"feed\"/>\n";
    let without_tasks = format!("{}{alone}{}", &plain[..start], &plain[end..]);
    assert!(prepared_text(&without_tasks).contains("tickbus_execute := handshake.STEPPING;"));
}

#[test]
fn a_body_of_pragmas_gets_a_controller() {
    let start = project().find("IF 1 ").expect("there is one");
    let end = project().find("</xhtml>").expect("its end");
    let mut text = project();
    text.replace_range(start..end, "{n++;}");
    refused(&text, "if it reads no clock, name the unit: --no-clock ");
    let settings = Settings {
        no_clock: vec!["PRESS".to_owned()],
        ..Settings::default()
    };
    let made = prepare(&[source(&text)], &settings).expect("vouched for");
    let made = String::from_utf8(made.files[0].clone()).expect("text");
    assert!(
        made.contains("THEN (*tickbus}*){n++;}(*{tickbus*) END_IF;"),
        "{made}"
    );
}

#[test]
fn a_task_may_have_blanks_in_its_name() {
    let text = project().replace("\"fast\"", "\"Main Task\"");
    let made = prepared_text(&text);
    assert!(made.contains("OR tickbus_execute_Main_Task THEN"), "{made}");
}

#[test]
fn what_cannot_be_prepared_is_told_with_its_place() {
    let plain = project();
    for (text, says) in [
        (
            PROJECT.to_owned(),
            "plc.xml:38:47: feed runs in two tasks; ",
        ),
        (
            plain.replace("\"TON\"", "\"TONR\""),
            "plc.xml:11:42: TONR runs on a clock of its own",
        ),
        (
            plain.replace("\"TON\"", "\"MC_Power\""),
            "the type MC_Power is in none of these sources",
        ),
        (
            plain.replace("IF 1 &lt;&gt; 2", "x := TIME(); IF"),
            "plc.xml:24:68: TIME() reads the clock",
        ),
        (
            plain.replace("IF 1 ", "Wait(1 &lt; 2); IF 1 "),
            "plc.xml:24:63: Wait is in none of these sources",
        ),
        (
            plain.replace("IF 1 ", "LD x\nIF 1 "),
            "plc.xml:24:63: these statements are in IL",
        ),
        (
            plain.replace("IF 1 ", "(* IF 1 "),
            "plc.xml:24:63: the comment or text that begins here has no end",
        ),
        (
            plain.replace("IF 1 ", "<b>x</b>IF 1 "),
            "these statements hold other elements",
        ),
        (
            plain.replace("<ST><xhtml", "<SFC/><ST><xhtml"),
            "plc.xml:24:15: these statements are in SFC",
        ),
        (
            plain.replace("\"start\"", "\"tickbus_execute_x\""),
            "the name tickbus_execute_x is reserved by tickbus",
        ),
        (
            plain.replace("%IX8.0", "%id4"),
            "the program uses %id4 already",
        ),
        (
            plain.replace("T#30ms", "T#1.5ms"),
            "plc.xml:32:52: the interval T#1.5ms is not a whole number",
        ),
        (
            plain.replace("interval=\"T#30ms\"", "single=\"x\""),
            "this task starts at an event",
        ),
        (
            plain.replace("typeName=\"feed\"", "typeName=\"fed\""),
            "the program fed is not in this project",
        ),
        (
            plain.replace(
                "<interface/>",
                "<interface><InterfaceAsPlainText/></interface>",
            ),
            "kept as plain text, too",
        ),
        (
            plain.replace("resource", "elsewhere"),
            "there is no resource with tasks",
        ),
        (
            plain.replace("project", "else"),
            "plc.xml:2:1: this is not a PLCopen project",
        ),
        (plain.replace("</project>", ""), "this XML cannot be read"),
        (prepared_text(&plain), "this program was prepared before"),
    ] {
        refused(&text, says);
    }
    let both = [source(&plain), source("PROGRAM x")];
    let told = prepare(&both, &Settings::default()).expect_err("two");
    assert!(
        told[0]
            .to_string()
            .starts_with("plc.xml:1:1: this is XML beside other sources; ")
    );
}

#[test]
fn a_program_without_an_interface_gets_one() {
    let text = project().replace("        <interface/>\n", "");
    let made = prepared_text(&text);
    let right =
        "<pou name=\"press\" pouType=\"program\"><!--{tickbus-->\n<interface>\n<externalVars>\n";
    assert!(made.contains(right), "{made}");
}

/// Written from memory of an export of CODESYS: units are extensions of the application, and instances have no type.
const CODESYS: &str = r#"<project xmlns="http://www.plcopen.org/xml/tc6_0200">
<types><dataTypes/><pous/></types>
<instances><configurations><configuration name="Device"><resource name="Application">
<task name="MainTask" interval="PT0.02S" priority="1"><pouInstance name="PLC_PRG" typeName=""/></task>
<addData>
<data name="http://www.3s-software.com/plcopenxml/pou" handleUnknown="implementation"><pou name="PLC_PRG" pouType="program"><interface><localVars><variable name="t"><type><derived name="TON"/></type></variable></localVars></interface><body><ST><xhtml xmlns="http://www.w3.org/1999/xhtml">t(IN := TRUE, PT := T#1s);</xhtml></ST></body></pou></data>
</addData></resource></configuration></configurations></instances>
</project>
"#;

#[test]
fn blocks_stand_beside_the_programs_of_a_project() {
    let made = prepared_text(CODESYS);
    let data = "<data name=\"http://www.3s-software.com/plcopenxml/pou\" handleUnknown=\"implementation\"><pou name=";
    for piece in [
        format!("</pou></data><!--{{tickbus-->{data}\"TICKBUS_TON\""),
        format!("</pou></data>\n{data}\"TICKBUS_SCHEDULER\""),
        format!("</pou></data>\n{data}\"TICKBUS_SCHEDULE\" pouType=\"program\">"),
        "<pouInstance name=\"TICKBUS_SCHEDULE\" typeName=\"\"/>\n  <pouInstance name=\"PLC_PRG\" typeName=\"\"/>".to_owned(),
        "<pous/>".to_owned(),
    ] {
        assert!(made.contains(&piece), "{piece}\n{made}");
    }
    assert_eq!(made.matches("</data>").count(), 4);
}

#[test]
fn references_to_characters_are_read() {
    let text = project().replace(
        "IF 1 ",
        "s := &#39;it (* is&#x27;;&#13;&#10;b := &#34;\u{e4}&#228;&#34; &#60; s; IF 1 ",
    );
    prepared_text(&text);
    for (statements, says) in [
        (
            "t := &#x54;IME();",
            "plc.xml:24:68: this is a reference to an ordinary character; write the character",
        ),
        ("t := TIME&#40;);", "plc.xml:24:72: this is a reference"),
        (
            "s := &#39;open;",
            "plc.xml:24:68: the comment or text that begins here has no end",
        ),
        ("%ID0 := 1;", "plc.xml:24:63: the program uses %ID0 already"),
    ] {
        refused(
            &project().replace("IF 1 ", &format!("{statements} IF 1 ")),
            says,
        );
    }
}

#[test]
fn what_cannot_be_prepared_of_statements_is_told() {
    let plain = project();
    for (text, says) in [
        (
            plain.replace(
                "<interface/>",
                "<interface/><addData><Inheritance><Extends>TON</Extends></Inheritance></addData>",
            ),
            "plc.xml:23:43: this block extends another one; inheritance is not prepared",
        ),
        (
            plain.replace("IF 1 ", "feed(); IF 1 "),
            "plc.xml:24:63: feed is called here, and a task runs it too",
        ),
        (
            plain.replace("IF 1 ", "SysTimeRtc.SysTimeRtcGet(r); IF 1 "),
            "plc.xml:24:74: SysTimeRtcGet() reads the clock",
        ),
        (
            plain.replace("IF 1 ", "Lib.Get(r); IF 1 "),
            "plc.xml:24:63: Lib is not declared",
        ),
        (
            plain.replace("\"press\"", "\"Go\""),
            "plc.xml:22:7: tickbus puts in a variable named Go",
        ),
    ] {
        refused(&text, says);
    }
}

proptest! {
    /// Pieces are removed from the project and inserted elsewhere.
    #[test]
    fn no_damage_to_a_project_makes_it_panic(
        damage in proptest::collection::vec((0_usize..3000, 0_usize..80, 0_usize..3000), 1..4),
    ) {
        let mut text = project();
        for (from, length, to) in damage {
            let boundary = |text: &str, at: usize| {
                (at % (text.len() + 1)..=text.len()).find(|at| text.is_char_boundary(*at)).expect("its end")
            };
            let start = boundary(&text, from);
            let end = boundary(&text, (start + length).min(text.len()));
            let piece: String = text.drain(start..end).collect();
            let at = boundary(&text, to);
            text.insert_str(at, &piece);
        }
        if let Ok(made) = prepared(&text) {
            let bytes = made.files[0].clone();
            prop_assert_eq!(undo(&Source { name: String::new(), bytes }), Ok(text.into_bytes()));
        }
    }
}

/// `TICKBUS_UPDATE=1` rewrites the files.
#[test]
fn our_blocks_as_xml_are_made_from_their_sources() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../plc/iec61131");
    for (name, text) in SOURCES {
        let right = plcopen_xml(name, text);
        let path = folder.join(format!("{name}.xml"));
        if std::env::var_os("TICKBUS_UPDATE").is_some() {
            std::fs::write(&path, &right).expect("it can be written");
        }
        let found = std::fs::read_to_string(&path).unwrap_or_default();
        assert!(
            found == right,
            "{name}.xml is out of date; TICKBUS_UPDATE=1 writes it anew"
        );
        let document = Document::parse(&right).expect("XML");
        let blocks = text
            .lines()
            .filter(|line| line.starts_with("FUNCTION_BLOCK "));
        let units = document
            .descendants()
            .filter(|node| node.has_tag_name(("http://www.plcopen.org/xml/tc6_0200", "pou")));
        let names: Vec<&str> = units.filter_map(|unit| unit.attribute("name")).collect();
        assert!(
            blocks
                .map(|line| &line["FUNCTION_BLOCK ".len()..])
                .eq(names)
        );
    }
}
