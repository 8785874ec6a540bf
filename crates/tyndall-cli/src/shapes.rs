//! Shapes beside spheres, as the command line has them: meshes, arrows and ellipsoids.

use std::path::PathBuf;

use clap::Args;
use tyndall::scene::arrows::{self, Arrows};
use tyndall::scene::coloring::{self, linear};
use tyndall::scene::ellipsoids::{self, Ellipsoids, Shaping};
use tyndall::scene::{Scene, grouped};
use tyndall::structure::Spheres;
use tyndall::structure::shapes::Mesh;
use tyndall::{Cell, Error, Result};
use tyndall_io::read;

use crate::report::counted;
use crate::values::length;

/// What is shown beside the particles.
#[derive(Args)]
#[command(next_help_heading = "Shapes")]
pub(crate) struct Shapes {
    /// A mesh of triangles beside the particles, such as a wall: an STL, OBJ or PLY file in their coordinates; repeated for more. Both of its sides are
    /// shown; periodic images have it, too. The camera frames the particles alone, as walls may be far larger
    #[arg(long, value_name = "FILE")]
    mesh: Vec<PathBuf>,
    /// Color of a mesh, #rrggbb or a color's name: one for all, or repeated, one for each [default: light gray]
    #[arg(long, value_name = "COLOR", value_parser = coloring::color, requires = "mesh")]
    mesh_color: Vec<[u8; 3]>,
    /// A mesh that hides what is behind it but is not shown: an STL, OBJ or PLY file in the particles' coordinates; repeated for more. Pictures have no color and alpha 0 there
    /// (with an opaque background that), for laying them over a plate or another renderer's set: --background none. It casts shadows and throws light back, in
    /// light gray. Also for media, alone and with spheres
    #[arg(long, value_name = "FILE")]
    holdout: Vec<PathBuf>,
    /// The edges of the simulation's cell as rods of that radius among the particles, in their light and with shadows, in place of the lines of --cell; auto is a 200th of the
    /// shortest edge
    #[arg(long, value_name = "R", value_parser = rod, num_args = 0..=1, default_missing_value = "auto", conflicts_with = "cell")]
    cell_radius: Option<Rod>,
    /// Color of the rods, #rrggbb or a color's name [default: dark gray]
    #[arg(long, value_name = "COLOR", value_parser = coloring::color, requires = "cell_radius")]
    cell_color: Option<[u8; 3]>,
    /// Particles as ellipsoids or superquadrics, if the file has what LAMMPS (shapex quatw) or LIGGGHTS (shapex quat1 blockiness1) writes (auto); none for
    /// spheres; or by attributes of three half axes, of a quaternion, w first, and of two exponents: HALF_AXES, HALF_AXES,QUATERNION or all three; or by a symmetric tensor of six
    /// (xx yy zz xy xz yz) or nine numbers, along its principal axes: tensor:NAME, as long as its eigenvalues without their signs (stress), or covariance:NAME, as their roots
    /// (U of ANISOU, gyration); @voigt behind the name for xx yy zz yz xz xy. What has a tensor of 0 is not shown
    #[arg(long, value_name = "WHICH", default_value = "auto")]
    ellipsoids: Shaping,
    /// What half axes are multiplied with [default: 1; of a tensor so that most are no longer than a radius]. The displacement parameters of crystals enclose half of
    /// the probability with covariance:U and 1.5382
    #[arg(long, value_name = "S", value_parser = length, allow_hyphen_values = true)]
    ellipsoid_scale: Option<f32>,
    /// An arrow of a vector attribute at each particle, from its center and in its color: a name such as v, of an attribute with two or three numbers or
    /// of scalars like vx vy vz
    #[arg(long, value_name = "NAME")]
    arrows: Option<String>,
    /// Length of an arrow over that of its vector [default: so that most are as long as 1.5 times the distance of neighbors, or 3 radii]
    #[arg(long, value_name = "S", value_parser = length, allow_hyphen_values = true, requires = "arrows")]
    arrow_scale: Option<f32>,
    /// Radius of an arrow's shaft [default: 0.04 of the usual length]
    #[arg(long, value_name = "R", value_parser = length, allow_hyphen_values = true, requires = "arrows")]
    arrow_radius: Option<f32>,
    /// Arrows without spheres
    #[arg(long, requires = "arrows")]
    pub(crate) arrows_only: bool,
}

/// The radius of the cell's edges; none if it is to be found.
#[derive(Clone, Copy)]
struct Rod(Option<f32>);

fn rod(text: &str) -> Result<Rod> {
    if text == "auto" { Ok(Rod(None)) } else { length(text).map(|radius| Rod(Some(radius))) }
}

/// Radius of the cell's edges over the length of the shortest one.
const ROD_SHARE: f64 = 0.005;
/// Their gray, which is seen before a white background.
const ROD_COLOR: [u8; 3] = [0x50; 3];

/// The gray of walls, which leaves colors to the particles.
const MESH_COLOR: [u8; 3] = [0xb8; 3];

impl Shapes {
    /// The files of meshes.
    pub(crate) fn files(&self) -> impl Iterator<Item = &PathBuf> {
        self.mesh.iter().chain(&self.holdout)
    }

    /// Whether there are meshes.
    pub(crate) fn has_meshes(&self) -> bool {
        !self.mesh.is_empty()
    }

    /// The flag that asks for a shape, if one does.
    pub(crate) fn name(&self) -> Option<&'static str> {
        let arrows = self.arrows.as_ref().map(|_| "--arrows");
        let ellipsoids = self.has_given_ellipsoids().then_some("--ellipsoids");
        arrows.or(ellipsoids).or((!self.mesh.is_empty()).then_some("--mesh")).or(self.rods())
    }

    /// The flag that asks for a hold-out, if it is given.
    pub(crate) fn holdout(&self) -> Option<&'static str> {
        (!self.holdout.is_empty()).then_some("--holdout")
    }

    /// The flag that asks for the cell as rods, if it is given.
    pub(crate) fn rods(&self) -> Option<&'static str> {
        self.cell_radius.map(|_| "--cell-radius")
    }

    /// Shows the edges of the cell in a scene, if that is wanted; a warning if there is no cell.
    pub(crate) fn add_cell(&self, cell: Option<&Cell>, scene: &mut Scene) -> Result<Option<&'static str>> {
        let Some(Rod(radius)) = self.cell_radius else { return Ok(None) };
        let Some(cell) = cell else { return Ok(Some("--cell-radius: the file has no cell")) };
        let shortest = cell.edges().map(|[from, to]| from.distance(to)).fold(f64::INFINITY, f64::min);
        let radius = radius.unwrap_or((ROD_SHARE * shortest) as f32);
        scene.add_cell(cell, radius, linear(self.cell_color.unwrap_or(ROD_COLOR)))?;
        Ok(None)
    }

    /// Whether shapes need the particles as a whole.
    pub(crate) fn are_of_particles(&self) -> bool {
        self.arrows.is_some() || self.has_given_ellipsoids()
    }

    /// Whether attributes are named that make ellipsoids.
    fn has_given_ellipsoids(&self) -> bool {
        matches!(self.ellipsoids, Shaping::Given { .. } | Shaping::Tensor(_))
    }

    /// Vectors and tensors that are drawn, by their names.
    pub(crate) fn vectors(&self) -> Vec<String> {
        let of_ellipsoids = match &self.ellipsoids {
            Shaping::Given { half_axes, turn, exponents } => {
                [Some(half_axes), turn.as_ref(), exponents.as_ref()]
            }
            Shaping::Tensor(tensor) => [Some(&tensor.name), None, None],
            Shaping::Auto | Shaping::Spheres => [None; 3],
        };
        self.arrows.iter().chain(of_ellipsoids.into_iter().flatten()).cloned().collect()
    }

    /// Finds the ellipsoids that are wanted, which would be these spheres otherwise.
    pub(crate) fn ellipsoids(&self, spheres: Spheres) -> Result<Option<Ellipsoids>> {
        if self.arrows_only {
            return Ok(None);
        }
        ellipsoids::find(spheres, &self.ellipsoids, self.ellipsoid_scale)
    }

    /// Finds the arrows that are wanted, of particles with these radii.
    pub(crate) fn arrows(&self, spheres: Spheres) -> Result<Option<Arrows>> {
        let Some(name) = self.arrows.clone() else { return Ok(None) };
        let radius = if self.arrows_only { 0.0 } else { arrows::usual_radius(spheres) };
        let options = arrows::Options { name, scale: self.arrow_scale, radius: self.arrow_radius };
        arrows::find(spheres.particles, &options, radius).map(Some)
    }

    /// Reads the meshes.
    pub(crate) fn meshes(&self) -> Result<Meshes> {
        let (count, colors) = (self.mesh.len(), self.mesh_color.len());
        if colors > 1 && colors != count {
            let allowed = format!("one for all, or one for each of {}", counted(count, "mesh"));
            return Err(Error::setting("--mesh-color", format!("{colors} colors"), allowed));
        }
        let color = |number: usize| {
            let color = self.mesh_color.get(number).or(self.mesh_color.first());
            linear(*color.unwrap_or(&MESH_COLOR))
        };
        let read = |(number, path): (usize, &PathBuf)| Ok((read::mesh("--mesh", path)?, color(number)));
        let shown = self.mesh.iter().enumerate().map(read).collect::<Result<_>>()?;
        Ok(Meshes { shown, ..self.holdouts()? })
    }

    /// Reads the hold-outs alone.
    pub(crate) fn holdouts(&self) -> Result<Meshes> {
        let holdouts = self.holdout.iter().map(|path| read::mesh("--holdout", path));
        Ok(Meshes { shown: Vec::new(), holdouts: holdouts.collect::<Result<_>>()? })
    }
}

/// Meshes.
pub(crate) struct Meshes {
    /// With their colors, linear RGB.
    shown: Vec<(Mesh, [f32; 3])>,
    holdouts: Vec<Mesh>,
}

impl Meshes {
    /// Whether any hide without being shown.
    pub(crate) fn have_holdouts(&self) -> bool {
        !self.holdouts.is_empty()
    }

    /// With the hold-outs of others.
    pub(crate) fn and(mut self, others: Self) -> Self {
        self.holdouts.extend(others.holdouts);
        self
    }

    /// What there is, in words.
    pub(crate) fn description(&self) -> Vec<String> {
        let counts = [self.shown.len(), self.holdouts.len()];
        let triangles = [
            self.shown.iter().map(|(mesh, _)| mesh.len()).sum::<usize>(),
            self.holdouts.iter().map(Mesh::len).sum(),
        ];
        let names = [("a mesh", "meshes"), ("a hold-out", "hold-outs")];
        let pieces = counts.into_iter().zip(triangles).zip(names);
        let piece = |((count, triangles), (one, several)): ((usize, usize), (&str, &str))| match count {
            0 => None,
            1 => Some(format!("{one} of {}", counted(triangles, "triangle"))),
            count => Some(format!("{count} {several} of {} triangles", grouped(triangles))),
        };
        pieces.filter_map(piece).collect()
    }

    /// Adds them to a scene.
    pub(crate) fn add_to(&self, scene: &mut Scene) -> Result<()> {
        self.shown.iter().try_for_each(|(mesh, color)| scene.add_mesh(mesh, *color))?;
        self.holdouts.iter().try_for_each(|mesh| scene.add_holdout(mesh, linear(MESH_COLOR)))
    }
}
