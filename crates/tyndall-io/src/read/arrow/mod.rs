//! Tables of Apache Arrow: its own files and streams, and Parquet, which is read into Arrow's arrays.
//!
//! Takes the whole content, gives the particles of one frame. Blocks of rows are decoded side by side and joined in order; only the columns
//! that are wanted are looked at. Invariant: the decoders, which trust sizes, are given none that the file could not fill, and what they
//! assert is an error of the file (`guard.rs`).

mod column;
pub(crate) mod ipc;
mod pages;
pub(crate) mod parquet;
mod plan;
mod thrift;

use std::path::Path;
use std::sync::Arc;

use arrow_schema::Schema;
use rayon::prelude::*;
use tyndall::particles::{Columns, Radii};
use tyndall::{Cell, DVec3, Error, Result};

use self::column::{Joined, Part, Places};
use self::plan::{Plan, Role};
use super::content::Content;
use super::{Request, records};
use crate::sequence::Frame;

/// Bytes that packed ones become at most: deflate's limit, which whole compressed files have too.
const MOST_RATIO: usize = 1032;
/// Rows that are decoded at a time.
const BATCH_ROWS: usize = 1 << 16;
/// Bytes of rows that are decoded before they are joined.
const ROUND_BYTES: usize = 16 << 20;
const HINT: &str = "was it written to its end?";

/// What the columns of a block of rows have, in the order of the plan's leaves; or what is wrong with one.
type Block = Vec<std::result::Result<Part, String>>;

/// The content of the file, which the decoders keep.
struct Shared(Arc<Content>);

impl AsRef<[u8]> for Shared {
    fn as_ref(&self) -> &[u8] {
        (*self.0).as_ref()
    }
}

/// A table while it is read.
struct Table<'a> {
    path: &'a Path,
    plan: Plan,
    places: Places,
    columns: Vec<Joined>,
    rows: usize,
}

impl<'a> Table<'a> {
    fn new(path: &'a Path, schema: &Schema, request: &Request) -> Result<Self> {
        let options = request.options;
        let plan = Plan::new(path, schema, options.columns.as_deref(), options.wanted.as_ref())?;
        let columns = plan.leaves.iter().filter(|it| it.role == Role::Attribute).map(Joined::new).collect();
        Ok(Self { path, plan, places: Places::default(), columns, rows: 0 })
    }

    /// The columns of the file that are read, in order.
    fn roots(&self) -> Vec<usize> {
        let mut roots: Vec<usize> = self.plan.leaves.iter().map(|it| it.root).collect();
        roots.sort();
        roots.dedup();
        roots
    }

    /// Appends blocks, each with so many rows.
    fn append(&mut self, blocks: Vec<(usize, Block)>) -> Result<()> {
        let fault =
            |name: &str, what: String| Err(Error::format(self.path, format!("column '{name}'"), what, HINT));
        let mut attributes: Vec<Block> = self.columns.iter().map(|_| Vec::new()).collect();
        let mut positions = Vec::new();
        for (rows, block) in blocks {
            let (mut coordinates, mut others) = (Vec::new(), attributes.iter_mut());
            for (leaf, part) in self.plan.leaves.iter().zip(block) {
                if let Ok(part) = &part
                    && part.rows() != rows
                {
                    let what = format!("{} rows were found, {rows} were promised", part.rows());
                    return fault(&leaf.name, what);
                }
                match (leaf.role, part) {
                    (Role::Attribute, part) => others.next().expect("one a leaf").push(part),
                    (role, Ok(part)) => coordinates.push((role, part)),
                    (_, Err(what)) => return fault(&leaf.name, what),
                }
            }
            self.rows += rows;
            positions.push(coordinates);
        }
        let (places, columns) = (&mut self.places, &mut self.columns);
        let (placed, ()) = rayon::join(
            || positions.iter().try_for_each(|it| places.append(it)),
            || {
                let append = |(column, parts): (&mut Joined, Block)| {
                    parts.into_iter().for_each(|part| column.append(part));
                };
                columns.par_iter_mut().zip(attributes).for_each(append);
            },
        );
        let position = self.plan.leaves.iter().find(|it| it.role != Role::Attribute);
        placed.or_else(|what| fault(position.map_or("", |it| &it.name), what))
    }

    /// The frame; `about` is what [`About::to_text`] wrote, if the file has it.
    fn finish(self, about: Option<&str>) -> Result<Frame> {
        let Self { plan, places, columns, .. } = self;
        let (mut conventions, mut warnings) = (plan.conventions, plan.warnings);
        if places.is_flat() {
            conventions.push("two-dimensional: z = 0".to_string());
        }
        let mut attributes = Vec::new();
        for column in columns {
            match column.into_attribute() {
                Ok((attribute, said)) => {
                    attributes.push(attribute);
                    conventions.extend(said);
                }
                Err(why) => warnings.push(why),
            }
        }
        records::spell_out_colors(&mut attributes, &mut conventions);
        let about = about.and_then(About::from_text).unwrap_or_default();
        let columns = Columns {
            positions: places.into_positions(),
            attributes,
            radii: about.radius.map(Radii::Uniform),
            cell: about.cell,
            time: about.time,
            time_unit: about.time_unit,
            length_unit: about.length_unit.or(plan.length_unit),
            bonds: Vec::new(),
        };
        records::frame(columns, conventions, warnings)
    }
}

/// The key under which [`About`] stands in a file's metadata.
pub(crate) const ABOUT: &str = "tyndall";

/// What particles have beside columns.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct About {
    pub(crate) time: Option<f64>,
    pub(crate) time_unit: Option<String>,
    pub(crate) length_unit: Option<String>,
    pub(crate) cell: Option<Cell>,
    pub(crate) radius: Option<f32>,
}

impl About {
    /// As JSON.
    pub(crate) fn to_text(&self) -> String {
        let cell = self.cell.as_ref().map(|cell| {
            serde_json::json!({
                "origin": cell.origin.to_array(),
                "vectors": cell.vectors.map(|it| it.to_array()),
                "periodic": cell.periodic,
            })
        });
        let all = serde_json::json!({
            "time": self.time, "time_unit": self.time_unit, "length_unit": self.length_unit, "cell": cell,
            "radius": self.radius,
        });
        all.to_string()
    }

    /// From JSON; `None` if it is none. What cannot be understood in it is not there.
    pub(crate) fn from_text(text: &str) -> Option<Self> {
        let all: serde_json::Value = serde_json::from_str(text).ok()?;
        let vector = |value: &serde_json::Value| -> Option<DVec3> {
            let numbers: [f64; 3] = serde_json::from_value(value.clone()).ok()?;
            Some(DVec3::from_array(numbers)).filter(|it| it.is_finite())
        };
        let cell = || -> Option<Cell> {
            let cell = &all["cell"];
            let vectors = &cell["vectors"];
            Some(Cell {
                origin: vector(&cell["origin"])?,
                vectors: [vector(&vectors[0])?, vector(&vectors[1])?, vector(&vectors[2])?],
                periodic: serde_json::from_value(cell["periodic"].clone()).ok()?,
            })
        };
        Some(Self {
            time: all["time"].as_f64(),
            time_unit: all["time_unit"].as_str().map(str::to_string),
            length_unit: all["length_unit"].as_str().map(str::to_string),
            cell: cell(),
            radius: all["radius"].as_f64().map(|it| it as f32).filter(|it| (0.0..f32::INFINITY).contains(it)),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_stands_beside_the_columns_is_written_and_read() {
        let about = About {
            time: Some(0.1),
            time_unit: Some("ps".to_string()),
            length_unit: Some("Å".to_string()),
            cell: Some(Cell {
                origin: DVec3::new(0.1, -1e300, 1e-300),
                vectors: [DVec3::X, 2.0 * DVec3::Y, DVec3::ONE / 3.0],
                periodic: [true, false, true],
            }),
            radius: Some(0.3),
        };
        assert_eq!(About::from_text(&about.to_text()), Some(about));
        assert_eq!(About::from_text(&About::default().to_text()), Some(About::default()));
        assert_eq!(About::from_text("{\"cell\": {\"vectors\": 3}, \"radius\": -1}"), Some(About::default()));
        assert_eq!(About::from_text("pandas"), None);
    }
}
