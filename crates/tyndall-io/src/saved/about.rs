//! What a file says about itself, as JSON: all that is no array. Numbers are told with all their digits.

use std::path::Path;

use serde::{Deserialize, Serialize};
use tyndall::math::Bounds;
use tyndall::particles::Dropped;
use tyndall::scene::automatic::Framing;
use tyndall::scene::guesses::{Guesses, Shown};
use tyndall::scene::outline::Outline;
use tyndall::scene::wanted::{Offered, Wanted};
use tyndall::structure::saved::{Facts, RadiiOf};
use tyndall::structure::{Kind, Packing, PackingError, pkd, treelets};
use tyndall::{DVec3, Particles, Radii, Result, Vec3};

use super::fault;

/// A box, by its least and greatest corner; none where it holds nothing.
type Box3 = Option<[[f64; 3]; 2]>;

/// See the module.
#[derive(Serialize, Deserialize)]
pub(super) struct About {
    /// The files that the particles came from.
    pub(super) sources: Vec<String>,
    pub(super) particles: u64,
    /// Offsets are measured from here.
    pub(super) origin: [f64; 3],
    /// Of the centers, as offsets.
    bounds: Box3,
    pub(super) cell: Option<Cell>,
    pub(super) time: Option<f64>,
    #[serde(default)]
    pub(super) time_unit: Option<String>,
    pub(super) length_unit: Option<String>,
    pub(super) dropped: Lost,
    pub(super) attributes: Vec<Attribute>,
    /// How many there are; not said by those who knew of none.
    #[serde(default)]
    pub(super) bonds: u64,
    pub(super) radii: Sizes,
    pub(super) conventions: Vec<String>,
    /// Not yet known while the file is written.
    structure: Option<Structure>,
    guesses: Guessed,
}

#[derive(Clone, Copy, Serialize, Deserialize)]
pub(super) struct Cell {
    origin: [f64; 3],
    vectors: [[f64; 3]; 3],
    periodic: [bool; 3],
}

impl Cell {
    pub(super) fn cell(self) -> tyndall::Cell {
        tyndall::Cell {
            origin: DVec3::from_array(self.origin),
            vectors: self.vectors.map(DVec3::from_array),
            periodic: self.periodic,
        }
    }
}

#[derive(Clone, Copy, Serialize, Deserialize)]
pub(super) struct Lost {
    position: u64,
    radius: u64,
}

impl Lost {
    pub(super) fn dropped(self) -> Dropped {
        Dropped { position: self.position, radius: self.radius }
    }
}

#[derive(Serialize, Deserialize)]
pub(super) struct Attribute {
    pub(super) name: String,
    pub(super) components: usize,
    pub(super) values: String,
    pub(super) unit: Option<String>,
    /// Of words, which the values number.
    pub(super) names: Option<Vec<String>>,
}

/// How large the particles are.
#[derive(Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Sizes {
    Uniform(f64),
    PerType { attribute: usize, radii: Vec<f64> },
    PerParticle { attribute: usize, scale: f64 },
}

impl Sizes {
    /// Of particles with the attributes at `places`. An attribute that is not among them stays one that is not there.
    pub(super) fn radii(&self, places: &[usize]) -> Radii {
        let new_place = |old: usize| places.iter().position(|&it| it == old).unwrap_or(usize::MAX);
        match self {
            Self::Uniform(radius) => Radii::Uniform(*radius as f32),
            Self::PerType { attribute, radii } => Radii::PerType {
                attribute: new_place(*attribute),
                radii: radii.iter().map(|&it| it as f32).collect(),
            },
            Self::PerParticle { attribute, scale } => {
                Radii::PerParticle { attribute: new_place(*attribute), scale: *scale as f32 }
            }
        }
    }

    /// The attribute that they are of, if they are of one.
    fn attribute(&self) -> Option<usize> {
        match self {
            Self::Uniform(_) => None,
            Self::PerType { attribute, .. } | Self::PerParticle { attribute, .. } => Some(*attribute),
        }
    }
}

#[derive(Serialize, Deserialize)]
struct Structure {
    kind: Arranged,
    bounds: Box3,
    radii: Held,
    largest_radius: f64,
    packing_error: Option<PackingCost>,
}

/// Which structure, and how it was built.
#[derive(Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Arranged {
    Bvh { bits: Bits },
    Pkd { axis: Axis, order: Order },
    Treelets { size: u32, cut: Cut, axis: Axis, order: Order },
}

#[derive(Serialize, Deserialize)]
enum Bits {
    #[serde(rename = "exact")]
    Exact,
    #[serde(rename = "16")]
    Bits16,
    #[serde(rename = "11")]
    Bits11,
    #[serde(rename = "8")]
    Bits8,
}

#[derive(Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Axis {
    WidestExtent,
    RoundRobin,
}

#[derive(Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Order {
    NodeFirst,
    NearChildFirst,
}

#[derive(Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Cut {
    Median,
    Middle,
}

/// How the structure holds radii.
#[derive(Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Held {
    One(f64),
    Table(Vec<f64>),
    Each,
    Packed,
}

#[derive(Serialize, Deserialize)]
struct PackingCost {
    center_largest: [f64; 3],
    center_rms: [f64; 3],
    radius_largest: f64,
    mean_radius: f64,
    float_spacing: f64,
    distribution_largest: Option<f64>,
}

#[derive(Serialize, Deserialize)]
struct Guessed {
    radii: String,
    without_outliers: Frame,
    all: Frame,
}

#[derive(Serialize, Deserialize)]
struct Frame {
    bounds: Box3,
    description: String,
    warning: Option<String>,
    of_cell: bool,
    center: [f64; 3],
    outline: Vec<[f64; 3]>,
}

fn wide(vector: Vec3) -> [f64; 3] {
    vector.as_dvec3().to_array()
}

fn box3(bounds: &Bounds) -> Box3 {
    (!bounds.is_empty()).then(|| [wide(bounds.min), wide(bounds.max)])
}

fn bounds(box3: &Box3) -> Bounds {
    let narrow = |corner: [f64; 3]| DVec3::from_array(corner).as_vec3();
    box3.map_or(Bounds::EMPTY, |[min, max]| Bounds { min: narrow(min), max: narrow(max) })
}

impl About {
    /// Of particles with these radii, without a structure.
    pub(super) fn of(
        particles: &Particles,
        radii: &Radii,
        guesses: &Guesses,
        sources: Vec<String>,
        conventions: Vec<String>,
    ) -> Self {
        let dropped = particles.dropped();
        let attribute = |it: &tyndall::Attribute| Attribute {
            name: it.name.clone(),
            components: it.components,
            values: it.values.type_name().into(),
            unit: it.unit.clone(),
            names: match it.values.view() {
                tyndall::particles::View::Text { names, .. } => Some(names.to_vec()),
                _ => None,
            },
        };
        let wide_all = |radii: &[f32]| radii.iter().map(|&it| it.into()).collect();
        Self {
            sources,
            particles: particles.len() as u64,
            origin: particles.positions().origin().to_array(),
            bounds: box3(&particles.bounds()),
            cell: particles.cell().map(|cell| Cell {
                origin: cell.origin.to_array(),
                vectors: cell.vectors.map(|it| it.to_array()),
                periodic: cell.periodic,
            }),
            time: particles.time().filter(|time| time.is_finite()),
            time_unit: particles.time_unit().map(str::to_string),
            length_unit: particles.length_unit().map(str::to_string),
            dropped: Lost { position: dropped.position, radius: dropped.radius },
            attributes: particles.attributes().iter().map(attribute).collect(),
            bonds: particles.bonds().len() as u64,
            radii: match radii {
                Radii::Uniform(radius) => Sizes::Uniform((*radius).into()),
                Radii::PerType { attribute, radii } => {
                    Sizes::PerType { attribute: *attribute, radii: wide_all(radii) }
                }
                Radii::PerParticle { attribute, scale } => {
                    Sizes::PerParticle { attribute: *attribute, scale: (*scale).into() }
                }
            },
            conventions,
            structure: None,
            guesses: Guessed {
                radii: guesses.radii.clone(),
                without_outliers: Frame::of(&guesses.without_outliers),
                all: Frame::of(&guesses.all),
            },
        }
    }

    /// The places of all attributes.
    pub(super) fn all(&self) -> Vec<usize> {
        (0..self.attributes.len()).collect()
    }

    /// The places of the attributes that are wanted, and of that of the radii.
    pub(super) fn wanted(&self, wanted: &Wanted) -> Vec<usize> {
        let offered = self.attributes.iter().map(|it| Offered {
            name: &it.name,
            components: it.components,
            is_measured: matches!(it.values.as_str(), "f32" | "f64"),
        });
        let flags = wanted.flags(&offered.collect::<Vec<_>>());
        (0..flags.len()).filter(|&it| flags[it] || self.radii.attribute() == Some(it)).collect()
    }

    /// Adds what the structure is.
    pub(super) fn with_structure(self, facts: &Facts) -> Self {
        Self { structure: Structure::of(facts), ..self }
    }

    /// As it stands in the file.
    pub(super) fn text(&self) -> Vec<u8> {
        serde_json::to_vec_pretty(self).expect("plain data become JSON")
    }

    /// Reads what a file says.
    pub(super) fn parse(path: &Path, text: &[u8]) -> Result<Self> {
        serde_json::from_slice(text).map_err(|error| fault(path, "about", format!("cannot be read: {error}")))
    }

    /// The box of the centers.
    pub(super) fn bounds(&self) -> Bounds {
        bounds(&self.bounds)
    }

    /// What the structure is.
    pub(super) fn facts(&self, path: &Path) -> Result<Facts> {
        let structure = self.structure.as_ref();
        let structure = structure.ok_or_else(|| fault(path, "about", "no structure is described"))?;
        Ok(Facts {
            kind: structure.kind.kind(),
            count: self.particles as usize,
            bounds: bounds(&structure.bounds),
            radii: match &structure.radii {
                Held::One(radius) => RadiiOf::One(*radius as f32),
                Held::Table(radii) => RadiiOf::Table(radii.iter().map(|&it| it as f32).collect()),
                Held::Each => RadiiOf::Each,
                Held::Packed => RadiiOf::Packed,
            },
            largest_radius: structure.largest_radius as f32,
            packing_error: structure.packing_error.as_ref().map(PackingCost::error),
        })
    }

    /// What was guessed; `sample` are spheres that stand for all.
    pub(super) fn guesses(&self, path: &Path, sample: Vec<[f32; 4]>) -> Result<Guesses> {
        let shown = |frame: &Frame| match frame.outline.is_empty() {
            true => Err(fault(path, "about", "an outline without points")),
            false => Ok(frame.shown()),
        };
        Ok(Guesses {
            radii: self.guesses.radii.clone(),
            without_outliers: shown(&self.guesses.without_outliers)?,
            all: shown(&self.guesses.all)?,
            sample,
        })
    }
}

impl Structure {
    /// None of brute force, which is not saved.
    fn of(facts: &Facts) -> Option<Self> {
        Some(Self {
            kind: Arranged::of(facts.kind)?,
            bounds: box3(&facts.bounds),
            radii: match &facts.radii {
                RadiiOf::One(radius) => Held::One((*radius).into()),
                RadiiOf::Table(radii) => Held::Table(radii.iter().map(|&it| it.into()).collect()),
                RadiiOf::Each => Held::Each,
                RadiiOf::Packed => Held::Packed,
            },
            largest_radius: facts.largest_radius.into(),
            packing_error: facts.packing_error.as_ref().map(PackingCost::of),
        })
    }
}

impl Arranged {
    fn of(kind: Kind) -> Option<Self> {
        let axis = |options: pkd::Options| match options.axis {
            pkd::Axis::WidestExtent => Axis::WidestExtent,
            pkd::Axis::RoundRobin => Axis::RoundRobin,
        };
        let order = |options: pkd::Options| match options.order {
            pkd::Order::NodeFirst => Order::NodeFirst,
            pkd::Order::NearChildFirst => Order::NearChildFirst,
        };
        Some(match kind {
            Kind::Bvh(packing) => Self::Bvh {
                bits: match packing {
                    Packing::Exact => Bits::Exact,
                    Packing::Bits16 => Bits::Bits16,
                    Packing::Bits11 => Bits::Bits11,
                    Packing::Bits8 => Bits::Bits8,
                },
            },
            Kind::Pkd(options) => Self::Pkd { axis: axis(options), order: order(options) },
            Kind::Treelets(treelets::Options { size, cut, heap }) => Self::Treelets {
                size,
                cut: match cut {
                    treelets::Cut::Median => Cut::Median,
                    treelets::Cut::Middle => Cut::Middle,
                },
                axis: axis(heap),
                order: order(heap),
            },
            Kind::Brute => return None,
        })
    }

    fn kind(&self) -> Kind {
        let options = |axis: &Axis, order: &Order| pkd::Options {
            axis: match axis {
                Axis::WidestExtent => pkd::Axis::WidestExtent,
                Axis::RoundRobin => pkd::Axis::RoundRobin,
            },
            order: match order {
                Order::NodeFirst => pkd::Order::NodeFirst,
                Order::NearChildFirst => pkd::Order::NearChildFirst,
            },
        };
        match self {
            Self::Bvh { bits } => Kind::Bvh(match bits {
                Bits::Exact => Packing::Exact,
                Bits::Bits16 => Packing::Bits16,
                Bits::Bits11 => Packing::Bits11,
                Bits::Bits8 => Packing::Bits8,
            }),
            Self::Pkd { axis, order } => Kind::Pkd(options(axis, order)),
            Self::Treelets { size, cut, axis, order } => Kind::Treelets(treelets::Options {
                size: *size,
                cut: match cut {
                    Cut::Median => treelets::Cut::Median,
                    Cut::Middle => treelets::Cut::Middle,
                },
                heap: options(axis, order),
            }),
        }
    }
}

impl PackingCost {
    fn of(error: &PackingError) -> Self {
        Self {
            center_largest: error.center_largest.map(f64::from),
            center_rms: error.center_rms.map(f64::from),
            radius_largest: error.radius_largest.into(),
            mean_radius: error.mean_radius.into(),
            float_spacing: error.float_spacing.into(),
            distribution_largest: error.distribution_largest.map(f64::from),
        }
    }

    fn error(&self) -> PackingError {
        PackingError {
            center_largest: self.center_largest.map(|it| it as f32),
            center_rms: self.center_rms.map(|it| it as f32),
            radius_largest: self.radius_largest as f32,
            mean_radius: self.mean_radius as f32,
            float_spacing: self.float_spacing as f32,
            distribution_largest: self.distribution_largest.map(|it| it as f32),
        }
    }
}

impl Frame {
    fn of(shown: &Shown) -> Self {
        let Shown { framing, outline } = shown;
        Self {
            bounds: box3(&framing.bounds),
            description: framing.description.clone(),
            warning: framing.warning.clone(),
            of_cell: framing.of_cell,
            center: outline.center.to_array(),
            outline: outline.points.iter().map(|it| it.to_array()).collect(),
        }
    }

    fn shown(&self) -> Shown {
        let points = self.outline.iter().map(|&it| DVec3::from_array(it)).collect();
        Shown {
            framing: Framing {
                bounds: bounds(&self.bounds),
                description: self.description.clone(),
                warning: self.warning.clone(),
                of_cell: self.of_cell,
            },
            outline: Outline { center: DVec3::from_array(self.center), points },
        }
    }
}
