//! Arrays of Arrow to columns: a part at a time, joined in order.
//!
//! Where whole numbers have nulls they become floats, in which NaN says so; words are empty there.

use std::collections::HashMap;

use arrow_array::cast::AsArray;
use arrow_array::types::{self, ArrowPrimitiveType};
use arrow_array::{Array, ArrayRef, PrimitiveArray};
use arrow_schema::{DataType, TimeUnit};
use tyndall::DVec3;
use tyndall::particles::{Attribute, Positions, Values};

use super::plan::{Leaf, Place, Role, Sort, per_second};
use crate::read::numbers::Kind;
use crate::read::records::ORIGIN_COUNT;
use crate::read::sections::with_gaps;

/// What some rows have of a column.
#[derive(Debug)]
pub(super) struct Part {
    rows: usize,
    components: usize,
    values: Values,
}

impl Part {
    /// How many rows it has.
    pub(super) fn rows(&self) -> usize {
        self.rows
    }

    fn number(&self, row: usize, component: usize) -> f64 {
        number(&self.values, row * self.components + component)
    }

    /// Appends a component of all rows, as seen from `origin`.
    fn append_offsets(&self, component: usize, origin: f64, offsets: &mut Vec<f32>) {
        let places = component..self.rows * self.components;
        let step = self.components.max(1);
        let offset = |value: f64| (value - origin) as f32;
        match &self.values {
            Values::F32(it) => offsets.extend(it[places].iter().step_by(step).map(|&it| offset(it.into()))),
            Values::F64(it) => offsets.extend(it[places].iter().step_by(step).map(|&it| offset(it))),
            values => offsets.extend(places.step_by(step).map(|place| offset(number(values, place)))),
        }
    }
}

fn number(values: &Values, place: usize) -> f64 {
    match values {
        Values::F32(values) => values[place].into(),
        Values::F64(values) => values[place],
        Values::I32(values) => values[place].into(),
        Values::I64(values) => values[place] as f64,
        Values::U8(values) => values[place].into(),
        Values::Text { .. } | Values::Frozen(_) => unreachable!("words are no numbers"),
    }
}

/// The values of a leaf in the column of the table that has it; on failure says what is wrong with the column.
pub(super) fn part(column: &ArrayRef, leaf: &Leaf) -> Result<Part, String> {
    let rows = column.len();
    let of = |array: &ArrayRef| match leaf.sort {
        Sort::Numbers(kind) => numbers(array, kind),
        Sort::Words => words(array),
    };
    let child =
        |place: usize| column.as_struct_opt().map(|it| it.column(place).clone()).ok_or("it is no structure");
    match &leaf.place {
        Place::One(None) => Ok(Part { rows, components: 1, values: of(column)? }),
        Place::One(Some(place)) => Ok(Part { rows, components: 1, values: of(&child(*place)?)? }),
        Place::List => list(column, leaf),
        Place::Children(places) => {
            let parts: Vec<Values> = places.iter().map(|&it| of(&child(it)?)).collect::<Result<_, _>>()?;
            let count = parts.len();
            let all = (0..rows * count).map(|it| number(&parts[it % count], it / count));
            let values = match parts.iter().all(|it| matches!(it, Values::F32(_))) {
                true => Values::F32(all.map(|it| it as f32).collect()),
                false => Values::F64(all.collect()),
            };
            Ok(Part { rows, components: count, values })
        }
    }
}

/// Lists of numbers, all of one length.
fn list(column: &ArrayRef, leaf: &Leaf) -> Result<Part, String> {
    let Sort::Numbers(kind) = leaf.sort else { return Err("it has lists of words".to_string()) };
    let rows = column.len();
    let is_null = |row: usize| column.is_null(row);
    // Where each row begins, and how long it is.
    let (starts, lengths, items): (Vec<usize>, Vec<usize>, ArrayRef) = match column.data_type() {
        DataType::FixedSizeList(..) => {
            let list = column.as_fixed_size_list();
            let length = list.value_length() as usize;
            (
                (0..rows).map(|row| list.value_offset_at(row)).collect(),
                vec![length; rows],
                list.values().clone(),
            )
        }
        DataType::LargeList(_) => {
            let list = column.as_list::<i64>();
            let offsets = list.value_offsets();
            let ends = offsets.windows(2).map(|it| (it[1] - it[0]) as usize).collect();
            (offsets[..rows].iter().map(|&it| it as usize).collect(), ends, list.values().clone())
        }
        _ => {
            let list = column.as_list_opt::<i32>().ok_or("it has no lists")?;
            let offsets = list.value_offsets();
            let ends = offsets.windows(2).map(|it| (it[1] - it[0]) as usize).collect();
            (offsets[..rows].iter().map(|&it| it as usize).collect(), ends, list.values().clone())
        }
    };
    let told = (0..rows).find(|&row| !is_null(row));
    let components = told.map_or(leaf.components.unwrap_or(1), |row| lengths[row]);
    if (0..rows).any(|row| !is_null(row) && lengths[row] != components) {
        return Err("its lists have different lengths".to_string());
    }
    if components == 0 || told.is_none() && rows > 0 && leaf.components.is_none() {
        return Err("its lists are empty".to_string());
    }
    // Most lists follow each other without a gap.
    if starts.windows(2).all(|it| it[0] + components == it[1]) && !(0..rows).any(is_null) {
        let first = starts.first().copied().unwrap_or(0);
        return Ok(Part { rows, components, values: numbers(&items.slice(first, rows * components), kind)? });
    }
    let first = starts.first().copied().unwrap_or(0);
    let end = starts.iter().zip(&lengths).map(|(start, length)| start + length).next_back().unwrap_or(first);
    let all = numbers(&items.slice(first, end - first), kind)?;
    let value = |place: usize| {
        let row = place / components;
        if is_null(row) { f64::NAN } else { number(&all, starts[row] - first + place % components) }
    };
    let values = (0..rows * components).map(value);
    let values = match with_gaps(kind) {
        Kind::F32 => Values::F32(values.map(|it| it as f32).collect()),
        _ => Values::F64(values.collect()),
    };
    Ok(Part { rows, components, values })
}

/// Numbers of any type.
fn numbers(array: &ArrayRef, kind: Kind) -> Result<Values, String> {
    macro_rules! integers {
        ($($data:pat => $type:ty),* $(,)?) => {
            match array.data_type() {
                $($data => return Ok(integers(array.as_primitive::<$type>(), kind, |it| it as i64)),)*
                _ => {}
            }
        };
    }
    integers! {
        DataType::Int8 => types::Int8Type, DataType::Int16 => types::Int16Type, DataType::Int32 => types::Int32Type,
        DataType::Int64 => types::Int64Type, DataType::UInt8 => types::UInt8Type, DataType::UInt16 => types::UInt16Type,
        DataType::UInt32 => types::UInt32Type,
    }
    macro_rules! converted {
        ($type:ty, $convert:expr) => {
            Ok(Values::F64(floats(array.as_primitive::<$type>(), f64::NAN, $convert)))
        };
    }
    // Divided, not multiplied by a fraction, which would be rounded itself.
    let unit = |scale: &i8| 10f64.powi(i32::from(*scale));
    match array.data_type() {
        DataType::UInt64 => {
            let values = array.as_primitive::<types::UInt64Type>();
            // What is beyond the signed numbers makes floats of all.
            match values.iter().flatten().any(|it| it > i64::MAX as u64) {
                true => Ok(Values::F64(floats(values, f64::NAN, |it| it as f64))),
                false => Ok(integers(values, kind, |it| it as i64)),
            }
        }
        DataType::Boolean => {
            let values = array.as_boolean();
            Ok(match values.null_count() {
                0 => Values::U8(values.values().iter().map(u8::from).collect()),
                _ => Values::F32(
                    values.iter().map(|it| it.map_or(f32::NAN, |it| f32::from(u8::from(it)))).collect(),
                ),
            })
        }
        DataType::Float16 => {
            Ok(Values::F32(floats(array.as_primitive::<types::Float16Type>(), f32::NAN, |it| it.to_f32())))
        }
        DataType::Float32 => {
            Ok(Values::F32(floats(array.as_primitive::<types::Float32Type>(), f32::NAN, |it| it)))
        }
        DataType::Float64 => {
            Ok(Values::F64(floats(array.as_primitive::<types::Float64Type>(), f64::NAN, |it| it)))
        }
        DataType::Decimal32(_, scale) => converted!(types::Decimal32Type, |it| f64::from(it) / unit(scale)),
        DataType::Decimal64(_, scale) => converted!(types::Decimal64Type, |it| it as f64 / unit(scale)),
        DataType::Decimal128(_, scale) => converted!(types::Decimal128Type, |it| it as f64 / unit(scale)),
        DataType::Decimal256(_, scale) => {
            let number = |it: arrow_buffer::i256| it.to_string().parse().unwrap_or(f64::NAN);
            converted!(types::Decimal256Type, |it| number(it) / unit(scale))
        }
        DataType::Date32 => converted!(types::Date32Type, |it| f64::from(it) * 86_400.0),
        DataType::Date64 => converted!(types::Date64Type, |it| it as f64 / 1e3),
        DataType::Time32(TimeUnit::Second) => converted!(types::Time32SecondType, f64::from),
        DataType::Time32(_) => converted!(types::Time32MillisecondType, |it| f64::from(it) / 1e3),
        DataType::Timestamp(unit, _) | DataType::Duration(unit) | DataType::Time64(unit) => {
            let values = moments(array).ok_or("its moments cannot be read")?;
            Ok(Values::F64(floats(&values, f64::NAN, |it| it as f64 / per_second(unit))))
        }
        DataType::Dictionary(..) => {
            let dictionary = array.as_any_dictionary();
            let all = match dictionary.values().is_empty() {
                true => Values::F64(vec![]),
                false => numbers(dictionary.values(), Kind::F64)?,
            };
            let value = |(row, key): (usize, usize)| match array.is_null(row) {
                true => f64::NAN,
                false => number(&all, key),
            };
            Ok(Values::F64(keys(array).into_iter().enumerate().map(value).collect()))
        }
        other => Err(format!("its type {other} is not read")),
    }
}

/// Moments of any unit, as the numbers that they are.
fn moments(array: &ArrayRef) -> Option<PrimitiveArray<types::Int64Type>> {
    let data = array.to_data().into_builder().data_type(DataType::Int64).build().ok()?;
    Some(PrimitiveArray::from(data))
}

fn floats<T: ArrowPrimitiveType, O: Copy>(
    array: &PrimitiveArray<T>,
    null: O,
    convert: impl Fn(T::Native) -> O,
) -> Vec<O> {
    match array.null_count() {
        0 => array.values().iter().map(|&it| convert(it)).collect(),
        _ => array.iter().map(|it| it.map_or(null, &convert)).collect(),
    }
}

/// Whole numbers, in the narrowest column for their type; floats if there are nulls.
fn integers<T: ArrowPrimitiveType>(
    array: &PrimitiveArray<T>,
    kind: Kind,
    convert: impl Fn(T::Native) -> i64,
) -> Values {
    if array.null_count() > 0 || kind == Kind::F64 {
        return match with_gaps(kind) {
            Kind::F32 => Values::F32(floats(array, f32::NAN, |it| convert(it) as f32)),
            _ => Values::F64(floats(array, f64::NAN, |it| convert(it) as f64)),
        };
    }
    match kind {
        Kind::U8 => Values::U8(floats(array, 0, |it| convert(it) as u8)),
        Kind::U32 | Kind::I64 | Kind::U64 => Values::I64(floats(array, 0, convert)),
        _ => Values::I32(floats(array, 0, |it| convert(it) as i32)),
    }
}

/// Which of the values of a dictionary each row has; 0 where it has none.
fn keys(array: &ArrayRef) -> Vec<usize> {
    let dictionary = array.as_any_dictionary();
    if dictionary.values().is_empty() {
        return vec![0; array.len()];
    }
    dictionary.normalized_keys()
}

/// Words, each once.
#[derive(Debug, Default)]
struct Dictionary {
    known: HashMap<String, u32>,
    names: Vec<String>,
}

impl Dictionary {
    fn code(&mut self, word: &str) -> u32 {
        if let Some(&code) = self.known.get(word) {
            return code;
        }
        let code = self.names.len() as u32;
        self.names.push(word.to_string());
        self.known.insert(word.to_string(), code);
        code
    }
}

fn words(array: &ArrayRef) -> Result<Values, String> {
    let mut dictionary = Dictionary::default();
    let mut of = |words: &mut dyn Iterator<Item = Option<&str>>| -> Vec<u32> {
        words.map(|it| dictionary.code(it.unwrap_or_default())).collect()
    };
    let codes = match array.data_type() {
        DataType::Utf8 => of(&mut array.as_string::<i32>().iter()),
        DataType::LargeUtf8 => of(&mut array.as_string::<i64>().iter()),
        DataType::Utf8View => of(&mut array.as_string_view().iter()),
        DataType::Dictionary(..) => {
            let values = array.as_any_dictionary().values();
            let Values::Text { codes: all, names } = words(values)? else { unreachable!("words are text") };
            let codes: Vec<u32> = all.iter().map(|&it| dictionary.code(&names[it as usize])).collect();
            let code = |(row, key): (usize, usize)| match array.is_null(row) {
                true => dictionary.code(""),
                false => codes[key],
            };
            keys(array).into_iter().enumerate().map(code).collect()
        }
        other => return Err(format!("its type {other} is not read")),
    };
    Ok(Values::Text { codes, names: dictionary.names })
}

/// A column while its parts are joined.
#[derive(Debug)]
pub(super) struct Joined {
    leaf: Leaf,
    values: Option<Values>,
    components: usize,
    words: Dictionary,
    /// What is wrong with it: then it is left out.
    fault: Option<String>,
}

impl Joined {
    pub(super) fn new(leaf: &Leaf) -> Self {
        let components = leaf.components.unwrap_or(1);
        Self { leaf: leaf.clone(), values: None, components, words: Dictionary::default(), fault: None }
    }

    pub(super) fn append(&mut self, part: Result<Part, String>) {
        let part = match part {
            Ok(part) => part,
            Err(fault) => {
                self.fault.get_or_insert(fault);
                return;
            }
        };
        if part.rows == 0 || self.fault.is_some() {
            return;
        }
        let values = match part.values {
            Values::Text { codes, names } => {
                let own: Vec<u32> = names.iter().map(|it| self.words.code(it)).collect();
                Values::Text { codes: codes.iter().map(|&it| own[it as usize]).collect(), names: vec![] }
            }
            values => values,
        };
        match &mut self.values {
            None => {
                self.components = part.components;
                self.values = Some(values);
            }
            Some(_) if self.components != part.components => {
                self.fault = Some("its lists have different lengths".to_string());
                self.values = None;
            }
            Some(all) => join(all, values),
        }
    }

    /// The attribute, and what is to be said of it; on failure why there is none.
    pub(super) fn into_attribute(self) -> Result<(Attribute, Option<String>), String> {
        let Self { leaf, values, components, words, fault } = self;
        if let Some(fault) = fault {
            return Err(format!("left out: '{}': {fault}", leaf.name));
        }
        let values = match (values, leaf.sort) {
            (Some(Values::Text { codes, .. }), _) => Values::Text { codes, names: words.names },
            (Some(values), _) => values,
            (None, Sort::Words) => Values::Text { codes: vec![], names: vec![] },
            (None, Sort::Numbers(kind)) => kind.zeros(0),
        };
        let is_whole = |kind| !matches!(kind, Kind::F16 | Kind::F32 | Kind::F64);
        let became_floats = matches!(leaf.sort, Sort::Numbers(kind) if is_whole(kind))
            && matches!(values, Values::F32(_) | Values::F64(_));
        let said = became_floats.then(|| {
            format!(
                "'{}' has nulls or numbers beyond 64 bits: its whole numbers are floats, nulls NaN",
                leaf.name
            )
        });
        Ok((Attribute { name: leaf.name, components, unit: leaf.unit, values }, said))
    }
}

/// Appends to a column; where the types differ it becomes one of floats.
fn join(all: &mut Values, more: Values) {
    match (&mut *all, more) {
        (Values::F32(all), Values::F32(more)) => all.extend(more),
        (Values::F64(all), Values::F64(more)) => all.extend(more),
        (Values::I32(all), Values::I32(more)) => all.extend(more),
        (Values::I64(all), Values::I64(more)) => all.extend(more),
        (Values::U8(all), Values::U8(more)) => all.extend(more),
        (Values::Text { codes, .. }, Values::Text { codes: more, .. }) => codes.extend(more),
        (_, more) => {
            let is_wide = |it: &Values| matches!(it, Values::F64(_) | Values::I64(_));
            let numbers = |it: &Values| {
                let count = match it {
                    Values::F32(it) => it.len(),
                    Values::F64(it) => it.len(),
                    Values::I32(it) => it.len(),
                    Values::I64(it) => it.len(),
                    Values::U8(it) => it.len(),
                    Values::Text { .. } | Values::Frozen(_) => 0,
                };
                (0..count).map(|place| number(it, place)).collect::<Vec<f64>>()
            };
            let joined = [numbers(all), numbers(&more)].concat();
            *all = match is_wide(all) || is_wide(&more) {
                true => Values::F64(joined),
                false => Values::F32(joined.into_iter().map(|it| it as f32).collect()),
            };
        }
    }
}

/// Positions while their parts are joined.
#[derive(Debug, Default)]
pub(super) struct Places {
    origin: Option<DVec3>,
    offsets: [Vec<f32>; 3],
    components: Option<usize>,
}

impl Places {
    /// Appends rows; `parts` have their coordinates, with the role of each. On failure says what is wrong.
    pub(super) fn append(&mut self, parts: &[(Role, Part)]) -> Result<(), String> {
        let rows = parts.first().map_or(0, |(_, part)| part.rows);
        for (role, part) in parts {
            if *role == Role::Position {
                let known = *self.components.get_or_insert(part.components);
                if !(2..=3).contains(&part.components) || known != part.components {
                    return Err(format!("positions have two or three coordinates, not {}", part.components));
                }
            }
        }
        // Where the coordinates of an axis are; nowhere in the plane.
        let column = |axis: usize| {
            let of = |(role, part): &'_ (Role, Part)| match role {
                Role::Axis(of) => (*of == axis).then_some(0),
                Role::Position => (axis < part.components).then_some(axis),
                Role::Attribute => None,
            };
            parts.iter().find_map(|it| Some((&it.1, of(it)?)))
        };
        let columns: [Option<(&Part, usize)>; 3] = std::array::from_fn(column);
        let origin = *self.origin.get_or_insert_with(|| {
            let coordinate =
                |row, axis: usize| columns[axis].map_or(0.0, |(part, component)| part.number(row, component));
            let position = |row: usize| DVec3::from_array(std::array::from_fn(|axis| coordinate(row, axis)));
            let mut positions = Positions::new();
            positions.extend(&(0..rows.min(ORIGIN_COUNT)).map(position).collect::<Vec<_>>());
            positions.origin()
        });
        for (axis, offsets) in self.offsets.iter_mut().enumerate() {
            match columns[axis] {
                Some((part, component)) => part.append_offsets(component, origin[axis], offsets),
                None => offsets.extend(std::iter::repeat_n((0.0 - origin[axis]) as f32, rows)),
            }
        }
        Ok(())
    }

    pub(super) fn is_flat(&self) -> bool {
        self.components == Some(2)
    }

    pub(super) fn into_positions(self) -> Positions {
        Positions::from_offsets(self.origin.unwrap_or(DVec3::ZERO), self.offsets)
    }
}
