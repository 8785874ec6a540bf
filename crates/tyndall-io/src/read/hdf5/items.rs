//! A `DataItem` of XDMF: to which other one it refers, which rows a hyperslab takes, and its numbers where they are in no HDF5 file but between
//! its tags (`Format="XML"`), or raw in a file (`Format="Binary"`).
//!
//! `Dimensions` are those of the array, the last one running fastest; `NumberType` and `Precision` (bytes) tell the kind. A file is named by
//! the text, with `Endian` and the first byte, `Seek`. Source: xdmf.org, "XDMF Model and Format".

use std::ops::Range;
use std::sync::Arc;

use super::columns::Numbers;
use super::rows::{MOST_WIDTH, NATIVE, Rows};
use crate::read::content::Content;
use crate::read::numbers::{Kind, Order};
use crate::read::vtk::{Node, numbers};

/// So many references may lead to each other.
const MOST_REFERENCES: usize = 8;

/// The item for which another one stands: itself, or the one to which it refers.
pub(super) fn target<'a>(root: &'a Node<'a>, mut item: &'a Node<'a>) -> Result<&'a Node<'a>, String> {
    for _ in 0..MOST_REFERENCES {
        let path = match item.get("Reference") {
            None => return Ok(item),
            Some(word) if word.eq_ignore_ascii_case("XML") => item.text().trim(),
            Some(path) => path,
        };
        item = at_path(root, path)
            .ok_or_else(|| format!("its DataItem refers to '{path}', which is not there"))?;
    }
    Err("its DataItem refers to others, in a circle".into())
}

/// The element at a path like `/Xdmf/Domain/DataItem[@Name="points"]` or `/Xdmf/Domain/Grid[2]/Geometry/DataItem`.
fn at_path<'a>(root: &'a Node<'a>, path: &str) -> Option<&'a Node<'a>> {
    let mut depth = 0;
    let steps = path.trim_start_matches('/').split(|letter| {
        depth += i32::from(letter == '[') - i32::from(letter == ']');
        letter == '/' && depth == 0
    });
    let mut steps = steps.map(|step| match step.trim().split_once('[') {
        Some((name, rest)) => (name, rest.strip_suffix(']')),
        None => (step.trim(), Some("1")),
    });
    steps.next().filter(|it| it.0 == root.name)?;
    steps.try_fold(root, |node, (name, which)| {
        let (which, mut found) = (which?, node.children.iter().filter(|it| it.name == name));
        match which.strip_prefix("@Name=") {
            Some(wanted) => found.find(|it| it.get("Name") == Some(wanted.trim_matches(['"', '\'']))),
            None => found.nth(which.parse::<usize>().ok()?.checked_sub(1)?),
        }
    })
}

/// Which rows of a data set are taken: all, or those of a hyperslab.
#[derive(Default)]
pub(super) struct Slab {
    /// Indices of the dimensions before that of the rows.
    pub(super) lead: Vec<u64>,
    rows: Option<Range<usize>>,
}

impl Slab {
    /// The one that an item of starts, strides and counts tells, of a data set of this extent.
    pub(super) fn of(item: &Node, shape: &[u64]) -> Result<Self, String> {
        let numbers: Option<Vec<u64>> = item.text().split_whitespace().map(|it| it.parse().ok()).collect();
        let numbers = numbers.filter(|it| !it.is_empty() && it.len() == 3 * shape.len());
        let wrong = || format!("its HyperSlab '{}' is none of an extent of {shape:?}", item.text());
        let numbers = numbers.ok_or_else(wrong)?;
        let (starts, rest) = numbers.split_at(shape.len());
        let (strides, counts) = rest.split_at(shape.len());
        let lead = counts[..counts.len() - 1].iter().take_while(|it| **it == 1).count();
        let behind = lead + 1..shape.len();
        let are_whole = behind.clone().all(|it| (starts[it], counts[it]) == (0, shape[it]));
        if strides[lead] != 1 || !behind.clone().all(|it| strides[it] == 1) || !are_whole {
            return Err("its HyperSlab takes parts of rows, or some of them".into());
        }
        let end = starts[lead].checked_add(counts[lead]).filter(|it| *it <= shape[lead]).ok_or_else(wrong)?;
        let rows = starts[lead] as usize..end as usize;
        let is_all = rows == (0..shape[lead] as usize);
        Ok(Self { lead: starts[..lead].to_vec(), rows: (!is_all).then_some(rows) })
    }

    /// Those of the rows.
    pub(super) fn cut(self, rows: Rows) -> Result<Rows, String> {
        match self.rows {
            Some(range) => rows.within(range).ok_or("its HyperSlab takes some rows of a step".into()),
            None => Ok(rows),
        }
    }
}

/// The kind of its numbers.
fn kind(item: &Node) -> Result<Kind, String> {
    let name = item.get("NumberType").or(item.get("DataType")).unwrap_or("Float");
    let precision = item.get("Precision");
    Ok(match (name.to_ascii_lowercase().as_str(), precision) {
        ("float", Some("4") | None) => Kind::F32,
        ("float", Some("8")) => Kind::F64,
        ("char", Some("1") | None) | ("int", Some("1")) => Kind::I8,
        ("uchar", Some("1") | None) | ("uint", Some("1")) => Kind::U8,
        ("short", Some("2") | None) | ("int", Some("2")) => Kind::I16,
        ("ushort", Some("2") | None) | ("uint", Some("2")) => Kind::U16,
        ("int", Some("4") | None) => Kind::I32,
        ("uint", Some("4") | None) => Kind::U32,
        ("int", Some("8")) => Kind::I64,
        ("uint", Some("8")) => Kind::U64,
        (_, precision) => {
            let bytes = precision.map_or(String::new(), |it| format!(" of {it} bytes"));
            return Err(format!("its numbers are of the type {name}{bytes}"));
        }
    })
}

/// The rows, and the numbers in each.
fn extent(item: &Node) -> Result<(usize, usize), String> {
    let text = item.get("Dimensions").ok_or("its DataItem has no Dimensions")?;
    let wrong = || format!("its Dimensions are '{text}'");
    let sizes: Option<Vec<usize>> = text.split_whitespace().map(|it| it.parse().ok()).collect();
    let sizes = sizes.filter(|it| !it.is_empty()).ok_or_else(wrong)?;
    let width = sizes[1..].iter().try_fold(1usize, |width, &size| width.checked_mul(size));
    let width = width.filter(|&it| it > 0 && it as u64 <= MOST_WIDTH).ok_or_else(wrong)?;
    sizes[0].checked_mul(width).ok_or_else(wrong)?;
    Ok((sizes[0], width))
}

/// The numbers between its tags.
pub(super) fn text(item: &Node) -> Result<Numbers, String> {
    let (kind, (count, width)) = (kind(item)?, extent(item)?);
    let bytes = numbers(item.text().as_bytes(), kind, count * width)?;
    let content = Arc::new(Content::Unpacked(bytes));
    Ok(Numbers { content, kind, order: Order::Little, start: 0, stride: width * kind.size(), count, width })
}

/// Its numbers in `content`, the file that it names.
pub(super) fn binary(item: &Node, content: Arc<Content>) -> Result<Numbers, String> {
    let (kind, (count, width)) = (kind(item)?, extent(item)?);
    if let Some(packed) = item.get("Compression").filter(|it| !["Raw", "None"].contains(it)) {
        return Err(format!("its file is compressed: {packed}"));
    }
    let order = match item.get("Endian").unwrap_or("Native").to_ascii_lowercase().as_str() {
        "little" => Order::Little,
        "big" => Order::Big,
        "native" => NATIVE,
        other => return Err(format!("there is no order of bytes '{other}'")),
    };
    let seek = item.get("Seek").unwrap_or("0");
    let start: usize = seek.parse().map_err(|_| format!("its Seek is '{seek}'"))?;
    let end = (count * width).checked_mul(kind.size()).and_then(|it| it.checked_add(start));
    let there = (*content).as_ref().len();
    if end.is_none_or(|end| end > there) {
        let numbers = count * width;
        return Err(format!(
            "{numbers} numbers from byte {start} on are more than a file of {there} bytes has"
        ));
    }
    Ok(Numbers { content, kind, order, start, stride: width * kind.size(), count, width })
}
