//! What stands before the voxels of a file: its header, and of each grid the name, type, metadata and transform.

use std::path::Path;

use tyndall::{Error, Result};

use super::transform::{self, Transform};
use crate::read::cursor::Cursor;
use crate::read::numbers::Order;

/// The first bytes of every file.
pub(super) const MAGIC: [u8; 8] = *b" BDV\0\0\0\0";
/// The versions that are read.
const VERSIONS: std::ops::RangeInclusive<u32> = 218..=224;
/// What separates a name from the number that tells it from others like it.
const SEPARATOR: char = '\x1e';
const HINT: &str = "was the file copied to its end?";

/// Versions that brought something.
pub(super) mod since {
    /// Whether values are packed is said in the header.
    pub(in crate::vdb) const SELECTIVE_COMPRESSION: u32 = 220;
    /// How values are packed is said grid by grid, and values that are not active can be left out.
    pub(in crate::vdb) const MASK_COMPRESSION: u32 = 222;
}

/// How values are packed: bits of a number in the file.
pub(super) mod packed {
    pub(in crate::vdb) const ZIP: u32 = 1;
    pub(in crate::vdb) const ACTIVE_MASK: u32 = 2;
    pub(in crate::vdb) const BLOSC: u32 = 4;
}

/// A file's grids, without their voxels.
#[derive(Debug)]
pub(super) struct File<'a> {
    pub(super) path: &'a Path,
    pub(super) bytes: &'a [u8],
    pub(super) version: u32,
    pub(super) grids: Vec<Header>,
}

/// What is said of a grid.
#[derive(Clone, Debug)]
pub(super) struct Header {
    /// Its name, with a number in brackets where several have the same.
    pub(super) name: String,
    pub(super) kind: Kind,
    /// Whether numbers are stored as 16-bit floats.
    pub(super) is_half: bool,
    pub(super) class: Class,
    /// Bits of [`packed`].
    pub(super) packed: u32,
    /// `None` where this version knows no such transform; then what it is called.
    pub(super) transform: std::result::Result<Transform, String>,
    /// What `file_voxel_count` says.
    pub(super) voxel_count: Option<i64>,
    /// What `file_bbox_min` and `file_bbox_max` say.
    pub(super) voxel_box: [Option<[i32; 3]>; 2],
    /// Where its tree begins: that of another grid, of which it is an instance, or its own.
    pub(super) tree: usize,
}

/// What the voxels of a grid are.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Kind {
    Float,
    Double,
    /// Three floats.
    Vector,
    /// Points, in leaves that only OpenVDB's own library takes apart.
    Points,
    /// Something else, by the file's name for it.
    Other(String),
}

/// What a grid's values mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Class {
    /// Nobody says.
    Unknown,
    /// Distances from a surface, negative inside.
    LevelSet,
    /// How much there is.
    FogVolume,
    /// Components at the middles of voxels' faces.
    Staggered,
}

impl Class {
    /// As files say it.
    const NAMES: [(Self, &'static str); 4] = [
        (Self::Unknown, "unknown"),
        (Self::LevelSet, "level set"),
        (Self::FogVolume, "fog volume"),
        (Self::Staggered, "staggered"),
    ];

    /// What files call it.
    pub fn name(self) -> &'static str {
        Self::NAMES.iter().find(|it| it.0 == self).map_or("unknown", |it| it.1)
    }
}

impl Kind {
    /// The kind by the name of a grid's type, and whether its numbers are halves.
    fn of(name: &str) -> (Self, bool) {
        let (name, is_half) = name.strip_suffix("_HalfFloat").map_or((name, false), |name| (name, true));
        let value = name.strip_prefix("Tree_").unwrap_or(name);
        let kind = match value.strip_suffix("_5_4_3") {
            Some("float") => Self::Float,
            Some("double") => Self::Double,
            Some("vec3s") => Self::Vector,
            _ if value.starts_with("ptdata") || value.starts_with("ptidx") => Self::Points,
            Some(value) => Self::Other(value.to_string()),
            None => Self::Other(name.to_string()),
        };
        (kind, is_half)
    }

    /// What people call it.
    pub(super) fn name(&self) -> &str {
        match self {
            Self::Float => "float",
            Self::Double => "double",
            Self::Vector => "vec3s",
            Self::Points => "points",
            Self::Other(name) => name,
        }
    }

    /// Numbers of a value, and bytes of a number, if its trees are read.
    pub(super) fn value(&self) -> Option<(usize, usize)> {
        match self {
            Self::Float => Some((1, 4)),
            Self::Double => Some((1, 8)),
            Self::Vector => Some((3, 4)),
            Self::Points | Self::Other(_) => None,
        }
    }
}

/// Whether the file begins like OpenVDB.
pub(crate) fn recognise(head: &[u8]) -> bool {
    head.starts_with(&MAGIC)
}

impl<'a> File<'a> {
    /// Reads everything but the trees.
    pub(super) fn open(path: &'a Path, bytes: &'a [u8]) -> Result<Self> {
        let mut cursor = Cursor::new(path, bytes, 0, Order::Little, HINT);
        if cursor.take(MAGIC.len(), "the first bytes")? != MAGIC {
            return Err(cursor.fault("this is not a file of OpenVDB"));
        }
        let version = cursor.number::<u32>("a version")?;
        if !VERSIONS.contains(&version) {
            let what = format!("version {version} of OpenVDB's files was found, {VERSIONS:?} are read");
            return Err(Error::format(path, "", what, "save it again with OpenVDB 2 to 12"));
        }
        cursor.skip(8, "the library's version")?;
        let has_places = cursor.number::<u8>("a flag")? != 0;
        let mut packed = packed::ZIP;
        if (since::SELECTIVE_COMPRESSION..since::MASK_COMPRESSION).contains(&version) {
            packed = u32::from(cursor.number::<u8>("a flag")? != 0);
        }
        cursor.skip(36, "an identifier")?;
        metadata(&mut cursor, |_, _, _| ())?;
        let count = cursor.number::<u32>("a number of grids")?;
        if !has_places && count > 0 {
            let what = "the file was written as a stream, which does not say where its grids are";
            return Err(Error::format(path, "", what, "load and save it with OpenVDB or Houdini"));
        }
        let mut grids: Vec<Header> = Vec::new();
        let mut keys: Vec<String> = Vec::new();
        for number in 0..count {
            let key = text(&mut cursor, "a grid's name")?;
            let (kind, is_half) = Kind::of(&text(&mut cursor, "a grid's type")?);
            let parent = text(&mut cursor, "the grid of which it is an instance")?;
            let [begin, _, end] = [(); 3].map(|()| cursor.number::<i64>("the place of a grid"));
            let [begin, end] = [begin?, end?].map(usize::try_from);
            let (Ok(begin), Ok(end)) = (begin, end) else {
                return Err(cursor.fault(format!("grid {number} begins or ends nowhere in the file")));
            };
            let (name, suffix) = key.split_once(SEPARATOR).unwrap_or((&key, ""));
            let name = if suffix.is_empty() { name.to_string() } else { format!("{name}[{suffix}]") };
            let mut header = Header {
                name,
                kind,
                is_half,
                class: Class::Unknown,
                packed,
                transform: Err(String::new()),
                voxel_count: None,
                voxel_box: [None; 2],
                tree: 0,
            };
            header.read(&mut Cursor::new(path, bytes, begin, Order::Little, HINT), version)?;
            if !parent.is_empty() {
                let parent = keys.iter().position(|it| *it == parent).map(|place| &grids[place]);
                let parent = parent.filter(|it| it.kind == header.kind).ok_or_else(|| {
                    let what =
                        format!("grid '{}' is an instance of a grid that is not before it", header.name);
                    Error::format(path, format!("byte {begin}"), what, HINT)
                })?;
                (header.tree, header.packed, header.is_half) = (parent.tree, parent.packed, parent.is_half);
            }
            grids.push(header);
            keys.push(key);
            cursor = Cursor::new(path, bytes, end, Order::Little, HINT);
        }
        Ok(Self { path, bytes, version, grids })
    }
}

impl Header {
    /// Reads what a grid says before its tree.
    fn read(&mut self, cursor: &mut Cursor, version: u32) -> Result<()> {
        if version >= since::MASK_COMPRESSION {
            self.packed = cursor.number("how values are packed")?;
            let known = packed::ZIP | packed::ACTIVE_MASK | packed::BLOSC;
            if self.packed & !known != 0 {
                return Err(cursor.fault(format!("values are packed in an unknown way ({})", self.packed)));
            }
        }
        metadata(cursor, |name, kind, value| match (name, kind) {
            ("class", "string") => {
                let class = Class::NAMES.iter().find(|it| it.1.as_bytes() == value);
                self.class = class.map_or(Class::Unknown, |it| it.0);
            }
            ("file_voxel_count", "int64") => {
                self.voxel_count = value.try_into().ok().map(i64::from_le_bytes);
            }
            ("file_bbox_min", "vec3i") => self.voxel_box[0] = corner(value),
            ("file_bbox_max", "vec3i") => self.voxel_box[1] = corner(value),
            _ => {}
        })?;
        self.transform = transform::read(cursor)?;
        self.tree = cursor.place();
        Ok(())
    }
}

fn corner(value: &[u8]) -> Option<[i32; 3]> {
    let (numbers, rest) = value.as_chunks::<4>();
    let numbers: [[u8; 4]; 3] = numbers.try_into().ok().filter(|_| rest.is_empty())?;
    Some(numbers.map(i32::from_le_bytes))
}

/// Reads a list of names, types and values, and shows each; what is not known passes by its size.
fn metadata(cursor: &mut Cursor, mut see: impl FnMut(&str, &str, &[u8])) -> Result<()> {
    for _ in 0..cursor.number::<u32>("a number of metadata")? {
        let name = text(cursor, "a metadata's name")?;
        let kind = text(cursor, "a metadata's type")?;
        let size = cursor.number::<u32>("a metadata's size")?;
        see(&name, &kind, cursor.take(size as usize, "a metadata's value")?);
    }
    Ok(())
}

/// A length and so many letters.
pub(super) fn text(cursor: &mut Cursor, what: &str) -> Result<String> {
    let length = cursor.number::<u32>(what)?;
    cursor.text(length as usize, what)
}
