//! Workbooks as written by TIA Portal, and malicious ones.

use std::fmt::Write as _;
use std::io::{Cursor, Write as _};

use tickbus::import::{ImportOptions, Imported, import};
use zip::ZipWriter;
use zip::write::SimpleFileOptions;

use crate::import::{notes, signals};

/// A zip archive of these parts.
fn zipped(parts: &[(&str, &[u8])]) -> Vec<u8> {
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    for (name, content) in parts {
        zip.start_file(*name, SimpleFileOptions::default())
            .expect("a part");
        zip.write_all(content).expect("its content");
    }
    zip.finish().expect("a zip").into_inner()
}

/// A workbook with these sheets (name and XML) and shared texts.
fn workbook(sheets: &[(&str, String)], shared: &str) -> Vec<u8> {
    let (mut list, mut relations) = (String::new(), String::new());
    for (number, (name, _)) in sheets.iter().enumerate() {
        let id = number + 1;
        write!(
            list,
            "<sheet name=\"{name}\" sheetId=\"{id}\" r:id=\"rId{id}\"/>"
        )
        .unwrap();
        write!(
            relations,
            "<Relationship Id=\"rId{id}\" Target=\"worksheets/sheet{id}.xml\" \
             Type=\"http://schemas.openxmlformats.org/officeDocument/2006/relationships/worksheet\"/>"
        )
        .unwrap();
    }
    let main = "http://schemas.openxmlformats.org/spreadsheetml/2006/main";
    let office = "http://schemas.openxmlformats.org/officeDocument/2006/relationships";
    let package = "http://schemas.openxmlformats.org/package/2006/relationships";
    let mut parts: Vec<(String, String)> = vec![
        (
            "_rels/.rels".to_owned(),
            format!(
                "<Relationships xmlns=\"{package}\"><Relationship Id=\"r\" Type=\"{office}/officeDocument\" Target=\"xl/workbook.xml\"/></Relationships>"
            ),
        ),
        (
            "xl/workbook.xml".to_owned(),
            format!(
                "<workbook xmlns=\"{main}\" xmlns:r=\"{office}\"><sheets>{list}</sheets></workbook>"
            ),
        ),
        (
            "xl/_rels/workbook.xml.rels".to_owned(),
            format!("<Relationships xmlns=\"{package}\">{relations}</Relationships>"),
        ),
        ("xl/sharedStrings.xml".to_owned(), shared.to_owned()),
    ];
    for (number, (_, rows)) in sheets.iter().enumerate() {
        let xml = format!("<worksheet xmlns=\"{main}\"><sheetData>{rows}</sheetData></worksheet>");
        parts.push((format!("xl/worksheets/sheet{}.xml", number + 1), xml));
    }
    let parts: Vec<(&str, &[u8])> = parts
        .iter()
        .map(|(name, text)| (name.as_str(), text.as_bytes()))
        .collect();
    zipped(&parts)
}

/// Rows of text, starting at row `first`.
fn rows(first: usize, table: &[&[&str]]) -> String {
    let mut xml = String::new();
    for (row, cells) in table.iter().enumerate() {
        let row = first + row;
        write!(xml, "<row r=\"{row}\">").unwrap();
        for (column, cell) in (b'A'..).zip(*cells) {
            write!(
                xml,
                "<c r=\"{}{row}\" t=\"inlineStr\"><is><t>{cell}</t></is></c>",
                char::from(column)
            )
            .unwrap();
        }
        xml.push_str("</row>");
    }
    xml
}

const NO_TEXTS: &str = "<sst xmlns=\"http://schemas.openxmlformats.org/spreadsheetml/2006/main\" count=\"0\" uniqueCount=\"0\"></sst>";

const TIA: &[&[&str]] = &[
    &[
        "Name",
        "Path",
        "Data Type",
        "Logical Address",
        "Comment",
        "Hmi Visible",
        "Hmi Accessible",
        "Hmi Writeable",
    ],
    &[
        "Start",
        "Default tag table",
        "Bool",
        "%I0.0",
        "the button",
        "True",
        "True",
        "True",
    ],
    &[
        "Speed",
        "Default tag table",
        "Real",
        "%QD4",
        "",
        "True",
        "True",
        "True",
    ],
    &[
        "Ticks",
        "Default tag table",
        "LInt",
        "%I8.0",
        "",
        "True",
        "True",
        "True",
    ],
];

fn read(bytes: &[u8]) -> Result<Imported, String> {
    import(
        "tags.xlsx",
        bytes,
        ImportOptions::default(),
        &tickbus::KINDS,
    )
    .map_err(|mistakes| mistakes.to_string())
}

#[test]
fn the_workbook_of_tia_portal_is_read_and_its_other_sheets_are_told() {
    let properties: &[&[&str]] = &[&["Path", "BelongsToUnit"], &["Default tag table", ""]];
    let imported = read(&workbook(
        &[
            ("PLC Tags", rows(1, TIA)),
            ("TagTable Properties", rows(1, properties)),
        ],
        NO_TEXTS,
    ))
    .expect("a workbook");
    let names: Vec<String> = signals(&imported)
        .into_iter()
        .map(|(name, address, kind)| format!("{name} {address} {kind}"))
        .collect();
    assert_eq!(
        names,
        ["Start %IX0.0 BOOL", "Speed %QD4 REAL", "Ticks %IL8 LINT"]
    );
    assert_eq!(
        notes(&imported),
        [
            "Start: the button [Default tag table]",
            "Speed:  [Default tag table]",
            "Ticks:  [Default tag table]"
        ]
    );
    let skipped: Vec<&str> = imported
        .skipped
        .iter()
        .map(|m| m.mistake.what.as_str())
        .collect();
    assert_eq!(
        skipped,
        ["sheet \"TagTable Properties\": it has no column of addresses: skipped"]
    );
}

#[test]
fn mistakes_in_a_sheet_have_its_name_row_and_column() {
    let table: &[&[&str]] = &[
        TIA[0],
        &["a", "", "Bool", "%I0.9"],
        &["b", "", "Intt", "%IW2"],
    ];
    let told = read(&workbook(&[("PLC Tags", rows(5, table))], NO_TEXTS)).expect_err("mistakes");
    let lines: Vec<&str> = told.lines().collect();
    assert!(
        lines[0].starts_with("tags.xlsx:6:4: sheet \"PLC Tags\": "),
        "{told}"
    );
    assert!(
        lines[1].starts_with("tags.xlsx:7:3: sheet \"PLC Tags\": \"Intt\" is no type"),
        "{told}"
    );
}

#[test]
fn workbooks_that_lie_are_refused_before_they_take_memory() {
    // A single cell at the far corner.
    let far = "<row r=\"1048576\"><c r=\"XFD1048576\" t=\"inlineStr\"><is><t>x</t></is></c></row>";
    let told = read(&workbook(&[("a", far.to_owned())], NO_TEXTS)).expect_err("too far");
    assert!(told.contains("row 1048576, column 16384"), "{told}");
    // States a huge number of texts.
    let lie = NO_TEXTS.replace("uniqueCount=\"0\"", "uniqueCount = '1000000000000'");
    let told = read(&workbook(&[("a", rows(1, TIA))], &lie)).expect_err("a lie");
    assert!(
        told.contains("says that it has 1000000000000 texts"),
        "{told}"
    );
    // A few hundred kilobytes that unpack to more than 64 MiB.
    let blanks = vec![b' '; 65 << 20];
    let told = read(&zipped(&[("xl/workbook.xml", &blanks)])).expect_err("a bomb");
    assert!(told.contains("unpacks to more than 64 MiB"), "{told}");
}

#[test]
fn what_is_no_workbook_is_told() {
    for bytes in [
        &b"PK\x03\x04rest"[..],
        b"\xD0\xCF\x11\xE0old",
        &zipped(&[("a", b"b")]),
    ] {
        let told = read(bytes).expect_err("no workbook");
        assert!(told.contains("workbook"), "{told}");
    }
    let mut cut = workbook(&[("PLC Tags", rows(1, TIA))], NO_TEXTS);
    cut.truncate(cut.len() / 2);
    assert!(read(&cut).is_err());
}
