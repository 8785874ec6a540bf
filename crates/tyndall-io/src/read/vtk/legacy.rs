//! VTK's legacy files: a few words, then arrays as text or as big-endian bytes.
//!
//! Takes the content, gives where the points and their arrays stand. Cells, lookup tables, meta data and words are passed over.
//! Source: "VTK file formats" (Kitware), vtkDataReader.cxx; versions 1 to 5.1.

use std::path::Path;

use tyndall::{Error, Result};

use super::data::{self, Array, Content};
use super::image::{Block, Image, no_image};
use super::{Piece, Set};
use crate::read::column::{self, Separator};
use crate::read::lattice::{self, Samples};
use crate::read::numbers::{Kind, Order};

const MAGIC: &[u8] = b"# vtk DataFile Version ";
const HINT: &str = "is the file whole? ParaView can write it anew as .vtp";

/// Whether the file begins like a legacy file.
pub(super) fn recognise(head: &[u8]) -> bool {
    head.get(..MAGIC.len()).is_some_and(|it| it.eq_ignore_ascii_case(MAGIC))
}

/// What the first lines say.
pub(super) struct Header {
    /// The version's first number.
    version: u32,
    binary: bool,
    /// The word behind DATASET, in lower case; FIELD stands for itself.
    pub(super) kind: String,
    /// Where the next word is.
    place: usize,
}

impl Header {
    /// Reads the header.
    pub(super) fn read(path: &Path, bytes: &[u8]) -> Result<Self> {
        let mut words = Words { path, bytes, place: 0, binary: false };
        let first = words.line();
        let version = first.get(MAGIC.len()..).unwrap_or_default().trim_ascii();
        let version = version.split(|&it| it == b'.').next().unwrap_or_default();
        let version = std::str::from_utf8(version).ok().and_then(|it| it.parse().ok());
        let version = version.ok_or_else(|| words.fault("the first line has no version"))?;
        words.line();
        let encoding = words.word().to_ascii_lowercase();
        let binary = match &encoding[..] {
            b"ascii" => false,
            b"binary" => true,
            other => {
                let what = format!("ASCII or BINARY was wanted, '{}' was found", data::show(other));
                return Err(words.fault(what));
            }
        };
        let word = words.word().to_ascii_lowercase();
        let kind = if word == b"dataset" { words.word().to_ascii_lowercase() } else { word };
        let kind = data::show(&kind);
        Ok(Self { version, binary, kind, place: words.place })
    }

    /// What the format is called in this file.
    pub(super) fn title(&self) -> String {
        let encoding = if self.binary { "binary" } else { "text" };
        format!("legacy VTK ({encoding}, {})", self.kind.replace('_', " "))
    }

    /// Refuses what has no points of its own.
    pub(super) fn check(&self, path: &Path) -> Result<()> {
        match self.kind.as_str() {
            "polydata" | "unstructured_grid" | "structured_grid" => Ok(()),
            "structured_points" | "rectilinear_grid" => Err(lattice::no_particles(path, &self.kind)),
            other => {
                let what = format!("a data set with points was wanted, '{other}' was found");
                Err(Error::format(path, "header", what, HINT))
            }
        }
    }
}

/// Finds the arrays of a file.
pub(super) fn read<'a>(path: &'a Path, bytes: &'a [u8]) -> Result<Set<'a>> {
    let header = Header::read(path, bytes)?;
    header.check(path)?;
    let mut file = File::new(path, bytes, &header);
    while file.section()? {}
    file.finish()
}

/// Finds the arrays of an image.
pub(super) fn image<'a>(path: &'a Path, bytes: &'a [u8]) -> Result<Image<'a>> {
    let header = Header::read(path, bytes)?;
    if header.kind != "structured_points" {
        return Err(no_image(path, &header.kind));
    }
    let mut file = File::new(path, bytes, &header);
    while file.section()? {}
    let extent = file.size.map(|size| [0, i64::try_from(size).unwrap_or(i64::MAX) - 1]);
    let block = Block { extent, points: file.attributes, cells: file.cell_attributes };
    Ok(Image { extent, origin: file.origin, spacing: file.spacing, blocks: vec![block] })
}

/// Whom the arrays belong to that come next.
#[derive(Clone, Copy, PartialEq)]
enum Owner {
    Whole,
    Points,
    /// So many cells.
    Cells(usize),
}

struct File<'a> {
    words: Words<'a>,
    /// Whether cells are written as since version 5.
    new_cells: bool,
    set: Set<'a>,
    piece: Option<(usize, Array<'a>)>,
    attributes: Vec<Array<'a>>,
    /// The arrays of the cells of an image.
    cell_attributes: Vec<Array<'a>>,
    owner: Owner,
    /// Of an image: its points along x, y, z, where the first one lies, and their distances.
    size: [usize; 3],
    origin: [f64; 3],
    spacing: [f64; 3],
}

impl<'a> File<'a> {
    fn new(path: &'a Path, bytes: &'a [u8], header: &Header) -> Self {
        Self {
            words: Words { path, bytes, place: header.place, binary: header.binary },
            new_cells: header.version >= 5,
            set: Set::default(),
            piece: None,
            attributes: Vec::new(),
            cell_attributes: Vec::new(),
            owner: Owner::Whole,
            size: [0; 3],
            origin: [0.0; 3],
            spacing: [1.0; 3],
        }
    }

    /// How many points there are.
    fn count(&self) -> usize {
        let image = || Samples::count(self.size).unwrap_or_default();
        self.piece.as_ref().map_or_else(image, |(count, _)| *count)
    }

    /// Passes over the next section; false at the end of the file.
    fn section(&mut self) -> Result<bool> {
        let word = self.words.word();
        if word.is_empty() {
            return Ok(false);
        }
        match &word.to_ascii_lowercase()[..] {
            b"points" => {
                let count = self.words.count("how many points")?;
                let kind = self.words.kind()?;
                let Type::Numbers(kind) = kind else {
                    return Err(self.words.fault("the points are no numbers"));
                };
                let content = self.words.array(count, 3, kind)?;
                let points = Array { name: "points".into(), components: 3, kind, content };
                self.piece = Some((count, points));
            }
            name @ (b"vertices" | b"lines" | b"polygons" | b"triangle_strips" | b"cells") => {
                let [cells, size] = [self.words.count("cells")?, self.words.count("their size")?];
                let mut faces = cells;
                if self.new_cells {
                    faces = faces.saturating_sub(1);
                    for (word, count) in [("offsets", cells), ("connectivity", size)] {
                        if self.words.peek().eq_ignore_ascii_case(word.as_bytes()) {
                            self.words.word();
                            self.skip_array(count, 1)?;
                        }
                    }
                } else {
                    self.words.array(size, 1, Kind::I32)?;
                }
                // What the cells of a grid are is said by CELL_TYPES.
                if !matches!(name, b"vertices" | b"cells") {
                    self.set.other_cells = self.set.other_cells.saturating_add(faces);
                }
            }
            b"cell_types" => {
                let count = self.words.count("how many cell types")?;
                let content = self.words.array(count, 1, Kind::I32)?;
                let types = Array { name: "cell types".into(), components: 1, kind: Kind::I32, content };
                self.set.note_cell_types(self.words.path, count, &types)?;
            }
            b"dimensions" => {
                for size in &mut self.size {
                    *size = self.words.count("dimensions")?;
                }
            }
            name @ (b"origin" | b"spacing" | b"aspect_ratio") => {
                let numbers = [self.words.real()?, self.words.real()?, self.words.real()?];
                if name == b"origin" {
                    self.origin = numbers;
                } else {
                    self.spacing = numbers;
                }
            }
            b"point_data" => {
                let count = self.words.count("how many points have data")?;
                self.owner = Owner::Points;
                if self.count() != count {
                    return Err(self
                        .words
                        .fault(format!("data of {count} points, not of as many as there are")));
                }
            }
            b"cell_data" => {
                self.owner = Owner::Cells(self.words.count("how many cells have data")?);
            }
            b"field" => self.field()?,
            b"metadata" => self.words.skip_metadata(),
            b"lookup_table" => {
                self.words.word();
                let count = self.words.count("how many colors")?;
                let kind = if self.words.binary { Kind::U8 } else { Kind::F32 };
                self.words.array(count, 4, kind)?;
            }
            b"color_scalars" => {
                let name = self.words.name();
                let components = self.words.count("how many colors")?;
                self.attribute(name, components, Type::Numbers(Kind::U8))?;
                // Only as text they are written as numbers from 0 to 1.
                if let (Owner::Points, Some(array)) = (self.owner, self.attributes.last_mut())
                    && let Content::Text(text) = array.content
                {
                    array.content = Content::Shares(text);
                }
            }
            b"scalars" => {
                let name = self.words.name();
                let kind = self.words.kind()?;
                let components = match self.words.rest_of_line() {
                    b"" => 1,
                    word => self.words.parse(word, "how many components")?,
                };
                if self.words.peek().eq_ignore_ascii_case(b"lookup_table") {
                    self.words.word();
                    self.words.word();
                }
                self.attribute(name, components, kind)?;
            }
            kind @ (b"vectors"
            | b"normals"
            | b"tensors"
            | b"tensors6"
            | b"texture_coordinates"
            | b"global_ids"
            | b"pedigree_ids"
            | b"edge_flags") => {
                let name = self.words.name();
                let components = match kind {
                    b"vectors" | b"normals" => 3,
                    b"tensors" => 9,
                    b"tensors6" => 6,
                    b"texture_coordinates" => self.words.count("how many components")?,
                    _ => 1,
                };
                let kind = self.words.kind()?;
                self.attribute(name, components, kind)?;
            }
            _ => {
                let what =
                    format!("a section such as POINT_DATA was wanted, '{}' was found", data::show(word));
                return Err(self.words.fault(what));
            }
        }
        Ok(true)
    }

    /// An array of the points, the cells or the whole.
    fn attribute(&mut self, name: String, components: usize, kind: Type) -> Result<()> {
        let points = self.count();
        match self.owner {
            Owner::Points => self.array_of(name, components, points, kind),
            Owner::Cells(count) => self.array_of_cells(name, components, count, kind),
            Owner::Whole => Err(self.words.fault(format!("'{name}' belongs neither to points nor to cells"))),
        }
    }

    fn skip_array(&mut self, count: usize, components: usize) -> Result<()> {
        let kind = self.words.kind()?;
        self.skip(kind, count, components)
    }

    fn skip(&mut self, kind: Type, count: usize, components: usize) -> Result<()> {
        match kind {
            Type::Numbers(kind) => self.words.array(count, components, kind).map(drop),
            Type::Bits => self.words.bits(count, components),
            Type::Words => self.words.strings(count, components),
        }
    }

    /// An array of the points that is kept, or said to be left out.
    fn array_of(&mut self, name: String, components: usize, count: usize, kind: Type) -> Result<()> {
        match kind {
            Type::Numbers(kind) if components > 0 => {
                let content = self.words.array(count, components, kind)?;
                self.attributes.push(Array { name, components, kind, content });
                Ok(())
            }
            _ => {
                self.set.odd_arrays.push(name);
                self.skip(kind, count, components)
            }
        }
    }

    /// An array of the cells.
    fn array_of_cells(&mut self, name: String, components: usize, count: usize, kind: Type) -> Result<()> {
        self.set.cell_arrays.push(name.clone());
        let Type::Numbers(kind) = kind else { return self.skip(kind, count, components) };
        let content = self.words.array(count, components, kind)?;
        self.cell_attributes.push(Array { name, components, kind, content });
        Ok(())
    }

    /// Named arrays that each say how long they are.
    fn field(&mut self) -> Result<()> {
        self.words.word();
        let arrays = self.words.count("how many arrays")?;
        for _ in 0..arrays {
            let mut name = self.words.word();
            while name.eq_ignore_ascii_case(b"metadata") {
                self.words.skip_metadata();
                name = self.words.word();
            }
            if name.eq_ignore_ascii_case(b"null_array") {
                continue;
            }
            if name.is_empty() {
                return Err(self.words.fault("the file ends inside a field"));
            }
            let name = decode_name(name);
            let [components, count] = [self.words.count("components")?, self.words.count("tuples")?];
            let kind = self.words.kind()?;
            match (self.owner, kind) {
                (Owner::Points, _) => {
                    let points = self.count();
                    if points != count {
                        let what = format!("array '{name}' has {count} tuples for {points} points");
                        return Err(self.words.fault(what));
                    }
                    self.array_of(name, components, count, kind)?;
                }
                (Owner::Cells(_), _) => self.array_of_cells(name, components, count, kind)?,
                (Owner::Whole, Type::Numbers(kind)) => {
                    let content = self.words.array(count, components, kind)?;
                    let array = Array { name, components, kind, content };
                    self.set.note_time(self.words.path, &array, count)?;
                }
                (Owner::Whole, _) => self.skip(kind, count, components)?,
            }
        }
        Ok(())
    }

    fn finish(mut self) -> Result<Set<'a>> {
        let Some((count, points)) = self.piece else {
            return Err(self.words.fault("the file has no POINTS"));
        };
        if !self.words.binary && !self.words.bytes.last().is_some_and(u8::is_ascii_whitespace) {
            self.set.warnings.push("the last line has no end: its last value may be cut off".into());
        }
        let attributes = self.attributes;
        self.set.pieces.push(Piece { path: self.words.path, count, points, attributes, words: Vec::new() });
        Ok(self.set)
    }
}

/// What an array holds.
#[derive(Clone, Copy)]
enum Type {
    Numbers(Kind),
    Bits,
    Words,
}

/// A name as it was before blanks and the like were written as %20.
fn decode_name(name: &[u8]) -> String {
    let mut bytes = Vec::with_capacity(name.len());
    let mut rest = name;
    while let [first, tail @ ..] = rest {
        rest = tail;
        let digits = tail.get(..2).and_then(|it| std::str::from_utf8(it).ok());
        match digits.and_then(|it| u8::from_str_radix(it, 16).ok()).filter(|_| *first == b'%') {
            Some(byte) => {
                bytes.push(byte);
                rest = &tail[2..];
            }
            None => bytes.push(*first),
        }
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

/// Words and arrays that follow each other.
struct Words<'a> {
    path: &'a Path,
    bytes: &'a [u8],
    place: usize,
    binary: bool,
}

impl<'a> Words<'a> {
    fn fault(&self, what: impl Into<String>) -> Error {
        Error::format(self.path, format!("byte {}", self.place), what, HINT)
    }

    /// The next word; empty at the end.
    fn word(&mut self) -> &'a [u8] {
        let rest = &self.bytes[self.place..];
        let start = rest.iter().position(|it| !it.is_ascii_whitespace()).unwrap_or(rest.len());
        let word = &rest[start..];
        let word = &word[..word.iter().position(u8::is_ascii_whitespace).unwrap_or(word.len())];
        self.place += start + word.len();
        word
    }

    /// The next word, which is left where it is.
    fn peek(&mut self) -> &'a [u8] {
        let place = self.place;
        let word = self.word();
        self.place = place;
        word
    }

    /// The rest of the line, and what ends it.
    fn line(&mut self) -> &'a [u8] {
        let rest = &self.bytes[self.place..];
        let end = memchr::memchr(b'\n', rest).unwrap_or(rest.len());
        self.place += (end + 1).min(rest.len());
        &rest[..end]
    }

    /// The same without blanks; what ends the line stays.
    fn rest_of_line(&mut self) -> &'a [u8] {
        let rest = &self.bytes[self.place..];
        let end = memchr::memchr(b'\n', rest).unwrap_or(rest.len());
        self.place += end;
        rest[..end].trim_ascii()
    }

    fn name(&mut self) -> String {
        decode_name(self.word())
    }

    fn parse(&self, word: &[u8], what: &str) -> Result<usize> {
        let number = std::str::from_utf8(word).ok().and_then(|it| it.parse().ok());
        number.ok_or_else(|| {
            self.fault(format!("{what}: a count was wanted, '{}' was found", data::show(word)))
        })
    }

    fn count(&mut self, what: &str) -> Result<usize> {
        let word = self.word();
        self.parse(word, what)
    }

    fn real(&mut self) -> Result<f64> {
        let word = self.word();
        let number = column::number(word, Separator::BLANKS).filter(|(_, taken)| *taken == word.len());
        let number = number
            .ok_or_else(|| self.fault(format!("a number was wanted, '{}' was found", data::show(word))));
        Ok(number?.0)
    }

    fn kind(&mut self) -> Result<Type> {
        let word = self.word().to_ascii_lowercase();
        Ok(Type::Numbers(match &word[..] {
            b"char" | b"signed_char" | b"vtktypeint8" => Kind::I8,
            b"unsigned_char" | b"vtktypeuint8" => Kind::U8,
            b"short" | b"vtktypeint16" => Kind::I16,
            b"unsigned_short" | b"vtktypeuint16" => Kind::U16,
            b"int" | b"vtkidtype" | b"vtktypeint32" => Kind::I32,
            b"unsigned_int" | b"vtktypeuint32" => Kind::U32,
            b"long" | b"vtktypeint64" => Kind::I64,
            b"unsigned_long" | b"vtktypeuint64" => Kind::U64,
            b"float" => Kind::F32,
            b"double" => Kind::F64,
            b"bit" => return Ok(Type::Bits),
            b"string" | b"utf8_string" => return Ok(Type::Words),
            other => {
                let what = format!("a type such as float was wanted, '{}' was found", data::show(other));
                return Err(self.fault(what));
            }
        }))
    }

    /// The array that begins on the next line.
    fn array(&mut self, count: usize, components: usize, kind: Kind) -> Result<Content<'a>> {
        let values = count.checked_mul(components);
        if !self.binary {
            let values = values.ok_or_else(|| self.fault("the array has no size"))?;
            return self.text(values).map(Content::Text);
        }
        let size = values.and_then(|it| it.checked_mul(kind.size()));
        self.bytes(size).map(|bytes| Content::Plain(bytes, Order::Big))
    }

    /// So many bytes from the next line on.
    fn bytes(&mut self, size: Option<usize>) -> Result<&'a [u8]> {
        self.line();
        let left = self.bytes.len() - self.place;
        let end = size.and_then(|it| self.place.checked_add(it));
        let taken = end.and_then(|end| self.bytes.get(self.place..end));
        let Some(taken) = taken else {
            let wanted = size.map_or("too many".into(), |it| it.to_string());
            return Err(self.fault(format!("{wanted} bytes of an array were wanted, {left} are there")));
        };
        self.place += taken.len();
        Ok(taken)
    }

    /// So many tokens.
    fn text(&mut self, values: usize) -> Result<&'a [u8]> {
        let rest = &self.bytes[self.place..];
        // A value takes a digit and a blank.
        if values > rest.len() / 2 + 1 {
            return Err(self.fault(format!("{values} numbers were wanted, {} bytes are there", rest.len())));
        }
        let (mut at, mut found) = (0, 0);
        while found < values {
            let start = rest[at..].iter().position(|it| !it.is_ascii_whitespace());
            let Some(start) = start else {
                return Err(self.fault(format!("the file ends after {found} of {values} numbers")));
            };
            at += start;
            at += rest[at..].iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len() - at);
            found += 1;
        }
        self.place += at;
        Ok(&rest[..at])
    }

    fn bits(&mut self, count: usize, components: usize) -> Result<()> {
        let values = count.checked_mul(components).ok_or_else(|| self.fault("the array has no size"))?;
        if self.binary { self.bytes(Some(values.div_ceil(8))).map(drop) } else { self.text(values).map(drop) }
    }

    /// Passes over words: a line each, or each behind its length, which is one, two, four or eight bytes by its first two bits.
    fn strings(&mut self, count: usize, components: usize) -> Result<()> {
        self.line();
        let values = count.checked_mul(components).ok_or_else(|| self.fault("the array has no size"))?;
        for value in 0..values {
            let rest = &self.bytes[self.place..];
            if !self.binary {
                if rest.is_empty() {
                    return Err(self.fault(format!("the file ends after {value} of {values} words")));
                }
                self.line();
                continue;
            }
            let first = rest.first().copied().unwrap_or_default();
            let digits = [8, 4, 2, 1][usize::from(first >> 6)];
            let length = rest.get(..digits).map(|it| {
                let number = it.iter().fold(0u64, |sum, &byte| sum << 8 | u64::from(byte));
                (number & (u64::MAX >> (66 - 8 * digits))) as usize
            });
            let end = length.and_then(|it| it.checked_add(digits)).filter(|&end| end <= rest.len());
            let end =
                end.ok_or_else(|| self.fault(format!("the file ends after {value} of {values} words")))?;
            self.place += end;
        }
        Ok(())
    }

    /// Passes over meta data, which end with an empty line.
    fn skip_metadata(&mut self) {
        self.line();
        while self.place < self.bytes.len() && !self.line().trim_ascii().is_empty() {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_spelled_out() {
        assert_eq!(decode_name(b"my%20array%25%2"), "my array%%2");
        assert_eq!(decode_name(b"%zz%"), "%zz%");
    }

    #[test]
    fn files_are_known_by_their_first_line() {
        assert!(recognise(b"# vtk DataFile Version 3.0\nx\n"));
        assert!(!recognise(b"# vtk DataFile Version") && !recognise(b"# a table of x y z and more columns"));
    }

    #[test]
    fn lengths_of_words_have_one_two_four_or_eight_bytes() {
        let mut bytes = b"\n".to_vec();
        for header in [vec![0xc2], vec![0x80, 2], vec![0x40, 0, 0, 2], vec![0, 0, 0, 0, 0, 0, 0, 2]] {
            bytes.extend([&header[..], b"ab"].concat());
        }
        let mut words = Words { path: Path::new("test"), bytes: &bytes, place: 0, binary: true };
        words.strings(2, 2).unwrap();
        assert_eq!(words.place, bytes.len());
        words.place = 0;
        assert!(words.strings(5, 1).is_err());
    }
}
