//! Results in the XML format of `JUnit`, which all CI servers read: the elements and attributes that the schema of
//! Jenkins' xUnit plug-in knows, and no others, since that plug-in refuses a report with others.

use std::fmt::Write as _;
use std::time::Duration;

/// One test file's results.
#[derive(Clone, Debug)]
pub struct Group {
    /// The file.
    pub name: String,
    /// The tests of the file.
    pub cases: Vec<Case>,
}

/// One test's result.
#[derive(Clone, Debug)]
pub struct Case {
    /// The test's name.
    pub name: String,
    /// The line of the file at which the test begins.
    pub line: usize,
    /// The duration of the test, in wall time.
    pub took: Duration,
    /// The result of the test.
    pub verdict: Verdict,
    /// Further information for the report's output.
    pub output: String,
}

/// The result of one test.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// The test passed.
    Passed,
    /// An expectation failed: the failure as one line, and in full.
    Failed(String, String),
    /// The test could not be run: the reason as one line, and in full.
    Wrong(String, String),
}

/// Writes the results as a document.
pub fn junit_xml(groups: &[Group]) -> String {
    let mut text = String::from("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n");
    let all = || groups.iter().flat_map(|group| &group.cases);
    let _ = writeln!(text, "<testsuites name=\"tickbus test\"{}>", totals(all()));
    for group in groups {
        let name = escaped(&group.name);
        let totals = totals(group.cases.iter());
        let _ = writeln!(
            text,
            "  <testsuite name=\"{name}\" file=\"{name}\"{totals}>"
        );
        for case in &group.cases {
            write_case(&mut text, &name, case);
        }
        text.push_str("  </testsuite>\n");
    }
    text.push_str("</testsuites>\n");
    text
}

fn totals<'c>(cases: impl Iterator<Item = &'c Case>) -> String {
    let (mut tests, mut failures, mut errors, mut took) = (0, 0, 0, Duration::ZERO);
    for case in cases {
        tests += 1;
        failures += u32::from(matches!(case.verdict, Verdict::Failed(..)));
        errors += u32::from(matches!(case.verdict, Verdict::Wrong(..)));
        took += case.took;
    }
    format!(
        " tests=\"{tests}\" failures=\"{failures}\" errors=\"{errors}\" time=\"{:.3}\"",
        took.as_secs_f64()
    )
}

/// Writes one test; `file` is escaped already. Writing to a string cannot fail.
fn write_case(text: &mut String, file: &str, case: &Case) {
    let _ = writeln!(
        text,
        "    <testcase name=\"{}\" classname=\"{file}\" time=\"{:.3}\">",
        escaped(&case.name),
        case.took.as_secs_f64()
    );
    let (element, kind, short, full) = match &case.verdict {
        Verdict::Passed => ("", "", "", ""),
        Verdict::Failed(short, full) => ("failure", "expectation", short.as_str(), full.as_str()),
        Verdict::Wrong(short, full) => ("error", "input", short.as_str(), full.as_str()),
    };
    if !element.is_empty() {
        let _ = writeln!(
            text,
            "      <{element} type=\"{kind}\" message=\"{}\">{}</{element}>",
            escaped(short),
            escaped(full)
        );
    }
    if !case.output.is_empty() {
        let _ = writeln!(
            text,
            "      <system-out>{}</system-out>",
            escaped(&case.output)
        );
    }
    text.push_str("    </testcase>\n");
}

/// Text escaped for an element or an attribute. Characters that XML does not allow become the replacement
/// character.
fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            // An XML reader would turn these into blanks in an attribute.
            '\n' | '\t' | '\r' => {
                let _ = write!(out, "&#{};", u32::from(c));
            }
            '\u{0}'..='\u{1f}' | '\u{fffe}' | '\u{ffff}' => out.push('\u{fffd}'),
            c => out.push(c),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn case(name: &str, verdict: Verdict) -> Case {
        Case {
            name: name.to_owned(),
            line: 3,
            took: Duration::from_millis(12),
            verdict,
            output: String::new(),
        }
    }

    #[test]
    fn results_are_counted_and_told() {
        let groups = [Group {
            name: "tests/a.toml".to_owned(),
            cases: vec![
                case("one", Verdict::Passed),
                case(
                    "two",
                    Verdict::Failed("short".into(), "short\n  long".into()),
                ),
                case("three", Verdict::Wrong("what".into(), "what".into())),
            ],
        }];
        let text = junit_xml(&groups);
        assert_eq!(
            text,
            "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
             <testsuites name=\"tickbus test\" tests=\"3\" failures=\"1\" errors=\"1\" time=\"0.036\">\n  \
               <testsuite name=\"tests/a.toml\" file=\"tests/a.toml\" tests=\"3\" failures=\"1\" errors=\"1\" time=\"0.036\">\n    \
                 <testcase name=\"one\" classname=\"tests/a.toml\" time=\"0.012\">\n    \
                 </testcase>\n    \
                 <testcase name=\"two\" classname=\"tests/a.toml\" time=\"0.012\">\n      \
                   <failure type=\"expectation\" message=\"short\">short&#10;  long</failure>\n    \
                 </testcase>\n    \
                 <testcase name=\"three\" classname=\"tests/a.toml\" time=\"0.012\">\n      \
                   <error type=\"input\" message=\"what\">what</error>\n    \
                 </testcase>\n  \
               </testsuite>\n\
             </testsuites>\n"
        );
    }

    #[test]
    fn no_text_breaks_the_document() {
        assert_eq!(
            escaped("\"a\" <b> & 'c'\n]]>\u{0}\u{1b}ö±\u{ffff}"),
            "&quot;a&quot; &lt;b&gt; &amp; 'c'&#10;]]&gt;\u{fffd}\u{fffd}ö±\u{fffd}"
        );
    }
}
