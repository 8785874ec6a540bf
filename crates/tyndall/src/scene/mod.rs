//! What is seen, by whom, in which light.

mod amounts;
pub mod arrows;
pub mod automatic;
pub mod bonding;
pub mod camera;
pub mod camera_path;
pub mod center;
pub mod color;
pub mod coloring;
pub mod colormap;
mod colormap_tables;
mod cut;
pub mod element;
pub mod ellipsoids;
mod expression;
pub mod guesses;
pub mod image_light;
pub mod joined;
mod kinds;
pub mod light;
pub mod looks;
pub mod material;
mod meaning;
pub mod motion;
pub mod opacity;
pub mod outline;
pub mod quantity;
mod rgb;
pub mod select;
pub mod sizes;
mod spacing;
mod statistics;
pub mod subset;
pub mod type_elements;
pub mod units;
pub mod viewpoint;
pub mod wanted;

use crate::error::{Error, Result};
use crate::frozen::Frozen;
use crate::math::Ray;
use crate::particles::Cell;
use crate::structure::replicas::Replicas;
use crate::structure::selection::Column;
use crate::structure::shapes::{Arrow, Ellipsoid, Mesh, Segment, Shapes};
use crate::structure::{Structure, by_node};
#[cfg(feature = "gpu")]
use color::ColorColumn;
use color::ParticleColors;
use cut::Cut;
use glam::Vec3;
use light::Lighting;
use select::Selectable;
pub use statistics::{grouped, short};

/// Particles, and how they are seen.
pub struct Scene {
    /// What lights them.
    pub lighting: Lighting,
    /// Linear RGB behind them; none leaves the picture transparent there.
    pub background: Option<[f32; 3]>,
    structure: Structure,
    /// By node.
    colors: ParticleColors,
    /// Beside the particles.
    shapes: Option<Shapes>,
    /// By node the probability that a particle is there, where not all are opaque.
    opacity: Option<Frozen<f32>>,
    /// By node the radiance that particles give off, if any do.
    glow: Option<Frozen<[f32; 3]>>,
    /// By node how far particles move while a picture is taken, if any do.
    motion: Option<Vec<Vec3>>,
    /// What of it all is left, where that is not all.
    cut: Option<Cut>,
    /// Quantities that filters may ask for.
    selectables: Vec<Selectable<Column>>,
}

impl Scene {
    /// Particles with the colors that were resolved for them before they were arranged.
    pub fn new(
        structure: Structure,
        colors: ParticleColors,
        lighting: Lighting,
        background: Option<[f32; 3]>,
    ) -> Self {
        let colors = colors.arranged(structure.ids());
        Self {
            lighting,
            background,
            structure,
            colors,
            shapes: None,
            opacity: None,
            glow: None,
            motion: None,
            cut: None,
            selectables: Vec::new(),
        }
    }

    /// The same light, colors, cut and background on other arrays, with the same nodes.
    fn with(&self, structure: Structure, shapes: Option<Shapes>, opacity: Option<Frozen<f32>>) -> Self {
        let (lighting, background) = (self.lighting.clone(), self.background);
        let (colors, cut) = (self.colors.clone(), self.cut.clone());
        Self {
            lighting,
            background,
            structure,
            colors,
            shapes,
            opacity,
            glow: self.glow.clone(),
            motion: None,
            cut,
            selectables: Vec::new(),
        }
    }

    /// The particles.
    pub fn structure(&self) -> &Structure {
        &self.structure
    }

    /// The particles, to be hidden by rules of a test's own.
    #[cfg(all(test, feature = "gpu"))]
    pub(crate) fn structure_mut(&mut self) -> &mut Structure {
        &mut self.structure
    }

    /// Colors the particles anew, with colors resolved for them in the order of their ids.
    pub fn recolor(&mut self, colors: ParticleColors) {
        self.colors = colors.arranged(self.structure.ids());
    }

    /// Gives back the particles.
    pub fn into_structure(self) -> Structure {
        self.structure
    }

    /// Shows periodic images too: see [`Structure::replicate`].
    pub fn replicate(&mut self, replicas: &Replicas) -> Result<()> {
        self.structure.replicate(replicas)
    }

    /// Joins particles by cylinders of that radius, between what the ids of `segments` name; what has no length, or an id that is none, is left out.
    ///
    /// Fails with [`Error::Setting`] if the radius is not a number above 0, or there are too many nodes.
    pub fn bond(&mut self, segments: &[Segment], radius: f32) -> Result<()> {
        self.add(|shapes, structure| shapes.add_bonds(structure, segments, radius))
    }

    /// Shows arrows of particles, in their colors, with shafts of that radius.
    ///
    /// Fails with [`Error::Setting`] if the radius is not a number above 0, or there are too many nodes.
    pub fn add_arrows(&mut self, arrows: &[Arrow], radius: f32) -> Result<()> {
        self.add(|shapes, structure| shapes.add_arrows(structure, arrows, radius))
    }

    /// Shows ellipsoids around the centers of particles, in their colors. Their spheres stay what they are: with radii scaled by 0 they are not seen.
    ///
    /// Fails with [`Error::Setting`] if a half axis is not a number above 0, or there are too many nodes.
    pub fn add_ellipsoids(&mut self, ellipsoids: &[Ellipsoid]) -> Result<()> {
        self.add(|shapes, structure| shapes.add_ellipsoids(structure, ellipsoids))
    }

    /// Shows a mesh of a color (linear RGB) beside the particles, from both sides; periodic images have images of it. It belongs to no particle, so that
    /// no filter hides it, and has the id -1.
    ///
    /// Fails with [`Error::Setting`] if there are too many nodes.
    pub fn add_mesh(&mut self, mesh: &Mesh, color: [f32; 3]) -> Result<()> {
        self.add(|shapes, structure| shapes.add_mesh(structure, mesh, color))
    }

    /// Lets a mesh hide what is behind it without being shown: where it is in front, pictures have no color, alpha 0 and no depth, or their background. For light
    /// it is there as a mesh of that color (linear RGB): it casts shadows, throws light back, and is seen in mirrors and through glass.
    ///
    /// Fails as [`Self::add_mesh`] does.
    pub fn add_holdout(&mut self, mesh: &Mesh, color: [f32; 3]) -> Result<()> {
        self.add(|shapes, structure| shapes.add_holdout(structure, mesh, color))
    }

    /// Whether anything hides without being shown.
    pub(crate) fn has_holdouts(&self) -> bool {
        self.shapes.as_ref().is_some_and(Shapes::have_holdouts)
    }

    /// Whether what is at a node hides without being shown.
    pub(crate) fn is_holdout(&self, node: u32) -> bool {
        let node = self.cap_of(node).map_or(node, |(_, cut)| cut);
        self.locate_shape(node).is_some_and(|(shapes, own, _)| shapes.is_holdout(own))
    }

    /// Shows the edges of a cell as rods of that radius and color (linear RGB), which belong to no particle, as a mesh does.
    ///
    /// Fails with [`Error::Setting`] if the radius is not a number above 0, or there are too many nodes.
    pub fn add_cell(&mut self, cell: &Cell, radius: f32, color: [f32; 3]) -> Result<()> {
        self.add(|shapes, structure| shapes.add_rods(structure, cell.edges(), radius, color))
    }

    fn add(&mut self, add: impl FnOnce(&mut Shapes, &Structure) -> Result<()>) -> Result<()> {
        let mut shapes = self.shapes.take().map_or_else(Shapes::new, Ok)?;
        let added = add(&mut shapes, &self.structure);
        shapes.show(&self.structure)?;
        self.shapes = Some(shapes).filter(|shapes| !shapes.is_empty());
        added
    }

    /// The shapes beside the particles, if there are any.
    #[inline(always)]
    pub(crate) fn shapes(&self) -> Option<&Shapes> {
        self.shapes.as_ref()
    }

    /// How many nodes particles and shapes have, in all images.
    pub(crate) fn nodes(&self) -> u32 {
        let shapes = self.shapes.as_ref().map_or(0, Shapes::nodes);
        self.structure.nodes() + self.structure.images() * shapes
    }

    /// The shapes' node, counted from 0, that a node behind those of the particles is, and by how much its image is moved.
    #[inline(always)]
    pub(crate) fn locate_shape(&self, node: u32) -> Option<(&Shapes, u32, Vec3)> {
        let shapes = self.shapes.as_ref()?;
        let node = node.checked_sub(self.structure.nodes())?;
        Some((shapes, node % shapes.nodes(), self.structure.shift(node / shapes.nodes())))
    }

    /// Depth and node of the first shape that a ray meets before `depth`; every shape of every image is tried.
    pub(crate) fn shape_before(&self, ray: &Ray, depth: Option<f32>) -> Option<(f32, u32)> {
        self.first_shape(ray, depth, |shapes, ray, _| shapes.intersect(ray))
    }

    /// The same by the hierarchy of the shapes, but for the one of node `except`. Where rounding decides whether a rim is met, it may not be.
    pub(crate) fn shape_met(&self, ray: &Ray, depth: Option<f32>, except: Option<u32>) -> Option<(f32, u32)> {
        self.first_shape(ray, depth, |shapes, ray, first_node| {
            let except = except.and_then(|node| node.checked_sub(first_node)).map(|node| node / 2);
            shapes.nearest(ray, except)
        })
    }

    /// What `ask` finds in the shapes of each image, whose nodes count from the number that it is told.
    fn first_shape(
        &self,
        ray: &Ray,
        depth: Option<f32>,
        ask: impl Fn(&Shapes, &Ray, u32) -> Option<(f32, u32)>,
    ) -> Option<(f32, u32)> {
        let shapes = self.shapes.as_ref()?;
        let mut best: Option<(f32, u32)> = None;
        for image in 0..self.structure.images() {
            let t_max =
                best.map(|(depth, _)| depth).or(depth).map_or(ray.t_max, |depth| depth.min(ray.t_max));
            let moved = Ray { origin: ray.origin - self.structure.shift(image), t_max, ..*ray };
            let first_node = self.structure.nodes() + image * shapes.nodes();
            let found = ask(shapes, &moved, first_node);
            best = found.map(|(depth, node)| (depth, first_node + node)).or(best);
        }
        best
    }

    /// The place in the file of the particle at a node, or of that to which a shape or its half belongs, or what a cap is of; none of a mesh.
    #[inline(always)]
    pub(crate) fn place(&self, node: u32) -> Option<u64> {
        let node = self.cap_of(node).map_or(node, |(_, cut)| cut);
        match self.locate_shape(node) {
            Some((shapes, node, _)) => shapes.particle(node).map(|owner| self.structure.place(owner)),
            None => Some(self.structure.place(node)),
        }
    }

    /// Scales all radii: see [`Structure::scale_radii`].
    pub fn scale_radii(&mut self, scale: f32) {
        self.structure.scale_radii(scale);
    }

    /// The colors as they are held, by node.
    #[cfg(feature = "gpu")]
    pub(crate) fn color_column(&self) -> ColorColumn<'_> {
        self.colors.column()
    }

    /// From now on particles give off light: RGB radiance by id; none lets them be dark. It is seen in media ([`crate::render::medium::solids`]).
    ///
    /// Fails with [`Error::Setting`] if a radiance is negative or not finite.
    pub fn set_glow(&mut self, glow: Option<&[[f32; 3]]>) -> Result<()> {
        let is_wrong = |it: &&[f32; 3]| !it.iter().all(|value| (0.0..f32::INFINITY).contains(value));
        if let Some(wrong) = glow.iter().copied().flatten().find(is_wrong) {
            let allowed = "three finite numbers that are not negative";
            return Err(Error::setting("--emission", format!("{wrong:?}"), allowed));
        }
        let shines = glow.filter(|glow| glow.iter().any(|it| *it != [0.0; 3]));
        self.glow = shines.map(|glow| by_node(glow, self.structure.ids(), [0.0; 3]).into());
        Ok(())
    }

    /// Whether any particle gives off light.
    pub(crate) fn glows(&self) -> bool {
        self.glow.is_some()
    }

    /// The radiance that the particle at `node` gives off, without images.
    pub(crate) fn glow(&self, node: u32) -> [f32; 3] {
        self.glow.as_ref().map_or([0.0; 3], |glow| glow[node as usize])
    }

    /// The color of the particle at `node`, without images: linear RGB, 0 to 1.
    #[inline(always)]
    pub(crate) fn color(&self, node: u32) -> [f32; 3] {
        self.colors.color(node as usize)
    }
}
