//! The numbers of an XDMF `DataItem` that are in no HDF5 file: between its tags (`Format="XML"`), or raw in a file (`Format="Binary"`).
//!
//! `Dimensions` are those of the array, the last one running fastest; `NumberType` and `Precision` (bytes) tell the kind. A file is named by
//! the text, with `Endian` and the first byte, `Seek`. Source: xdmf.org, "XDMF Model and Format".

use std::sync::Arc;

use super::columns::Numbers;
use super::tree::{MOST_WIDTH, NATIVE};
use crate::read::content::Content;
use crate::read::numbers::{Kind, Order};
use crate::read::vtk::{Node, numbers};

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
