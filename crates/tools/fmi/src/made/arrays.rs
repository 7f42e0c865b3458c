//! Signals that are the elements of an array: one variable of FMI 3.0.

use std::collections::{BTreeMap, BTreeSet};

/// An array of signals.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Array {
    /// The name: that of its elements without their indices.
    pub name: String,
    /// The slots of the elements; the last index changes first.
    pub slots: Vec<usize>,
    /// The number of elements in each dimension.
    pub sizes: Vec<usize>,
}

/// The elements that have the same name before their indices.
struct Elements<K> {
    kind: K,
    /// False once an element does not fit the others.
    fits: bool,
    /// The slots by their indices.
    slots: BTreeMap<Vec<u64>, usize>,
}

/// Finds the arrays among the signals, which are in the order of their slots: each has a name, and a `kind` that all
/// elements of an array have in common. A name in `taken` is not the name of an array.
///
/// An array has at least two elements, and one at every index between the lowest and the highest.
pub(super) fn find<'a, K: PartialEq>(
    signals: impl Iterator<Item = (&'a str, K)>,
    taken: &BTreeSet<&str>,
) -> Vec<Array> {
    let mut found: BTreeMap<&str, Elements<(K, bool)>> = BTreeMap::new();
    for (slot, (name, kind)) in signals.enumerate() {
        let Some((name, indices, is_nested)) = split(name) else {
            continue;
        };
        let kind = (kind, is_nested);
        let Some(elements) = found.get_mut(name) else {
            let elements = Elements {
                kind,
                fits: !taken.contains(name),
                slots: BTreeMap::from([(indices, slot)]),
            };
            found.insert(name, elements);
            continue;
        };
        let mut others = elements.slots.keys();
        elements.fits &= elements.kind == kind
            && others.all(|other| other.len() == indices.len())
            && !elements.slots.contains_key(&indices);
        elements.slots.insert(indices, slot);
    }
    let arrays = found.into_iter();
    let arrays = arrays.filter(|(_, elements)| elements.fits && elements.slots.len() > 1);
    arrays
        .filter_map(|(name, elements)| {
            Some(Array {
                name: name.to_owned(),
                sizes: sizes(&elements.slots)?,
                slots: elements.slots.into_values().collect(),
            })
        })
        .collect()
}

/// Splits the name of an element into the name of its array and its indices: `x[3]`, `x[2,3]` or `x[2][3]`. Returns
/// true for the last form.
fn split(name: &str) -> Option<(&str, Vec<u64>, bool)> {
    let (mut rest, mut brackets) = (name, Vec::new());
    while let Some(inner) = rest.strip_suffix(']') {
        let open = inner.rfind('[')?;
        brackets.push(&inner[open + 1..]);
        rest = &inner[..open];
    }
    rest = rest.trim_end();
    if rest.is_empty() || brackets.is_empty() {
        return None;
    }
    let is_nested = brackets.len() > 1;
    let texts = brackets.into_iter().rev().flat_map(|text| text.split(','));
    let indices = texts.map(|text| {
        let index: u64 = text.parse().ok()?;
        // Not "+1" or "01", which would be a second name of the same element.
        (index.to_string() == text).then_some(index)
    });
    Some((rest, indices.collect::<Option<_>>()?, is_nested))
}

/// Returns the number of elements in each dimension, if none is missing.
fn sizes(slots: &BTreeMap<Vec<u64>, usize>) -> Option<Vec<usize>> {
    let dimensions = slots.keys().next()?.len();
    let sizes = (0..dimensions).map(|dimension| {
        let indices = slots.keys().map(|indices| indices[dimension]);
        let (least, most) = (indices.clone().min()?, indices.max()?);
        usize::try_from((most - least).checked_add(1)?).ok()
    });
    let sizes: Vec<usize> = sizes.collect::<Option<_>>()?;
    let count = sizes
        .iter()
        .try_fold(1_usize, |count, size| count.checked_mul(*size))?;
    (count == slots.len()).then_some(sizes)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The names, slots and sizes of the arrays among these names.
    fn found(names: &[&str]) -> Vec<(String, Vec<usize>, Vec<usize>)> {
        let taken = names.iter().copied().chain(["time"]).collect();
        let signals = names.iter().map(|name| (*name, ()));
        let arrays = find(signals, &taken);
        let parts = |array: Array| (array.name, array.slots, array.sizes);
        arrays.into_iter().map(parts).collect()
    }

    #[test]
    fn elements_in_any_order_are_an_array_in_the_order_of_their_indices() {
        let whole = found(&["a[2]", "x", "a[0]", "a[1]"]);
        assert_eq!(whole, [("a".to_owned(), vec![2, 3, 0], vec![3])]);
        let plane = found(&["a[1,1]", "a[1,2]", "a[1,3]", "a[2,1]", "a[2,2]", "a[2,3]"]);
        let slots = vec![0, 1, 2, 3, 4, 5];
        assert_eq!(plane, [("a".to_owned(), slots, vec![2, 3])]);
        let spaced = found(&["a [1]", "a [2]"]);
        assert_eq!(spaced, [("a".to_owned(), vec![0, 1], vec![2])]);
        let nested = found(&["a.b[0][10]", "a.b[0][9]"]);
        assert_eq!(nested, [("a.b".to_owned(), vec![1, 0], vec![1, 2])]);
        let tens: Vec<String> = (1..=11).map(|index| format!("a[{index}]")).collect();
        let tens: Vec<&str> = tens.iter().map(String::as_str).collect();
        assert_eq!(found(&tens)[0].1, (0..11).collect::<Vec<_>>());
    }

    #[test]
    fn signals_that_are_no_whole_array_stay_apart() {
        for names in [
            &["a[1]"][..],
            &["a[1]", "a[3]"],
            &["a[1]", "a[01]"],
            &["a[1]", "a [1]"],
            &["a[1]", "a[+2]"],
            &["a[1]", "a[2,1]"],
            &["a[1,1]", "a[1][2]"],
            &["a[1,1]", "a[2,2]"],
            &["a[0]", "a[18446744073709551615]"],
            &["a[1]", "a[2]", "a"],
            &["time[1]", "time[2]"],
            &["[1]", "[2]"],
            &["a[x]", "a[]", "a]", "a[1].x", "a[2].x"],
        ] {
            assert_eq!(found(names), [], "{names:?}");
        }
    }

    #[test]
    fn elements_of_different_kinds_are_no_array() {
        let taken = BTreeSet::new();
        let signals = [("a[1]", 'r'), ("a[2]", 'i'), ("b[1]", 'r'), ("b[2]", 'r')];
        let arrays = find(signals.into_iter(), &taken);
        let names: Vec<String> = arrays.into_iter().map(|array| array.name).collect();
        assert_eq!(names, ["b"]);
    }
}
