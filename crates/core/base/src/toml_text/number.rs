//! Formatting of numbers for people.

/// A number in at most seven significant digits.
pub fn short_number(number: f64) -> String {
    let rounded: f64 = format!("{number:.6e}").parse().unwrap_or(number);
    let size = rounded.abs();
    if size == 0.0 || !size.is_finite() || (1e-4..1e15).contains(&size) {
        rounded.to_string()
    } else {
        format!("{rounded:e}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        for (number, text) in [
            (0.0, "0"),
            (250.0, "250"),
            (-296.296_296_296, "-296.2963"),
            (250.0 / 27_648.0, "0.009042245"),
            (f64::from(f32::MAX), "3.402823e38"),
            (1e-9, "1e-9"),
            (f64::INFINITY, "inf"),
        ] {
            assert_eq!(short_number(number), text);
        }
    }
}
