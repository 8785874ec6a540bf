//! The header of a PLY file: lines of text up to `end_header`.
//!
//! Takes the file, gives its elements with their properties and where the body begins. Lines end with LF, CRLF or CR alone.

use std::path::Path;

use tyndall::{Error, Result};

use crate::read::numbers::{Kind, Order};

/// What the header says.
pub(super) struct Header {
    pub(super) encoding: Encoding,
    pub(super) elements: Vec<Element>,
    /// What stands behind `comment`, line by line.
    pub(super) comments: Vec<String>,
    /// The byte where the body begins.
    pub(super) body: usize,
    /// The byte that ends a line.
    pub(super) line_end: u8,
}

/// How the body is written.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Encoding {
    Text,
    Binary(Order),
}

/// A table of the file: `count` rows of the properties.
#[derive(Debug)]
pub(super) struct Element {
    pub(super) name: String,
    pub(super) count: u64,
    pub(super) properties: Vec<Property>,
}

/// A column of a table.
#[derive(Debug)]
pub(super) struct Property {
    pub(super) name: String,
    pub(super) shape: Shape,
}

/// One value a row, or a count and so many values.
#[derive(Clone, Copy, Debug)]
pub(super) enum Shape {
    Scalar(Kind),
    List { length: Kind, item: Kind },
}

impl Property {
    /// The type of a scalar; `None` for a list.
    pub(super) fn kind(&self) -> Option<Kind> {
        match self.shape {
            Shape::Scalar(kind) => Some(kind),
            Shape::List { .. } => None,
        }
    }
}

impl Element {
    /// The types of the scalars, in order.
    pub(super) fn scalars(&self) -> impl Iterator<Item = Kind> {
        self.properties.iter().filter_map(Property::kind)
    }

    /// Whether all rows have the same size in binary: there are no lists.
    pub(super) fn is_fixed(&self) -> bool {
        self.properties.iter().all(|it| it.kind().is_some())
    }
}

impl Header {
    pub(super) fn read(path: &Path, bytes: &[u8]) -> Result<Self> {
        let line_end =
            if bytes.get(3) == Some(&b'\r') && bytes.get(4) != Some(&b'\n') { b'\r' } else { b'\n' };
        let (mut encoding, mut elements, mut comments) = (None, Vec::<Element>::new(), Vec::new());
        let mut place = 0;
        for number in 1.. {
            let wrong = |what: String, hint: &str| Error::format(path, format!("line {number}"), what, hint);
            let Some(length) = memchr::memchr(line_end, &bytes[place..]) else {
                return Err(wrong("the file ends before end_header".into(), super::CUT_OFF));
            };
            let line = String::from_utf8_lossy(&bytes[place..place + length]);
            place += length + 1;
            let words: Vec<&str> = line.split_ascii_whitespace().collect();
            match words[..] {
                ["comment", ..] => {
                    let (_, comment) = line.split_once("comment").unwrap_or_default();
                    let comment = comment.strip_prefix(' ').unwrap_or(comment);
                    comments.push(comment.trim_end_matches('\r').to_string());
                }
                [] | ["obj_info", ..] => {}
                ["ply"] if number == 1 => {}
                ["end_header"] => {
                    let Some(encoding) = encoding else {
                        return Err(wrong("the header has no line 'format'".into(), "add: format ascii 1.0"));
                    };
                    return Ok(Self { encoding, elements, comments, body: place, line_end });
                }
                ["format", name, "1.0"] => {
                    encoding = Some(self::encoding(name).ok_or_else(|| unknown(&wrong, &line))?)
                }
                ["element", name, count] => {
                    let count = count.parse().map_err(|_| unknown(&wrong, &line))?;
                    elements.push(Element { name: name.into(), count, properties: vec![] });
                }
                ["property", ref rest @ ..] => {
                    let property = property(rest).ok_or_else(|| unknown(&wrong, &line))?;
                    let element = elements.last_mut().ok_or_else(|| unknown(&wrong, &line))?;
                    element.properties.push(property);
                }
                _ => return Err(unknown(&wrong, &line)),
            }
        }
        unreachable!("a file has fewer lines than there are numbers")
    }

    /// Which element holds the particles.
    pub(super) fn vertex(&self, path: &Path) -> Result<usize> {
        let is_vertex = |it: &Element| {
            ["vertex", "vertices", "point", "points"].contains(&it.name.to_lowercase().as_str())
        };
        self.elements.iter().position(is_vertex).ok_or_else(|| {
            let names: Vec<&str> = self.elements.iter().map(|it| it.name.as_str()).collect();
            let what = format!("element 'vertex' was wanted, there are: {}", names.join(", "));
            Error::format(path, "header", what, "name the element that holds the positions vertex")
        })
    }

    /// Says what of the file is not shown.
    pub(super) fn left_out(&self, vertex: usize, warnings: &mut Vec<String>) {
        for (place, element) in self.elements.iter().enumerate() {
            if place != vertex && element.count > 0 {
                let (count, name) = (element.count, &element.name);
                warnings.push(format!("left out: {count} of element '{name}'; only vertices are particles"));
            }
        }
        for property in self.elements[vertex].properties.iter().filter(|it| it.kind().is_none()) {
            warnings.push(format!("left out: property '{}' of the vertices, a list", property.name));
        }
    }
}

/// The error for a line that is not understood.
fn unknown(wrong: &dyn Fn(String, &str) -> Error, line: &str) -> Error {
    let line: String = line.trim().chars().take(60).collect();
    wrong(
        format!("a line of a PLY 1.0 header was wanted, '{line}' was found"),
        "lines are: format, element NAME COUNT, property TYPE NAME, comment, end_header",
    )
}

fn encoding(name: &str) -> Option<Encoding> {
    match name {
        "ascii" => Some(Encoding::Text),
        "binary_little_endian" => Some(Encoding::Binary(Order::Little)),
        "binary_big_endian" => Some(Encoding::Binary(Order::Big)),
        _ => None,
    }
}

fn property(words: &[&str]) -> Option<Property> {
    match *words {
        ["list", length, item, name] => Some(Property {
            name: name.into(),
            shape: Shape::List { length: kind(length)?, item: kind(item)? },
        }),
        [scalar, name] => Some(Property { name: name.into(), shape: Shape::Scalar(kind(scalar)?) }),
        _ => None,
    }
}

fn kind(name: &str) -> Option<Kind> {
    Some(match name {
        "char" | "int8" => Kind::I8,
        "uchar" | "uint8" => Kind::U8,
        "short" | "int16" => Kind::I16,
        "ushort" | "uint16" => Kind::U16,
        "int" | "int32" => Kind::I32,
        "uint" | "uint32" => Kind::U32,
        "int64" | "long" => Kind::I64,
        "uint64" | "ulong" => Kind::U64,
        "float" | "float32" => Kind::F32,
        "double" | "float64" => Kind::F64,
        _ => return None,
    })
}
