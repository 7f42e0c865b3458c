//! PLCopen XML and L5X.

use tickbus::import::{ImportOptions, Imported, import};

use crate::import::{notes, signals};

fn read(file: &str, text: &str) -> Imported {
    import(
        file,
        text.as_bytes(),
        ImportOptions::default(),
        &tickbus::KINDS,
    )
    .unwrap_or_else(|mistakes| panic!("{mistakes}"))
}

fn told(text: &str) -> String {
    let wrong = import(
        "plant.xml",
        text.as_bytes(),
        ImportOptions::default(),
        &tickbus::KINDS,
    )
    .expect_err("mistakes");
    wrong.to_string()
}

const PLCOPEN: &str = r#"<?xml version="1.0" encoding="utf-8"?>
<project xmlns="http://www.plcopen.org/xml/tc6_0200">
  <types><pous><pou name="Main" pouType="program"><interface><localVars>
    <variable name="Step"><type><INT/></type></variable>
  </localVars></interface></pou></pous></types>
  <instances><configurations><configuration name="c"><resource name="r">
    <globalVars name="IO">
      <variable name="Start" address="%IX0.0"><type><BOOL/></type>
        <documentation><xhtml xmlns="http://www.w3.org/1999/xhtml">the green &amp; big
           button</xhtml></documentation></variable>
      <variable name="Level" address="%IW2"><type><INT/></type></variable>
      <variable name="Speed" address="%QD4"><type><REAL/></type></variable>
      <variable name="Flag" address="%MX0.0"><type><BOOL/></type></variable>
      <variable name="Later" address="%I*"><type><BOOL/></type></variable>
    </globalVars>
  </resource></configuration></configurations></instances>
</project>
"#;

#[test]
fn variables_of_plcopen_xml_with_an_address_become_signals_and_the_others_are_told() {
    let imported = read("plant.xml", PLCOPEN);
    let names: Vec<_> = signals(&imported)
        .into_iter()
        .map(|(name, address, kind)| format!("{name} {address} {kind}"))
        .collect();
    assert_eq!(
        names,
        [
            "Start %IX0.0 BOOL",
            "Level %IW2 INT",
            "Speed %QD4 REAL",
            "Later %IX8.0 BOOL"
        ]
    );
    assert!(
        imported.text.contains("\"%IX8.0\"   # %I*"),
        "{}",
        imported.text
    );
    assert_eq!(imported.assigned, 1);
    assert_eq!(
        notes(&imported)[..2],
        ["Start: the green & big button [IO]", "Level:  [IO]"]
    );
    let skipped: Vec<String> = imported
        .skipped
        .iter()
        .map(|m| format!("{:?} {}", m.place.unwrap(), m.mistake.what))
        .collect();
    assert_eq!(
        skipped,
        [
            "(4, 5) 1 variables without an address, \"Step\" the first, are no inputs or outputs: skipped",
            "(13, 38) \"%MX0.0\" is a marker, no part of the process image: skipped",
        ]
    );
}

#[test]
fn addresses_that_count_elements_are_asked_for_when_they_overlap_as_bytes() {
    let text = PLCOPEN
        .replace("%IW2", "%IW1")
        .replace("%IX0.0", "%IW0")
        .replace(
            "<BOOL/></type>\n        <doc",
            "<INT/></type>\n        <doc",
        );
    let told = told(&text);
    assert!(told.starts_with("plant.xml:11:"), "{told}");
    assert!(told.contains("add --iec"), "{told}");
}

const L5X: &str = r#"<?xml version="1.0" encoding="UTF-8" standalone="yes"?>
<RSLogix5000Content SchemaRevision="1.0" TargetName="Cell" TargetType="Controller">
<Controller Use="Target" Name="Cell">
<Modules>
<Module Name="AI" ParentModule="Local"><Ports><Port Id="1" Address="3" Type="ICP" Upstream="true"/></Ports>
<Communications><Connections><Connection><InputTag><Data Format="Decorated"><Structure DataType="AB:1756_IF8:I:0">
<DataValueMember Name="Ch0Data" DataType="REAL"/></Structure></Data></InputTag></Connection></Connections></Communications>
</Module>
</Modules>
<Tags>
<Tag Name="Start_PB" TagType="Alias" Radix="Decimal" AliasFor="Local:1:I.Data.0"><Description><![CDATA[the green
button]]></Description></Tag>
<Tag Name="Motor" TagType="Alias" DataType="BOOL" AliasFor="Local:2:O.Data.3"/>
<Tag Name="Level" TagType="Alias" AliasFor="Local:3:I.Ch0Data"/>
<Tag Name="Unknown" TagType="Alias" AliasFor="Local:4:I.Ch0Data"/>
<Tag Name="Counter" TagType="Base" DataType="DINT"/>
</Tags>
</Controller></RSLogix5000Content>
"#;

#[test]
fn aliases_of_module_points_in_l5x_become_signals_laid_out_without_gaps() {
    let imported = read("cell.L5X", L5X);
    let names: Vec<_> = signals(&imported)
        .into_iter()
        .map(|(name, address, kind)| format!("{name} {address} {kind}"))
        .collect();
    assert_eq!(
        names,
        [
            "Start_PB %IX4.0 BOOL",
            "Motor %QX0.0 BOOL",
            "Level %ID0 REAL"
        ]
    );
    assert!(
        imported.text.contains("   # Local:1:I.Data.0\n"),
        "{}",
        imported.text
    );
    assert_eq!(notes(&imported), ["Start_PB: the green button []"]);
    let skipped: Vec<&str> = imported
        .skipped
        .iter()
        .map(|m| m.mistake.what.as_str())
        .collect();
    assert_eq!(
        skipped,
        [
            "the type of \"Local:4:I.Ch0Data\" stands nowhere in the file: skipped",
            "1 tags that are no aliases of a module's inputs or outputs, \"Counter\" the first: skipped",
        ]
    );
}

#[test]
fn broken_foreign_and_malicious_xml_is_refused_with_its_place() {
    let broken = told("<project>\n  <variable name=\"a\"\n</project>");
    assert!(
        broken.starts_with("plant.xml:") && broken.contains("cannot be read"),
        "{broken}"
    );
    assert!(told("<Document/>").contains("the root element \"Document\""));
    let laughs = "<?xml version=\"1.0\"?><!DOCTYPE p [<!ENTITY a \"aaaa\"><!ENTITY b \"&a;&a;&a;&a;\">]><project>&b;</project>";
    assert!(told(laughs).contains("cannot be read"), "{}", told(laughs));
    // Nested more deeply than any stack allows.
    let deep = format!(
        "<project>{}{}</project>",
        "<a>".repeat(200_000),
        "</a>".repeat(200_000)
    );
    assert!(!told(&deep).is_empty());
}

#[test]
fn local_variables_of_one_name_get_that_of_their_program_in_front() {
    let pou = |name: &str, address: &str| {
        format!(
            "<pou name=\"{name}\" pouType=\"program\"><interface><localVars><variable name=\"Start\" address=\"{address}\">\
             <type><BOOL/></type></variable></localVars></interface></pou>"
        )
    };
    let text = format!(
        "<project><types><pous>{}{}</pous></types></project>",
        pou("Left", "%IX0.0"),
        pou("Right", "%IX0.1")
    );
    let names = |imported: &Imported| {
        let signals = signals(imported).into_iter();
        signals.map(|(name, ..)| name).collect::<Vec<_>>()
    };
    assert_eq!(names(&read("plant.xml", &text)), ["Start", "Right.Start"]);

    let program = |name: &str, point: usize| {
        format!(
            "<Program Name=\"{name}\"><Tags><Tag Name=\"Start\" TagType=\"Alias\" AliasFor=\"Local:1:I.Data.{point}\"/></Tags></Program>"
        )
    };
    let text = format!(
        "<RSLogix5000Content><Controller><Programs>{}{}</Programs></Controller></RSLogix5000Content>",
        program("Left", 0),
        program("Right", 1)
    );
    let imported = read("cell.L5X", &text);
    assert_eq!(names(&imported), ["Start", "Right.Start"]);
    assert_eq!(
        notes(&imported),
        ["Start:  [Left]", "Right.Start:  [Right]"]
    );
}

#[test]
fn modules_whose_names_begin_with_i_have_outputs_all_the_same() {
    let text = "<RSLogix5000Content><Controller><Tags>\
                <Tag Name=\"a\" TagType=\"Alias\" DataType=\"BOOL\" AliasFor=\"Rack:Inlet:O.Data.0\"/>\
                <Tag Name=\"b\" TagType=\"Alias\" DataType=\"BOOL\" AliasFor=\"Rack:Outlet:I1[2].0\"/>\
                <Tag Name=\"c\" TagType=\"Alias\" DataType=\"BOOL\" AliasFor=\"Rack:Inlet.Data.0\"/>\
                </Tags></Controller></RSLogix5000Content>";
    let imported = read("cell.L5X", text);
    let found: Vec<_> = signals(&imported)
        .into_iter()
        .map(|(name, address, _)| format!("{name} {address}"))
        .collect();
    assert_eq!(found, ["a %QX0.0", "b %IX0.0"]);
    assert!(imported.skipped[0].mistake.what.contains("\"c\" the first"));
}
