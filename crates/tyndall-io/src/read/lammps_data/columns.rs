//! What the columns of the Atoms and Velocities sections are.

use tyndall::scene::grouped;

/// The columns of each atom style, without the image flags that may follow. Source: LAMMPS documentation of `read_data`.
const STYLES: [(&str, &str); 30] = [
    ("angle", "id mol type x y z"),
    ("atomic", "id type x y z"),
    ("body", "id type bodyflag mass x y z"),
    ("bond", "id mol type x y z"),
    ("bpm/sphere", "id mol type diameter density x y z"),
    ("charge", "id type q x y z"),
    ("dielectric", "id type q x y z mux muy muz area ed em epsilon curvature"),
    ("dipole", "id type q x y z mux muy muz"),
    ("dpd", "id type theta x y z"),
    ("edpd", "id type edpd_temp edpd_cv x y z"),
    ("electron", "id type q espin eradius x y z"),
    ("ellipsoid", "id type ellipsoidflag density x y z"),
    ("full", "id mol type q x y z"),
    ("line", "id mol type lineflag density x y z"),
    ("mdpd", "id type rho x y z"),
    ("mesont", "id mol type bond_nt1 bond_nt2 mass mradius mlength buckling x y z"),
    ("molecular", "id mol type x y z"),
    ("oxdna", "id type x y z"),
    ("peri", "id type volume density x y z"),
    ("rheo", "id type status rho x y z"),
    ("rheo/thermal", "id type status rho energy x y z"),
    ("smd", "id type mol volume mass kradius cradius x0 y0 z0 x y z"),
    ("sph", "id type rho esph cv x y z"),
    ("sphere", "id type diameter density x y z"),
    ("spin", "id type x y z spx spy spz sp"),
    ("template", "id type mol template_index template_atom x y z"),
    ("tri", "id mol type triangleflag density x y z"),
    ("wavepacket", "id type q espin eradius etag cs_re cs_im x y z"),
    // Styles with further columns, as many as the user wants.
    ("hybrid", "id type x y z"),
    ("tdpd", "id type x y z"),
];

/// The first rows of a section.
#[derive(Debug)]
pub(super) struct Sample {
    /// How many fields the first row has.
    pub(super) fields: usize,
    /// Which of them are integers in all rows.
    pub(super) integers: Vec<bool>,
}

impl Sample {
    /// Looks at the rows at the front of `text`.
    pub(super) fn of(text: &[u8]) -> Self {
        let rows = || {
            text.split(|&byte| byte == b'\n')
                .map(|row| row.split(|&byte| byte == b'#').next().unwrap_or_default().trim_ascii())
                .take_while(|row| !row.is_empty())
                .take(100)
        };
        let fields = |row: &'_ [u8]| row.split(u8::is_ascii_whitespace).filter(|it| !it.is_empty()).count();
        let count = rows().next().map_or(0, fields);
        let mut integers = vec![true; count];
        for row in rows() {
            let words = row.split(u8::is_ascii_whitespace).filter(|it| !it.is_empty());
            for (integer, word) in integers.iter_mut().zip(words) {
                let digits = word.strip_prefix(b"-").unwrap_or(word);
                *integer &= !digits.is_empty() && digits.iter().all(u8::is_ascii_digit);
            }
        }
        Self { fields: count, integers }
    }

    /// Whether the last three fields can be image flags.
    fn ends_with_flags(&self) -> bool {
        self.fields >= 8 && self.integers[self.fields - 3..].iter().all(|&it| it)
    }
}

/// The names of the columns of Atoms, and what to say about them. `comment` stands behind the section's name.
pub(super) fn of_atoms(comment: &str, sample: &Sample) -> Result<(Vec<String>, String), String> {
    let words = |text: &str| text.split_whitespace().map(str::to_string).collect::<Vec<_>>();
    let mut told = comment.split_whitespace();
    let style = told.next().and_then(|word| STYLES.iter().find(|(style, _)| *style == word));
    let (mut names, mut line) = match style {
        Some(&(style, columns)) => {
            let mut names = words(columns);
            if style == "hybrid" {
                // Each style adds what the others have not said.
                for (_, columns) in told.filter_map(|word| STYLES.iter().find(|(style, _)| *style == word)) {
                    names.extend(
                        words(columns).into_iter().filter(|it| !names.contains(it)).collect::<Vec<_>>(),
                    );
                }
            }
            let open = style == "hybrid" || style == "tdpd";
            let (least, flags) = (names.len(), names.len() + 3);
            if sample.fields < least || (!open && sample.fields != least && sample.fields != flags) {
                return Err(format!(
                    "atom style {style} has {least} columns, or {flags} with image flags; the first row has {}",
                    sample.fields
                ));
            }
            let more = sample.fields - least;
            let more =
                if more == 3 && !open || more >= 3 && sample.ends_with_flags() { more - 3 } else { more };
            let first = least + 1;
            names.extend((first..first + more).map(|column| format!("c{column}")));
            (names, format!("atom style {style}"))
        }
        None => {
            let flags = if sample.ends_with_flags() { 3 } else { 0 };
            let integer = |column: usize| sample.integers.get(column).copied().unwrap_or(false);
            let style = match sample.fields - flags.min(sample.fields) {
                5 => "atomic",
                6 if integer(2) => "molecular",
                6 => "charge",
                7 if integer(2) => "full",
                7 => "sphere",
                _ => {
                    return Err(format!(
                        "the file does not tell its atom style, and {} columns may be of several",
                        grouped(sample.fields)
                    ));
                }
            };
            let columns = STYLES.iter().find(|(it, _)| *it == style).map_or("", |(_, columns)| columns);
            (words(columns), format!("atom style {style} (by the number and kind of columns)"))
        }
    };
    if sample.fields == names.len() + 3 {
        names.extend(words("ix iy iz"));
    }
    line += &format!(": {}", names.join(" "));
    Ok((names, line))
}

/// The names of the columns of Velocities, for atoms with the columns `atoms`.
pub(super) fn of_velocities(atoms: &[String], sample: &Sample) -> Vec<String> {
    let has = |name: &str| atoms.iter().any(|it| it == name);
    let further: [&str; 3] = match has("diameter") {
        true => ["omegax", "omegay", "omegaz"],
        false => ["angmomx", "angmomy", "angmomz"],
    };
    let names = ["id", "vx", "vy", "vz"].map(str::to_string).into_iter();
    let further = further.map(str::to_string).into_iter().filter(|_| sample.fields == 7);
    let names: Vec<String> = names.chain(further).collect();
    let more = names.len() + 1..sample.fields + 1;
    names.into_iter().chain(more.map(|column| format!("velocity_c{column}"))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(comment: &str, rows: &str) -> Result<String, String> {
        of_atoms(comment, &Sample::of(rows.as_bytes())).map(|(names, _)| names.join(" "))
    }

    #[test]
    fn the_comment_tells_the_style() {
        for (style, columns) in STYLES {
            let count = columns.split(' ').count();
            let row = vec!["1"; count].join(" ");
            assert_eq!(names(style, &row).unwrap(), columns, "{style}");
            let flags = format!("{row} 0 -1 0 # C");
            // Of styles with further columns, these may be as many as flags: integers are.
            assert_eq!(names(style, &flags).unwrap(), format!("{columns} ix iy iz"), "{style}");
        }
        assert_eq!(
            names("hybrid sphere charge", "1 1 0 0 0 2.5 1 -0.5 0 0 1").unwrap(),
            "id type x y z diameter density q ix iy iz"
        );
        assert_eq!(names("hybrid", "1 1 0 0 0 2.5 0.5").unwrap(), "id type x y z c6 c7");
        assert_eq!(names("hybrid", "1 1 0 0 0 2.5 0 0 1").unwrap(), "id type x y z c6 ix iy iz");
        let message = names("full", "1 1 0 0 0").unwrap_err();
        assert!(message.contains("atom style full has 7 columns, or 10"), "{message}");
    }

    #[test]
    fn without_one_number_and_kind_of_columns_tell() {
        let cases = [
            ("1 1 0.5 0 0", "id type x y z"),
            ("1 1 0 0 0\n2 1 1 1 1\n", "id type x y z"),
            ("1 1 0.5 0 0 0 0 0", "id type x y z ix iy iz"),
            ("1 2 3 0.5 0 0", "id mol type x y z"),
            ("1 2 -0.5 0.5 0 0 0 0 0", "id type q x y z ix iy iz"),
            ("1 2 3 0.5 0 0 0", "id mol type q x y z"),
            ("1 2 3 0.5 0 0 0.5 1 0 1", "id mol type q x y z ix iy iz"),
            ("1 2 3.5 1 0 0.1 0", "id type diameter density x y z"),
            ("1 2 3 1 0 0.1 0\n1 2 3.5 1 0 0.1 0\n\nVelocities", "id type diameter density x y z"),
        ];
        for (rows, wanted) in cases {
            assert_eq!(names("some words", rows).as_deref(), Ok(wanted), "{rows}");
        }
        for rows in ["", "1 2 3", "1 1 0.1 0.1 0.1 1.5 2.5 3.5 4.5"] {
            assert!(names("", rows).is_err(), "{rows}");
        }
    }
}
