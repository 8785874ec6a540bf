//! VTK's XML files: where the points and their arrays stand.
//!
//! The elements are read by an XML parser, up to the appended data, which need not be XML and are found by their offsets. Arrays
//! inside of elements stay where they are. Source: "VTK file formats" (Kitware), vtkXMLDataReader.cxx.

use std::path::Path;

use memchr::memmem;
use quick_xml::XmlVersion;
use quick_xml::events::{BytesStart, Event};
use quick_xml::reader::Reader;
use tyndall::{Error, Result};

use super::data::{Array, Compressor, Content, Encoded, Style};
use super::image::{Block, Image, no_image};
use super::words::WordArray;
use super::{Piece, Set};
use crate::read::numbers::{Kind, Order};

const HINT: &str = "is the file whole? ParaView can write it anew";
/// Elements within each other; VTK has less than ten.
const DEPTH: usize = 100;

/// An element.
#[derive(Debug, Default)]
pub(in crate::read) struct Node<'a> {
    pub(in crate::read) name: String,
    attributes: Vec<(String, String)>,
    /// The first text in it that is not blank.
    text: &'a str,
    pub(in crate::read) children: Vec<Node<'a>>,
}

impl<'a> Node<'a> {
    fn new(tag: &BytesStart) -> quick_xml::Result<Self> {
        let mut attributes = Vec::new();
        for attribute in tag.attributes() {
            let attribute = attribute?;
            let value = attribute.normalized_value(XmlVersion::Implicit1_0)?;
            attributes.push((attribute.key.as_ref().to_string(), value.trim().to_string()));
        }
        Ok(Self { name: tag.name().as_ref().to_string(), attributes, ..Self::default() })
    }

    /// The value of an attribute.
    pub(in crate::read) fn get(&self, name: &str) -> Option<&str> {
        self.attributes.iter().find(|(key, _)| key == name).map(|(_, value)| value.as_str())
    }

    /// The first text in it that is not blank.
    #[cfg(feature = "hdf5")]
    pub(in crate::read) fn text(&self) -> &'a str {
        self.text
    }

    pub(in crate::read) fn child(&self, name: &str) -> Option<&Self> {
        self.children.iter().find(|it| it.name == name)
    }

    /// All elements of that name below this one, in the order of the file.
    pub(in crate::read) fn all(&self, name: &str) -> Vec<&Self> {
        let below = self
            .children
            .iter()
            .flat_map(|it| (it.name == name).then_some(it).into_iter().chain(it.all(name)));
        below.collect()
    }
}

/// A file's elements.
pub(super) struct Document<'a> {
    path: &'a Path,
    /// The element `VTKFile`.
    root: Node<'a>,
    /// The element that it holds, by the word of its type.
    pub(super) kind: String,
    appended: Option<Appended<'a>>,
}

/// What stands behind the elements.
struct Appended<'a> {
    bytes: &'a [u8],
    base64: bool,
}

impl<'a> Document<'a> {
    /// Reads the elements.
    pub(super) fn read(path: &'a Path, bytes: &'a [u8]) -> Result<Self> {
        let start = memmem::find(bytes, b"<AppendedData");
        let appended = start.map(|start| Appended::find(path, &bytes[start..])).transpose()?;
        let root = elements(path, &bytes[..start.unwrap_or(bytes.len())], start.is_some())?;
        if root.name != "VTKFile" {
            let what = format!("the element VTKFile was wanted, '{}' was found", root.name);
            return Err(Error::format(path, "", what, HINT));
        }
        let kind = root.get("type").unwrap_or_default().to_string();
        Ok(Self { path, root, kind, appended })
    }

    /// The element that holds all else.
    pub(super) fn body(&self) -> Result<&Node<'a>> {
        let body = self.root.child(&self.kind);
        body.ok_or_else(|| self.fault("", format!("there is no element '{}'", self.kind)))
    }

    /// What the format is called in this file.
    pub(super) fn title(&self) -> String {
        format!("VTK {}", self.kind)
    }

    fn fault(&self, place: &str, what: impl Into<String>) -> Error {
        Error::format(self.path, place, what, HINT)
    }

    fn style(&self) -> Result<Style> {
        let order = match self.root.get("byte_order") {
            Some("BigEndian") => Order::Big,
            Some("LittleEndian") | None => Order::Little,
            Some(other) => return Err(self.fault("VTKFile", format!("there is no byte order '{other}'"))),
        };
        let wide = match self.root.get("header_type") {
            Some("UInt64") => true,
            Some("UInt32") | None => false,
            Some(other) => return Err(self.fault("VTKFile", format!("there is no header of type '{other}'"))),
        };
        let compressor = match self.root.get("compressor") {
            None | Some("") => None,
            Some("vtkZLibDataCompressor") => Some(Compressor::Zlib),
            Some("vtkLZ4DataCompressor") => Some(Compressor::Lz4),
            Some("vtkLZMADataCompressor") => Some(Compressor::Lzma),
            Some(other) => {
                let what = format!("the data are compressed by {other}, which is not known here");
                let hint = "save the file anew in ParaView with the compressor ZLib, LZ4, LZMA or none";
                return Err(Error::format(self.path, "VTKFile", what, hint));
            }
        };
        Ok(Style { order, wide, compressor })
    }

    /// Finds the arrays of the file.
    pub(super) fn set(&self) -> Result<Set<'a>> {
        let body = self.body()?;
        let style = self.style()?;
        let mut set = Set::default();
        for node in body.child("FieldData").into_iter().flat_map(|it| &it.children) {
            if let Some(Ok(array)) = self.array(node, style, 1)? {
                let count = node.get("NumberOfTuples").and_then(|it| it.parse().ok()).unwrap_or(1);
                set.note_time(self.path, &array, count)?;
            }
        }
        for node in body.children.iter().filter(|it| it.name == "Piece") {
            self.piece(node, style, &mut set)?;
        }
        if let Some(steps) =
            body.get("TimeValues").map(|it| it.split_whitespace().count()).filter(|&it| it > 1)
        {
            set.warnings.push(format!("left out: all but the first of {steps} time steps within the file"));
        }
        Ok(set)
    }

    fn piece(&self, node: &Node<'a>, style: Style, set: &mut Set<'a>) -> Result<()> {
        let count = |name: &str| match node.get(name) {
            None => Ok(0),
            Some(text) => text
                .parse::<usize>()
                .map_err(|_| self.fault("Piece", format!("{name}: a count was wanted, '{text}' was found"))),
        };
        let points = match node.get("Extent") {
            Some(extent) => extent_points(extent).ok_or_else(|| {
                self.fault("Piece", format!("Extent: six numbers were wanted, '{extent}' was found"))
            })?,
            None => count("NumberOfPoints")?,
        };
        for cells in ["NumberOfLines", "NumberOfStrips", "NumberOfPolys"] {
            set.other_cells = set.other_cells.saturating_add(count(cells)?);
        }
        let cells = count("NumberOfCells")?;
        let types =
            node.child("Cells").and_then(|it| it.children.iter().find(|it| it.get("Name") == Some("types")));
        if let Some(types) = types.filter(|_| cells > 0)
            && let Some(Ok(types)) = self.array(types, style, 1)?
        {
            set.note_cell_types(self.path, cells, &types)?;
        }
        for array in node.child("CellData").into_iter().flat_map(|it| &it.children) {
            set.cell_arrays.push(array.get("Name").unwrap_or("unnamed").to_string());
        }
        if points == 0 {
            return Ok(());
        }
        let centers = node.child("Points").and_then(|it| it.child("DataArray"));
        let centers = centers.ok_or_else(|| self.fault("Piece", "its points have no array"))?;
        let Some(Ok(centers)) = self.array(centers, style, 3)? else {
            return Err(self.fault("Points", "the points are no numbers"));
        };
        let (mut attributes, mut words) = (Vec::new(), Vec::new());
        for array in node.child("PointData").into_iter().flat_map(|it| &it.children) {
            match self.array(array, style, 1)? {
                Some(Ok(array)) => attributes.push(array),
                Some(Err(name)) if is_words(array) => {
                    let components = array.get("NumberOfComponents").and_then(|it| it.parse().ok());
                    let components = components.filter(|&it| it > 0).unwrap_or(1);
                    words.push(WordArray { name, components, text: array.text.as_bytes() });
                }
                Some(Err(name)) => set.odd_arrays.push(name),
                None => {}
            }
        }
        set.pieces.push(Piece { path: self.path, count: points, points: centers, attributes, words });
        Ok(())
    }

    /// The image that the file holds.
    pub(super) fn image(&self) -> Result<Image<'a>> {
        if self.kind != "ImageData" {
            return Err(no_image(self.path, &self.kind));
        }
        let body = self.body()?;
        let style = self.style()?;
        let identity = |it: &&str| it.split_whitespace().eq("1 0 0 0 1 0 0 0 1".split(' '));
        if body.get("Direction").is_some_and(|it| !identity(&it)) {
            let hint = "resample it along the axes, for example in ParaView";
            return Err(Error::format(self.path, "ImageData", "the image is turned (Direction)", hint));
        }
        let vector = |name: &str, default: f64| {
            let text = body.get(name);
            let numbers = text.map_or(Some(vec![default; 3]), |it| {
                it.split_whitespace().map(|it| it.parse().ok()).collect()
            });
            let numbers = numbers.and_then(|it| <[f64; 3]>::try_from(it).ok());
            let found = text.unwrap_or_default();
            numbers.ok_or_else(|| {
                self.fault("ImageData", format!("{name}: three numbers were wanted, '{found}' was found"))
            })
        };
        let extent = |node: &Node, name: &str| {
            let text = node.get(name).unwrap_or_default();
            let what = || format!("{name}: six numbers were wanted, '{text}' was found");
            parse_extent(text).ok_or_else(|| self.fault(&node.name, what()))
        };
        let mut blocks = Vec::new();
        for piece in body.children.iter().filter(|it| it.name == "Piece") {
            let arrays = |name: &str| -> Result<Vec<Array<'a>>> {
                let nodes = piece.child(name).into_iter().flat_map(|it| &it.children);
                let arrays = nodes.map(|it| Ok(self.array(it, style, 1)?.and_then(std::result::Result::ok)));
                arrays.filter_map(Result::transpose).collect()
            };
            let [points, cells] = [arrays("PointData")?, arrays("CellData")?];
            blocks.push(Block { extent: extent(piece, "Extent")?, points, cells });
        }
        Ok(Image {
            extent: extent(body, "WholeExtent")?,
            origin: vector("Origin", 0.0)?,
            spacing: vector("Spacing", 1.0)?,
            blocks,
        })
    }

    /// An array; its name only if it holds no numbers, `None` if it is of another time step or no array at all.
    fn array(
        &self,
        node: &Node<'a>,
        style: Style,
        components: usize,
    ) -> Result<Option<std::result::Result<Array<'a>, String>>> {
        let is_array = matches!(node.name.as_str(), "DataArray" | "Array");
        let later = |it: &str| it.split_whitespace().all(|it| it != "0");
        if !is_array || node.get("TimeStep").is_some_and(later) {
            return Ok(None);
        }
        let name = node.get("Name").unwrap_or("unnamed").to_string();
        let Some(kind) = kind(node.get("type").unwrap_or_default()) else { return Ok(Some(Err(name))) };
        let components = match node.get("NumberOfComponents") {
            None => components,
            Some(text) => text.parse().ok().filter(|&it| it > 0).ok_or_else(|| {
                self.fault(&format!("array '{name}'"), format!("'{text}' components are no count"))
            })?,
        };
        let content = match node.get("format").unwrap_or("ascii") {
            "ascii" => Content::Text(node.text.as_bytes()),
            "binary" => Content::Encoded(Encoded { bytes: node.text.as_bytes(), base64: true, style }),
            "appended" => {
                let place = format!("array '{name}'");
                let appended = self.appended.as_ref();
                let appended = appended.ok_or_else(|| self.fault(&place, "there are no appended data"))?;
                let offset = node.get("offset").and_then(|it| it.parse().ok());
                let bytes = offset.and_then(|it: usize| appended.bytes.get(it..));
                let bytes =
                    bytes.ok_or_else(|| self.fault(&place, "its offset is not within the appended data"))?;
                Content::Encoded(Encoded { bytes, base64: appended.base64, style })
            }
            other => {
                return Err(self.fault(&format!("array '{name}'"), format!("there is no format '{other}'")));
            }
        };
        Ok(Some(Ok(Array { name, components, kind, content })))
    }
}

impl<'a> Appended<'a> {
    /// What `bytes`, which begin with the element `AppendedData`, hold.
    fn find(path: &Path, bytes: &'a [u8]) -> Result<Self> {
        let fault = |what: &str| Error::format(path, "AppendedData", what, HINT);
        let end = memchr::memchr(b'>', bytes).ok_or_else(|| fault("the element does not end"))?;
        let base64 = match &bytes[..end] {
            tag if memmem::find(tag, b"base64").is_some() => true,
            tag if memmem::find(tag, b"raw").is_some() => false,
            _ => return Err(fault("its encoding is neither raw nor base64")),
        };
        // Offsets count from behind an underscore.
        let data = bytes[end + 1..].trim_ascii_start();
        let data =
            data.strip_prefix(b"_").ok_or_else(|| fault("the data do not begin with an underscore"))?;
        Ok(Self { bytes: data, base64 })
    }
}

/// Reads elements into a tree. With `open`, some need not be closed: what closes them comes later.
pub(in crate::read) fn elements<'a>(path: &Path, bytes: &'a [u8], open: bool) -> Result<Node<'a>> {
    let mut reader = Reader::from_reader(bytes);
    let fault = |reader: &Reader<_>, what: String| {
        Error::format(path, format!("byte {}", reader.buffer_position()), what, HINT)
    };
    let mut above: Vec<Node> = vec![Node::default()];
    loop {
        let event = reader.read_event().map_err(|error| fault(&reader, error.to_string()))?;
        match event {
            Event::Start(tag) | Event::Empty(tag) if above.len() > DEPTH => {
                return Err(fault(&reader, format!("element '{}' is too deep", tag.name().as_ref())));
            }
            Event::Start(tag) => {
                above.push(Node::new(&tag).map_err(|error| fault(&reader, error.to_string()))?);
            }
            Event::Empty(tag) => {
                let node = Node::new(&tag).map_err(|error| fault(&reader, error.to_string()))?;
                above.last_mut().expect("the file's own node").children.push(node);
            }
            Event::End(_) => close(&mut above),
            Event::Text(text) => {
                let node = above.last_mut().expect("the file's own node");
                if let std::borrow::Cow::Borrowed(text) = text.into_inner()
                    && node.text.is_empty()
                {
                    node.text = text.trim_ascii();
                }
            }
            Event::Eof => break,
            _ => {}
        }
    }
    if above.len() > 1 && !open {
        let name = &above.last().expect("the file's own node").name;
        return Err(fault(&reader, format!("the file ends inside the element '{name}'")));
    }
    while above.len() > 1 {
        close(&mut above);
    }
    let root = above.pop().and_then(|file| file.children.into_iter().next());
    root.ok_or_else(|| fault(&reader, "there is no element".into()))
}

/// Hands the last node to the one above it.
fn close(above: &mut Vec<Node>) {
    // An end without a start is an error of the parser: the file's own node stays.
    if above.len() > 1
        && let Some(node) = above.pop()
        && let Some(parent) = above.last_mut()
    {
        parent.children.push(node);
    }
}

/// Whether an array has words, written as text.
fn is_words(node: &Node) -> bool {
    node.get("type") == Some("String") && node.get("format").is_none_or(|it| it == "ascii")
}

/// The numbers of an array's type; `None` for words and bits.
fn kind(name: &str) -> Option<Kind> {
    Some(match name {
        "Int8" => Kind::I8,
        "UInt8" => Kind::U8,
        "Int16" => Kind::I16,
        "UInt16" => Kind::U16,
        "Int32" => Kind::I32,
        "UInt32" => Kind::U32,
        "Int64" => Kind::I64,
        "UInt64" => Kind::U64,
        "Float32" => Kind::F32,
        "Float64" => Kind::F64,
        _ => return None,
    })
}

/// How many points a piece of a structured grid has.
fn extent_points(extent: &str) -> Option<usize> {
    parse_extent(extent)?.iter().try_fold(1usize, |count, [first, last]| {
        let points = last.checked_sub(*first)?.checked_add(1)?.max(0);
        count.checked_mul(points.try_into().ok()?)
    })
}

/// The first and the last number along each axis.
fn parse_extent(extent: &str) -> Option<[[i64; 2]; 3]> {
    let ends: Vec<i64> = extent.split_whitespace().map(|it| it.parse().ok()).collect::<Option<_>>()?;
    let ends: [i64; 6] = ends.try_into().ok()?;
    Some([[ends[0], ends[1]], [ends[2], ends[3]], [ends[4], ends[5]]])
}
