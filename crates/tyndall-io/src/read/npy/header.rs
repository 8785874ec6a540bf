//! The header of an NPY file: a dictionary, written as Python writes it, of type, order and shape.
//!
//! Takes the bytes from the magic on, gives a [`Header`]. Its sizes are what the file says: they are compared with the bytes that
//! are there before anything is read by them. Source: NumPy enhancement proposal 1 and `numpy.lib.format`.

use super::literal::{Literal, parse};
use crate::read::numbers::{Kind, Order};

/// What is wrong with a file and what to try; the path is added by the caller.
pub(super) type Fault = (String, &'static str);

const HINT: &str = "write the array again with numpy.save";

/// More fields than this are not believed.
const FIELDS_MAX: usize = 65536;

/// An array's type and shape.
#[derive(Debug)]
pub(super) struct Header {
    pub(super) element: Element,
    pub(super) fortran_order: bool,
    pub(super) shape: Vec<usize>,
    /// The byte where the values begin.
    pub(super) start: usize,
}

/// What an array consists of.
#[derive(Clone, Debug)]
pub(super) enum Element {
    Scalar(Scalar),
    /// A structure: its members, and its size in bytes.
    Record(Vec<Member>, usize),
}

/// A value of one type.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Scalar {
    Number(Kind, Order),
    /// Text of a fixed number of bytes, padded with zeros.
    Bytes(usize),
    /// Text of a fixed number of bytes, 4 a letter.
    Letters(usize, Order),
    /// So many bytes of something that is not read, or of padding.
    Other(usize),
}

/// A member of a structure: `components` values, `step` bytes apart.
#[derive(Clone, Debug)]
pub(super) struct Member {
    pub(super) name: String,
    pub(super) scalar: Scalar,
    pub(super) offset: usize,
    pub(super) components: usize,
    pub(super) step: usize,
}

impl Scalar {
    pub(super) fn size(self) -> usize {
        match self {
            Self::Number(kind, _) => kind.size(),
            Self::Bytes(size) | Self::Letters(size, _) | Self::Other(size) => size,
        }
    }
}

impl Element {
    pub(super) fn size(&self) -> usize {
        match self {
            Self::Scalar(scalar) => scalar.size(),
            Self::Record(_, size) => *size,
        }
    }
}

impl Header {
    /// How many bytes there are before the values, told by the first 12 bytes.
    pub(super) fn length(bytes: &[u8]) -> Result<usize, Fault> {
        match *bytes {
            [0x93, b'N', b'U', b'M', b'P', b'Y', 1, _, a, b, ..] => {
                Ok(10 + usize::from(u16::from_le_bytes([a, b])))
            }
            [0x93, b'N', b'U', b'M', b'P', b'Y', 2 | 3, _, a, b, c, d, ..] => {
                Ok(12 + u32::from_le_bytes([a, b, c, d]) as usize)
            }
            [0x93, b'N', b'U', b'M', b'P', b'Y', version, _, _, ..] if !(1..=3).contains(&version) => {
                Err((format!("NPY version 1, 2 or 3 was wanted, {version} was found"), HINT))
            }
            _ => Err(("the header of a NumPy array was wanted".into(), HINT)),
        }
    }

    /// Reads the header of an array.
    pub(super) fn read(bytes: &[u8]) -> Result<Self, Fault> {
        let start = Self::length(bytes)?;
        let is_latin = bytes[6] < 3;
        let text_start = if bytes[6] == 1 { 10 } else { 12 };
        let Some(text) = bytes.get(text_start..start) else {
            return Err((
                format!("a header of {start} bytes was wanted, {} bytes are there", bytes.len()),
                HINT,
            ));
        };
        let text: String = if is_latin {
            text.iter().map(|byte| char::from(*byte)).collect()
        } else {
            String::from_utf8_lossy(text).into_owned()
        };
        let wrong = |what: &str| (format!("the array's header is damaged: {what}"), HINT);
        let Literal::Dictionary(entries) = parse(&text).map_err(|what| wrong(&what))? else {
            return Err(wrong("a dictionary was wanted"));
        };
        let entry = |name: &str| {
            let found = entries.iter().find(|(key, _)| matches!(key, Literal::Text(key) if key == name));
            found.map(|(_, value)| value).ok_or_else(|| wrong(&format!("it has no '{name}'")))
        };
        let Literal::Truth(fortran_order) = *entry("fortran_order")? else {
            return Err(wrong("fortran_order is True or False"));
        };
        let shape = shape(entry("shape")?).ok_or_else(|| wrong("the shape is a tuple of integers"))?;
        let element = element(entry("descr")?, 0)?;
        Ok(Self { element, fortran_order, shape, start })
    }

    /// How many bytes the values need; `None` if that is more than can be counted.
    pub(super) fn values_bytes(&self) -> Option<usize> {
        self.shape.iter().try_fold(self.element.size(), |bytes, length| bytes.checked_mul(*length))
    }
}

fn shape(literal: &Literal) -> Option<Vec<usize>> {
    let length = |literal: &Literal| match literal {
        Literal::Integer(length) => usize::try_from(*length).ok(),
        _ => None,
    };
    match literal {
        Literal::List(lengths) if lengths.len() <= 64 => lengths.iter().map(length).collect(),
        literal => length(literal).map(|length| vec![length]),
    }
}

fn element(descr: &Literal, depth: usize) -> Result<Element, Fault> {
    let wrong = |what: &str| (format!("the array's type is damaged: {what}"), HINT);
    match descr {
        Literal::Text(name) => scalar(name).map(Element::Scalar),
        Literal::List(members) if depth < 16 => {
            let (mut flat, mut size) = (Vec::new(), 0usize);
            for member in members {
                let parts: &[Literal] = match member {
                    Literal::List(parts) => parts,
                    _ => &[],
                };
                let (name, descr, shape) = match parts {
                    [name, descr] => (name, descr, vec![]),
                    [name, descr, lengths] => {
                        (name, descr, shape(lengths).ok_or_else(|| wrong("a member's shape"))?)
                    }
                    _ => return Err(wrong("a member is (name, type) or (name, type, shape)")),
                };
                // A member with a title has the pair (title, name) for a name.
                let name = match name {
                    Literal::Text(name) => name,
                    Literal::List(pair) => match &pair[..] {
                        [_, Literal::Text(name)] => name,
                        _ => return Err(wrong("a member's name")),
                    },
                    _ => return Err(wrong("a member's name")),
                };
                let element = element(descr, depth + 1)?;
                let count = shape.iter().try_fold(1usize, |count, length| count.checked_mul(*length));
                let bytes = count.and_then(|count| count.checked_mul(element.size()));
                let (Some(count), Some(end)) = (count, bytes.and_then(|bytes| bytes.checked_add(size)))
                else {
                    return Err(wrong("a member is too large"));
                };
                flatten(name, element, count, size, &mut flat).ok_or_else(|| wrong("too many members"))?;
                size = end;
            }
            Ok(Element::Record(flat, size))
        }
        _ => Err(wrong("a name or a list of members was wanted")),
    }
}

/// Adds a member, or the members of a structure within it; `None` if they are too many.
fn flatten(name: &str, element: Element, count: usize, offset: usize, flat: &mut Vec<Member>) -> Option<()> {
    match element {
        Element::Scalar(scalar) => {
            flat.push(Member { name: name.into(), scalar, offset, components: count, step: scalar.size() });
        }
        Element::Record(members, size) => {
            let count = if members.is_empty() { 0 } else { count };
            for place in 0..count {
                let prefix = if count == 1 { name.to_string() } else { format!("{name}[{place}]") };
                if flat.len() + members.len() > FIELDS_MAX {
                    return None;
                }
                flat.extend(members.iter().map(|member| Member {
                    name: format!("{prefix}.{}", member.name),
                    offset: offset + place * size + member.offset,
                    ..*member
                }));
            }
        }
    }
    (flat.len() <= FIELDS_MAX).then_some(())
}

/// A type's name, such as `<f4`.
fn scalar(name: &str) -> Result<Scalar, Fault> {
    let unknown = |hint| Err((format!("the array has values of type '{name}', which cannot be read"), hint));
    let mut letters = name.chars();
    let order = match letters.next() {
        Some('<' | '|' | '=') => Order::Little,
        Some('>') => Order::Big,
        _ => return unknown(HINT),
    };
    let code = letters.next();
    let size = letters.as_str();
    let kind = match (code, size) {
        (Some('O'), _) => {
            let what = "the array holds Python objects, not numbers".to_string();
            return Err((what, "convert it before saving: array.astype('f4')"));
        }
        (Some('?'), _) | (Some('b' | 'u'), "1") => Kind::U8,
        (Some('i'), "1") => Kind::I8,
        (Some('i'), "2") => Kind::I16,
        (Some('u'), "2") => Kind::U16,
        (Some('i'), "4") => Kind::I32,
        (Some('u'), "4") => Kind::U32,
        (Some('i'), "8") => Kind::I64,
        (Some('u'), "8") => Kind::U64,
        (Some('f'), "2") => Kind::F16,
        (Some('f'), "4") => Kind::F32,
        (Some('f'), "8") => Kind::F64,
        (Some('m' | 'M'), size) if size.starts_with('8') => return Ok(Scalar::Other(8)),
        (Some(code), size) => {
            let hint = "convert it before saving: array.astype('f8')";
            let Ok(length) = size.parse::<u32>() else { return unknown(hint) };
            let length = length as usize;
            return match code {
                'S' | 'a' => Ok(Scalar::Bytes(length)),
                'U' => Ok(Scalar::Letters(4 * length, order)),
                'V' | 'c' | 'f' => Ok(Scalar::Other(length)),
                _ => unknown(hint),
            };
        }
        (None, _) => return unknown(HINT),
    };
    Ok(Scalar::Number(kind, order))
}
