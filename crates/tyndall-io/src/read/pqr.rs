//! PQR, the input of Poisson-Boltzmann solvers: atoms with their charges and radii.
//!
//! A row has words between blanks: ATOM or HETATM, number, atom, residue, maybe chain, residue number, x y z, charge and radius; other records are passed over. Lengths are Å,
//! charges those of electrons. PDB has other numbers behind the coordinates, in columns of their own. Source: APBS and PDB2PQR, the PQR format.

use std::path::Path;

use tyndall::particles::{Attribute, Values};
use tyndall::scene::element::Element;
use tyndall::{Columns, DVec3, Error, Positions, Progress, Result};

use super::column::{Column, Separator, Words};
use super::{Index, Request, Span, finish, molecules, pdb, rows, whole_lines};
use crate::sequence::{Frame, Options};

/// Rows between two looks at the progress.
const STEP: usize = 1 << 12;

/// Whether the first atom is one of PQR. The name of the file decides where the numbers stand as in PDB.
pub(crate) fn recognise(head: &[u8], path: &Path) -> bool {
    let is_named = path.extension().is_some_and(|it| it.eq_ignore_ascii_case("pqr"));
    // Occupancy and temperature factor have two decimals each.
    let at = |line: &[u8], column: usize| line.get(column - 1) == Some(&b'.');
    let is_pdb = |line: &[u8]| at(line, 58) && at(line, 64);
    let atom = whole_lines(head).find(|line| is_atom(line));
    let is_record =
        super::is_text(head) && (pdb::begins(head) || head.trim_ascii_start().starts_with(b"ATOM"));
    is_record && atom.is_some_and(|line| (is_named || !is_pdb(line)) && row(line).is_some())
}

fn is_atom(line: &[u8]) -> bool {
    line.starts_with(b"ATOM") || line.starts_with(b"HETATM")
}

struct Row<'a> {
    number: &'a [u8],
    name: &'a [u8],
    residue: &'a [u8],
    chain: &'a [u8],
    residue_number: &'a [u8],
    position: DVec3,
    charge: f32,
    radius: f32,
}

/// The row of an atom; none if it has other words.
fn row(line: &[u8]) -> Option<Row<'_>> {
    // A long number leaves no blank behind HETATM.
    let rest = line.strip_prefix(b"HETATM").or_else(|| line.strip_prefix(b"ATOM"))?;
    let words: Vec<&[u8]> = rows::split(rest, Separator::BLANKS).collect();
    let (names, numbers) = words.split_last_chunk::<5>()?;
    let (number, name, residue, chain, residue_number) = match *names {
        [number, name, residue, residue_number] => (number, name, residue, &b""[..], residue_number),
        [number, name, residue, chain, residue_number] => (number, name, residue, chain, residue_number),
        _ => return None,
    };
    let mut parsed = [0.0; 5];
    for (value, word) in parsed.iter_mut().zip(numbers) {
        *value = fast_float2::parse::<f64, _>(word).ok()?;
    }
    let [x, y, z, charge, radius] = parsed;
    let position = DVec3::new(x, y, z);
    let (charge, radius) = (charge as f32, radius as f32);
    Some(Row { number, name, residue, chain, residue_number, position, charge, radius })
}

/// The line with blanks around coordinates that stand in the columns of PDB, where large ones leave none.
fn parted(line: &[u8]) -> Vec<u8> {
    let ends = [30, 38, 46, 54].map(|end| end.min(line.len()));
    let starts = std::iter::once(0).chain(ends);
    let fields = starts.zip(ends.into_iter().chain([line.len()])).map(|(start, end)| &line[start..end]);
    fields.collect::<Vec<_>>().join(&b' ')
}

/// Finds the one frame. Without an END nobody can tell whether its last row is the last one.
pub(crate) fn index(_: &Path, bytes: &[u8], _: &Options) -> Result<Index> {
    let last = bytes.trim_ascii_end().rsplit(|&byte| byte == b'\n').next().unwrap_or_default();
    let is_torn = is_atom(last) && !bytes.ends_with(b"\n");
    let frame = Span { offset: 0, line: 1, bytes: Some(bytes.len() as u64) };
    let doubt = "no END follows the last atom, so nobody can tell whether it is the last one";
    Ok(Index {
        frames: if is_torn { Vec::new() } else { vec![frame] },
        cut: is_torn,
        doubt: (!is_torn && last != b"END").then(|| doubt.to_string()),
        ..Index::default()
    })
}

/// Reads the atoms.
pub(crate) fn frame(
    path: &Path,
    bytes: &[u8],
    _: Span,
    _: &Request,
    progress: &dyn Progress,
) -> Result<Frame> {
    progress.begin("read", Some(bytes.len() as u64), "B");
    let mut positions = Vec::new();
    let [mut names, mut elements, mut residues, mut chains] = [(); 4].map(|()| Words::default());
    let [mut numbers, mut residue_numbers] = [(); 2].map(|()| Vec::new());
    let [mut charges, mut radii] = [(); 2].map(|()| Vec::new());
    let whole = |word: &[u8]| std::str::from_utf8(word).ok()?.parse::<i64>().ok();
    for (place, line) in bytes.split(|&byte| byte == b'\n').enumerate() {
        if place % STEP == 0 && progress.cancelled() {
            return Err(Error::Interrupted);
        }
        progress.advance(line.len() as u64 + 1);
        let line = line.trim_ascii_end();
        if !is_atom(line) {
            continue;
        }
        let parted = parted(line);
        let row = row(line).or_else(|| row(&parted)).ok_or_else(|| {
            let what = format!(
                "wanted ATOM, number, atom, residue, maybe chain, residue number, x y z, charge and radius, found '{}'",
                rows::shortened(line)
            );
            let hint = "blanks have to stand between all of them, or coordinates where PDB has them";
            Error::format(path, format!("line {}", place + 1), what, hint)
        })?;
        positions.push(row.position);
        numbers.push(whole(row.number));
        names.push(row.name);
        let name = std::str::from_utf8(row.name).unwrap_or_default();
        elements.push(Element::from_atom_name(name).map_or("", Element::symbol).as_bytes());
        residues.push(row.residue);
        chains.push(row.chain);
        residue_numbers.push(whole(row.residue_number));
        charges.push(row.charge);
        radii.push(row.radius);
    }
    let text = |words: Words| Column::Text(words).into_values();
    let all = [
        ("id", molecules::counted_on(&numbers, i64::MAX, 1)),
        ("name", text(names)),
        ("element", text(elements)),
        ("resname", text(residues)),
        ("chain", text(chains)),
        ("resid", molecules::counted_on(&residue_numbers, i64::MAX, 0)),
        ("charge", Values::F32(charges)),
        ("radius", Values::F32(radii)),
    ];
    let is_told = |(name, values): &(&str, Values)| match values {
        Values::Text { names, .. } => *name != "chain" || names.iter().any(|it| !it.is_empty()),
        _ => true,
    };
    let attributes = all.into_iter().filter(is_told).map(|(name, values)| Attribute::new(name, 1, values));
    let mut columns =
        Columns { attributes: attributes.collect(), length_unit: Some("Å".into()), ..Columns::default() };
    columns.positions = Positions::new();
    columns.positions.extend(&positions);
    finish(columns, vec!["lengths: Å (PQR convention)".into()], Vec::new())
}

#[cfg(test)]
mod tests {
    use super::*;
    use tyndall::Radii;

    /// Of PDB2PQR with and without chains, and with columns of other widths.
    const ROWS: [&str; 4] = [
        "REMARK   1 PQR file generated by PDB2PQR\nATOM      1  N   NTHR A   1      17.047  14.099   3.625  0.1812 1.8240\nTER\nEND\n",
        "ATOM      1  N   THR     1      17.047  14.099   3.625  0.1812 1.8240\n",
        "HETATM123456 N THR A 1 17.047 14.099 3.625 0.1812 1.824\n",
        "ATOM 1 N THR 1 17.047 14.099 3.625 .1812 1.8240\r\n",
    ];

    fn read(text: &str) -> Result<Frame> {
        let (path, options) = (Path::new("a.pqr"), Options::default());
        let index = index(path, text.as_bytes(), &options)?;
        let request = Request { options: &options, bytes: None, units: None, topology: None, others: &() };
        frame(path, text.as_bytes(), index.frames[0], &request, &())
    }

    #[test]
    fn atoms_have_charges_and_radii() {
        for text in ROWS {
            assert!(recognise(text.as_bytes(), Path::new("a")), "{text}");
            let particles = read(text).unwrap().particles;
            let value = |name: &str| particles.attribute(name).unwrap().number(0, 0);
            assert_eq!((particles.len(), value("charge") as f32, value("resid")), (1, 0.1812, 1.0), "{text}");
            let radii = particles.radii().unwrap();
            assert!(
                matches!(radii, Radii::PerParticle { .. }) && particles.radius(radii, 0) == 1.824,
                "{text}"
            );
            assert_eq!(particles.positions().world(0).as_vec3().to_array(), [17.047, 14.099, 3.625]);
            assert_eq!(particles.attribute("chain").is_some(), text.contains(" A "), "{text}");
        }
    }

    #[test]
    fn an_end_that_is_missing_is_told() {
        let index = |text: &str| index(Path::new("a.pqr"), text.as_bytes(), &Options::default()).unwrap();
        assert!(index(ROWS[0]).doubt.is_none() && index(ROWS[1]).doubt.is_some());
        let torn = index(ROWS[1].trim_end());
        assert!(torn.cut && torn.frames.is_empty());
    }

    #[test]
    fn pdb_is_another_format() {
        let pdb = "ATOM      1  N   THR A   1      17.047  14.099   3.625  1.00 13.79           N\n";
        let short = "ATOM      1  N   THR A   1      17.047  14.099   3.625  1.00 13.79\n";
        for text in [pdb, short] {
            assert!(!recognise(text.as_bytes(), Path::new("a.pdb")), "{text}");
        }
        // The name says what numbers with two decimals are.
        assert!(recognise(short.as_bytes(), Path::new("a.pqr")));
        assert!(!recognise(b"ATOM of words\n", Path::new("a.pqr")));
        let cif = b"data_A\nloop_\n_atom_site.id\nATOM 1 N N GLY A 1 5.1 9.5 1.4 1\n";
        assert!(!recognise(cif, Path::new("a.cif")));
    }

    #[test]
    fn coordinates_may_fill_their_columns() {
        let row = "ATOM      2  CA  THR     1    -116.967-112.784  -4.338 -0.0034 1.9080\n";
        let particles = read(row).unwrap().particles;
        assert_eq!(particles.positions().world(0).as_vec3().to_array(), [-116.967, -112.784, -4.338]);
        let error =
            read(&format!("{row}ATOM 2 CA THR 1 16.967-112.784 -4.338 0 1.9\n")).unwrap_err().to_string();
        assert!(error.contains("line 2") && error.contains("blanks"), "{error}");
        assert_eq!(read("END\n").unwrap().particles.len(), 0);
    }
}
