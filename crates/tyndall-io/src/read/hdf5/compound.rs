//! Data sets whose rows are records: tables of h5py, PyTables and Astropy.
//!
//! The members `x`, `y` and `z`, by any name that tables know, or one of two or three numbers that is called like positions, are the place; the
//! others are quantities, but those without numbers. The table is read as a whole, and its members are brought into columns from there.

use std::sync::Arc;

use tyndall::Result;

use super::columns::{Input, Numbers, Term};
use super::data::{Data, Member};
use super::plain::NAMES;
use crate::read::content::Content;
use crate::read::sections::Column;
use crate::read::table;

/// What a table holds.
pub(super) struct Table {
    pub(super) positions: Input,
    pub(super) count: usize,
    pub(super) columns: Vec<Column>,
    pub(super) values: Vec<Input>,
    /// Members without numbers.
    pub(super) left_out: Vec<String>,
}

/// The members that are the place: one, or one for each axis.
fn place(members: &[Member]) -> Option<Vec<usize>> {
    let is_named = |it: &&Member| NAMES.iter().any(|name| name.eq_ignore_ascii_case(&it.name));
    let vectors = members.iter().filter(|it| (2..=3).contains(&it.width));
    if let Some(vector) = vectors.clone().find(is_named) {
        return members.iter().position(|it| std::ptr::eq(it, vector)).map(|it| vec![it]);
    }
    let names: Vec<String> =
        members.iter().map(|it| if it.width == 1 { it.name.clone() } else { String::new() }).collect();
    let (x, y, z) = table::coordinates(&names)?;
    Some([Some(x), Some(y), z].into_iter().flatten().collect())
}

/// Whether the rows of a data set are records with a place.
pub(super) fn is_table(data: &Data) -> bool {
    data.shape().len() == 1 && place(&data.members()).is_some()
}

/// Reads a table; `None` if it is none.
pub(super) fn read(data: &Data) -> Result<Option<Table>> {
    let members = data.members();
    let Some(place) = place(&members) else { return Ok(None) };
    let (bytes, stride) = data.records()?;
    let (count, content) = (bytes.len() / stride, Arc::new(Content::Unpacked(bytes)));
    let numbers = |member: &Member| Numbers {
        content: Arc::clone(&content),
        kind: member.kind,
        order: member.order,
        start: member.offset,
        stride,
        count,
        width: member.width,
    };
    let axis = |&it: &usize| vec![Term::Numbers(numbers(&members[it]), 1.0)];
    let positions = match place[..] {
        [vector] => Input::Numbers(numbers(&members[vector])),
        _ => Input::Sums(place.iter().map(axis).collect()),
    };
    let others = || members.iter().enumerate().filter(|(it, _)| !place.contains(it)).map(|it| it.1);
    let left_out = data.member_names().into_iter().filter(|name| !members.iter().any(|it| it.name == *name));
    Ok(Some(Table {
        positions,
        count,
        columns: others().map(|it| Column::new(it.name.clone(), it.width)).collect(),
        values: others().map(|it| Input::Numbers(numbers(it))).collect(),
        left_out: left_out.collect(),
    }))
}
