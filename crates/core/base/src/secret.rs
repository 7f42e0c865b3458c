//! Comparing secrets.

/// True if `given` is the secret `right`. The duration of the comparison does not reveal how much of `given` is right, only
/// whether its length is.
pub fn is_same_secret(given: &[u8], right: &[u8]) -> bool {
    let pairs = given.iter().zip(right);
    let differences = pairs.fold(0, |all, (one, other)| all | (one ^ other));
    given.len() == right.len() && std::hint::black_box(differences) == 0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_whole_secret_is_the_same() {
        for (given, is_same) in [
            ("secret", true),
            ("secreT", false),
            ("Secret", false),
            ("secre", false),
            ("secrets", false),
            ("", false),
        ] {
            assert_eq!(
                is_same_secret(given.as_bytes(), b"secret"),
                is_same,
                "{given}"
            );
        }
    }
}
