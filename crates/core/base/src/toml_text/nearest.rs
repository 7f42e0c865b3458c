//! The right name nearest to a wrong one.

/// Longer words are not compared: no known name is this long, and the comparison takes quadratic time.
const LONGEST: usize = 64;

/// The candidate most similar to `word`, ignoring case; `None` if no candidate is similar enough.
pub fn nearest<'c>(word: &str, candidates: impl IntoIterator<Item = &'c str>) -> Option<&'c str> {
    let word = word.trim().to_lowercase();
    let length = word.chars().take(LONGEST + 1).count();
    if length == 0 || length > LONGEST {
        return None;
    }
    candidates
        .into_iter()
        .filter(|candidate| candidate.len() <= 4 * LONGEST)
        .filter_map(|candidate| {
            let other = candidate.chars().count();
            let limit = length.max(other).div_ceil(3).min(length.max(other) - 1);
            // The difference in length is a lower bound of the distance, and cheap.
            let near = length.abs_diff(other) <= limit;
            let distance = || strsim::damerau_levenshtein(&word, &candidate.to_lowercase());
            near.then(distance)
                .filter(|distance| *distance <= limit)
                .map(|d| (d, candidate))
        })
        .min_by_key(|(distance, _)| *distance)
        .map(|(_, candidate)| candidate)
}

/// The suggestion for `word`: the nearest candidate, or those that start like it, else all of them; `kinds` is their
/// collective name.
pub fn did_you_mean(word: &str, kinds: &str, candidates: &[&str]) -> String {
    if let Some(near) = nearest(word, candidates.iter().copied()) {
        return format!("did you mean \"{near}\"?");
    }
    let begins = word.trim().to_lowercase();
    let alike =
        |candidate: &&&str| begins.len() > 1 && candidate.to_lowercase().starts_with(&begins);
    let near: Vec<String> = candidates
        .iter()
        .filter(alike)
        .map(|c| format!("\"{c}\""))
        .collect();
    if candidates.is_empty() {
        format!("there are no {kinds} yet; add one first")
    } else if near.is_empty() {
        format!("{kinds} are {}", candidates.join(", "))
    } else {
        format!("did you mean {}?", near.join(" or "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slips_find_their_name() {
        let keys = ["name", "address", "type", "latch", "fail_safe"];
        for (wrong, right) in [
            ("adress", Some("address")),
            ("Latch", Some("latch")),
            ("failsafe", Some("fail_safe")),
            ("tpye", Some("type")),
            ("colour", None),
            ("x", None),
            ("", None),
        ] {
            assert_eq!(nearest(wrong, keys), right, "{wrong}");
        }
        assert_eq!(nearest(&"a".repeat(1_000_000), keys), None);
        assert_eq!(
            did_you_mean("x", "signals", &[]),
            "there are no signals yet; add one first"
        );
    }
}
