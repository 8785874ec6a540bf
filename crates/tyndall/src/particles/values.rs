//! What is known of every particle besides its place: named columns of numbers or words.

use std::collections::HashMap;

use crate::frozen::Frozen;

/// The values of an attribute, particle by particle; the components of one particle stand side by side. [`Values::view`] shows them
/// wherever they are held.
#[derive(Clone, Debug)]
pub enum Values {
    /// 32-bit floats.
    F32(Vec<f32>),
    /// 64-bit floats, kept where 32 bits would lose what the file says.
    F64(Vec<f64>),
    /// 32-bit integers; narrower ones are widened to it.
    I32(Vec<i32>),
    /// 64-bit integers.
    I64(Vec<i64>),
    /// Bytes, also for colors and truth values.
    U8(Vec<u8>),
    /// Words: `names[codes[k]]`.
    Text {
        /// Which name each particle has.
        codes: Vec<u32>,
        /// The names, in order of first appearance.
        names: Vec<String>,
    },
    /// Any of these that stay where they are, such as in a mapped file.
    Frozen(FrozenValues),
}

/// [`Values`] that no longer change.
#[derive(Clone, Debug)]
pub enum FrozenValues {
    /// 32-bit floats.
    F32(Frozen<f32>),
    /// 64-bit floats.
    F64(Frozen<f64>),
    /// 32-bit integers.
    I32(Frozen<i32>),
    /// 64-bit integers.
    I64(Frozen<i64>),
    /// Bytes.
    U8(Frozen<u8>),
    /// Words: `names[codes[k]]`.
    Text {
        /// Which name each particle has.
        codes: Frozen<u32>,
        /// The names.
        names: Vec<String>,
    },
}

/// [`Values`], wherever they are held.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum View<'a> {
    /// 32-bit floats.
    F32(&'a [f32]),
    /// 64-bit floats.
    F64(&'a [f64]),
    /// 32-bit integers.
    I32(&'a [i32]),
    /// 64-bit integers.
    I64(&'a [i64]),
    /// Bytes.
    U8(&'a [u8]),
    /// Words: `names[codes[k]]`.
    Text {
        /// Which name each particle has.
        codes: &'a [u32],
        /// The names.
        names: &'a [String],
    },
}

/// Runs the same expression on whichever column a [`View`] has.
macro_rules! each_column {
    ($view:expr, $column:ident => $body:expr) => {
        match $view {
            View::F32($column) => $body,
            View::F64($column) => $body,
            View::I32($column) => $body,
            View::I64($column) => $body,
            View::U8($column) => $body,
            View::Text { codes: $column, .. } => $body,
        }
    };
}

impl PartialEq for Values {
    fn eq(&self, other: &Self) -> bool {
        self.view() == other.view()
    }
}

impl Values {
    /// The values.
    #[inline(always)]
    pub fn view(&self) -> View<'_> {
        match self {
            Self::F32(column) => View::F32(column),
            Self::F64(column) => View::F64(column),
            Self::I32(column) => View::I32(column),
            Self::I64(column) => View::I64(column),
            Self::U8(column) => View::U8(column),
            Self::Text { codes, names } => View::Text { codes, names },
            Self::Frozen(FrozenValues::F32(column)) => View::F32(column),
            Self::Frozen(FrozenValues::F64(column)) => View::F64(column),
            Self::Frozen(FrozenValues::I32(column)) => View::I32(column),
            Self::Frozen(FrozenValues::I64(column)) => View::I64(column),
            Self::Frozen(FrozenValues::U8(column)) => View::U8(column),
            Self::Frozen(FrozenValues::Text { codes, names }) => View::Text { codes, names },
        }
    }

    /// How many values there are: particles times components.
    pub fn len(&self) -> usize {
        each_column!(self.view(), column => column.len())
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The value at `place` as a number; a word counts as its code.
    #[inline(always)]
    pub fn number(&self, place: usize) -> f64 {
        match self.view() {
            View::F32(column) => column[place] as f64,
            View::F64(column) => column[place],
            View::I32(column) => column[place] as f64,
            View::I64(column) => column[place] as f64,
            View::U8(column) => column[place] as f64,
            View::Text { codes, .. } => codes[place] as f64,
        }
    }

    /// The type's name: `f32`, `f64`, `i32`, `i64`, `u8` or `text`.
    pub fn type_name(&self) -> &'static str {
        match self.view() {
            View::F32(_) => "f32",
            View::F64(_) => "f64",
            View::I32(_) => "i32",
            View::I64(_) => "i64",
            View::U8(_) => "u8",
            View::Text { .. } => "text",
        }
    }

    /// Whether the values are integers or words: things to count, not to measure.
    pub fn is_discrete(&self) -> bool {
        !matches!(self.view(), View::F32(_) | View::F64(_))
    }

    /// Memory of one value.
    pub(super) fn value_bytes(&self) -> usize {
        fn of<T>(_: &[T]) -> usize {
            size_of::<T>()
        }
        each_column!(self.view(), column => of(column))
    }

    /// Keeps the particles for which `keep` says so.
    pub(super) fn retain(&mut self, components: usize, keep: &[bool]) {
        fn kept<T: Copy>(column: &[T], components: usize, keep: &[bool]) -> Vec<T> {
            let rows = column.chunks_exact(components).zip(keep).filter(|(_, keep)| **keep);
            rows.flat_map(|(row, _)| row).copied().collect()
        }
        *self = match self.view() {
            View::F32(column) => Self::F32(kept(column, components, keep)),
            View::F64(column) => Self::F64(kept(column, components, keep)),
            View::I32(column) => Self::I32(kept(column, components, keep)),
            View::I64(column) => Self::I64(kept(column, components, keep)),
            View::U8(column) => Self::U8(kept(column, components, keep)),
            View::Text { codes, names } => {
                Self::Text { codes: kept(codes, components, keep), names: names.to_vec() }
            }
        };
    }
}

/// A named quantity of every particle.
#[derive(Clone, Debug, PartialEq)]
pub struct Attribute {
    /// Its name in the file.
    pub name: String,
    /// Values a particle: 1 for a scalar, 3 for a vector.
    pub components: usize,
    /// Its unit, where the file or its format tells.
    pub unit: Option<String>,
    /// `components` values for every particle.
    pub values: Values,
}

impl Attribute {
    /// An attribute without a unit.
    pub fn new(name: impl Into<String>, components: usize, values: Values) -> Self {
        Self { name: name.into(), components, unit: None, values }
    }

    /// The values of the particles `ids`, in this order, of words those that they have. Panics if there is no such particle.
    pub fn of(&self, ids: &[u32]) -> Self {
        fn picked<T: Copy>(column: &[T], components: usize, ids: &[u32]) -> Vec<T> {
            let row = |&id: &u32| &column[components * id as usize..][..components];
            ids.iter().flat_map(row).copied().collect()
        }
        let values = match self.values.view() {
            View::F32(column) => Values::F32(picked(column, self.components, ids)),
            View::F64(column) => Values::F64(picked(column, self.components, ids)),
            View::I32(column) => Values::I32(picked(column, self.components, ids)),
            View::I64(column) => Values::I64(picked(column, self.components, ids)),
            View::U8(column) => Values::U8(picked(column, self.components, ids)),
            View::Text { codes, names } => {
                let (mut places, mut kept) = (HashMap::new(), Vec::new());
                let mut place = |code: u32| {
                    *places.entry(code).or_insert_with(|| {
                        kept.push(names.get(code as usize).cloned().unwrap_or_default());
                        kept.len() as u32 - 1
                    })
                };
                let codes = picked(codes, self.components, ids).into_iter().map(&mut place).collect();
                Values::Text { codes, names: kept }
            }
        };
        Self { name: self.name.clone(), unit: self.unit.clone(), values, ..*self }
    }

    /// Component `component` of particle `id`.
    #[inline(always)]
    pub fn number(&self, id: usize, component: usize) -> f64 {
        self.values.number(id * self.components + component)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_of_some_particles_are_in_their_order_with_their_words() {
        let vector =
            Attribute { unit: Some("m".into()), ..Attribute::new("v", 2, Values::I32((0..8).collect())) };
        let picked = vector.of(&[3, 0]);
        assert_eq!(
            (picked.values, picked.unit.as_deref(), picked.components),
            (Values::I32(vec![6, 7, 0, 1]), Some("m"), 2)
        );
        let names = ["O", "H", "M"].map(String::from).to_vec();
        let words = Attribute::new("name", 1, Values::Text { codes: vec![0, 1, 2, 1], names });
        let names = ["M", "O"].map(String::from).to_vec();
        assert_eq!(words.of(&[2, 0, 2]).values, Values::Text { codes: vec![0, 1, 0], names });
        assert!(words.of(&[]).values.is_empty());
    }
}
