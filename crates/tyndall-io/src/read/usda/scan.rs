//! The text form of USD as prims and properties: where values are, not what they are.

use std::path::Path;
use std::sync::Arc;

use memchr::{memchr, memchr3};
use tyndall::{Error, Result};

/// Prims in prims beyond this are a mistake, or an attack.
const MOST_DEPTH: usize = 200;
/// And so are more clouds of points, or cameras, than these.
const MOST_PRIMS: usize = 1 << 12;

/// Which prims are wanted, and what to try where the file is wrong.
#[derive(Clone, Copy)]
pub(super) struct Wanted {
    pub(super) is: fn(&Prim) -> bool,
    /// What they are called.
    pub(super) name: &'static str,
    pub(super) hint: &'static str,
}

/// What a file has.
pub(super) struct Layer<'a> {
    metadata: &'a [u8],
    /// The prims that are wanted.
    pub(super) prims: Vec<Prim<'a>>,
}

/// A prim.
pub(super) struct Prim<'a> {
    /// Its name behind those of the prims it is in: `/world/spray`.
    pub(super) path: String,
    pub(super) name: &'a str,
    pub(super) kind: &'a str,
    pub(super) properties: Vec<Property<'a>>,
    /// The properties that are transforms, those of the outermost prim first and its own last.
    pub(super) transforms: Vec<Arc<Vec<Property<'a>>>>,
}

/// A property of a prim.
#[derive(Clone)]
pub(super) struct Property<'a> {
    /// Its type: `float[]`.
    pub(super) kind: &'a str,
    pub(super) name: &'a str,
    value: Option<&'a [u8]>,
    /// Values at times, in order.
    pub(super) samples: Vec<(f64, &'a [u8])>,
    metadata: &'a [u8],
}

/// The values of a property around a time.
pub(super) struct Around<'a> {
    pub(super) before: &'a [u8],
    /// The next sample, and the share of the way to it.
    pub(super) next: Option<(&'a [u8], f64)>,
}

impl<'a> Layer<'a> {
    pub(super) fn read(path: &Path, text: &'a [u8], wanted: Wanted) -> Result<Self> {
        let place = memchr(b'\n', text).unwrap_or(text.len());
        let mut scanner = Scanner { path, hint: wanted.hint, text, place };
        scanner.skip_blanks();
        let metadata = if scanner.peek() == Some(b'(') { scanner.value()? } else { &[] };
        let root = scanner.body("", "", 0)?;
        let mut layer = Self { metadata, prims: Vec::new() };
        layer.take(root, "", &[], wanted);
        if layer.prims.len() > MOST_PRIMS {
            return Err(scanner.fault(format!("more than {MOST_PRIMS} {}", wanted.name)));
        }
        Ok(layer)
    }

    /// Takes the wanted prims of a tree.
    fn take(&mut self, node: Node<'a>, path: &str, above: &[Arc<Vec<Property<'a>>>], wanted: Wanted) {
        let is_transform = |it: &&Property| it.name.starts_with("xformOp");
        let own: Vec<Property> = node.properties.iter().filter(is_transform).cloned().collect();
        let own = (!own.is_empty()).then(|| Arc::new(own));
        let transforms: Vec<_> = above.iter().cloned().chain(own).collect();
        for child in node.children {
            let path = format!("{path}/{}", child.name);
            self.take(child, &path, &transforms, wanted);
        }
        let Node { name, kind, properties, .. } = node;
        let prim = Prim { path: path.to_string(), name, kind, properties, transforms };
        if (wanted.is)(&prim) {
            self.prims.push(prim);
        }
    }

    /// A number that the file says of itself.
    pub(super) fn number(&self, name: &str) -> Option<f64> {
        said(self.metadata, name)?.parse().ok().filter(|it: &f64| it.is_finite())
    }

    /// A word that the file says of itself.
    pub(super) fn word(&self, name: &str) -> Option<&'a str> {
        said(self.metadata, name)
    }
}

impl<'a> Prim<'a> {
    pub(super) fn property(&self, name: &str) -> Option<&Property<'a>> {
        self.properties.iter().find(|it| it.name == name)
    }

    /// Where its points are.
    pub(super) fn positions(&self) -> Option<&Property<'a>> {
        match self.kind {
            "Points" => self.property("points"),
            "PointInstancer" => self.property("positions"),
            _ => None,
        }
    }
}

impl<'a> Property<'a> {
    /// Its value at a time; nothing if it has none.
    pub(super) fn at(&self, time: Option<f64>) -> Option<&'a [u8]> {
        let sample = time.and_then(|time| {
            let before = self.samples.iter().rposition(|it| it.0 <= time).unwrap_or(0);
            self.samples.get(before)
        });
        let first = self.samples.first();
        let value = sample.map(|it| it.1).or(self.value).or(first.map(|it| it.1));
        value.filter(|it| *it != b"None")
    }

    /// The same, with the sample behind it where a time lies between two.
    pub(super) fn around(&self, time: Option<f64>) -> Option<Around<'a>> {
        let after = time.map_or(0, |time| self.samples.partition_point(|it| it.0 <= time));
        let pair = after.checked_sub(1).and_then(|before| self.samples.get(before..after + 1));
        let next =
            time.zip(pair).map(|(time, pair)| (pair[1].1, (time - pair[0].0) / (pair[1].0 - pair[0].0)));
        Some(Around { before: self.at(time)?, next: next.filter(|it| it.0 != b"None") })
    }

    /// How many elements of its array a point has.
    pub(super) fn element_size(&self) -> usize {
        said(self.metadata, "elementSize").and_then(|it| it.parse().ok()).unwrap_or(1).max(1)
    }
}

/// What metadata say of a name: `metersPerUnit = 0.01`.
fn said<'a>(metadata: &'a [u8], name: &str) -> Option<&'a str> {
    let text = std::str::from_utf8(metadata).ok()?;
    text.lines().flat_map(|line| line.split(';')).find_map(|line| {
        let line = line.trim().trim_start_matches('(').trim_end_matches(')').trim();
        let value = line.strip_prefix(name)?.trim_start().strip_prefix('=')?;
        Some(value.trim().trim_matches(['"', '\'']))
    })
}

/// A prim with what is below it.
struct Node<'a> {
    kind: &'a str,
    name: &'a str,
    properties: Vec<Property<'a>>,
    children: Vec<Node<'a>>,
}

struct Scanner<'a, 'p> {
    path: &'p Path,
    hint: &'static str,
    text: &'a [u8],
    place: usize,
}

impl<'a> Scanner<'a, '_> {
    fn fault(&self, what: impl Into<String>) -> Error {
        let place = self.place.min(self.text.len());
        let line = 1 + memchr::memchr_iter(b'\n', &self.text[..place]).count();
        Error::format(self.path, format!("line {line}"), what, self.hint)
    }

    fn peek(&self) -> Option<u8> {
        self.text.get(self.place).copied()
    }

    /// Passes over blanks, line ends, what separates, and comments.
    fn skip_blanks(&mut self) {
        while let Some(byte) = self.peek() {
            match byte {
                b' ' | b'\t' | b'\r' | b'\n' | b',' | b';' => self.place += 1,
                b'#' => self.skip_line(),
                _ => break,
            }
        }
    }

    /// Passes over blanks of this line.
    fn skip_in_line(&mut self) {
        while matches!(self.peek(), Some(b' ' | b'\t')) {
            self.place += 1;
        }
    }

    fn skip_line(&mut self) {
        let rest = &self.text[self.place..];
        self.place += memchr(b'\n', rest).unwrap_or(rest.len());
    }

    /// A name, or a type such as `float[]`; empty where none stands.
    fn word(&mut self) -> Result<&'a str> {
        let rest = &self.text[self.place..];
        let ends = |it: &u8| it.is_ascii_whitespace() || b"=()[]{}\"'<>@,;#".contains(it);
        let mut length = rest.iter().position(ends).unwrap_or(rest.len());
        if rest[length..].starts_with(b"[]") {
            length += 2;
        }
        let word = std::str::from_utf8(&rest[..length]).map_err(|_| self.fault("a name is no UTF-8"))?;
        self.place += length;
        Ok(word)
    }

    /// The bytes of a value.
    fn value(&mut self) -> Result<&'a [u8]> {
        let start = self.place;
        match self.peek() {
            Some(b'[' | b'(' | b'{') => self.skip_brackets()?,
            Some(b'"' | b'\'') => self.skip_text()?,
            Some(b'@') => self.skip_to(b'@')?,
            Some(b'<') => self.skip_to(b'>')?,
            _ => {
                self.word()?;
            }
        }
        match &self.text[start..self.place] {
            [] => Err(self.fault("a value was wanted")),
            value => Ok(value),
        }
    }

    fn skip_to(&mut self, end: u8) -> Result<()> {
        let rest = self.text.get(self.place + 1..).unwrap_or_default();
        let place = memchr(end, rest).ok_or_else(|| self.fault("the file ends inside a value"))?;
        self.place += place + 2;
        Ok(())
    }

    /// Passes over a text in quotes.
    fn skip_text(&mut self) -> Result<()> {
        let quote = self.text[self.place];
        let three = [quote; 3];
        if self.text[self.place..].starts_with(&three) {
            let rest = &self.text[self.place + 3..];
            let end = memchr::memmem::find(rest, &three);
            self.place += 6 + end.ok_or_else(|| self.fault("the file ends inside a text"))?;
            return Ok(());
        }
        self.place += 1;
        loop {
            match self.peek() {
                Some(b'\\') => self.place += 2,
                Some(byte) => {
                    self.place += 1;
                    if byte == quote {
                        return Ok(());
                    }
                }
                None => return Err(self.fault("the file ends inside a text")),
            }
        }
    }

    /// Passes over a bracket and all that is inside.
    fn skip_brackets(&mut self) -> Result<()> {
        // Most brackets hold numbers alone.
        let rest = &self.text[self.place..];
        if rest[0] == b'['
            && let Some(end) = memchr(b']', rest)
            && memchr3(b'"', b'\'', b'#', &rest[..end]).is_none()
            && memchr3(b'[', b'@', b'{', &rest[1..end]).is_none()
        {
            self.place += end + 1;
            return Ok(());
        }
        let (begin, mut depth) = (self.place, 0usize);
        loop {
            match self.peek() {
                Some(b'[' | b'(' | b'{') => depth += 1,
                Some(b']' | b')' | b'}') => {
                    depth -= 1;
                    if depth == 0 {
                        self.place += 1;
                        return Ok(());
                    }
                }
                Some(b'"' | b'\'') => {
                    self.skip_text()?;
                    continue;
                }
                Some(b'@') => {
                    self.skip_to(b'@')?;
                    continue;
                }
                Some(b'#') => {
                    self.skip_line();
                    continue;
                }
                Some(_) => {}
                None => {
                    self.place = begin;
                    return Err(self.fault("the file ends inside what begins here"));
                }
            }
            self.place += 1;
        }
    }

    /// What stands between the braces of a prim, up to the closing one, or to the end of the file.
    fn body(&mut self, kind: &'a str, name: &'a str, depth: usize) -> Result<Node<'a>> {
        if depth > MOST_DEPTH {
            return Err(self.fault(format!("more than {MOST_DEPTH} prims in each other")));
        }
        let mut node = Node { kind, name, properties: Vec::new(), children: Vec::new() };
        loop {
            self.skip_blanks();
            match self.peek() {
                None if depth == 0 => return Ok(node),
                None => return Err(self.fault(format!("the file ends inside prim '{name}'"))),
                Some(b'}') if depth > 0 => {
                    self.place += 1;
                    return Ok(node);
                }
                _ => {}
            }
            match self.word()? {
                "" => return Err(self.fault("a prim or a property was wanted")),
                specifier @ ("def" | "over" | "class") => {
                    let child = self.prim(depth)?;
                    node.children.extend(child.filter(|_| specifier != "class"));
                }
                first => {
                    if let Some(property) = self.property(first)? {
                        add(&mut node.properties, property);
                    }
                }
            }
        }
    }

    /// A prim behind its specifier; nothing if it is not active.
    fn prim(&mut self, depth: usize) -> Result<Option<Node<'a>>> {
        self.skip_blanks();
        let kind = self.word()?;
        self.skip_blanks();
        if !matches!(self.peek(), Some(b'"' | b'\'')) {
            return Err(self.fault("the name of a prim was wanted"));
        }
        let name = self.value()?;
        let name =
            std::str::from_utf8(&name[1..name.len() - 1]).map_err(|_| self.fault("a name is no UTF-8"))?;
        self.skip_blanks();
        let metadata = if self.peek() == Some(b'(') { self.value()? } else { &[] };
        self.skip_blanks();
        if self.peek() != Some(b'{') {
            return Err(self.fault(format!("the braces of prim '{name}' were wanted")));
        }
        self.place += 1;
        let node = self.body(kind, name, depth + 1)?;
        Ok(Some(node).filter(|_| said(metadata, "active") != Some("false")))
    }

    /// A property that begins with a word; nothing if it has no value.
    fn property(&mut self, first: &'a str) -> Result<Option<Property<'a>>> {
        let (mut kind, mut name) = ("", first);
        loop {
            self.skip_in_line();
            match self.peek() {
                Some(b'"' | b'\'') => self.skip_text()?, // The name of a set of variants.
                None | Some(b'=' | b'(' | b'\r' | b'\n' | b'}' | b';' | b'#') => break,
                _ => match self.word()? {
                    "" => {
                        return Err(self.fault(format!("the name of a property was wanted behind '{name}'")));
                    }
                    word => (kind, name) = (name, word),
                },
            }
        }
        let mut value = None;
        if self.peek() == Some(b'=') {
            self.place += 1;
            self.skip_blanks();
            value = Some(self.value()?);
            self.skip_in_line();
        }
        let metadata = if self.peek() == Some(b'(') { self.value()? } else { &[] };
        let Some(value) = value else { return Ok(None) };
        let mut property = Property { kind, name, value: None, samples: Vec::new(), metadata };
        match name.strip_suffix(".timeSamples") {
            Some(name) => {
                property.name = name;
                property.samples = self.samples(value)?;
            }
            None => property.value = Some(value),
        }
        Ok(Some(property))
    }

    /// The samples of `{ 0: value, 1: value }`.
    fn samples(&self, block: &'a [u8]) -> Result<Vec<(f64, &'a [u8])>> {
        let inside = block.strip_prefix(b"{").and_then(|it| it.strip_suffix(b"}"));
        let inside = inside.ok_or_else(|| self.fault("time samples were wanted: { TIME: VALUE, }"))?;
        let mut scanner = Scanner { path: self.path, hint: self.hint, text: inside, place: 0 };
        let mut samples: Vec<(f64, &[u8])> = Vec::new();
        loop {
            scanner.skip_blanks();
            if scanner.peek().is_none() {
                samples.sort_by(|a, b| a.0.total_cmp(&b.0));
                return Ok(samples);
            }
            let word = scanner.word()?;
            let time = word.trim_end_matches(':').parse().ok().filter(|it: &f64| it.is_finite());
            let time =
                time.ok_or_else(|| self.fault(format!("the time of a sample was wanted, found '{word}'")))?;
            scanner.skip_blanks();
            if scanner.peek() == Some(b':') {
                scanner.place += 1;
                scanner.skip_blanks();
            }
            samples.push((time, scanner.value()?));
        }
    }
}

/// Adds a property, or what is said of one that is there already.
fn add<'a>(properties: &mut Vec<Property<'a>>, property: Property<'a>) {
    match properties.iter_mut().find(|it| it.name == property.name) {
        Some(known) => {
            known.value = known.value.or(property.value);
            known.samples.extend(property.samples);
            if known.metadata.is_empty() {
                known.metadata = property.metadata;
            }
        }
        None => properties.push(property),
    }
}
