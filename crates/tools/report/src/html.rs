//! Text for HTML and JSON, and numbers formatted for people.

use std::fmt;

use maud::Markup;
use tickbus_base::time::Nanos;

/// The text of `markup`. Control characters are not permitted in HTML, not even escaped.
pub(super) fn printable(markup: Markup) -> String {
    let is_control = |c: char| c.is_control() && !matches!(c, '\n' | '\t');
    markup.into_string().replace(is_control, "\u{fffd}")
}

/// Writes a text as JSON that is safe within a script element.
pub(super) struct Json<'a>(pub(super) &'a str);

impl fmt::Display for Json<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("\"")?;
        for c in self.0.chars() {
            match c {
                '"' => f.write_str("\\\"")?,
                '\\' => f.write_str("\\\\")?,
                // "</script" and "<!--" would end or change the element.
                '<' | '>' | '&' | '\u{2028}' | '\u{2029}' => write!(f, "\\u{:04x}", u32::from(c))?,
                c if c.is_control() => write!(f, "\\u{:04x}", u32::from(c))?,
                c => fmt::Write::write_char(f, c)?,
            }
        }
        f.write_str("\"")
    }
}

/// An integer with thousands separators: 1,234,567.
pub(super) fn count(number: u64) -> String {
    let digits = number.to_string();
    let mut text = String::with_capacity(digits.len() * 4 / 3);
    for (at, digit) in digits.char_indices() {
        if at > 0 && (digits.len() - at).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

/// A count and its noun, in singular or plural.
pub(super) fn counted(number: u64, one: &str, many: &str) -> String {
    format!("{} {}", count(number), if number == 1 { one } else { many })
}

/// A time in seconds, down to the nanosecond, with at least three decimals and no further trailing zeros.
pub(super) fn seconds(time: Nanos) -> String {
    let sign = if time.0 < 0 { "−" } else { "" };
    let size = time.0.unsigned_abs();
    let decimals = format!("{:09}", size % 1_000_000_000);
    let decimals = decimals.trim_end_matches('0');
    format!("{sign}{}.{decimals:0<3} s", count(size / 1_000_000_000))
}

/// A span in a suitable unit, in at most four digits.
pub(super) fn span(time: Nanos) -> String {
    let size = time.0.unsigned_abs();
    let (unit, name) = match size {
        0..1_000 => (1_i64, "ns"),
        1_000..1_000_000 => (1_000, "µs"),
        1_000_000..1_000_000_000 => (1_000_000, "ms"),
        1_000_000_000..120_000_000_000 => (1_000_000_000, "s"),
        120_000_000_000..7_200_000_000_000 => (60_000_000_000, "min"),
        _ => (3_600_000_000_000, "h"),
    };
    format!(
        "{} {name}",
        digits(time.as_micros() * 1e3 / Nanos(unit).as_micros() / 1e3)
    )
}

/// A number in at most four significant digits, or as many as its integer part has.
pub(super) fn digits(number: f64) -> String {
    let whole = number.abs().max(1.0).log10().floor();
    let decimals = (3.0 - whole).clamp(0.0, 3.0);
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "0 to 3"
    )]
    let text = format!("{number:.*}", decimals as usize);
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use maud::html;

    #[test]
    fn texts_stand_for_themselves() {
        let text = "<b> & \"x\" 'y' \u{7}é\n";
        assert_eq!(
            printable(html! { (text) }),
            "&lt;b&gt; &amp; &quot;x&quot; 'y' \u{fffd}é\n"
        );
        let script = "</script><!-- \"\\ \u{1}\u{2028}é";
        assert_eq!(
            Json(script).to_string(),
            r#""\u003c/script\u003e\u003c!-- \"\\ \u0001\u2028é""#
        );
    }

    #[test]
    fn numbers_are_for_people() {
        assert_eq!(
            [0, 999, 1000, 1_234_567].map(count),
            ["0", "999", "1,000", "1,234,567"]
        );
        for (nanos, text) in [
            (0, "0.000 s"),
            (1_500_000_000, "1.500 s"),
            (-1, "−0.000000001 s"),
            (3_600_000_000_000, "3,600.000 s"),
        ] {
            assert_eq!(seconds(Nanos(nanos)), text);
        }
        for (nanos, text) in [
            (0, "0 ns"),
            (1_000_000, "1 ms"),
            (1_234_567, "1.235 ms"),
            (123_456_789, "123.5 ms"),
            (90_000_000_000, "90 s"),
            (3_600_000_000_000, "60 min"),
            (-2_500, "-2.5 µs"),
        ] {
            assert_eq!(span(Nanos(nanos)), text);
        }
        assert_eq!(
            [0.25, 12.0, 12_345.6, 0.0].map(digits),
            ["0.25", "12", "12346", "0"]
        );
    }
}
