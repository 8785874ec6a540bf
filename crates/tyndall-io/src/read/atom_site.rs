//! What the categories of PDBx/mmCIF mean, as text, as BinaryCIF or in formats with the same columns: atoms, cell, assemblies and bonds between residues.
//!
//! An [`AtomSite`] takes the columns of `_atom_site` by name and gives a frame; a [`Document`] has the small categories, an [`Entry`] what they say. Author's names of
//! chains and residues are preferred, as they are printed; the archive's names of chains, by which assemblies are made, are `asym`.

use std::collections::HashMap;
use std::path::Path;

use tyndall::particles::{Attribute, Values};
use tyndall::scene::element::Element;
use tyndall::{Columns, DVec3, Error, Result};

use super::assembly::{self, Assembly, Group, Operator};
use super::column::{Column, Words};
use super::connections::{self, Partner};
use super::{Request, finish, molecules, records};
use crate::sequence::Frame;

/// The small categories that are looked at.
pub(super) const CATEGORIES: [&str; 6] =
    ["cell", "symmetry", "space_group", "pdbx_struct_assembly_gen", "pdbx_struct_oper_list", "struct_conn"];
/// An assembly of more operators than this is a mistake, or an attack.
pub(super) const MOST_OPERATORS: usize = 1 << 16;

/// What a column has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Word,
    Float,
    Integer,
}

/// The columns that are read: the item, what it has, and the attribute that it becomes, coordinates aside. Of several that become
/// the same attribute the first that is there is taken.
const WANTED: [(&str, Kind, &str); 20] = [
    ("Cartn_x", Kind::Float, "x"),
    ("Cartn_y", Kind::Float, "y"),
    ("Cartn_z", Kind::Float, "z"),
    ("id", Kind::Integer, "id"),
    ("label_atom_id", Kind::Word, "name"),
    ("auth_atom_id", Kind::Word, "name"),
    ("type_symbol", Kind::Word, "element"),
    ("label_alt_id", Kind::Word, "altloc"),
    ("label_comp_id", Kind::Word, "resname"),
    ("auth_comp_id", Kind::Word, "resname"),
    ("auth_asym_id", Kind::Word, "chain"),
    ("label_asym_id", Kind::Word, "asym"),
    ("label_entity_id", Kind::Word, "entity"),
    ("auth_seq_id", Kind::Integer, "resid"),
    ("label_seq_id", Kind::Integer, "resid"),
    ("pdbx_PDB_ins_code", Kind::Word, "icode"),
    ("occupancy", Kind::Float, "occupancy"),
    ("B_iso_or_equiv", Kind::Float, "b_factor"),
    ("pdbx_formal_charge", Kind::Integer, "charge"),
    ("group_PDB", Kind::Word, "group"),
];

/// What the column `item` has; `None` if it is not read.
pub(super) fn kind(item: &str) -> Option<Kind> {
    WANTED.iter().find(|(name, ..)| *name == item).map(|(_, kind, _)| *kind)
}

/// A column while it is read. A missing value is NaN, an empty word, or none.
#[derive(Debug)]
pub(super) enum Data {
    Words(Words),
    Floats(Vec<f64>),
    Integers(Vec<Option<i64>>),
}

impl Data {
    /// An empty column.
    pub(super) fn new(kind: Kind) -> Self {
        match kind {
            Kind::Word => Self::Words(Words::default()),
            Kind::Float => Self::Floats(Vec::new()),
            Kind::Integer => Self::Integers(Vec::new()),
        }
    }

    /// Appends a value; on failure says what was wanted.
    pub(super) fn push(&mut self, value: Option<&[u8]>) -> std::result::Result<(), &'static str> {
        match (self, value) {
            (Self::Words(words), value) => words.push(value.unwrap_or_default()),
            (Self::Floats(column), None) => column.push(f64::NAN),
            (Self::Integers(column), None) => column.push(None),
            (Self::Floats(column), Some(text)) => column.push(float(text).ok_or("a number")?),
            (Self::Integers(column), Some(text)) => {
                let number = std::str::from_utf8(text).ok().and_then(|it| it.parse().ok());
                column.push(Some(number.ok_or("an integer")?));
            }
        }
        Ok(())
    }

    fn len(&self) -> usize {
        match self {
            Self::Words(words) => words.len(),
            Self::Floats(column) => column.len(),
            Self::Integers(column) => column.len(),
        }
    }

    /// The values of a column; `None` if no value is told.
    fn into_values(self) -> Option<Values> {
        match self {
            Self::Words(words) => {
                let values = Column::Text(words).into_values();
                let told =
                    matches!(&values, Values::Text { names, .. } if names.iter().any(|it| !it.is_empty()));
                told.then_some(values)
            }
            Self::Floats(column) => {
                let told = column.iter().any(|it| it.is_finite());
                told.then(|| Values::F32(column.iter().map(|&it| it as f32).collect()))
            }
            Self::Integers(column) => {
                let narrow = |it: &Option<i64>| i32::try_from(it.unwrap_or(0));
                let values = match column.iter().map(narrow).collect() {
                    Ok(narrow) => Values::I32(narrow),
                    Err(_) => Values::I64(column.iter().map(|it| it.unwrap_or(0)).collect()),
                };
                column.iter().any(Option::is_some).then_some(values)
            }
        }
    }
}

/// A number, maybe with its uncertainty behind it: `1.234(5)`.
fn float(text: &[u8]) -> Option<f64> {
    let end = text.iter().position(|&it| it == b'(').unwrap_or(text.len());
    fast_float2::parse(&text[..end]).ok()
}

/// The atoms of a model while they are read.
#[derive(Debug)]
pub(super) struct AtomSite {
    /// For each column of the file the wanted one that it is.
    places: Vec<Option<usize>>,
    columns: Vec<Option<Data>>,
}

impl AtomSite {
    /// For a loop with these items.
    pub(super) fn new(items: &[&str]) -> Self {
        let place = |item: &&str| WANTED.iter().position(|(name, ..)| name.eq_ignore_ascii_case(item));
        let places: Vec<Option<usize>> = items.iter().map(place).collect();
        let column = |(place, (_, kind, _)): (usize, &(&str, Kind, &str))| {
            places.contains(&Some(place)).then(|| Data::new(*kind))
        };
        let columns = WANTED.iter().enumerate().map(column).collect();
        Self { places, columns }
    }

    /// Appends a row; on failure says which column is wrong, and what was wanted.
    pub(super) fn push<'v>(
        &mut self,
        values: impl Iterator<Item = Option<&'v [u8]>>,
    ) -> std::result::Result<(), (usize, &'static str)> {
        for (column, (value, place)) in values.zip(&self.places).enumerate() {
            if let Some(data) = place.and_then(|place| self.columns[place].as_mut()) {
                data.push(value).map_err(|wanted| (column, wanted))?;
            }
        }
        Ok(())
    }

    /// Puts a whole column in, which must be one that [`kind`] knows.
    pub(super) fn insert(&mut self, item: &str, data: Data) {
        if let Some(place) = WANTED.iter().position(|(name, ..)| *name == item) {
            self.columns[place] = Some(data);
        }
    }

    /// The atoms as a frame.
    pub(super) fn frame(mut self, path: &Path, entry: Entry, request: &Request) -> Result<Frame> {
        let mut conventions = vec![format!("lengths: Å ({} convention)", entry.format)];
        let mut axis = |place: usize| match self.columns[place].take() {
            Some(Data::Floats(column)) => Ok(column),
            _ => {
                let what = format!("_atom_site has no column {}", WANTED[place].0);
                Err(Error::format(
                    path,
                    "_atom_site",
                    what,
                    "write Cartesian coordinates: Cartn_x, Cartn_y, Cartn_z",
                ))
            }
        };
        let [x, y, z] = [axis(0)?, axis(1)?, axis(2)?];
        let count = x.len();
        if y.len() != count || z.len() != count {
            let what = "Cartn_x, Cartn_y and Cartn_z have different numbers of values";
            return Err(Error::format(path, "_atom_site", what, "download or write the file again"));
        }
        let position = |id: usize| DVec3::new(x[id], y[id], z[id]);
        let positions = records::positions(count, None, position);

        let mut attributes: Vec<Attribute> = Vec::new();
        for ((item, _, name), data) in WANTED.iter().zip(self.columns) {
            let Some(data) = data.filter(|_| !attributes.iter().any(|it| it.name == *name)) else { continue };
            if data.len() != count {
                let what = format!("{item} has {} values, Cartn_x has {count}", data.len());
                return Err(Error::format(path, "_atom_site", what, "download or write the file again"));
            }
            attributes.extend(data.into_values().map(|values| Attribute::new(*name, 1, values)));
        }
        // Where only the archive's names of chains are there, they are the chains.
        if !attributes.iter().any(|it| it.name == "chain") {
            let asym = attributes.iter().find(|it| it.name == "asym").map(|it| it.values.clone());
            attributes.extend(asym.map(|values| Attribute::new("chain", 1, values)));
        }
        elements(&mut attributes);
        let mut bonds = entry.bonds.clone();
        bonds.extend(connections::bonds(&entry.links, &attributes));
        let columns = Columns {
            positions,
            attributes,
            radii: None,
            cell: entry.cell(&mut conventions),
            time: None,
            time_unit: None,
            length_unit: Some("Å".to_string()),
            bonds,
        };
        let columns = match &request.options.assembly {
            Some(wanted) => assembly::apply(columns, &entry.assemblies, wanted, "asym")?,
            None => {
                conventions.extend(assembly::offer(&entry.assemblies));
                columns
            }
        };
        finish(columns, conventions, Vec::new())
    }
}

/// Writes elements as they are always written (`FE` is `Fe`); where the file tells none, atoms' names do.
fn elements(attributes: &mut Vec<Attribute>) {
    if let Some(attribute) = attributes.iter_mut().find(|it| it.name == "element") {
        if let Values::Text { names, .. } = &mut attribute.values {
            for name in names {
                let known = Element::from_symbol(name).filter(|it| it.symbol().eq_ignore_ascii_case(name));
                *name = known.map_or_else(|| std::mem::take(name), |it| it.symbol().to_string());
            }
        }
        return;
    }
    let Some(names) = attributes.iter().find(|it| it.name == "name") else { return };
    let Values::Text { codes, names } = &names.values else { return };
    let symbol = |name: &String| Element::from_atom_name(name).map_or("", Element::symbol).to_string();
    let names = names.iter().map(symbol).collect();
    attributes.push(Attribute::new("element", 1, Values::Text { codes: codes.clone(), names }));
}

/// What stands beside the atoms.
#[derive(Debug, Default)]
pub(super) struct Entry {
    /// What the format is called.
    pub(super) format: &'static str,
    /// Lengths of the cell's edges in Å, and the angles between them in degrees.
    pub(super) lattice: Option<[[f64; 3]; 2]>,
    /// The space group, if it is told.
    pub(super) space_group: Option<String>,
    /// The assemblies, by the archive's names of chains.
    pub(super) assemblies: Vec<Assembly>,
    /// Pairs of atoms.
    pub(super) bonds: Vec<[u32; 2]>,
    /// Pairs of atoms by their names.
    pub(super) links: Vec<[Partner; 2]>,
}

impl Entry {
    /// The cell, if it is that of a simulation; says so if it is that of a crystal.
    fn cell(&self, conventions: &mut Vec<String>) -> Option<tyndall::Cell> {
        let [lengths, angles] = self.lattice?;
        // A cell of 1 Å is what stands where there is none.
        let cell = molecules::cell_of_angles(lengths, angles).filter(|_| lengths != [1.0; 3])?;
        match &self.space_group {
            Some(group) if !molecules::is_simple(group) => {
                conventions.push(molecules::crystal(group));
                None
            }
            _ => Some(cell),
        }
    }
}

/// The small categories: for each its items, and the values of each; missing ones are empty.
#[derive(Debug, Default)]
pub(super) struct Document {
    categories: HashMap<String, HashMap<String, Vec<String>>>,
}

impl Document {
    /// Appends a value.
    pub(super) fn push(&mut self, category: &str, item: &str, value: Option<&[u8]>) {
        let items = self.categories.entry(category.to_string()).or_default();
        let value = String::from_utf8_lossy(value.unwrap_or_default()).into_owned();
        items.entry(item.to_string()).or_default().push(value);
    }

    fn column(&self, category: &str, item: &str) -> &[String] {
        self.categories.get(category).and_then(|it| it.get(item)).map_or(&[], Vec::as_slice)
    }

    fn numbers<const N: usize>(&self, category: &str, items: [&str; N], row: usize) -> Option<[f64; N]> {
        let mut numbers = [0.0; N];
        for (number, item) in numbers.iter_mut().zip(items) {
            *number = float(self.column(category, item).get(row)?.as_bytes())?;
        }
        Some(numbers)
    }

    /// What they say about the atoms.
    pub(super) fn entry(&self) -> Entry {
        let lengths = self.numbers("cell", ["length_a", "length_b", "length_c"], 0);
        let angles = self.numbers("cell", ["angle_alpha", "angle_beta", "angle_gamma"], 0);
        let groups = [("symmetry", "space_group_name_H-M"), ("space_group", "name_H-M_alt")];
        let group = groups.iter().find_map(|(category, item)| self.column(category, item).first());
        Entry {
            format: "mmCIF",
            lattice: lengths.zip(angles).map(|(lengths, angles)| [lengths, angles]),
            space_group: group.cloned(),
            assemblies: self.assemblies(),
            bonds: Vec::new(),
            links: connections::links(self.column("struct_conn", "conn_type_id").len(), |item, row| {
                self.column("struct_conn", item).get(row).map(String::as_str)
            }),
        }
    }

    fn assemblies(&self) -> Vec<Assembly> {
        let list = "pdbx_struct_oper_list";
        let ids = self.column(list, "id");
        let operator = |row: usize| -> Option<Operator> {
            let [xx, xy, xz] = self.numbers(list, ["matrix[1][1]", "matrix[1][2]", "matrix[1][3]"], row)?;
            let [yx, yy, yz] = self.numbers(list, ["matrix[2][1]", "matrix[2][2]", "matrix[2][3]"], row)?;
            let [zx, zy, zz] = self.numbers(list, ["matrix[3][1]", "matrix[3][2]", "matrix[3][3]"], row)?;
            let shift = self.numbers(list, ["vector[1]", "vector[2]", "vector[3]"], row)?;
            let rows = [DVec3::new(xx, xy, xz), DVec3::new(yx, yy, yz), DVec3::new(zx, zy, zz)];
            Some(Operator { rows, shift: DVec3::from_array(shift) })
        };
        let operators: HashMap<&str, Operator> =
            ids.iter().enumerate().filter_map(|(row, id)| Some((id.as_str(), operator(row)?))).collect();
        let generators = "pdbx_struct_assembly_gen";
        let mut assemblies: Vec<Assembly> = Vec::new();
        let mut left = MOST_OPERATORS;
        let columns =
            self.column(generators, "oper_expression").iter().zip(self.column(generators, "asym_id_list"));
        for (name, (expression, chains)) in self.column(generators, "assembly_id").iter().zip(columns) {
            let chains =
                chains.split(',').map(|it| it.trim().to_string()).filter(|it| !it.is_empty()).collect();
            let Some(operators) = expand(expression, &operators, left) else { continue };
            left -= operators.len();
            let group = Group { chains, operators };
            match assemblies.iter_mut().find(|it| it.name == *name) {
                Some(assembly) => assembly.groups.push(group),
                None => assemblies.push(Assembly { name: name.clone(), groups: vec![group] }),
            }
        }
        assemblies
    }
}

/// The operators of an expression: `1,3-5`, or products of such lists, `(X0)(1-60)`: the right one first. `None` if it cannot be understood,
/// or has more than `most` operators.
fn expand(expression: &str, known: &HashMap<&str, Operator>, most: usize) -> Option<Vec<Operator>> {
    let lists = expression.split(['(', ')']).map(str::trim).filter(|it| !it.is_empty());
    let mut product = vec![Operator::IDENTITY];
    for list in lists {
        let mut factors = Vec::new();
        for item in list.split(',').map(str::trim) {
            if factors.len() > most {
                return None;
            }
            if let Some(operator) = known.get(item) {
                factors.push(*operator);
                continue;
            }
            let (first, last) = item.split_once('-')?;
            let (first, last): (usize, usize) = (first.trim().parse().ok()?, last.trim().parse().ok()?);
            if last.checked_sub(first)? >= known.len() {
                return None;
            }
            for number in first..=last {
                factors.push(*known.get(number.to_string().as_str())?);
            }
        }
        if product.len() * factors.len() > most {
            return None;
        }
        product = product.iter().flat_map(|left| factors.iter().map(|right| left.after(right))).collect();
    }
    Some(product)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn expressions_are_lists_ranges_and_products() {
        let shift = |x: f64| Operator { shift: DVec3::X * x, ..Operator::IDENTITY };
        let turn = Operator { rows: [DVec3::NEG_X, DVec3::NEG_Y, DVec3::Z], shift: DVec3::ZERO };
        let known: HashMap<&str, Operator> =
            [("1", shift(1.0)), ("2", shift(2.0)), ("3", shift(3.0)), ("P", turn)].into_iter().collect();
        let shifts = |expression: &str| -> Option<Vec<f64>> {
            Some(expand(expression, &known, MOST_OPERATORS)?.iter().map(|it| it.shift.x).collect())
        };
        assert_eq!(shifts("1"), Some(vec![1.0]));
        assert_eq!(shifts("1,3"), Some(vec![1.0, 3.0]));
        assert_eq!(shifts("(1-3)"), Some(vec![1.0, 2.0, 3.0]));
        assert_eq!(shifts("(P)(1, 2-3)"), Some(vec![-1.0, -2.0, -3.0]));
        assert_eq!(shifts("(1,2)(3)"), Some(vec![4.0, 5.0]));
        for expression in ["4", "1-9999999999", "3-1", "x-y", "1-4"] {
            assert_eq!(shifts(expression), None, "{expression}");
        }
        assert_eq!(shifts(&"(1-3)".repeat(64)), None);
    }
}
