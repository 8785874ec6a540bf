//! Bonds that PDBx/mmCIF tells atom by atom: the category `_struct_conn` of links between residues.

use std::collections::HashMap;

use tyndall::Attribute;
use tyndall::particles::Values;

/// Kinds of links that are bonds, by the first letters of `conn_type_id`; hydrogen bonds and salt bridges are none.
const BONDS: [&str; 3] = ["covale", "disulf", "metalc"];
/// Symmetries that leave an atom where it is.
const IN_PLACE: [&str; 3] = ["1_555", "", "."];

/// An atom as a link names it. Empty words are not told.
#[derive(Debug, PartialEq)]
pub(super) struct Partner {
    asym: String,
    /// The number of the residue by its author.
    residue: i64,
    atom: String,
    altloc: String,
}

/// The links that are bonds between atoms as they stand in the file; `value` gives an item of the category in a row, if it is told.
pub(super) fn links<'a>(rows: usize, value: impl Fn(&str, usize) -> Option<&'a str>) -> Vec<[Partner; 2]> {
    let word = |item: &str, row| value(item, row).filter(|it| *it != "?").unwrap_or_default();
    let partner = |number: u8, row: usize| {
        let item = |name: &str| word(&format!("ptnr{number}_{name}"), row);
        let residue = [item("auth_seq_id"), item("label_seq_id")].iter().find_map(|it| it.parse().ok())?;
        if !IN_PLACE.contains(&item("symmetry")) {
            return None;
        }
        let altloc = word(&format!("pdbx_ptnr{number}_label_alt_id"), row);
        let altloc = if altloc == "." { "" } else { altloc };
        Some(Partner {
            asym: item("label_asym_id").into(),
            residue,
            atom: item("label_atom_id").into(),
            altloc: altloc.into(),
        })
    };
    let is_bond = |row: &usize| BONDS.iter().any(|kind| word("conn_type_id", *row).starts_with(kind));
    (0..rows).filter(is_bond).filter_map(|row| Some([partner(1, row)?, partner(2, row)?])).collect()
}

/// The pairs of atoms that links name, by the atoms' attributes; links whose atoms are not there are left out.
pub(super) fn bonds(links: &[[Partner; 2]], attributes: &[Attribute]) -> Vec<[u32; 2]> {
    let named = |name: &str| attributes.iter().find(|it| it.name == name);
    let words = |name: &str| match &named(name)?.values {
        Values::Text { codes, names } => Some((codes, names)),
        _ => None,
    };
    let (Some((asyms, asym_names)), Some((atoms, atom_names)), Some(residues)) =
        (words("asym"), words("name"), named("resid"))
    else {
        return Vec::new();
    };
    let altlocs = words("altloc");
    // What is looked for: chain, residue, atom, and the place where it is told.
    let code = |names: &[String], word: &str| names.iter().position(|it| it == word).map(|it| it as u32);
    let mut wanted: HashMap<_, Vec<(&str, usize)>> = HashMap::new();
    for (place, partner) in links.iter().flatten().enumerate() {
        if let Some((asym, atom)) = code(asym_names, &partner.asym).zip(code(atom_names, &partner.atom)) {
            wanted.entry((asym, partner.residue, atom)).or_default().push((&partner.altloc, place));
        }
    }
    let mut found = vec![None; 2 * links.len()];
    for (id, (&asym, &atom)) in asyms.iter().zip(atoms).enumerate() {
        let residue = residues.number(id, 0) as i64;
        for &(altloc, place) in wanted.get(&(asym, residue, atom)).into_iter().flatten() {
            let here = altlocs.map_or("", |(codes, names)| names[codes[id] as usize].as_str());
            if found[place].is_none() && (altloc.is_empty() || altloc == here) {
                found[place] = Some(id as u32);
            }
        }
    }
    found
        .chunks_exact(2)
        .filter_map(|pair| Some([pair[0]?, pair[1]?]))
        .filter(|[one, other]| one != other)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(name: &str, words: &[&str]) -> Attribute {
        let codes = (0..words.len() as u32).collect();
        let names = words.iter().map(ToString::to_string).collect();
        Attribute::new(name, 1, Values::Text { codes, names })
    }

    #[test]
    fn links_find_their_atoms_by_chain_residue_name_and_place() {
        let rows = [
            // Kind, symmetries, chains, residues, atoms, and the second one's alternative.
            ["disulf", "1_555", "1_555", "A", "A", "3", "7", "SG", "SG", "?"],
            ["covale", "1_555", "1_555", "A", "B", "7", "2", "SG", "C1", "B"],
            ["metalc", "1_555", "4_655", "A", "A", "3", "7", "SG", "SG", "?"],
            ["hydrog", "1_555", "1_555", "A", "A", "3", "7", "SG", "SG", "?"],
            ["covale", "1_555", "1_555", "A", "A", "3", "8", "SG", "SG", "?"],
            ["covale", "1_555", "1_555", "A", "A", "3", "3", "SG", "SG", "?"],
        ];
        let items = [
            "conn_type_id",
            "ptnr1_symmetry",
            "ptnr2_symmetry",
            "ptnr1_label_asym_id",
            "ptnr2_label_asym_id",
            "ptnr1_auth_seq_id",
            "ptnr2_label_seq_id",
            "ptnr1_label_atom_id",
            "ptnr2_label_atom_id",
            "pdbx_ptnr2_label_alt_id",
        ];
        let links = links(rows.len(), |item, row| {
            items.iter().position(|it| *it == item).map(|column| rows[row][column])
        });
        assert_eq!(links.len(), 4, "neither hydrogen bonds nor bonds to other cells: {links:?}");
        let attributes = [
            words("asym", &["A", "A ", "A", "B", "B"]),
            Attribute::new("resid", 1, Values::I32(vec![3, 3, 7, 2, 2])),
            words("name", &["SG", "SG", "SG", "C1", "C1"]),
            words("altloc", &["", "", "", "A", "B"]),
        ];
        // Names that appear twice have one code.
        let attributes = attributes.map(|mut attribute| {
            if let Values::Text { codes, names } = &mut attribute.values {
                for code in codes {
                    let name = &names[*code as usize];
                    *code = names.iter().position(|it| it == name).unwrap() as u32;
                }
            }
            attribute
        });
        assert_eq!(bonds(&links, &attributes), [[0, 2], [2, 4]]);
        assert!(bonds(&links, &attributes[1..]).is_empty(), "without chains");
    }
}
