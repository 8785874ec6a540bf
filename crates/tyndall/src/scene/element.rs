//! Chemical elements: their colors, their van der Waals radii, and which element a file's label means.
//!
//! Sources. Colors: Jmol (jmol.sourceforge.net/jscolors). Radii: Bondi, J. Phys. Chem. 68, 441 (1964), with Rowland and Taylor, J. Phys.
//! Chem. 100, 7384 (1996) for H and Mantina et al., J. Phys. Chem. A 113, 5806 (2009) for the main group; where these have none,
//! Alvarez, Dalton Trans. 42, 8617 (2013).

use rayon::prelude::*;

use crate::particles::{Attribute, Particles, View};

/// `symbol/color/radius` of the elements by atomic number from 1: sRGB as RRGGBB, radius in Å, `-` where none is known.
const TABLE: &str = "\
    H/ffffff/1.20 He/d9ffff/1.40 Li/cc80ff/1.82 Be/c2ff00/1.53 B/ffb5b5/1.92 C/909090/1.70 N/3050f8/1.55 \
    O/ff0d0d/1.52 F/90e050/1.47 Ne/b3e3f5/1.54 Na/ab5cf2/2.27 Mg/8aff00/1.73 Al/bfa6a6/1.84 Si/f0c8a0/2.10 \
    P/ff8000/1.80 S/ffff30/1.80 Cl/1ff01f/1.75 Ar/80d1e3/1.88 K/8f40d4/2.75 Ca/3dff00/2.31 Sc/e6e6e6/2.58 \
    Ti/bfc2c7/2.46 V/a6a6ab/2.42 Cr/8a99c7/2.45 Mn/9c7ac7/2.45 Fe/e06633/2.44 Co/f090a0/2.40 Ni/50d050/1.63 \
    Cu/c88033/1.40 Zn/7d80b0/1.39 Ga/c28f8f/1.87 Ge/668f8f/2.11 As/bd80e3/1.85 Se/ffa100/1.90 Br/a62929/1.85 \
    Kr/5cb8d1/2.02 Rb/702eb0/3.03 Sr/00ff00/2.49 Y/94ffff/2.75 Zr/94e0e0/2.52 Nb/73c2c9/2.56 Mo/54b5b5/2.45 \
    Tc/3b9e9e/2.44 Ru/248f8f/2.46 Rh/0a7d8c/2.44 Pd/006985/1.63 Ag/c0c0c0/1.72 Cd/ffd98f/1.58 In/a67573/1.93 \
    Sn/668080/2.17 Sb/9e63b5/2.06 Te/d47a00/2.06 I/940094/1.98 Xe/429eb0/2.16 Cs/57178f/3.43 Ba/00c900/2.49 \
    La/70d4ff/2.98 Ce/ffffc7/2.88 Pr/d9ffc7/2.92 Nd/c7ffc7/2.95 Pm/a3ffc7/- Sm/8fffc7/2.90 Eu/61ffc7/2.87 \
    Gd/45ffc7/2.83 Tb/30ffc7/2.79 Dy/1fffc7/2.87 Ho/00ff9c/2.81 Er/00e675/2.83 Tm/00d452/2.79 Yb/00bf38/2.80 \
    Lu/00ab24/2.74 Hf/4dc2ff/2.63 Ta/4da6ff/2.53 W/2194d6/2.57 Re/267dab/2.49 Os/266696/2.48 Ir/175487/2.41 \
    Pt/d0d0e0/1.75 Au/ffd123/1.66 Hg/b8b8d0/1.55 Tl/a6544d/1.96 Pb/575961/2.02 Bi/9e4fb5/2.07 Po/ab5c00/1.97 \
    At/754f45/2.02 Rn/428296/2.20 Fr/420066/3.48 Ra/007d00/2.83 Ac/70abfa/2.80 Th/00baff/2.93 Pa/00a1ff/2.88 \
    U/008fff/1.86 Np/0080ff/2.82 Pu/006bff/2.81 Am/545cf2/2.83 Cm/785ce3/3.05 Bk/8a4fe3/3.40 Cf/a136d4/3.05 \
    Es/b31fd4/2.70 Fm/b31fba/- Md/b30da6/- No/bd0d87/- Lr/c70066/- Rf/cc0059/- Db/d1004f/- Sg/d90045/- \
    Bh/e00038/- Hs/e6002e/- Mt/eb0026/-";

/// Standard atomic weights by atomic number from 1 to 98 (IUPAC 2021, abridged; of the longest-lived isotope where there is none).
const WEIGHTS: [f64; 98] = [
    1.008, 4.0026, 6.94, 9.0122, 10.81, 12.011, 14.007, 15.999, 18.998, 20.180, 22.990, 24.305, 26.982,
    28.085, 30.974, 32.06, 35.45, 39.95, 39.098, 40.078, 44.956, 47.867, 50.942, 51.996, 54.938, 55.845,
    58.933, 58.693, 63.546, 65.38, 69.723, 72.630, 74.922, 78.971, 79.904, 83.798, 85.468, 87.62, 88.906,
    91.224, 92.906, 95.95, 97.0, 101.07, 102.91, 106.42, 107.87, 112.41, 114.82, 118.71, 121.76, 127.60,
    126.90, 131.29, 132.91, 137.33, 138.91, 140.12, 140.91, 144.24, 145.0, 150.36, 151.96, 157.25, 158.93,
    162.50, 164.93, 167.26, 168.93, 173.05, 174.97, 178.49, 180.95, 183.84, 186.21, 190.23, 192.22, 195.08,
    196.97, 200.59, 204.38, 207.2, 208.98, 209.0, 210.0, 222.0, 223.0, 226.0, 227.0, 232.04, 231.04, 238.03,
    237.0, 244.0, 243.0, 247.0, 247.0, 251.0,
];
/// Covalent radii in Å by atomic number from 1 to 96: Cordero et al., Dalton Trans., 2832 (2008); of carbon sp3, of Mn, Fe and Co low spin.
const COVALENT_RADII: [f64; 96] = [
    0.31, 0.28, 1.28, 0.96, 0.84, 0.76, 0.71, 0.66, 0.57, 0.58, 1.66, 1.41, 1.21, 1.11, 1.07, 1.05, 1.02,
    1.06, 2.03, 1.76, 1.70, 1.60, 1.53, 1.39, 1.39, 1.32, 1.26, 1.24, 1.32, 1.22, 1.22, 1.20, 1.19, 1.20,
    1.20, 1.16, 2.20, 1.95, 1.90, 1.75, 1.64, 1.54, 1.47, 1.46, 1.42, 1.39, 1.45, 1.44, 1.42, 1.39, 1.39,
    1.38, 1.39, 1.40, 2.44, 2.15, 2.07, 2.04, 2.03, 2.01, 1.99, 1.98, 1.98, 1.96, 1.94, 1.92, 1.92, 1.89,
    1.90, 1.87, 1.87, 1.75, 1.70, 1.62, 1.51, 1.44, 1.41, 1.36, 1.36, 1.32, 1.45, 1.46, 1.48, 1.40, 1.50,
    1.50, 2.60, 2.21, 2.15, 2.06, 2.00, 1.96, 1.90, 1.87, 1.80, 1.69,
];
/// Names of attributes that hold elements by symbol, best first.
const SYMBOL_NAMES: [&str; 5] = ["element", "elements", "species", "symbol", "symbols"];
/// Names of attributes that may hold a biomolecule's atom names (`CA`, `HW1`) or symbols.
const LABEL_NAMES: [&str; 6] = ["name", "names", "atom", "atom_name", "atomname", "label"];
/// Names of attributes that hold elements by atomic number.
const NUMBER_NAMES: [&str; 3] = ["atomic_number", "atomic_numbers", "atomicnumber"];

/// Whether an attribute of this name may tell elements.
pub(super) fn is_named(name: &str) -> bool {
    let names = SYMBOL_NAMES.iter().chain(&NUMBER_NAMES).chain(&["type", "types"]).chain(&LABEL_NAMES);
    names.into_iter().any(|known| known.eq_ignore_ascii_case(name))
}

/// Whether an attribute of this name holds the symbols of elements.
pub(super) fn is_of_symbols(name: &str) -> bool {
    SYMBOL_NAMES.iter().any(|known| known.eq_ignore_ascii_case(name))
}

/// What makes an element of a word.
type Parse = dyn Fn(&str) -> Option<Element>;

/// A chemical element.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Element {
    /// From 1 (hydrogen) to 109 (meitnerium).
    number: u8,
}

impl Element {
    /// The element of that atomic number; `None` outside 1 to 109.
    pub fn from_number(number: usize) -> Option<Self> {
        (1..=TABLE.split_ascii_whitespace().count())
            .contains(&number)
            .then_some(Self { number: number as u8 })
    }

    /// The element that a label of an element column means: its symbol in any case, else the symbol that its leading letters are
    /// (`Fe3+`, `O_w`, `H1`). Deuterium, `D`, is hydrogen.
    pub fn from_symbol(label: &str) -> Option<Self> {
        let letters = leading_letters(label.trim());
        let known = |symbol: &str| {
            let symbol = if symbol.eq_ignore_ascii_case("d") { "H" } else { symbol };
            let is_it = |row: &str| row.split('/').next().is_some_and(|it| it.eq_ignore_ascii_case(symbol));
            let place = TABLE.split_ascii_whitespace().position(is_it)?;
            Self::from_number(place + 1)
        };
        match letters.len() {
            0 => None,
            1 | 2 => known(letters),
            // A word of three letters or more is no symbol: `Solvent` is not sulfur.
            _ => None,
        }
    }

    /// The element that an atom name of a biomolecule means. There `CA` is the alpha carbon and `HG` a hydrogen; only metals and
    /// halogens that no residue's atoms are named after count with two letters, and digits may lead (`1HB2`).
    pub fn from_atom_name(name: &str) -> Option<Self> {
        const IONS: [&str; 12] = ["NA", "CL", "MG", "ZN", "FE", "BR", "LI", "MN", "CU", "SE", "AL", "SI"];
        let name = name.trim().trim_start_matches(|letter: char| letter.is_ascii_digit());
        let letters = leading_letters(name);
        let mixed_case = letters.len() == 2 && letters.ends_with(|letter: char| letter.is_ascii_lowercase());
        if mixed_case || IONS.iter().any(|ion| ion.eq_ignore_ascii_case(letters)) {
            return Self::from_symbol(letters);
        }
        let first = letters.get(..1)?;
        let single = letters.len() == 1 || "HCNOSP".contains(first);
        if single { Self::from_symbol(first) } else { None }
    }

    /// The element of that atomic weight, in atomic mass units, to a part in a thousand, or 0.015: enough for weights that are rounded, too
    /// little for groups of atoms that count as one (CH2 is no nitrogen).
    pub fn from_mass(mass: f64) -> Option<Self> {
        let off = |weight: &f64| (weight - mass).abs();
        let nearest = WEIGHTS.iter().enumerate().min_by(|(_, a), (_, b)| off(a).total_cmp(&off(b)));
        let (place, weight) = nearest?;
        let near = off(weight) <= (0.001 * weight).max(0.015);
        if near { Self::from_number(place + 1) } else { None }
    }

    /// The symbol: `H`, `He`.
    pub fn symbol(self) -> &'static str {
        self.row().0
    }

    /// Jmol's color, sRGB-encoded.
    pub fn color(self) -> [u8; 3] {
        let [_, r, g, b] =
            u32::from_str_radix(self.row().1, 16).expect("the table holds colors").to_be_bytes();
        [r, g, b]
    }

    /// The van der Waals radius in Å; `None` where none is known.
    pub fn radius(self) -> Option<f32> {
        self.row().2.parse().ok()
    }

    /// Its covalent radius in Å; `None` beyond curium.
    pub fn covalent_radius(self) -> Option<f64> {
        COVALENT_RADII.get(self.number as usize - 1).copied()
    }

    fn row(self) -> (&'static str, &'static str, &'static str) {
        let row = TABLE.split_ascii_whitespace().nth(self.number as usize - 1).expect("1 to 109");
        let mut words = row.split('/');
        let mut word = || words.next().expect("three words a row");
        (word(), word(), word())
    }
}

/// Whether an atom name is that of a site of charge without an atom, as models of water have them.
fn is_site(name: &str) -> bool {
    ["MW", "EP", "EPW", "LP"].contains(&leading_letters(name.trim()))
}

fn leading_letters(label: &str) -> &str {
    let end = label.find(|letter: char| !letter.is_ascii_alphabetic()).unwrap_or(label.len());
    &label[..end]
}

/// The elements of particles, by an attribute.
#[derive(Clone, Debug, PartialEq)]
pub struct Elements {
    /// Which of the particles' attributes tells.
    pub attribute: usize,
    /// The element of each of its values: of each code of a word, or each atomic number from 0.
    pub by_value: Vec<Option<Element>>,
    /// Whether each of its values names a site of charge without an atom.
    pub sites: Vec<bool>,
    /// The part of the particles whose element is known, or that are known to be no atoms, 0 to 1.
    pub known: f64,
}

impl Elements {
    /// Finds the attribute that tells the elements of most particles: symbols under a name that promises them, atomic numbers, a
    /// `type` whose words are all symbols, or atom names of which nine in ten are understood; where none of these tells, the symbols of
    /// some particles in `element`. `None` if there is none.
    pub fn find(particles: &Particles) -> Option<Self> {
        let by_names = |names: &[&str], parse: Option<&Parse>, least: f64| {
            names.iter().find_map(|name| {
                let named = |it: &Attribute| it.components == 1 && it.name.eq_ignore_ascii_case(name);
                let attribute = particles.attributes().iter().position(named)?;
                let found = Self::from_attribute(particles, attribute, parse)?;
                (found.known > 0.0 && found.known >= least).then_some(found)
            })
        };
        let exact = |word: &str| Element::from_symbol(word).filter(|element| element.symbol() == word);
        by_names(&SYMBOL_NAMES, Some(&Element::from_symbol), 0.5)
            .or_else(|| by_names(&NUMBER_NAMES, None, 0.5))
            .or_else(|| by_names(&["type", "types"], Some(&exact), 1.0))
            .or_else(|| by_names(&LABEL_NAMES, Some(&Element::from_atom_name), 0.9))
            .or_else(|| by_names(&SYMBOL_NAMES[..1], Some(&Element::from_symbol), 0.0))
    }

    /// By words that `parse` understands, or without it by integers that are atomic numbers.
    fn from_attribute(particles: &Particles, attribute: usize, parse: Option<&Parse>) -> Option<Self> {
        let values = &particles.attributes()[attribute].values;
        let by_value: Vec<Option<Element>> = match (values.view(), parse) {
            (View::Text { names, .. }, Some(parse)) => names.iter().map(|name| parse(name)).collect(),
            (View::I32(_) | View::I64(_) | View::U8(_), None) => {
                (0..=109).map(Element::from_number).collect()
            }
            _ => return None,
        };
        let sites = match values.view() {
            View::Text { names, .. } => names.iter().map(|name| is_site(name)).collect(),
            _ => vec![false; by_value.len()],
        };
        let is_known: Vec<bool> =
            by_value.iter().zip(&sites).map(|(it, site)| it.is_some() || *site).collect();
        let counts = |place: &usize| is_known.get(values.number(*place) as usize) == Some(&true);
        let count = (0..values.len()).into_par_iter().with_min_len(1 << 14).filter(counts).count();
        Some(Self { attribute, known: count as f64 / values.len().max(1) as f64, by_value, sites })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::particles::{Columns, Values};
    use glam::DVec3;

    fn symbol(element: Option<Element>) -> &'static str {
        element.map_or("-", Element::symbol)
    }

    #[test]
    fn masses_tell_elements_unless_they_are_those_of_groups() {
        let symbol = |mass: f64| Element::from_mass(mass).map(Element::symbol);
        let known = [
            (1.0, "H"),
            (1.01, "H"),
            (12.0, "C"),
            (12.011, "C"),
            (14.0067, "N"),
            (16.0, "O"),
            (58.693, "Ni"),
            (58.933, "Co"),
        ];
        for (mass, wanted) in
            known.into_iter().chain([(63.55, "Cu"), (35.453, "Cl"), (32.066, "S"), (238.0, "U")])
        {
            assert_eq!(symbol(mass), Some(wanted), "{mass}");
        }
        for mass in [14.027, 15.035, 13.019, 72.0, 2.0, 0.0, -1.0, 1e9, f64::NAN, f64::INFINITY] {
            assert_eq!(symbol(mass), None, "{mass}");
        }
    }

    #[test]
    fn every_row_of_the_table_is_whole() {
        assert_eq!(Element::from_number(0), None);
        assert_eq!(Element::from_number(110), None);
        for number in 1..=109 {
            let element = Element::from_number(number).unwrap();
            assert_eq!(Element::from_symbol(element.symbol()), Some(element));
            assert_eq!(Element::from_symbol(&element.symbol().to_uppercase()), Some(element));
            assert!(element.radius().is_none_or(|radius| (1.0..4.0).contains(&radius)), "{number}");
            element.color();
        }
        let gold = Element::from_number(79).unwrap();
        assert_eq!((gold.symbol(), gold.color(), gold.radius()), ("Au", [0xff, 0xd1, 0x23], Some(1.66)));
    }

    #[test]
    fn labels_of_element_columns_are_understood() {
        for (label, meant) in
            [("Ca", "Ca"), ("CA", "Ca"), ("fe3+", "Fe"), ("O_w", "O"), ("H1", "H"), ("D", "H")]
        {
            assert_eq!(symbol(Element::from_symbol(label)), meant, "{label}");
        }
        for label in ["", "7", "Solvent", "Xx", "é", "BB1"] {
            assert_eq!(Element::from_symbol(label), None, "{label}");
        }
    }

    #[test]
    fn atom_names_of_biomolecules_are_understood() {
        let names = [("CA", "C"), ("HG", "H"), ("NE2", "N"), ("CL", "Cl"), ("Ca", "Ca"), ("1HB2", "H")];
        for (name, meant) in
            names.into_iter().chain([("OW", "O"), ("K", "K"), ("SG", "S"), ("BB", "-"), ("", "-")])
        {
            assert_eq!(symbol(Element::from_atom_name(name)), meant, "{name}");
        }
    }

    fn particles(name: &str, words: &[&str]) -> Particles {
        let mut columns = Columns::default();
        columns.positions.extend(&vec![DVec3::ZERO; words.len()]);
        let codes = (0..words.len() as u32).collect();
        let names = words.iter().map(|word| word.to_string()).collect();
        columns.attributes.push(Attribute::new(name, 1, Values::Text { codes, names }));
        Particles::new(columns).unwrap()
    }

    #[test]
    fn the_column_with_elements_is_found() {
        let found = |name: &str, words: &[&str]| Elements::find(&particles(name, words)).map(|it| it.known);
        assert_eq!(found("Species", &["Cu", "Zr", "unknown", "Cu"]), Some(0.75));
        assert_eq!(found("name", &["CA", "OW", "HW1"]), Some(1.0));
        assert_eq!(found("name", &["OW", "HW1", "HW2", "MW"]), Some(1.0));
        assert_eq!(found("name", &["BB", "SC1", "W"]), None);
        assert_eq!(found("type", &["C", "Si"]), Some(1.0));
        assert_eq!(found("type", &["C", "big"]), None);
        assert_eq!(found("element", &[]), None);
    }

    #[test]
    fn integers_are_elements_only_where_the_name_says_so() {
        let known = |name: &str| {
            let mut columns = Columns::default();
            columns.positions.extend(&[DVec3::ZERO; 4]);
            columns.attributes.push(Attribute::new(name, 1, Values::I32(vec![1, 79, 0, -1])));
            Elements::find(&Particles::new(columns).unwrap()).map(|it| it.known)
        };
        assert_eq!((known("atomic_number"), known("type"), known("element")), (Some(0.5), None, None));
    }
}
