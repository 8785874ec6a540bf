//! LAMMPS text dumps: `ITEM:` headers and a row for every atom, frame after frame.
//!
//! Coordinates are the first complete set of `x y z`, `xu yu zu`, `xs ys zs`, `xsu ysu zsu`; scaled ones go through the cell.
//! All other columns are attributes under their own names. Image flags are not applied, ids are not sorted. Pieces of a frame that several
//! processors wrote follow each other in the order of their files, as they would in one.
//! Source: LAMMPS documentation of `dump`, and "Triclinic (non-orthogonal) simulation boxes" for the cell.

use std::path::{Path, PathBuf};

use tyndall::scene::units::Style;
use tyndall::{Cell, Columns, DVec3, Error, Particles, Progress, Result};

use super::column::{Kind, Separator};
use super::feed::Feed;
use super::rows::{self, Expected, Heading, Layout, Role, Scaled};
use super::{Index, Request, Span, finish};
use crate::sequence::Frame;

/// The sets of coordinates, best first, and whether they are fractions of the cell.
const COORDINATES: [([&str; 3], bool); 4] = [
    (["x", "y", "z"], false),
    (["xu", "yu", "zu"], false),
    (["xs", "ys", "zs"], true),
    (["xsu", "ysu", "zsu"], true),
];
/// Columns that are words in every dump.
const WORDS: [&str; 2] = ["element", "typelabel"];
/// Columns that are measured, even where a frame has only whole numbers.
pub(super) const MEASURED: [&str; 22] = [
    "x", "y", "z", "xu", "yu", "zu", "vx", "vy", "vz", "fx", "fy", "fz", "q", "mass", "radius", "diameter",
    "omegax", "omegay", "omegaz", "mux", "muy", "muz",
];

/// Whether the file begins like a dump.
pub(crate) fn recognise(head: &[u8]) -> bool {
    head.trim_ascii_start().starts_with(b"ITEM:")
}

/// What stands before the rows.
#[derive(Debug, Default)]
struct Header {
    units: Option<String>,
    time: Option<f64>,
    step: Option<f64>,
    count: Option<u64>,
    cell: Option<Cell>,
    /// Whether the header says along which edges the cell repeats.
    periodicity: bool,
    columns: Vec<String>,
}

/// Reads a header up to the line that names the columns; `None` if the content ends before that.
fn header(feed: &mut Feed) -> Result<Option<Header>> {
    let mut header = Header::default();
    loop {
        let Some(line) = feed.line()? else { return Ok(None) };
        let line = line.trim();
        if line.is_empty() {
            continue;
        }
        let Some(item) = line.strip_prefix("ITEM:").map(str::trim) else {
            if feed.at_end()? && feed.cut() {
                return Ok(None);
            }
            let what = format!(
                "wanted a line that begins with 'ITEM:', found '{}'",
                rows::shortened(line.as_bytes())
            );
            return Err(feed.fault(what, "does NUMBER OF ATOMS match the lines of the frame before?"));
        };
        if let Some(columns) = item.strip_prefix("ATOMS").or(item.strip_prefix("ENTRIES")) {
            header.columns = columns.split_whitespace().map(str::to_string).collect();
            return Ok(Some(header));
        }
        if let Some(style) = item.strip_prefix("BOX BOUNDS") {
            let mut lines = Vec::new();
            for _ in 0..3 {
                let Some(line) = feed.line()? else { return Ok(None) };
                lines.push(line);
            }
            header.periodicity = style.split_whitespace().any(is_boundary);
            header.cell = Some(cell(style, &lines).map_err(|what| {
                feed.fault(what, "write 'lo hi', and a tilt factor where the box is triclinic")
            })?);
            continue;
        }
        let Some(value) = feed.line()? else { return Ok(None) };
        let value = value.trim();
        let wrong = |what: &str| {
            feed.fault(
                format!("wanted {what}, found '{}'", rows::shortened(value.as_bytes())),
                "is the header whole?",
            )
        };
        match item {
            "TIMESTEP" => header.step = Some(value.parse().map_err(|_| wrong("a time step"))?),
            "TIME" => header.time = Some(value.parse().map_err(|_| wrong("a time"))?),
            "UNITS" => header.units = Some(value.to_string()),
            "NUMBER OF ATOMS" | "NUMBER OF ENTRIES" => {
                header.count = Some(value.parse().map_err(|_| wrong("a number of atoms"))?);
            }
            // Headers of later versions, one line each.
            _ => {}
        }
    }
}

/// Whether a word of the box's header is a pair of boundary styles, such as `pp` or `fs`.
fn is_boundary(word: &str) -> bool {
    word.len() == 2 && word.bytes().all(|it| b"pfsm".contains(&it))
}

/// The cell of `ITEM: BOX BOUNDS`.
fn cell(style: &str, lines: &[String]) -> std::result::Result<Cell, String> {
    let general = style.contains("abc origin");
    let mut values = [[0.0; 4]; 3];
    for (axis, line) in lines.iter().enumerate() {
        let words: Vec<&str> = line.split_whitespace().collect();
        let enough = if general { words.len() == 4 } else { (2..=3).contains(&words.len()) };
        for (value, word) in values[axis].iter_mut().zip(&words) {
            *value = fast_float2::parse(word).unwrap_or(f64::NAN);
        }
        if !enough || !values[axis].iter().all(|it| it.is_finite()) {
            return Err(format!(
                "wanted the bounds of the box along {}, found '{}'",
                ["x", "y", "z"][axis],
                rows::shortened(line.as_bytes())
            ));
        }
    }
    let mut periodic = [false; 3];
    for (flag, word) in periodic.iter_mut().zip(style.split_whitespace().filter(|it| is_boundary(it))) {
        *flag = word.starts_with('p');
    }
    if general {
        let vectors = values.map(|it| DVec3::new(it[0], it[1], it[2]));
        return Ok(Cell { origin: DVec3::new(values[0][3], values[1][3], values[2][3]), vectors, periodic });
    }
    Ok(bounded_cell(values.map(|it| [it[0], it[1]]), values.map(|it| it[2]), periodic))
}

/// The cell that is tilted by xy, xz, yz within a bounding box, low and high for each axis.
pub(super) fn bounded_cell(values: [[f64; 2]; 3], [xy, xz, yz]: [f64; 3], periodic: [bool; 3]) -> Cell {
    // Take off how far the tilts reach beyond the cell's own bounds.
    let reach = [[0.0, xy, xz, xy + xz], [0.0, yz, 0.0, yz], [0.0; 4]];
    let low: [f64; 3] =
        std::array::from_fn(|axis| values[axis][0] - reach[axis].into_iter().fold(0.0, f64::min));
    let high: [f64; 3] =
        std::array::from_fn(|axis| values[axis][1] - reach[axis].into_iter().fold(0.0, f64::max));
    let vectors = [
        DVec3::new(high[0] - low[0], 0.0, 0.0),
        DVec3::new(xy, high[1] - low[1], 0.0),
        DVec3::new(xz, yz, high[2] - low[2]),
    ];
    Cell { origin: DVec3::from_array(low), vectors, periodic }
}

/// Finds the frames by their headers and counts.
pub(crate) fn index(feed: &mut Feed) -> Result<Index> {
    let mut index = Index::default();
    loop {
        let (offset, line) = (feed.offset(), feed.line_number());
        if feed.peek(1 << 10)?.trim_ascii().is_empty() {
            break;
        }
        let Some(header) = header(feed)? else {
            index.cut = true;
            break;
        };
        let Some(count) = header.count else {
            return Err(feed.fault("the header has no ITEM: NUMBER OF ATOMS", "is the header whole?"));
        };
        let found = feed.skip_lines(count)?;
        let fields = |row: &[u8]| rows::split(row, Separator::BLANKS).count();
        let short =
            feed.ragged().is_some_and(|row| count > 0 && (feed.cut() || fields(row) < header.columns.len()));
        if found < count || short {
            index.cut = true;
            break;
        }
        index.units = index.units.or(header.units);
        index.frames.push(Span { offset, line, bytes: Some(feed.offset() - offset) });
    }
    index.cut |= feed.cut();
    Ok(index)
}

/// Reads a frame, from all files over which it is spread.
pub(crate) fn frame(feed: &mut Feed, request: &Request, progress: &dyn Progress) -> Result<Frame> {
    progress.begin("read", request.bytes_of_all(), "B");
    let mut pieces = Pieces::begin(feed, request, progress)?;
    request.others.texts(&mut |feed, request, progress| pieces.take(feed, request, progress), progress)?;
    pieces.finish(request)
}

/// A frame while it is read: one piece, or one from each file over which it is spread, with a header of its own.
struct Pieces {
    /// The file of the first piece, and its header.
    path: PathBuf,
    header: Header,
    /// The columns, which of them the coordinates are, and whether these are fractions of the cell.
    names: Vec<String>,
    axes: Axes,
    scaled: bool,
    layout: Layout,
    builder: rows::Builder,
}

impl Pieces {
    /// Reads the first piece.
    fn begin(feed: &mut Feed, request: &Request, progress: &dyn Progress) -> Result<Self> {
        let header = whole_header(feed)?;
        let names = request.options.columns.as_ref().unwrap_or(&header.columns).clone();
        let (axes, scaled) = coordinates(&names).ok_or_else(|| {
            let what = format!("no coordinates among the columns: {}", names.join(" "));
            let hint = if header.columns.is_empty() {
                "this old dump does not name its columns: try --columns id,type,x,y,z"
            } else {
                "dump x y z, xu yu zu, xs ys zs or xsu ysu zsu"
            };
            Error::format(feed.path(), format!("line {}", feed.line_number() - 1), what, hint)
        })?;
        let scaled = scaled || request.options.scaled;
        if scaled && header.cell.is_none() {
            let what = "scaled coordinates need ITEM: BOX BOUNDS, and there is none";
            return Err(feed.fault(what, "dump x y z instead"));
        }
        let layout = layout(feed, (&names, axes), header.cell.map(|cell| (cell, scaled)), request)?;
        let (path, builder) = (feed.path().to_path_buf(), rows::Builder::new(&layout));
        let expected = Expected { count: header.count, bytes: request.bytes };
        let mut pieces = Self { path, header, names, axes, scaled, layout, builder };
        pieces.builder.add(feed, &pieces.layout, expected, progress)?;
        Ok(pieces)
    }

    /// Reads another one.
    fn take(&mut self, feed: &mut Feed, request: &Request, progress: &dyn Progress) -> Result<()> {
        let header = whole_header(feed)?;
        Common::of(&header).check(feed.path(), Common::of(&self.header), &self.path)?;
        if self.builder.is_empty() {
            // A processor without atoms does not show what is a number and what a word.
            let cell = self.header.cell.map(|cell| (cell, self.scaled));
            self.layout = layout(feed, (&self.names, self.axes), cell, request)?;
            self.builder = rows::Builder::new(&self.layout);
        }
        let expected = Expected { count: header.count, bytes: request.bytes };
        self.builder.add(feed, &self.layout, expected, progress)
    }

    fn finish(self, request: &Request) -> Result<Frame> {
        let Self { header, names, axes, scaled, layout, builder, .. } = self;
        let rows = builder.finish(&layout);
        let (cell, units) = (header.cell, header.units.as_deref().or(request.units));
        let mut columns = Columns {
            positions: rows.positions,
            attributes: rows.attributes,
            cell,
            time: header.time.or(header.step),
            ..Columns::default()
        };
        tell_units(&mut columns, header.time.is_some(), units);
        let mut conventions = conventions(&names, axes, cell.as_ref(), scaled);
        if cell.is_some() && !header.periodicity {
            conventions.push("the box does not say whether it repeats: taken as not periodic".to_string());
        }
        let mut frame = finish(columns, conventions, Vec::new())?;
        frame.warnings.extend(looks_scaled(&frame.particles, &names, axes).filter(|_| !scaled));
        Ok(frame)
    }
}

/// The header of a frame that was found before.
fn whole_header(feed: &mut Feed) -> Result<Header> {
    let header = header(feed)?.filter(|it| it.count.is_some());
    header.ok_or_else(|| feed.fault("the header is not whole", "was the file changed?"))
}

/// How the rows that follow in `feed` are to be understood; with the cell comes whether coordinates are fractions of it.
fn layout(
    feed: &mut Feed,
    (names, axes): (&[String], Axes),
    cell: Option<(Cell, bool)>,
    request: &Request,
) -> Result<Layout> {
    let sample = feed.peek(1 << 14)?;
    let kinds = rows::kinds(own_rows(sample), Separator::BLANKS, names.len());
    let (mut roles, mut headings) = (Vec::new(), Vec::new());
    for (column, name) in names.iter().enumerate() {
        if let Some(axis) = axes.iter().position(|&it| it == Some(column)) {
            roles.push(Role::Axis(axis));
            continue;
        }
        let kind = match kinds[column] {
            _ if WORDS.contains(&name.as_str()) => Kind::Text,
            Kind::Integer if MEASURED.contains(&name.as_str()) => Kind::Float,
            kind => kind,
        };
        roles.push(Role::Attribute(headings.len()));
        headings.push(Heading::scalar(name, kind));
    }
    let mut layout = Layout {
        separator: Separator::BLANKS,
        roles,
        headings,
        scaled: cell.filter(|(_, scaled)| *scaled).map(|(cell, _)| Scaled::Fractions(cell)),
        gaps: false,
        origin: cell.map(|(cell, _)| cell.center()).filter(|center| center.is_finite()),
    };
    layout.keep(request.options.wanted.as_ref());
    Ok(layout)
}

/// What the pieces of a frame have in common.
pub(super) struct Common<'a> {
    pub(super) step: Option<f64>,
    pub(super) columns: &'a [String],
    /// How many columns there are, also where they have no names.
    pub(super) size: usize,
    pub(super) cell: Option<&'a Cell>,
}

impl<'a> Common<'a> {
    fn of(header: &'a Header) -> Self {
        let Header { step, columns, cell, .. } = header;
        Self { step: *step, columns, size: columns.len(), cell: cell.as_ref() }
    }
}

impl Common<'_> {
    /// Fails if a piece in the file `path` belongs to another frame than the first one, in the file `first_path`.
    pub(super) fn check(&self, path: &Path, first: Common, first_path: &Path) -> Result<()> {
        let other = first_path.file_name().unwrap_or(first_path.as_os_str()).to_string_lossy();
        let refuse = |what: String, hint: &str| Err(Error::format(path, "", what, hint));
        if self.step != first.step {
            let step = |of: &Common| of.step.map_or("no step".to_string(), |step| format!("step {step}"));
            let what = format!("this piece is of {}, {other} of {}", step(self), step(&first));
            return refuse(what, "are they of one dump, and all written to the end?");
        }
        if (self.columns, self.size) != (first.columns, first.size) {
            let columns = |of: &Common| match of.columns {
                [] => format!("{} columns without names", of.size),
                names => format!("the columns {}", names.join(" ")),
            };
            let what = format!("this piece has {}, {other} {}", columns(self), columns(&first));
            return refuse(what, "are they of one dump?");
        }
        if self.cell != first.cell {
            return refuse(format!("this piece has another box than {other}"), "are they of one dump?");
        }
        Ok(())
    }
}

/// Which columns the coordinates are; in two dimensions there may be no z.
pub(super) type Axes = [Option<usize>; 3];

/// Which columns the coordinates are, and whether they are scaled; `None` if they are not there.
pub(super) fn coordinates(names: &[String]) -> Option<(Axes, bool)> {
    let place = |name: &str| names.iter().position(|it| it == name);
    let found = || COORDINATES.iter().map(|(axes, scaled)| (axes.map(place), *scaled));
    let is_flat = |it: &(Axes, bool)| it.0[..2].iter().all(Option::is_some);
    let whole = found().find(|it| is_flat(it) && it.0[2].is_some());
    // A z that is written in another way is none that may be passed over.
    let has_z = found().any(|it| it.0[2].is_some());
    whole.or_else(|| found().find(is_flat).filter(|_| !has_z))
}

/// The rows at the front of `text`, up to the next header.
fn own_rows(text: &[u8]) -> &[u8] {
    &text[..memchr::memmem::find(text, b"ITEM:")
        .unwrap_or_else(|| memchr::memrchr(b'\n', text).unwrap_or(text.len()))]
}

/// What is to be said about the coordinates and their columns.
pub(super) fn conventions(names: &[String], axes: Axes, cell: Option<&Cell>, scaled: bool) -> Vec<String> {
    let tilted = cell.is_some_and(|cell| {
        let [a, b, c] = cell.vectors;
        [a.y, a.z, b.x, b.z, c.x, c.y].iter().any(|&it| it != 0.0)
    });
    let mut lines = vec![format!("coordinates: {}", axes_names(names, axes))];
    if scaled {
        lines[0] += if tilted { " (scaled by the triclinic cell)" } else { " (scaled by the cell)" };
    }
    if axes[2].is_none() {
        let place = if scaled { "the lower face of the cell" } else { "z = 0" };
        lines.push(format!("two-dimensional: at {place}"));
    }
    if ["ix", "iy", "iz"].iter().any(|flag| names.iter().any(|name| name == flag)) {
        lines.push("image flags ix iy iz: kept as attributes, not applied".to_string());
    }
    lines
}

fn axes_names(names: &[String], axes: Axes) -> String {
    axes.iter().flatten().map(|&axis| names[axis].as_str()).collect::<Vec<_>>().join(" ")
}

/// Tells the units of a unit system: of lengths, velocities, and the time, which may be the number of a step.
pub(super) fn tell_units(columns: &mut Columns, is_time: bool, units: Option<&str>) {
    let style = units.and_then(Style::find);
    columns.length_unit = style.and_then(Style::length).map(str::to_string);
    columns.time_unit = if is_time { style.and_then(Style::time) } else { Some("step") }.map(str::to_string);
    style.into_iter().for_each(|it| it.tell_velocities(&mut columns.attributes));
}

/// The warning if coordinates that are said to be real fill 0..1 in a cell that is far from unit size.
pub(super) fn looks_scaled(particles: &Particles, names: &[String], axes: Axes) -> Option<String> {
    let cell = particles.cell().filter(|_| particles.len() >= 8)?;
    let edge = cell.vectors.iter().map(|it| it.length()).fold(0.0, f64::max);
    let is_within = |at: DVec3| at.cmpge(DVec3::splat(-0.02)).all() && at.cmple(DVec3::splat(1.02)).all();
    // One that lies outside is found soon, where there are any.
    let all_within = edge > 2.0 && (0..particles.len()).all(|id| is_within(particles.positions().world(id)));
    let names = axes_names(names, axes);
    (all_within && particles.bounds().extent().max_element() > 0.5).then(|| {
        format!(
            "coordinates look scaled (0..1) but the columns are '{names}' — reading as real; use --coords scaled to change"
        )
    })
}

#[cfg(test)]
mod tests;
