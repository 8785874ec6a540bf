//! Exact shapes beside the particles: cylinders of bonds, rods, triangles of meshes, cylinders and cones of arrows, ellipsoids, superquadrics.
//!
//! They stand in a hierarchy of their own, over balls around them or around parts of them, and are asked after the particles. A shape has two
//! nodes behind those of the particles: bonds have two halves, which belong to the particles that they join.

mod cone;
mod cylinder;
mod ellipsoid;
mod mesh;
pub(crate) mod number;
mod superquadric;
#[cfg(test)]
mod tests;
mod triangle;

use std::sync::Arc;

use glam::{DQuat, DVec3, Vec3};

use super::Structure;
use super::bvh::{Bvh, Packing};
use super::search::{Every, Search, Within};
use crate::error::{Error, Result};
use crate::math::{Bounds, Ray};
use crate::structure::build::Record;
use cone::Cone;
use cylinder::Cylinder;
pub use ellipsoid::Ellipsoid;
use ellipsoid::Stretched;
pub use mesh::Mesh;
use number::{Entry, Line, Number};
use superquadric::Superquadric;
use triangle::Triangle;

/// Where a bond goes, as offsets from the particles' origin, and the ids of the particles that its first and second half belong to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segment {
    /// Where it starts.
    pub from: Vec3,
    /// Where it ends.
    pub to: Vec3,
    /// The particle of each half.
    pub ends: [u32; 2],
}

/// An arrow of a particle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arrow {
    /// Where it starts, as an offset from the particles' origin.
    pub from: Vec3,
    /// From there to its tip.
    pub vector: Vec3,
    /// The id of the particle.
    pub particle: u32,
}

/// The length of an arrow's tip over the radius of its shaft; a short arrow is half tip, and thinner.
const TIP_LENGTH: f32 = 5.0;
/// The radius of a tip over its length.
const TIP_RADIUS: f32 = 0.45;

impl Arrow {
    /// Its shaft and its tip; none if it has no length.
    fn parts(&self, radius: f32) -> Option<[Shape; 2]> {
        let (length, to) = (self.vector.length(), self.from + self.vector);
        let axis = self.vector.try_normalize()?;
        let height = (TIP_LENGTH * radius).min(0.5 * length);
        let shaft = Cylinder::between([self.from, to - height * axis], height / TIP_LENGTH)?;
        let tip = Cone { tip: to, axis, height, radius: TIP_RADIUS * height };
        Some([Shape::Cylinder(shaft), Shape::Cone(tip)])
    }
}

/// A shape, as offsets from the particles' origin.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Shape {
    Cylinder(Cylinder),
    Cone(Cone),
    Ellipsoid(Stretched),
    Superquadric(Superquadric),
    Triangle(Triangle),
}

/// A ball around a shape, or around a part of one.
#[derive(Clone, Copy, Debug)]
struct Ball {
    center: Vec3,
    radius: f32,
}

impl Shape {
    /// Where rays enter it, or meet it if it is flat. Rays that start inside do not enter: they do so at a negative distance.
    #[inline(always)]
    pub(crate) fn enter<R: Number>(&self, line: &Line<R>) -> Entry<R> {
        match self {
            Self::Cylinder(cylinder) => cylinder.enter(line),
            Self::Cone(cone) => cone.enter(line),
            Self::Ellipsoid(ellipsoid) => ellipsoid.enter(line),
            Self::Superquadric(superquadric) => R::by_ray(line, |line| superquadric.enter(line)),
            Self::Triangle(triangle) => triangle.enter(line),
        }
    }

    /// Place and normal of the surface near a point of it that was met along `direction`.
    pub(crate) fn surface(&self, point: Vec3, direction: Vec3) -> (Vec3, Vec3) {
        match self {
            Self::Cylinder(cylinder) => cylinder.surface(point, direction),
            Self::Cone(cone) => cone.surface(point, direction),
            Self::Ellipsoid(ellipsoid) => ellipsoid.surface(point, direction),
            Self::Superquadric(superquadric) => superquadric.surface(point, direction),
            Self::Triangle(triangle) => triangle.surface(point, direction),
        }
    }

    /// The radius of a sphere that touches it from within, about: 0 of what is flat.
    pub(crate) fn radius(&self) -> f32 {
        match self {
            Self::Cylinder(cylinder) => cylinder.radius,
            Self::Cone(cone) => cone.radius,
            Self::Ellipsoid(ellipsoid) => ellipsoid.shortest(),
            Self::Superquadric(superquadric) => superquadric.shortest(),
            Self::Triangle(_) => 0.0,
        }
    }

    /// Where a ray enters it within its interval, and whether in its second half.
    fn meet(&self, ray: &Ray) -> Option<(f32, bool)> {
        let Entry { t, is_second, meets } = self.enter(&Line::from(ray));
        (meets && ray.t_min < t && t < ray.t_max).then_some((t, is_second))
    }
}

impl Shape {
    /// Where the line of a ray enters and leaves it, if it does; what is flat is not entered.
    pub(crate) fn chord(&self, ray: &Ray) -> Option<[f32; 2]> {
        if matches!(self, Self::Triangle(_)) {
            return None;
        }
        let back = Ray { direction: -ray.direction, ..*ray };
        let (enter, leave) = (self.enter(&Line::from(ray)), self.enter(&Line::from(&back)));
        (enter.meets && leave.meets).then_some([enter.t, -leave.t])
    }

    /// Whether a point within it lies in its second half.
    fn is_second_at(&self, point: Vec3) -> bool {
        match self {
            Self::Cylinder(cylinder) => (point - cylinder.middle).dot(cylinder.axis) > 0.0,
            Self::Cone(_) | Self::Ellipsoid(_) | Self::Superquadric(_) | Self::Triangle(_) => false,
        }
    }
}

/// What a shape belongs to, and has its color from.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Owner {
    /// Particles: its halves belong to those at these nodes.
    Particles([u32; 2]),
    /// A mesh, or rods, by their number.
    Mesh(u32),
}

/// See the module. Clones share all but what is shown.
#[derive(Clone)]
pub(crate) struct Shapes {
    shapes: Arc<Vec<Shape>>,
    /// By shape.
    owners: Arc<Vec<Owner>>,
    /// By mesh, or rods: linear RGB.
    colors: Vec<[f32; 3]>,
    /// The numbers of the meshes that hide what is behind them and are not shown.
    holdouts: Vec<u32>,
    /// Over the balls of those that are shown.
    bvh: Bvh,
    /// The radius of the largest ball.
    longest: f32,
    /// No larger balls are wanted around parts of a mesh.
    mesh_ball: f32,
}

impl Shapes {
    pub(crate) fn new() -> Result<Self> {
        let bvh = Bvh::build(Vec::<Record<4>>::new(), 0.0, Packing::Exact, &())?;
        let (shapes, owners, colors, holdouts) = Default::default();
        Ok(Self { shapes, owners, colors, holdouts, bvh, longest: 0.0, mesh_ball: f32::INFINITY })
    }

    /// Adds bonds between particles that stand in `structure`, whose ids the segments have; what has no length is left out. `radius` is that of all.
    ///
    /// Fails with [`Error::Setting`] if the radius is not a number above 0, or there are too many.
    pub(crate) fn add_bonds(
        &mut self,
        structure: &Structure,
        segments: &[Segment],
        radius: f32,
    ) -> Result<()> {
        if !(radius > 0.0 && radius.is_finite()) {
            return Err(Error::setting("--bond-radius", radius, "a number above 0"));
        }
        let nodes = nodes_by_id(structure);
        for segment in segments {
            let [one, other] = segment.ends.map(|id| nodes.get(id as usize));
            let cylinder = Cylinder::between([segment.from, segment.to], radius);
            if let (Some(cylinder), Some(&one), Some(&other)) = (cylinder, one, other) {
                self.push(Shape::Cylinder(cylinder), Owner::Particles([one, other]));
            }
        }
        self.check(structure, "--bonds")
    }

    /// Adds arrows of particles of `structure`, whose shafts have that radius; what has no length is left out.
    ///
    /// Fails with [`Error::Setting`] if the radius is not a number above 0, or there are too many.
    pub(crate) fn add_arrows(&mut self, structure: &Structure, arrows: &[Arrow], radius: f32) -> Result<()> {
        if !(radius > 0.0 && radius.is_finite()) {
            return Err(Error::setting("--arrow-radius", radius, "a number above 0"));
        }
        let nodes = nodes_by_id(structure);
        for arrow in arrows {
            if let (Some(parts), Some(&node)) = (arrow.parts(radius), nodes.get(arrow.particle as usize)) {
                parts.into_iter().for_each(|part| self.push(part, Owner::Particles([node; 2])));
            }
        }
        self.check(structure, "--arrows")
    }

    /// Adds ellipsoids in place of particles of `structure`.
    ///
    /// Fails with [`Error::Setting`] if a half axis is not a number above 0, an exponent is out of range, or there are too many.
    pub(crate) fn add_ellipsoids(&mut self, structure: &Structure, ellipsoids: &[Ellipsoid]) -> Result<()> {
        let is_wrong = |it: &&Ellipsoid| !(it.half_axes.is_finite() && it.half_axes.min_element() > 0.0);
        if let Some(Ellipsoid { half_axes, .. }) = ellipsoids.iter().find(is_wrong) {
            return Err(Error::setting("--ellipsoids", half_axes, "numbers above 0"));
        }
        let allowed = 1.0..=Ellipsoid::MOST_EXPONENT;
        let mut exponents = ellipsoids.iter().flat_map(|it| it.exponents);
        if let Some(wrong) = exponents.find(|it| !allowed.contains(it)) {
            return Err(Error::setting("an exponent of --ellipsoids", wrong, "a number from 1 to 100"));
        }
        let nodes = nodes_by_id(structure);
        for ellipsoid in ellipsoids {
            if let Some(&node) = nodes.get(ellipsoid.particle as usize) {
                let (center, _) = structure.own_sphere(node);
                let shape = match ellipsoid.exponents {
                    Ellipsoid::ROUND => Shape::Ellipsoid(Stretched::new(center, ellipsoid)),
                    _ => Shape::Superquadric(Superquadric::new(center, ellipsoid)),
                };
                self.push(shape, Owner::Particles([node; 2]));
            }
        }
        self.check(structure, "--ellipsoids")
    }

    /// Adds a mesh of a color, linear RGB; triangles without area are left out.
    ///
    /// Fails with [`Error::Setting`] if there are too many.
    pub(crate) fn add_mesh(&mut self, structure: &Structure, mesh: &Mesh, color: [f32; 3]) -> Result<()> {
        let owner = Owner::Mesh(self.colors.len() as u32);
        self.colors.push(color);
        let origin = structure.origin();
        for corners in mesh.triangles() {
            let triangle = Triangle { corners: corners.map(|corner: DVec3| (corner - origin).as_vec3()) };
            if triangle.area() > 0.0 {
                self.push(Shape::Triangle(triangle), owner);
            }
        }
        self.check(structure, "--mesh")?;
        let areas = self.shapes.iter().filter_map(|shape| match shape {
            Shape::Triangle(triangle) => Some(f64::from(triangle.area())),
            _ => None,
        });
        let (count, area) = areas.fold((0.0, 0.0), |(count, sum), area| (count + 1.0, sum + area));
        // About as many balls as triangles, and some hundreds more, so that a wall of two triangles is not a single ball.
        self.mesh_ball = (area / (count + 256.0)).sqrt() as f32;
        Ok(())
    }

    /// The same for a mesh that hides what is behind it and is not shown itself; the color is that of the light that it throws back.
    pub(crate) fn add_holdout(&mut self, structure: &Structure, mesh: &Mesh, color: [f32; 3]) -> Result<()> {
        self.holdouts.push(self.colors.len() as u32);
        self.add_mesh(structure, mesh, color)
    }

    /// Adds rods with round ends, of a color, linear RGB, between places in the particles' coordinates; what has no length is left out.
    ///
    /// Fails with [`Error::Setting`] if the radius is not a number above 0, or there are too many.
    pub(crate) fn add_rods(
        &mut self,
        structure: &Structure,
        rods: impl Iterator<Item = [DVec3; 2]>,
        radius: f32,
        color: [f32; 3],
    ) -> Result<()> {
        if !(radius > 0.0 && radius.is_finite()) {
            return Err(Error::setting("--cell-radius", radius, "a number above 0"));
        }
        let owner = Owner::Mesh(self.colors.len() as u32);
        self.colors.push(color);
        let place = |point: DVec3| (point - structure.origin()).as_vec3();
        let mut ends: Vec<DVec3> = Vec::new();
        for [from, to] in rods {
            // Pieces, so that no ball around one is as large as the scene.
            let at = |piece: u32| place(from.lerp(to, f64::from(piece) / f64::from(PIECES)));
            for piece in 0..PIECES {
                let cylinder = Cylinder::between([at(piece), at(piece + 1)], radius);
                cylinder.into_iter().for_each(|it| self.push(Shape::Cylinder(it), owner));
            }
            ends.extend([from, to].into_iter().filter(|end| !ends.contains(end)).collect::<Vec<_>>());
        }
        for end in ends {
            let ball = Ellipsoid {
                particle: 0,
                half_axes: DVec3::splat(radius.into()),
                turn: DQuat::IDENTITY,
                exponents: Ellipsoid::ROUND,
            };
            self.push(Shape::Ellipsoid(Stretched::new(place(end), &ball)), owner);
        }
        self.check(structure, "--cell-radius")
    }

    fn push(&mut self, shape: Shape, owner: Owner) {
        Arc::make_mut(&mut self.shapes).push(shape);
        Arc::make_mut(&mut self.owners).push(owner);
    }

    fn check(&self, structure: &Structure, name: &str) -> Result<()> {
        let nodes = 2 * self.shapes.len() as u64 + structure.len() as u64;
        if u64::from(structure.images()) * nodes + structure.len() as u64 > 1 << 32 {
            let count = self.shapes.len();
            let allowed = "fewer shapes, or images: 2^32 parts of them and particles in all";
            return Err(Error::setting(name, count, allowed));
        }
        Ok(())
    }

    /// Shows shapes whose particles are all shown, and all meshes.
    pub(crate) fn show(&mut self, structure: &Structure) -> Result<()> {
        let mut records = Vec::new();
        self.longest = 0.0;
        let depth = if self.shapes.len() < 1 << 14 { MOST_HALVES } else { MOST_HALVES / 2 };
        for (id, (shape, owner)) in (0..).zip(self.shapes.iter().zip(self.owners.iter())) {
            let is_shown = match owner {
                Owner::Particles(nodes) => nodes.iter().all(|&node| structure.shows(node)),
                Owner::Mesh(_) => true,
            };
            let mut add = |ball: Ball| {
                let [x, y, z] = ball.center.to_array();
                records.push(Record { coordinates: [x, y, z, ball.radius], id });
                self.longest = ball.radius.max(self.longest);
            };
            match shape {
                _ if !is_shown => {}
                Shape::Cylinder(cylinder) => add(cylinder.ball()),
                Shape::Cone(cone) => add(cone.ball()),
                Shape::Ellipsoid(ellipsoid) => add(ellipsoid.ball()),
                Shape::Superquadric(superquadric) => add(superquadric.ball()),
                Shape::Triangle(triangle) => triangle.balls(self.mesh_ball, depth, &mut add),
            }
        }
        self.bvh = Bvh::build(records, 0.0, Packing::Exact, &())?;
        Ok(())
    }

    /// The halves of bonds of shown particles, outside the spheres of these: the particle's node, both ends, and the radius.
    pub(crate) fn halves(&self, structure: &Structure) -> impl Iterator<Item = (u32, [Vec3; 2], f32)> {
        let bonds = self.shapes.iter().zip(self.owners.iter()).filter_map(|it| match it {
            (Shape::Cylinder(bond), Owner::Particles(nodes)) => Some((*bond, *nodes)),
            _ => None,
        });
        let shown = bonds.filter(move |(_, nodes)| nodes.iter().all(|&node| structure.shows(node)));
        shown.flat_map(move |(Cylinder { middle, axis, half_length, radius }, nodes)| {
            let half = move |side: usize| {
                let outward = if side == 0 { -axis } else { axis };
                let end = middle + half_length * outward;
                let (center, own) = structure.sphere(nodes[side]);
                let inside = (own * own - radius * radius).max(0.0).sqrt() - (end - center).dot(-outward);
                let length = half_length - inside.clamp(0.0, half_length);
                (nodes[side], [middle, middle + length * outward], radius)
            };
            [half(0), half(1)]
        })
    }

    /// Those of the shown ones that `keeps` keeps, by the nodes of their particles, and all meshes.
    pub(crate) fn thinned(&self, keeps: impl Fn([u32; 2]) -> bool + Sync) -> Self {
        let mut thinned = self.clone();
        thinned.bvh.thin(|place| match self.owners[self.at(place) as usize] {
            Owner::Particles(nodes) => keeps(nodes),
            Owner::Mesh(_) => true,
        });
        thinned
    }

    /// Whether any belong to particles.
    pub(crate) fn have_particles(&self) -> bool {
        self.owners.iter().any(|owner| matches!(owner, Owner::Particles(_)))
    }

    /// Whether there are none.
    pub(crate) fn is_empty(&self) -> bool {
        self.shapes.is_empty()
    }

    /// Nodes of one image: two a shape.
    pub(crate) fn nodes(&self) -> u32 {
        2 * self.shapes.len() as u32
    }

    /// A box around all that are shown.
    pub(crate) fn bounds(&self) -> Bounds {
        self.bvh.bounds()
    }

    pub(crate) fn bvh(&self) -> &Bvh {
        &self.bvh
    }

    /// The number of the shape at a place of the hierarchy.
    #[inline(always)]
    pub(crate) fn at(&self, place: u32) -> u32 {
        self.bvh.ids()[place as usize]
    }

    #[inline(always)]
    pub(crate) fn shape(&self, number: u32) -> &Shape {
        &self.shapes[number as usize]
    }

    /// The particle that a node, counted from 0, belongs to, by its node; none of a mesh.
    #[inline(always)]
    pub(crate) fn particle(&self, node: u32) -> Option<u32> {
        match self.owners[node as usize / 2] {
            Owner::Particles(nodes) => Some(nodes[node as usize % 2]),
            Owner::Mesh(_) => None,
        }
    }

    /// The color of what a node, counted from 0, belongs to; `of_particle` knows those of particles by their nodes.
    #[inline(always)]
    pub(crate) fn color(&self, node: u32, of_particle: impl Fn(u32) -> [f32; 3]) -> [f32; 3] {
        match self.owners[node as usize / 2] {
            Owner::Particles(nodes) => of_particle(nodes[node as usize % 2]),
            Owner::Mesh(mesh) => self.colors[mesh as usize],
        }
    }

    /// Whether any mesh hides without being shown.
    pub(crate) fn have_holdouts(&self) -> bool {
        !self.holdouts.is_empty()
    }

    /// Whether a node, counted from 0, is one of a mesh that hides without being shown.
    pub(crate) fn is_holdout(&self, node: u32) -> bool {
        let owner = self.owners[node as usize / 2];
        matches!(owner, Owner::Mesh(mesh) if self.holdouts.contains(&mesh))
    }

    /// What a ray enters first, but for shape `except`, and the node, counted from 0: those are tried whose balls it enters.
    pub(crate) fn nearest(&self, ray: &Ray, except: Option<u32>) -> Option<(f32, u32)> {
        // Started so far back that it enters the balls in which it is.
        let back = 2.5 * self.longest;
        let from_behind = Ray { origin: ray.origin - back * ray.direction, t_max: ray.t_max + back, ..*ray };
        let mut best: Option<(f32, u32)> = None;
        let mut last = except;
        let mut met = |place: u32| {
            let number = self.at(place);
            // A shape of several balls is not asked again and again.
            if except != Some(number) && last != Some(number) {
                last = Some(number);
                keep_first(&mut best, self.shape(number).meet(ray), number);
            }
            // A ball that holds something nearer is entered before it, give or take rounding.
            best.map_or(f32::INFINITY, |(t, _)| 1.000_01 * (t + back))
        };
        self.bvh.search(Search::observed(&from_behind, Within(&mut met)));
        best
    }

    /// Of the shapes that hold the place of a ray at distance `t`, how deep it lies in the one in which it lies deepest, and its node, counted from 0: see
    /// [`Structure::deepest`].
    pub(crate) fn deepest(&self, ray: &Ray, t: f32) -> Option<(f32, u32)> {
        let point = ray.origin + t * ray.direction;
        let mut best: Option<(f32, u32)> = None;
        let mut met = |_: f32, place: u32| {
            let number = self.at(place);
            let shape = self.shape(number);
            let Some([enter, leave]) = shape.chord(ray).filter(|[enter, leave]| *enter <= t && t < *leave)
            else {
                return;
            };
            let found = ((t - enter) * (leave - t), 2 * number + u32::from(shape.is_second_at(point)));
            if best.is_none_or(|best| found.0 > best.0 || found.0 == best.0 && found.1 < best.1) {
                best = Some(found);
            }
        };
        self.bvh.search(Search::around(ray, t, Every(&mut met)));
        best
    }

    /// What a ray enters first, and the node, counted from 0: every shape that is shown is tried.
    pub(crate) fn intersect(&self, ray: &Ray) -> Option<(f32, u32)> {
        let mut best: Option<(f32, u32)> = None;
        for (place, &number) in (0..).zip(self.bvh.ids()) {
            if !self.bvh.shows(place) {
                continue;
            }
            keep_first(&mut best, self.shape(number).meet(ray), number);
        }
        best
    }
}

/// Pieces of a rod.
const PIECES: u32 = 32;

/// How often a triangle is halved at most.
const MOST_HALVES: u32 = 12;

/// Keeps the nearer of two, of equally near ones that of the smaller node.
fn keep_first(best: &mut Option<(f32, u32)>, met: Option<(f32, bool)>, number: u32) {
    if let Some((t, is_second)) = met {
        let found = (t, 2 * number + u32::from(is_second));
        if best.is_none_or(|best| t < best.0 || t == best.0 && found.1 < best.1) {
            *best = Some(found);
        }
    }
}

/// By id the node of a particle.
fn nodes_by_id(structure: &Structure) -> Vec<u32> {
    let mut nodes = vec![0_u32; structure.len()];
    for (&id, node) in structure.ids().iter().zip(0..) {
        if let Some(place) = nodes.get_mut(id as usize) {
            *place = node;
        }
    }
    nodes
}
