use super::*;

const HEAD: &str = "<UANodeSet xmlns=\"http://opcfoundation.org/UA/2011/03/UANodeSet.xsd\">\
    <NamespaceUris><Uri>urn:a</Uri></NamespaceUris>";

/// Loads files of these contents.
fn load(texts: &[&str]) -> Result<NodeSets, Mistake> {
    let folder = tempfile::tempdir().expect("a folder");
    let names: Vec<String> = (1..=texts.len())
        .map(|number| format!("{number}.xml"))
        .collect();
    for (name, text) in names.iter().zip(texts) {
        std::fs::write(folder.path().join(name), text).expect("it is written");
    }
    NodeSets::load(folder.path(), &names)
}

fn check(nodes: &str) -> Result<HashMap<NodeId, Target>, Mistake> {
    let text = format!("{HEAD}\n{nodes}\n</UANodeSet>");
    let found = load(&[&text])?.check(|uri| (uri == "urn:a").then_some(7))?;
    Ok(found.0)
}

#[test]
fn what_is_no_nodeset_is_told_with_its_place() {
    for (text, part) in [
        ("", "1.xml:1:1: "),
        ("<a/>", "begins with <a>"),
        ("<UANodeSet>", "1.xml:1:1"),
        ("<UANodeSet>\n  <b></UANodeSet>", "1.xml:2:6"),
        (
            "<!DOCTYPE a [<!ENTITY b \"cc\">]><UANodeSet>&b;</UANodeSet>",
            "DTD",
        ),
        (
            "<UANodeSet><Models><Model ModelUri=\"urn:a\"><RequiredModel ModelUri=\"urn:di\"/></Model></Models></UANodeSet>",
            "requires the model \"urn:di\"",
        ),
    ] {
        let told = load(&[text]).expect_err(text).to_string();
        assert!(told.contains(part), "\"{part}\" in {told}");
    }
    let missing = NodeSets::load(Path::new("/nowhere"), &["no.xml".to_owned()]);
    let told = missing.expect_err("it is not there").to_string();
    assert!(told.contains("\"no.xml\" cannot be read"), "{told}");
}

#[test]
fn nodes_that_contradict_the_format_are_told_with_their_place() {
    for (node, part) in [
        ("<UAObject BrowseName=\"x\"/>", "2:1: a node has no NodeId"),
        ("<UAObject NodeId=\"x=1\"/>", "\"x=1\" is no node id"),
        ("<UAObject NodeId=\"ns=2;i=1\"/>", "no namespace 2"),
        (
            "<UAObject NodeId=\"ns=1;i=1\" BrowseName=\"9:x\"/>",
            "no namespace 9",
        ),
        (
            "<UAVariable NodeId=\"ns=1;i=1\" DataType=\"Colour\"/>",
            "\"Colour\" is no node id",
        ),
        (
            "<UAVariable NodeId=\"ns=1;i=1\" ValueRank=\"high\"/>",
            "ValueRank \"high\"",
        ),
        (
            "<UAVariable NodeId=\"ns=1;i=1\" ArrayDimensions=\"1,x\"/>",
            "ArrayDimensions",
        ),
        (
            "<UAObjectType NodeId=\"ns=1;i=1\"><References><Reference ReferenceType=\"HasSubtype\">ns=1;i=2</Reference>\
             </References></UAObjectType><UAObjectType NodeId=\"ns=1;i=2\"><References>\
             <Reference ReferenceType=\"HasSubtype\">ns=1;i=1</Reference></References></UAObjectType>",
            "a subtype of its own",
        ),
    ] {
        let told = check(node).expect_err(node).to_string();
        assert!(told.contains(part), "\"{part}\" in {told}");
    }
}

#[test]
fn missing_parents_repeated_nodes_and_foreign_types_do_no_harm() {
    let found = check(
        "<UAVariable NodeId=\"ns=1;i=1\" DataType=\"Double\"><References>\
         <Reference ReferenceType=\"HasComponent\" IsForward=\"false\">ns=1;i=99</Reference>\
         <Reference ReferenceType=\"HasTypeDefinition\">ns=1;i=98</Reference></References>\
         <Value><ExtensionObject><TypeId><Identifier>ns=1;i=97</Identifier></TypeId><Body><Odd/></Body></ExtensionObject>\
         </Value></UAVariable>\
         <UAMethod NodeId=\"ns=1;i=1\"/><UAMethod NodeId=\"ns=1;s=m\"/><UAObject NodeId=\"i=85\"/><Extensions/>",
    );
    let found = found.expect("it is sound");
    assert_eq!(found.len(), 2);
    assert_eq!(
        found[&NodeId::new(7, 1_u32)],
        Target::Variable(NodeId::new(0, 11_u32))
    );
    assert_eq!(found[&NodeId::new(7, "m")], Target::Method);
}
