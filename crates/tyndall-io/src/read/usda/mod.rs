//! USD as text (`.usda`): the points of `Points` prims, and where a `PointInstancer` puts its instances, with their primvars.
//!
//! Takes the whole text, gives the points of all prims, each moved by the transforms that it is under. Frames are the time samples of the
//! points; what has no sample at a time has the one before it, or its default, but transforms go on from sample to sample. References, payloads and variants are not followed.
//! Source: OpenUSD, "UsdGeomPoints", "UsdGeomXformable", "UsdGeomPrimvar" and the text file format of Sdf.

pub(crate) mod camera;
mod numbers;
mod scan;
mod transform;

use std::path::Path;

use glam::{DMat3, DVec3};
use rayon::prelude::*;
use tyndall::particles::{Attribute, Columns, Values};
use tyndall::scene::wanted::Offered;
use tyndall::{Error, Progress, Result};

use self::numbers::{Column, joined, values};
use self::scan::{Layer, Prim, Property, Wanted};
use super::{Index, Request, Span, records};
use crate::sequence::{Frame, Options};

const HINT: &str = "export the points again as .usda, PLY or classic .bgeo";
const POINTS: Wanted =
    Wanted { is: |prim| prim.positions().is_some(), name: "prims with points", hint: HINT };
/// More values than these of a point are a mistake.
const MOST_COMPONENTS: usize = 1 << 10;
/// A value that is the same for all points has at most so many components: those of a matrix.
const MOST_REPEATED: usize = 16;
/// More quantities than these are a mistake.
const MOST_QUANTITIES: usize = 256;

/// Whether the file begins like one.
pub(crate) fn recognise(head: &[u8]) -> bool {
    head.starts_with(b"#usda ")
}

/// Names of lengths by how many metres they are.
const UNITS: [(f64, &str); 7] =
    [(1e-10, "Å"), (1e-9, "nm"), (1e-6, "µm"), (1e-3, "mm"), (1e-2, "cm"), (1.0, "m"), (1e3, "km")];

/// The times at which there are points; none where they stay.
fn times(layer: &Layer) -> Vec<f64> {
    let samples = layer.prims.iter().filter_map(|it| it.positions()).flat_map(|it| &it.samples);
    let mut times: Vec<f64> = samples.map(|it| it.0).collect();
    times.sort_by(f64::total_cmp);
    times.dedup();
    times
}

/// Finds the frames. A span's offset is the frame's number.
pub(crate) fn index(path: &Path, bytes: &[u8], _: &Options) -> Result<Index> {
    let layer = Layer::read(path, bytes, POINTS)?;
    let count = times(&layer).len().max(1);
    let span = |frame: usize| Span { offset: frame as u64, line: frame as u64 + 1, bytes: None };
    Ok(Index { frames: (0..count).map(span).collect(), ..Index::default() })
}

/// Reads a frame.
pub(crate) fn frame(
    path: &Path,
    bytes: &[u8],
    span: Span,
    request: &Request,
    progress: &dyn Progress,
) -> Result<Frame> {
    progress.begin("read", Some(bytes.len() as u64), "B");
    let layer = Layer::read(path, bytes, POINTS)?;
    let time = times(&layer).get(span.offset as usize).copied();
    let fault = |prim: &Prim, what: String| Error::format(path, format!("prim '{}'", prim.name), what, HINT);

    let (mut clouds, mut warnings) = (Vec::new(), Vec::new());
    for prim in &layer.prims {
        let Some(text) = prim.positions().and_then(|it| it.at(time)) else { continue };
        let kind = prim.positions().map_or("", |it| it.kind);
        let positions = values(kind, text).map_err(|what| fault(prim, what))?;
        if numbers::width(kind) != Some(3) || !positions.len().is_multiple_of(3) {
            return Err(fault(prim, "points that have not three coordinates each".to_string()));
        }
        let (matrix, left_out) = transform::of(&prim.transforms, time);
        warnings.extend(left_out.into_iter().map(|it| format!("left out: {it} of prim '{}'", prim.name)));
        clouds.push(Cloud { prim, count: positions.len() / 3, positions, matrix });
        progress.advance(text.len() as u64);
        if progress.cancelled() {
            return Err(Error::Interrupted);
        }
    }
    if clouds.is_empty() {
        let what = "there is no prim of type Points or PointInstancer that has points";
        return Err(Error::format(path, "", what, HINT));
    }

    // What the clouds have, each quantity once.
    let mut quantities: Vec<Quantity> = Vec::new();
    for cloud in &clouds {
        for property in &cloud.prim.properties {
            if quantities.len() < MOST_QUANTITIES
                && let Some(quantity) = Quantity::of(property, time)
                && !quantities.iter().any(|it| it.name == quantity.name)
            {
                quantities.push(quantity);
            }
        }
    }
    if let Some(wanted) = &request.options.wanted {
        let offered = quantities.iter().map(|it| Offered {
            name: &it.name,
            components: it.components,
            is_measured: it.is_measured,
        });
        let mut flags = wanted.flags(&offered.collect::<Vec<_>>()).into_iter();
        quantities.retain(|_| flags.next().unwrap_or(true));
    }
    let counts: Vec<usize> = clouds.iter().map(|it| it.count).collect();
    let (mut attributes, mut without_widths) = (Vec::new(), Vec::new());
    for quantity in &quantities {
        let mut parts = Vec::new();
        for cloud in &clouds {
            if progress.cancelled() {
                return Err(Error::Interrupted);
            }
            let column = cloud.column(quantity, time).map_err(|what| fault(cloud.prim, what))?;
            if let Some(Err(why)) = &column {
                warnings.push(format!("left out: {} of prim '{}' ({why})", quantity.name, cloud.prim.name));
            }
            let mut column = column.and_then(std::result::Result::ok);
            if quantity.name == RADIUS && column.is_none() {
                without_widths.push(cloud.prim.name);
                column = Some(Values::F32(vec![0.5; cloud.count]));
            }
            parts.push(column);
        }
        if parts.iter().any(Option::is_some) {
            let values = joined(parts, &counts, quantity.components);
            attributes.push(Attribute::new(&quantity.name, quantity.components, values));
        }
    }
    if clouds.len() > 1 {
        let codes = counts.iter().zip(0..).flat_map(|(&count, code)| std::iter::repeat_n(code, count));
        let names = clouds.iter().map(|it| it.prim.name.to_string()).collect();
        attributes.push(Attribute::new("prim", 1, Values::Text { codes: codes.collect(), names }));
    }

    let starts: Vec<usize> = counts
        .iter()
        .scan(0, |end, count| {
            *end += count;
            Some(*end - count)
        })
        .collect();
    let position = |id: usize| {
        let place = starts.partition_point(|&start| start <= id) - 1;
        clouds[place].position(id - starts[place])
    };
    let positions = records::positions(counts.iter().sum(), None, position);
    let metres = layer.number("metersPerUnit");
    let unit = metres.and_then(|metres| UNITS.iter().find(|it| (it.0 / metres - 1.0).abs() < 1e-6));
    let rate = layer.number("timeCodesPerSecond").filter(|it| *it > 0.0);
    let mut conventions = Vec::new();
    if quantities.iter().any(|it| it.name == RADIUS) {
        conventions.push("widths are diameters: radius is half of them".to_string());
    }
    if !without_widths.is_empty() {
        conventions.push(format!("prims without widths, taken as 1: {}", without_widths.join(", ")));
    }
    if layer.word("upAxis") == Some("Y") {
        conventions.push("the file's up axis is Y: --up y shows it upright".to_string());
    }
    let columns = Columns {
        positions,
        attributes,
        time: time.map(|code| rate.map_or(code, |rate| code / rate)),
        time_unit: time.map(|_| if rate.is_some() { "s" } else { "time code" }.to_string()),
        length_unit: unit.map(|it| it.1.to_string()),
        ..Columns::default()
    };
    records::frame(columns, conventions, warnings)
}

/// What half of `widths` is called.
const RADIUS: &str = "radius";

/// The points of a prim.
struct Cloud<'a> {
    prim: &'a Prim<'a>,
    count: usize,
    /// Three a point.
    positions: Values,
    matrix: glam::DAffine3,
}

/// A quantity of points.
#[derive(Debug)]
struct Quantity {
    name: String,
    components: usize,
    is_measured: bool,
}

impl Quantity {
    /// What a property of a prim is, if it is a value for every point, or one for all of them.
    fn of(property: &Property, time: Option<f64>) -> Option<Self> {
        let name = name(property)?;
        property.at(time)?;
        let width = numbers::width(property.kind)?;
        let components = width.checked_mul(property.element_size()).filter(|it| *it <= MOST_COMPONENTS)?;
        Some(Self { name, components, is_measured: numbers::is_measured(property.kind) })
    }
}

/// What a property is called as an attribute; none if it is no quantity of points.
fn name(property: &Property) -> Option<String> {
    if !property.kind.ends_with("[]") {
        return None;
    }
    Some(match property.name {
        "widths" => RADIUS.to_string(),
        "ids" => "id".to_string(),
        "velocities" => "velocity".to_string(),
        "accelerations" | "scales" | "protoIndices" | "angularVelocities" => property.name.to_string(),
        "primvars:displayColor" => "color".to_string(),
        "primvars:displayOpacity" => "opacity".to_string(),
        other => other.strip_prefix("primvars:").filter(|it| !it.ends_with(":indices"))?.to_string(),
    })
}

impl Cloud<'_> {
    fn position(&self, row: usize) -> DVec3 {
        let coordinate = |axis| self.positions.number(3 * row + axis);
        self.matrix.transform_point3(DVec3::new(coordinate(0), coordinate(1), coordinate(2)))
    }

    /// A quantity's values, one for each point; or why they are left out; nothing if the prim has none. Fails if they cannot be read.
    fn column(
        &self,
        quantity: &Quantity,
        time: Option<f64>,
    ) -> std::result::Result<Option<std::result::Result<Column, String>>, String> {
        let mine = self.prim.properties.iter().find(|it| name(it).as_ref() == Some(&quantity.name));
        let Some((property, text)) = mine.and_then(|it| Some((it, it.at(time)?))) else { return Ok(None) };
        let components = quantity.components;
        let wrong = |what: String| format!("{}: {what}", property.name);
        let mut column = values(property.kind, text).map_err(wrong)?;
        let of_indices = format!("{}:indices", property.name);
        if let Some(indices) = self.prim.property(&of_indices).and_then(|it| it.at(time)) {
            let places = values("int[]", indices).map_err(wrong)?;
            column = numbers::gathered(&column, components, &places).map_err(wrong)?;
        }
        let found = column.len();
        if found == components && self.count != 1 && components <= MOST_REPEATED {
            column = numbers::repeated(&column, self.count);
        } else if found != components * self.count {
            return Ok(Some(Err(format!("{found} values for {} points", self.count))));
        }
        let linear = self.matrix.matrix3;
        match property.name {
            "widths" => scale(&mut column, 0.5 * linear.determinant().abs().cbrt()),
            "velocities" | "accelerations" if linear != DMat3::IDENTITY => turn(&mut column, linear),
            _ => {}
        }
        Ok(Some(Ok(column)))
    }
}

fn scale(column: &mut Column, factor: f64) {
    match column {
        Values::F32(values) => values.par_iter_mut().for_each(|it| *it = (f64::from(*it) * factor) as f32),
        Values::F64(values) => values.par_iter_mut().for_each(|it| *it *= factor),
        _ => {}
    }
}

/// Turns vectors.
fn turn(column: &mut Column, matrix: DMat3) {
    if let Values::F32(values) = column {
        values.par_chunks_exact_mut(3).for_each(|it| {
            let turned = matrix * DVec3::new(it[0].into(), it[1].into(), it[2].into());
            it.copy_from_slice(&turned.as_vec3().to_array());
        });
    }
}

#[cfg(test)]
mod tests;
