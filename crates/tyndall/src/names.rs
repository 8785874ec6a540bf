//! Which name was meant: the nearest of a list, for the errors about names that do not exist.

/// The candidate most like `wanted`, if any is like it: equal but for case and signs, holding it or held by it, or a few typing
/// errors away.
pub fn nearest<'a>(wanted: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let plain = |name: &str| -> String {
        name.chars().filter(|letter| letter.is_alphanumeric()).flat_map(char::to_lowercase).collect()
    };
    let wanted = plain(wanted);
    let length = wanted.chars().count();
    let cost = |name: &str| {
        let errors = typing_errors(&wanted, name);
        // A part of the name, of two letters at least, is nearer than any typing error.
        let part = length >= 2 && name.len() >= 2 && (name.contains(&wanted) || wanted.contains(name));
        if part { Some((0, errors)) } else { (errors <= 1 + length / 4).then_some((1, errors)) }
    };
    let ranked = candidates.into_iter().filter_map(|name| Some((cost(&plain(name))?, name)));
    ranked.min_by_key(|(cost, _)| *cost).map(|(_, name)| name)
}

/// Letters to insert, remove or replace to make `a` of `b` (Levenshtein 1966).
fn typing_errors(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (above, letter) in a.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = above + 1;
        for (column, other) in b.iter().enumerate() {
            let replaced = diagonal + usize::from(letter != *other);
            diagonal = row[column + 1];
            row[column + 1] = replaced.min(diagonal + 1).min(row[column] + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_meant_name_is_found() {
        let names = ["Temperatures", "InternalEnergies", "Densities", "c_pe", "vx"];
        for (typed, meant) in [
            ("temp", Some("Temperatures")),
            ("densites", Some("Densities")),
            ("C-PE", Some("c_pe")),
            ("q", None),
        ] {
            assert_eq!(nearest(typed, names), meant, "{typed}");
        }
        assert_eq!(nearest("x", []), None);
    }

    #[test]
    fn typing_errors_are_counted() {
        for (a, b, count) in [("", "abc", 3), ("kitten", "sitting", 3), ("same", "same", 0), ("ab", "ba", 2)]
        {
            assert_eq!(typing_errors(a, b), count, "{a} {b}");
        }
    }
}
