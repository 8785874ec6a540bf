//! Biological assemblies: the copies of chains that make what is found in nature of what stands in a file.
//!
//! A file has assemblies; an assembly has groups of chains, each with the operators that make its copies.

use rayon::prelude::*;
use tyndall::particles::{Attribute, Values, View};
use tyndall::{Columns, DVec3, Error, Positions, Result};

/// A rotation, row by row, and the shift that follows it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Operator {
    pub(super) rows: [DVec3; 3],
    pub(super) shift: DVec3,
}

impl Operator {
    pub(super) const IDENTITY: Self = Self { rows: [DVec3::X, DVec3::Y, DVec3::Z], shift: DVec3::ZERO };

    /// Where it brings a point.
    pub(super) fn apply(&self, point: DVec3) -> DVec3 {
        DVec3::from_array(self.rows.map(|row| row.dot(point))) + self.shift
    }

    /// This one after `first`.
    pub(super) fn after(&self, first: &Self) -> Self {
        let column = |axis: usize| DVec3::from_array(first.rows.map(|row| row[axis]));
        let columns = [column(0), column(1), column(2)];
        let rows = self.rows.map(|row| DVec3::from_array(columns.map(|column| row.dot(column))));
        Self { rows, shift: self.apply(first.shift) }
    }
}

/// Chains, and the operators that make their copies.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Group {
    /// The names of the chains; none means all.
    pub(super) chains: Vec<String>,
    pub(super) operators: Vec<Operator>,
}

/// What a file says belongs together.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Assembly {
    /// Its name, usually a number.
    pub(super) name: String,
    pub(super) groups: Vec<Group>,
}

impl Assembly {
    fn operator_count(&self) -> usize {
        self.groups.iter().map(|it| it.operators.len()).sum()
    }
}

/// The line about assemblies that were not asked for, if one of them is more than what stands in the file.
pub(super) fn offer(assemblies: &[Assembly]) -> Option<String> {
    let larger = assemblies.iter().find(|it| it.operator_count() > 1)?;
    let (name, count) = (&larger.name, larger.operator_count());
    Some(format!("assembly {name} is made by {count} operators: --assembly {name} applies them"))
}

/// The groups that `wanted` means, a name or `all`; what is in several assemblies counts once.
fn chosen(assemblies: &[Assembly], wanted: &str) -> Result<Vec<Group>> {
    let all = wanted.eq_ignore_ascii_case("all");
    let mut groups: Vec<Group> = Vec::new();
    for group in assemblies.iter().filter(|it| all || it.name == wanted).flat_map(|it| &it.groups) {
        if !groups.contains(group) {
            groups.push(group.clone());
        }
    }
    if groups.is_empty() {
        let names: Vec<&str> = assemblies.iter().map(|it| it.name.as_str()).collect();
        let allowed = match names[..] {
            [] => "the file has no assemblies: leave --assembly out".to_string(),
            _ => format!("one of {}, or all", names.join(", ")),
        };
        return Err(Error::setting("assembly", wanted, allowed));
    }
    Ok(groups)
}

/// The particles of an assembly: each copy of each group, with the attribute `operator`, counted from 1 over all groups. `chain` names
/// the attribute that tells the chains. The cell is given up: copies do not stand in it.
pub(super) fn apply(columns: Columns, assemblies: &[Assembly], wanted: &str, chain: &str) -> Result<Columns> {
    let groups = chosen(assemblies, wanted)?;
    let chains = columns.attributes.iter().find(|it| it.name == chain).map(|it| &it.values);
    let ids = 0..columns.positions.len() as u32;
    let members_of = |group: &Group| match chains {
        Some(Values::Text { codes, names }) if !group.chains.is_empty() => {
            let is_named: Vec<bool> = names.iter().map(|it| group.chains.contains(it)).collect();
            ids.clone().filter(|&id| is_named[codes[id as usize] as usize]).collect()
        }
        _ => ids.clone().collect(),
    };
    let members: Vec<Vec<u32>> = groups.iter().map(members_of).collect();
    let total: usize =
        groups.iter().zip(&members).map(|(group, ids)| group.operators.len() * ids.len()).sum();
    if total >= u32::MAX as usize {
        let allowed = format!("{total} particles are more than a layer holds: choose a smaller assembly");
        return Err(Error::setting("assembly", wanted, allowed));
    }

    let mut order: Vec<u32> = Vec::with_capacity(total);
    let mut numbers: Vec<i32> = Vec::with_capacity(total);
    let mut positions = Positions::around(DVec3::ZERO);
    positions.reserve(total);
    let (mut number, mut bonds) = (0, Vec::new());
    for (group, ids) in groups.iter().zip(&members) {
        let points: Vec<DVec3> = ids.iter().map(|&id| columns.positions.world(id as usize)).collect();
        let place = |id: u32| ids.binary_search(&id).ok().map(|place| place as u32);
        let pair = |&[one, other]: &[u32; 2]| Some([place(one)?, place(other)?]);
        let bonded: Vec<[u32; 2]> = columns.bonds.iter().filter_map(pair).collect();
        for operator in &group.operators {
            number += 1;
            let first = order.len() as u32;
            bonds.extend(bonded.iter().map(|bond| bond.map(|place| first + place)));
            order.extend(ids);
            numbers.extend(std::iter::repeat_n(number, ids.len()));
            let moved: Vec<DVec3> = points.par_iter().map(|&point| operator.apply(point)).collect();
            positions.extend(&moved);
        }
    }
    let mut attributes: Vec<Attribute> = columns.attributes;
    for attribute in &mut attributes {
        attribute.values = in_order(&attribute.values, attribute.components, &order);
    }
    attributes.push(Attribute::new("operator", 1, Values::I32(numbers)));
    Ok(Columns { positions, attributes, bonds, cell: None, ..columns })
}

/// The rows of a column, in this order.
fn in_order(values: &Values, components: usize, order: &[u32]) -> Values {
    fn rows<T: Copy + Send + Sync>(values: &[T], components: usize, order: &[u32]) -> Vec<T> {
        let row = |&id: &u32| &values[id as usize * components..][..components];
        match components {
            1 => order.par_iter().map(|&id| values[id as usize]).collect(),
            _ => order.iter().flat_map(row).copied().collect(),
        }
    }
    match values.view() {
        View::F32(values) => Values::F32(rows(values, components, order)),
        View::F64(values) => Values::F64(rows(values, components, order)),
        View::I32(values) => Values::I32(rows(values, components, order)),
        View::I64(values) => Values::I64(rows(values, components, order)),
        View::U8(values) => Values::U8(rows(values, components, order)),
        View::Text { codes, names } => {
            Values::Text { codes: rows(codes, components, order), names: names.to_vec() }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A quarter turn around z.
    const TURN: Operator =
        Operator { rows: [DVec3::NEG_Y, DVec3::X, DVec3::Z], shift: DVec3::new(10.0, 0.0, 0.0) };

    fn columns() -> Columns {
        let mut positions = Positions::new();
        positions.extend(&[DVec3::new(1.0, 2.0, 3.0), DVec3::new(-1.0, 0.0, 0.5)]);
        let names = ["A", "B"].map(str::to_string).to_vec();
        let attributes = vec![
            Attribute::new("chain", 1, Values::Text { codes: vec![0, 1], names }),
            Attribute::new("pair", 2, Values::I32(vec![1, 2, 3, 4])),
        ];
        Columns { positions, attributes, ..Columns::default() }
    }

    fn assembly(name: &str, chains: &[&str], operators: &[Operator]) -> Assembly {
        let chains = chains.iter().map(|it| it.to_string()).collect();
        Assembly { name: name.to_string(), groups: vec![Group { chains, operators: operators.to_vec() }] }
    }

    #[test]
    fn operators_follow_each_other() {
        let point = DVec3::new(1.0, 2.0, 3.0);
        assert_eq!(TURN.apply(point), DVec3::new(8.0, 1.0, 3.0));
        assert_eq!(TURN.after(&TURN).apply(point), TURN.apply(TURN.apply(point)));
        assert_eq!(TURN.after(&Operator::IDENTITY), TURN);
    }

    #[test]
    fn copies_are_made_of_the_chains_that_are_named() {
        let assemblies = [assembly("1", &[], &[Operator::IDENTITY, TURN]), assembly("2", &["B"], &[TURN])];
        let both = apply(columns(), &assemblies, "1", "chain").unwrap();
        assert_eq!(both.positions.world(2), DVec3::new(8.0, 1.0, 3.0));
        assert_eq!(both.attributes[1].values, Values::I32(vec![1, 2, 3, 4, 1, 2, 3, 4]));
        assert_eq!(both.attributes[2].values, Values::I32(vec![1, 1, 2, 2]));
        let one = apply(columns(), &assemblies, "2", "chain").unwrap();
        assert_eq!((one.positions.len(), one.positions.world(0)), (1, DVec3::new(10.0, -1.0, 0.5)));
        assert_eq!(apply(columns(), &assemblies, "ALL", "chain").unwrap().positions.len(), 5);
        let twice = [assemblies[1].clone(), assembly("3", &["B"], &[TURN])];
        assert_eq!(
            apply(columns(), &twice, "all", "chain").unwrap().positions.len(),
            1,
            "the same group counts once"
        );
        assert!(offer(&assemblies).unwrap().contains("--assembly 1") && offer(&assemblies[1..]).is_none());
    }

    #[test]
    fn an_assembly_that_is_not_there_is_refused() {
        let message =
            |assemblies: &[Assembly]| apply(columns(), assemblies, "7", "chain").unwrap_err().to_string();
        assert!(message(&[assembly("1", &[], &[TURN])]).contains("one of 1, or all"));
        assert!(message(&[]).contains("has no assemblies"));
    }
}
