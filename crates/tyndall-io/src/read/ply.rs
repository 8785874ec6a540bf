//! PLY, the Stanford polygon format, as text and binary of either byte order.
//!
//! Takes the whole file, gives the element `vertex` as particles; each scalar property is an attribute of its own name, in the
//! file's order. Other elements and lists are skipped, said; so are comments, but those of `convert`. Files of 3D Gaussian splats get a radius from their scales.
//! Source: Greg Turk, "The PLY Polygon File Format", 1998, and the type names of later writers (`float32` for `float`).

mod faces;
mod header;
#[cfg(test)]
mod tests;
mod text;
mod told;

use std::path::Path;

use rayon::prelude::*;
use tyndall::particles::{Attribute, Columns, Radii, Values};
use tyndall::scene::wanted::{Offered, Wanted};
use tyndall::{Error, Progress, Result};

pub(super) use self::faces::faces;
use self::header::{Element, Encoding, Header, Property, Shape};
use super::numbers::{Kind, Order};
use super::records::{self, Field, Layout, Source};
use crate::sequence::Frame;

/// What to try with a file that is too short.
const CUT_OFF: &str = "the file is cut off or its header is wrong: copy it again or write it again";

/// The properties of 3D Gaussian splats that say how large they are.
const SCALES: [&str; 3] = ["scale_0", "scale_1", "scale_2"];

/// Whether the file begins like a PLY file.
pub(crate) fn recognise(head: &[u8]) -> bool {
    head.starts_with(b"ply\n") || head.starts_with(b"ply\r")
}

/// Reads the vertices, with those of their properties that are wanted.
pub(crate) fn read(
    path: &Path,
    bytes: &[u8],
    wanted: Option<&Wanted>,
    progress: &dyn Progress,
) -> Result<Frame> {
    progress.begin("read", Some(bytes.len() as u64), "B");
    let header = Header::read(path, bytes)?;
    let (mut conventions, mut warnings) = (Vec::new(), Vec::new());
    let vertex = header.vertex(path)?;
    let element = &header.elements[vertex];
    let mut roles = Roles::of(path, element, &mut conventions)?;
    let shown = roles.choose(element, wanted);
    header.left_out(vertex, &mut warnings);

    let before = &header.elements[..vertex];
    let mut columns = match header.encoding {
        Encoding::Text => {
            let body = text::Body { path, bytes, start: header.body, line_end: header.line_end };
            let cut_off = element.count > 0 && vertex + 1 == header.elements.len();
            if cut_off && !bytes.ends_with(&[header.line_end]) {
                warnings.push("the last line has no end: its last value may be cut off".into());
            }
            body.read(before, element, &roles, progress)?
        }
        Encoding::Binary(order) => {
            let mut rest = &bytes[header.body..];
            for element in before {
                rest = skip(path, element, rest, order)?;
            }
            Table { path, element, roles: &roles, order }.read(rest, bytes.len(), progress)?
        }
    };
    told::take(&header.comments, &mut columns);
    records::spell_out_colors(&mut columns.attributes, &mut conventions);
    if roles.is_splat(element) {
        add_splat_radius(&mut columns, &shown, &mut conventions);
    }
    records::frame(columns, conventions, warnings)
}

/// What becomes of each property of the vertices.
struct Roles {
    /// The properties that are x, y, z; `None` for a z that is missing.
    axes: [Option<usize>; 3],
    /// The scalar properties that become attributes.
    attributes: Vec<usize>,
}

impl Roles {
    fn of(path: &Path, element: &Element, conventions: &mut Vec<String>) -> Result<Self> {
        let scalar = |property: &Property| matches!(property.shape, Shape::Scalar(_));
        let find = |name: &str| {
            let properties = &element.properties;
            let exact = properties.iter().position(|it| scalar(it) && it.name == name);
            exact
                .or_else(|| properties.iter().position(|it| scalar(it) && it.name.eq_ignore_ascii_case(name)))
        };
        let axes = ["x", "y", "z"].map(find);
        if axes[0].is_none() || axes[1].is_none() {
            let names: Vec<&str> = element.properties.iter().map(|it| it.name.as_str()).collect();
            let what = format!("the vertices need properties x, y, z; they have: {}", names.join(", "));
            return Err(Error::format(path, "header", what, "rename the properties that hold the positions"));
        }
        if axes[2].is_none() {
            conventions.push("the vertices have no z: it is taken as 0".into());
        }
        let is_attribute =
            |place: &usize| scalar(&element.properties[*place]) && !axes.contains(&Some(*place));
        Ok(Self { axes, attributes: (0..element.properties.len()).filter(is_attribute).collect() })
    }

    /// Keeps the attributes that are wanted, and those that make the radius of splats. Gives the names of the former.
    fn choose(&mut self, element: &Element, wanted: Option<&Wanted>) -> Vec<String> {
        let property = |place: &usize| &element.properties[*place];
        let mut flags = vec![true; self.attributes.len()];
        let is_splat = self.is_splat(element);
        if let Some(wanted) = wanted {
            let offered = |place: &usize| Offered {
                name: &property(place).name,
                components: 1,
                is_measured: property(place).kind().is_some_and(Kind::is_float),
            };
            let radius = Offered { name: "radius", components: 1, is_measured: true };
            let offered: Vec<Offered> =
                self.attributes.iter().map(offered).chain(is_splat.then_some(radius)).collect();
            flags = wanted.flags(&offered);
        }
        let chosen: Vec<(usize, bool)> = self.attributes.iter().copied().zip(flags).collect();
        let is_read =
            |(place, flag): &&(usize, bool)| *flag || is_splat && SCALES.contains(&&*property(place).name);
        self.attributes = chosen.iter().filter(is_read).map(|(place, _)| *place).collect();
        chosen.iter().filter(|(_, flag)| *flag).map(|(place, _)| property(place).name.clone()).collect()
    }

    /// Whether the vertices are those of a file of 3D Gaussian splats.
    fn is_splat(&self, element: &Element) -> bool {
        let has = |name: &&str| element.properties.iter().any(|it| it.name == *name && it.kind().is_some());
        SCALES.iter().chain(&["rot_0", "opacity"]).all(has)
    }
}

/// The vertices of a binary file.
struct Table<'a> {
    path: &'a Path,
    element: &'a Element,
    roles: &'a Roles,
    order: Order,
}

impl Table<'_> {
    /// Reads them from the bytes that begin with them, and advances `progress` by `total_bytes`.
    fn read(&self, bytes: &[u8], total_bytes: usize, progress: &dyn Progress) -> Result<Columns> {
        let Self { path, element, .. } = *self;
        let count = usize::try_from(element.count).unwrap_or(usize::MAX);
        let stride = element.scalars().map(Kind::size).sum();
        let packed;
        let scalars = if element.is_fixed() {
            if count.checked_mul(stride).is_none_or(|needed| needed > bytes.len()) {
                return Err(records::truncated(path, element.count, stride, bytes.len()));
            }
            bytes
        } else {
            packed = self.without_lists(bytes, progress)?;
            &packed
        };
        let layout = self.layout(scalars, count, stride);
        Ok(layout.gather(path, total_bytes, progress)?.into_columns())
    }

    /// The scalars alone, moved together.
    fn without_lists(&self, bytes: &[u8], progress: &dyn Progress) -> Result<Vec<u8>> {
        let mut scalars = Vec::new();
        let mut rest = bytes;
        for row in 0..self.element.count {
            if row % 65536 == 0 && progress.cancelled() {
                return Err(Error::Interrupted);
            }
            for property in &self.element.properties {
                let Some((value, behind)) = split_property(property, rest, self.order) else {
                    return Err(cut_off(self.path, self.element, row, bytes.len()));
                };
                if property.kind().is_some() {
                    scalars.extend_from_slice(value);
                }
                rest = behind;
            }
        }
        Ok(scalars)
    }

    /// Where the scalars stand, if nothing stands between them.
    fn layout<'a>(&self, bytes: &'a [u8], count: usize, stride: usize) -> Layout<'a> {
        let Self { element, roles, order, .. } = *self;
        let mut start = 0;
        let sources: Vec<Option<Source>> = element
            .properties
            .iter()
            .map(|property| {
                let kind = property.kind()?;
                start += kind.size();
                Some(Source { bytes, kind, order, start: start - kind.size(), stride, step: 0 })
            })
            .collect();
        let field = |&place: &usize| {
            Some(Field {
                name: element.properties[place].name.clone(),
                components: 1,
                source: sources[place]?,
            })
        };
        Layout {
            count,
            axes: roles.axes.map(|place| place.and_then(|place| sources[place])),
            fields: roles.attributes.iter().filter_map(field).collect(),
        }
    }
}

/// What stands behind a binary element.
fn skip<'a>(path: &Path, element: &Element, bytes: &'a [u8], order: Order) -> Result<&'a [u8]> {
    let count = usize::try_from(element.count).unwrap_or(usize::MAX);
    if element.is_fixed() {
        let stride: usize = element.scalars().map(Kind::size).sum();
        let rest = count.checked_mul(stride).and_then(|length| bytes.get(length..));
        return rest.ok_or_else(|| cut_off(path, element, (bytes.len() / stride.max(1)) as u64, bytes.len()));
    }
    let mut rest = bytes;
    for row in 0..element.count {
        for property in &element.properties {
            let Some((_, behind)) = split_property(property, rest, order) else {
                return Err(cut_off(path, element, row, bytes.len()));
            };
            rest = behind;
        }
    }
    Ok(rest)
}

/// The bytes of a property, and what stands behind them; `None` if they are not all there.
fn split_property<'a>(property: &Property, bytes: &'a [u8], order: Order) -> Option<(&'a [u8], &'a [u8])> {
    match property.shape {
        Shape::Scalar(kind) => bytes.split_at_checked(kind.size()),
        Shape::List { length, item } => {
            bytes.get(..length.size())?;
            let source = Source { bytes, kind: length, order, start: 0, stride: 0, step: 0 };
            let items = source.number(0); // Negative or NaN counts become 0 items.
            let items_bytes = (items as usize).checked_mul(item.size())?;
            bytes.split_at_checked(length.size().checked_add(items_bytes)?)
        }
    }
}

/// An element has fewer rows than the header promises.
fn cut_off(path: &Path, element: &Element, rows: u64, available: usize) -> Error {
    let what = format!(
        "the header promises {} of element '{}', {rows} are whole in the {available} bytes that are there",
        element.count, element.name
    );
    Error::format(path, "", what, CUT_OFF)
}

/// Gives the Gaussians of a splat file a radius: their scales are logarithms of standard deviations. Of these those stay that are `shown`.
fn add_splat_radius(columns: &mut Columns, shown: &[String], conventions: &mut Vec<String>) {
    let [Some(x), Some(y), Some(z)] = SCALES.map(|name| columns.attributes.iter().find(|it| it.name == name))
    else {
        return;
    };
    let mean = |id: usize| (x.number(id, 0) + y.number(id, 0) + z.number(id, 0)) / 3.0;
    let radii = (0..x.values.len()).into_par_iter().map(|id| mean(id).exp() as f32).collect();
    conventions.push(
        "3D Gaussian splats: shown as spheres of radius exp((scale_0 + scale_1 + scale_2) / 3), added as attribute radius; \
         rotation, opacity and view-dependent color are kept as attributes, not drawn"
            .into(),
    );
    columns.attributes.retain(|it| !SCALES.contains(&&*it.name) || shown.contains(&it.name));
    columns.radii = Some(Radii::PerParticle { attribute: columns.attributes.len(), scale: 1.0 });
    columns.attributes.push(Attribute::new("radius", 1, Values::F32(radii)));
}
