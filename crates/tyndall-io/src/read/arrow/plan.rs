//! Which columns of a table are positions and which are attributes, by names and types.
//!
//! Takes the schema, gives a [`Plan`]. Coordinates are columns that tables also know as such, or a column of two or three numbers a row.

use std::path::Path;

use arrow_schema::{DataType, Field, Schema, TimeUnit};
use tyndall::scene::wanted::{Offered, Wanted};
use tyndall::{Error, Result};

use crate::read::numbers::Kind;
use crate::read::table;

/// What a column of vectors that are positions is called, best first.
const POSITIONS: [&str; 8] =
    ["pos", "position", "positions", "coordinates", "coords", "coord", "xyz", "points"];
/// More columns than this in one are not taken for attributes of particles.
const MOST_COMPONENTS: usize = 64;

/// What the values of a column are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Sort {
    Numbers(Kind),
    Words,
}

/// Where the values of a column are.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Place {
    /// In the column itself, or in the child of that number.
    One(Option<usize>),
    /// In lists of one length.
    List,
    /// In the children, a component each.
    Children(Vec<usize>),
}

/// What the values become.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Role {
    Axis(usize),
    /// All coordinates.
    Position,
    Attribute,
}

/// A column that is read.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Leaf {
    pub(super) name: String,
    pub(super) unit: Option<String>,
    /// The column of the table that has it.
    pub(super) root: usize,
    pub(super) place: Place,
    pub(super) sort: Sort,
    pub(super) role: Role,
    /// Values a row; `None` if only the rows tell.
    pub(super) components: Option<usize>,
}

impl Leaf {
    /// Bytes a row, as far as they are known.
    pub(super) fn row_bytes(&self) -> usize {
        let bytes = match self.sort {
            Sort::Numbers(kind) => kind.size(),
            Sort::Words => 4,
        };
        bytes * self.components.unwrap_or(1)
    }
}

/// All that is read of a table.
#[derive(Debug, Default)]
pub(super) struct Plan {
    pub(super) leaves: Vec<Leaf>,
    pub(super) length_unit: Option<String>,
    pub(super) conventions: Vec<String>,
    pub(super) warnings: Vec<String>,
}

impl Plan {
    /// For a table with this schema, whose columns may be given other names.
    pub(super) fn new(
        path: &Path,
        schema: &Schema,
        names: Option<&[String]>,
        wanted: Option<&Wanted>,
    ) -> Result<Self> {
        let count = schema.fields().len();
        if let Some(names) = names.filter(|it| it.len() != count) {
            let what = format!("there are {} names for {count} columns", names.len());
            return Err(Error::format(path, "", what, "name the columns: --columns x,y,z,…"));
        }
        let mut plan = Self::default();
        for (root, field) in schema.fields().iter().enumerate() {
            let name = names.map_or(field.name(), |it| &it[root]);
            let leaves = leaves(name, root, field);
            if leaves.is_empty() {
                plan.warnings.push(format!(
                    "left out: '{name}' ({}), which is no number, word or vector",
                    field.data_type()
                ));
            }
            plan.leaves.extend(leaves);
        }
        plan.find_positions(path)?;
        plan.name_components();
        if let Some(wanted) = wanted {
            let attributes = || plan.leaves.iter().filter(|it| it.role == Role::Attribute);
            let offered: Vec<Offered> = attributes()
                .map(|it| Offered {
                    name: &it.name,
                    components: it.components.unwrap_or(3),
                    is_measured: matches!(it.sort, Sort::Numbers(Kind::F16 | Kind::F32 | Kind::F64)),
                })
                .collect();
            let mut flags = wanted.flags(&offered).into_iter();
            plan.leaves.retain(|it| it.role != Role::Attribute || flags.next().unwrap_or(true));
        }
        Ok(plan)
    }

    fn find_positions(&mut self, path: &Path) -> Result<()> {
        let is_number = |it: &Leaf| matches!(it.sort, Sort::Numbers(_));
        let is_vector = |it: &Leaf| {
            is_number(it)
                && !matches!(it.place, Place::One(_))
                && it.components.is_none_or(|it| (2..=3).contains(&it))
        };
        let named = |name: &&str| {
            self.leaves
                .iter()
                .position(|it| is_vector(it) && table::name_and_unit(&it.name).0.eq_ignore_ascii_case(name))
        };
        if let Some(place) = POSITIONS.iter().find_map(named) {
            self.take_vector(place);
            return Ok(());
        }
        let scalars: Vec<usize> = (0..self.leaves.len())
            .filter(|&it| is_number(&self.leaves[it]) && matches!(self.leaves[it].place, Place::One(_)))
            .collect();
        let names: Vec<String> = scalars.iter().map(|&it| self.leaves[it].name.clone()).collect();
        if let Some((x, y, z)) = table::coordinates(&names) {
            for (axis, column) in [Some(x), Some(y), z].into_iter().enumerate() {
                let Some(column) = column else {
                    self.conventions.push("two-dimensional: z = 0".to_string());
                    continue;
                };
                self.leaves[scalars[column]].role = Role::Axis(axis);
            }
            let x = &self.leaves[scalars[x]];
            self.length_unit = x.unit.clone().or_else(|| table::name_and_unit(&x.name).1.map(str::to_string));
            return Ok(());
        }
        let may_be = |it: &Leaf| is_vector(it) && !table::is_other_vector(&it.name);
        let vectors: Vec<usize> = (0..self.leaves.len()).filter(|&it| may_be(&self.leaves[it])).collect();
        if let [place] = vectors[..] {
            self.conventions.push(format!("'{}' is taken as the positions", self.leaves[place].name));
            self.take_vector(place);
            return Ok(());
        }
        let all: Vec<&str> = self.leaves.iter().take(40).map(|it| it.name.as_str()).collect();
        let what = format!("no x, y, z and no vector of positions among the columns {}", all.join(", "));
        Err(Error::format(path, "", what, "name the columns: --columns x,y,z,…"))
    }

    fn take_vector(&mut self, place: usize) {
        let leaf = &mut self.leaves[place];
        leaf.role = Role::Position;
        self.length_unit =
            leaf.unit.clone().or_else(|| table::name_and_unit(&leaf.name).1.map(str::to_string));
    }

    /// Takes units out of the names of attributes.
    fn name_components(&mut self) {
        for leaf in self.leaves.iter_mut().filter(|it| it.role == Role::Attribute) {
            let (name, unit) = table::name_and_unit(&leaf.name);
            let (name, unit) = (name.to_string(), unit.map(str::to_string));
            leaf.name = if name.is_empty() { format!("c{}", leaf.root + 1) } else { name };
            leaf.unit = leaf.unit.take().or(unit);
        }
    }
}

/// What a column of the table has; nothing if it has no numbers and no words.
fn leaves(name: &str, root: usize, field: &Field) -> Vec<Leaf> {
    let unit = field.metadata().get("unit").cloned();
    let leaf = |place: Place, sort: Sort, components: Option<usize>, kind: &DataType| Leaf {
        name: name.to_string(),
        unit: unit.clone().or_else(|| is_time(kind).then(|| "s".to_string())),
        root,
        place,
        sort,
        role: Role::Attribute,
        components,
    };
    match field.data_type() {
        DataType::FixedSizeList(item, count) => {
            let count = usize::try_from(*count).ok().filter(|it| (1..=MOST_COMPONENTS).contains(it));
            match (number(item.data_type()), count) {
                (Some(kind), Some(count)) => {
                    vec![leaf(Place::List, Sort::Numbers(kind), Some(count), item.data_type())]
                }
                _ => vec![],
            }
        }
        DataType::List(item) | DataType::LargeList(item) => match number(item.data_type()) {
            Some(kind) => vec![leaf(Place::List, Sort::Numbers(kind), None, item.data_type())],
            None => vec![],
        },
        DataType::Struct(children) => {
            let kinds: Option<Vec<Kind>> = children.iter().map(|it| number(it.data_type())).collect();
            let axes: Vec<String> = children.iter().map(|it| it.name().to_ascii_lowercase()).collect();
            let is_vector = axes == ["x", "y", "z"] || axes == ["x", "y"];
            if let Some(kinds) = kinds.filter(|it| is_vector && it.iter().all(|kind| *kind == it[0])) {
                let place = Place::Children((0..axes.len()).collect());
                return vec![leaf(place, Sort::Numbers(kinds[0]), Some(axes.len()), &DataType::Null)];
            }
            let child = |(place, child): (usize, &std::sync::Arc<Field>)| {
                let sort = sort(child.data_type())?;
                let name = format!("{name}.{}", child.name());
                Some(Leaf { name, ..leaf(Place::One(Some(place)), sort, Some(1), child.data_type()) })
            };
            children.iter().enumerate().filter_map(child).collect()
        }
        kind => sort(kind).map(|sort| leaf(Place::One(None), sort, Some(1), kind)).into_iter().collect(),
    }
}

fn sort(kind: &DataType) -> Option<Sort> {
    match kind {
        DataType::Utf8 | DataType::LargeUtf8 | DataType::Utf8View => Some(Sort::Words),
        // Which of the numbers a row has is told by another: they are read as floats.
        DataType::Dictionary(_, values) => match sort(values)? {
            Sort::Words => Some(Sort::Words),
            Sort::Numbers(_) => Some(Sort::Numbers(Kind::F64)),
        },
        kind => number(kind).map(Sort::Numbers),
    }
}

/// What numbers of this type are read as.
fn number(kind: &DataType) -> Option<Kind> {
    Some(match kind {
        DataType::Boolean | DataType::UInt8 => Kind::U8,
        DataType::Int8 => Kind::I8,
        DataType::Int16 => Kind::I16,
        DataType::UInt16 => Kind::U16,
        DataType::Int32 => Kind::I32,
        DataType::UInt32 => Kind::U32,
        DataType::Int64 => Kind::I64,
        DataType::UInt64 => Kind::U64,
        DataType::Float16 => Kind::F16,
        DataType::Float32 => Kind::F32,
        DataType::Float64
        | DataType::Decimal32(..)
        | DataType::Decimal64(..)
        | DataType::Decimal128(..)
        | DataType::Decimal256(..) => Kind::F64,
        kind if is_time(kind) => Kind::F64,
        _ => return None,
    })
}

/// Whether these are moments or durations, which are read as seconds.
fn is_time(kind: &DataType) -> bool {
    matches!(
        kind,
        DataType::Timestamp(..)
            | DataType::Date32
            | DataType::Date64
            | DataType::Time32(_)
            | DataType::Time64(_)
            | DataType::Duration(_)
    )
}

/// How many of these are a second.
pub(super) fn per_second(unit: &TimeUnit) -> f64 {
    match unit {
        TimeUnit::Second => 1.0,
        TimeUnit::Millisecond => 1e3,
        TimeUnit::Microsecond => 1e6,
        TimeUnit::Nanosecond => 1e9,
    }
}
