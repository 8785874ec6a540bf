//! How a surface throws light on: distributions that are evaluated and drawn from.
//!
//! Directions point away from the surface, `n` is its normal, and all is measured per projected area: [`Scatter::evaluate`] includes the cosine.
//!
//! Sources: M. Fujii, "A tiny improvement of Oren-Nayar reflectance model", 2012; B. Walter et al., "Microfacet models for refraction through
//! rough surfaces", EGSR 2007 (GGX); E. Heitz, "Sampling the GGX distribution of visible normals", JCGT 7(4), 2018; M. Ashikhmin, P. Shirley, "An
//! anisotropic Phong BRDF model", JGT 5(2), 2000 (diffuse below a coat).

use std::f32::consts::{FRAC_1_PI, PI, TAU};

use glam::{Vec2, Vec3};

use crate::scene::material::Material;

/// A surface's point as light meets it.
pub(super) struct Scatter {
    /// Unit normal.
    normal: Vec3,
    /// Unit direction in which light is wanted; the cosine to the normal is positive.
    toward_eye: Vec3,
    /// Two axes across the normal.
    across: [Vec3; 2],
    color: Vec3,
    kind: Kind,
}

enum Kind {
    Matte { roughness: f32 },
    Glossy { alpha: f32, at_normal: f32, mean: f32, chance: f32 },
    Metal { alpha: f32 },
}

/// Light that is thrown on in one direction.
#[derive(Clone, Copy, Debug)]
pub(super) struct Thrown {
    /// RGB: share per solid angle, times the cosine.
    pub(super) share: Vec3,
    /// Probability density with which [`Scatter::draw`] draws the direction, per steradian.
    pub(super) density: f32,
}

impl Scatter {
    /// Light toward the unit vector `toward_eye` from a surface that is not clear; clear ones are taken as matte.
    pub(super) fn new(material: &Material, normal: Vec3, toward_eye: Vec3, color: Vec3) -> Self {
        let alpha = |roughness: f32| roughness.clamp(Material::LEAST_ROUGHNESS, 1.0).powi(2);
        let kind = match *material {
            Material::Matte { roughness } => Kind::Matte { roughness: roughness.clamp(0.0, 1.0) },
            Material::Clear { .. } => Kind::Matte { roughness: 0.0 },
            Material::Metal { roughness } => Kind::Metal { alpha: alpha(roughness) },
            Material::Glossy { roughness, index } => {
                let at_normal = ((index - 1.0) / (index + 1.0)).powi(2);
                let mirrored = schlick(at_normal, normal.dot(toward_eye).max(0.0));
                let matte = (1.0 - mirrored) * color.max_element();
                let chance = (mirrored / (mirrored + matte).max(f32::MIN_POSITIVE)).clamp(0.1, 0.9);
                let mean = at_normal + (1.0 - at_normal) / 21.0;
                Kind::Glossy { alpha: alpha(roughness), at_normal, mean, chance }
            }
        };
        let across = normal.any_orthonormal_pair().into();
        Self { normal, toward_eye, across, color, kind }
    }

    /// What comes from `toward`, a unit vector, and how likely that is drawn.
    pub(super) fn evaluate(&self, toward: Vec3) -> Thrown {
        let (eye, light) = (self.normal.dot(self.toward_eye), self.normal.dot(toward));
        if eye <= 0.0 || light <= 0.0 {
            return Thrown { share: Vec3::ZERO, density: 0.0 };
        }
        match self.kind {
            Kind::Matte { roughness } => {
                let share = self.color
                    * (FRAC_1_PI * light * rough(roughness, eye, light, toward.dot(self.toward_eye)));
                Thrown { share, density: FRAC_1_PI * light }
            }
            Kind::Metal { alpha } => {
                let (value, density, cosine) = self.mirrored(alpha, toward);
                let one = Vec3::ONE;
                Thrown { share: value * (self.color + (one - self.color) * fifth(cosine)), density }
            }
            Kind::Glossy { alpha, at_normal, mean, chance } => {
                let (value, density, cosine) = self.mirrored(alpha, toward);
                let passes =
                    (1.0 - schlick(at_normal, eye)) * (1.0 - schlick(at_normal, light)) / (1.0 - mean);
                let matte = self.color * (FRAC_1_PI * light * passes);
                let share = matte + Vec3::splat(value * schlick(at_normal, cosine));
                Thrown { share, density: chance * density + (1.0 - chance) * FRAC_1_PI * light }
            }
        }
    }

    /// A direction from which light comes, by three random numbers in [0, 1): the first two are best spread evenly.
    pub(super) fn draw(&self, random: [f32; 2], choice: f32) -> Vec3 {
        let alpha = match self.kind {
            Kind::Metal { alpha } => alpha,
            Kind::Glossy { alpha, chance, .. } if choice < chance => alpha,
            Kind::Matte { .. } | Kind::Glossy { .. } => {
                let (radius, (sin, cos)) = (random[0].sqrt(), (TAU * random[1]).sin_cos());
                let height = (1.0 - random[0]).max(0.0).sqrt();
                return self.world(Vec3::new(radius * cos, radius * sin, height));
            }
        };
        let half = self.world(visible_normal(self.local(self.toward_eye), alpha, random));
        (2.0 * half.dot(self.toward_eye) * half - self.toward_eye).normalize_or(self.normal)
    }

    /// Of a rough mirror without its reflectance: share times cosine, density of drawing, and the cosine at the facet.
    fn mirrored(&self, alpha: f32, toward: Vec3) -> (f32, f32, f32) {
        let half = (self.toward_eye + toward).normalize_or(self.normal);
        let (eye, light) = (self.normal.dot(self.toward_eye), self.normal.dot(toward));
        let facets = distribution(alpha, self.local(half));
        let (masked_eye, masked_light) = (mask(alpha, eye), mask(alpha, light));
        // Smith's masking of both directions together, which depend on the height of the facet.
        let both = 1.0 / (1.0 + masked_eye + masked_light);
        let density = facets / (4.0 * eye * (1.0 + masked_eye));
        (facets * both / (4.0 * eye), density, half.dot(toward).clamp(0.0, 1.0))
    }

    fn local(&self, vector: Vec3) -> Vec3 {
        Vec3::new(vector.dot(self.across[0]), vector.dot(self.across[1]), vector.dot(self.normal))
    }

    fn world(&self, vector: Vec3) -> Vec3 {
        vector.x * self.across[0] + vector.y * self.across[1] + vector.z * self.normal
    }
}

/// The share of light that a clear surface mirrors at a cosine, by Schlick's approximation.
fn schlick(at_normal: f32, cosine: f32) -> f32 {
    at_normal + (1.0 - at_normal) * fifth(cosine)
}

/// How near to grazing: (1 - cosine)^5.
fn fifth(cosine: f32) -> f32 {
    (1.0 - cosine).clamp(0.0, 1.0).powi(5)
}

/// What rough ground throws on in relation to an even one, by the cosines of both directions to the normal and to each other (Fujii).
fn rough(roughness: f32, eye: f32, light: f32, between: f32) -> f32 {
    let even = 1.0 / (1.0 + (0.5 - 2.0 / (3.0 * PI)) * roughness);
    let back = between - eye * light;
    let scale = if back > 0.0 { eye.max(light) } else { 1.0 };
    even * (1.0 + roughness * back / scale)
}

/// GGX: how many facets have a normal, given in the surface's axes.
fn distribution(alpha: f32, normal: Vec3) -> f32 {
    let alpha_sq = alpha * alpha;
    let below = normal.x * normal.x + normal.y * normal.y + alpha_sq * normal.z * normal.z;
    alpha_sq / (PI * below * below)
}

/// Smith's Lambda of GGX.
fn mask(alpha: f32, cosine: f32) -> f32 {
    let tangent_sq = (1.0 - cosine * cosine).max(0.0) / (cosine * cosine).max(1e-12);
    0.5 * ((1.0 + alpha * alpha * tangent_sq).sqrt() - 1.0)
}

/// A facet's normal, drawn from those that are seen from `eye` (Heitz 2018); the surface's normal is z.
fn visible_normal(eye: Vec3, alpha: f32, random: [f32; 2]) -> Vec3 {
    let stretched = Vec3::new(alpha * eye.x, alpha * eye.y, eye.z).normalize_or(Vec3::Z);
    let flat = Vec2::new(-stretched.y, stretched.x).normalize_or(Vec2::X);
    let first = Vec3::new(flat.x, flat.y, 0.0);
    let second = stretched.cross(first);
    let (radius, (sin, cos)) = (random[0].sqrt(), (TAU * random[1]).sin_cos());
    let (x, share) = (radius * cos, 0.5 * (1.0 + stretched.z));
    let y = (1.0 - share) * (1.0 - x * x).max(0.0).sqrt() + share * radius * sin;
    let up = (1.0 - x * x - y * y).max(0.0).sqrt();
    let normal = x * first + y * second + up * stretched;
    Vec3::new(alpha * normal.x, alpha * normal.y, normal.z.max(1e-6)).normalize_or(Vec3::Z)
}

/// The share of light that a clear surface mirrors, and the cosine on its other side; all of it where light cannot leave. `cosine` is that to
/// the normal on this side, `relative` the index of the other side over that of this one. Source: Fresnel's formulas.
pub(super) fn fresnel(cosine: f32, relative: f32) -> (f32, f32) {
    let sine_sq = (1.0 - cosine * cosine).max(0.0) / (relative * relative);
    if sine_sq >= 1.0 {
        return (1.0, 0.0);
    }
    let other = (1.0 - sine_sq).sqrt();
    let parallel = (relative * cosine - other) / (relative * cosine + other);
    let perpendicular = (cosine - relative * other) / (cosine + relative * other);
    (0.5 * (parallel * parallel + perpendicular * perpendicular), other)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream;

    const MATERIALS: [Material; 6] = [
        Material::Matte { roughness: 0.0 },
        Material::Matte { roughness: 1.0 },
        Material::Glossy { roughness: 0.4, index: 1.5 },
        Material::Glossy { roughness: 0.8, index: 1.5 },
        Material::Metal { roughness: 0.4 },
        Material::Metal { roughness: 0.7 },
    ];

    fn scatters() -> impl Iterator<Item = (Material, Scatter)> {
        MATERIALS.into_iter().flat_map(|material| {
            [0.95_f32, 0.5, 0.2].map(|cosine| {
                let normal = Vec3::new(0.36, 0.48, 0.8);
                let across = normal.any_orthonormal_vector();
                let eye = cosine * normal + (1.0 - cosine * cosine).sqrt() * across;
                (material, Scatter::new(&material, normal, eye, Vec3::ONE))
            })
        })
    }

    /// A direction uniform over the sphere.
    fn uniform(stream: &mut Stream) -> Vec3 {
        let z = 2.0 * stream.unit() - 1.0;
        let (sin, cos) = (TAU * stream.unit()).sin_cos();
        let r = (1.0 - z * z).sqrt();
        Vec3::new(r * cos, r * sin, z)
    }

    #[test]
    fn what_is_drawn_is_what_is_evaluated() {
        for (material, scatter) in scatters() {
            let mut stream = Stream::new(5, 1);
            let count = 200_000;
            // The integrals of share and density by uniform directions, and of share by drawn ones.
            let (mut shares, mut densities) = (0.0_f64, 0.0_f64);
            for _ in 0..count {
                let thrown = scatter.evaluate(uniform(&mut stream));
                shares += f64::from(thrown.share.x * 4.0 * PI) / f64::from(count);
                densities += f64::from(thrown.density * 4.0 * PI) / f64::from(count);
            }
            let (mut drawn, mut lost) = (0.0_f64, 0.0_f64);
            for _ in 0..count {
                let toward = scatter.draw([stream.unit(), stream.unit()], stream.unit());
                let thrown = scatter.evaluate(toward);
                if thrown.density > 0.0 {
                    drawn += f64::from(thrown.share.x / thrown.density) / f64::from(count);
                } else {
                    lost += 1.0 / f64::from(count);
                }
            }
            assert!((drawn - shares).abs() < 0.04 * shares, "{material:?}: {drawn} drawn, {shares}");
            // Mirrored directions below the surface are drawn, and count as nothing.
            assert!((densities + lost - 1.0).abs() < 0.04, "{material:?}: {densities} + {lost}");
            assert!(drawn < 1.005, "{material:?} gives more than it gets: {drawn}");
        }
    }

    #[test]
    fn light_goes_both_ways_alike() {
        let mut stream = Stream::new(9, 0);
        for material in MATERIALS {
            for _ in 0..200 {
                let [one, other] = [0, 1].map(|_| uniform(&mut stream)).map(|it| it * it.z.signum());
                let share = |eye: Vec3, toward: Vec3| {
                    Scatter::new(&material, Vec3::Z, eye, Vec3::splat(0.7)).evaluate(toward).share / toward.z
                };
                let [there, back] = [share(one, other), share(other, one)];
                assert!(there.abs_diff_eq(back, 1e-4 * (1.0 + there.x)), "{material:?}: {there} {back}");
            }
        }
    }

    #[test]
    fn a_clear_surface_mirrors_as_fresnel_says() {
        let (straight, other) = fresnel(1.0, 1.5);
        assert!((straight - 0.04).abs() < 1e-6 && other == 1.0);
        // Brewster's angle: nothing of one polarisation.
        let brewster = 1.5_f32.atan().cos();
        let (mirrored, other) = fresnel(brewster, 1.5);
        let perpendicular = ((brewster - 1.5 * other) / (brewster + 1.5 * other)).powi(2);
        assert!((mirrored - 0.5 * perpendicular).abs() < 1e-6);
        // From within beyond the critical angle all.
        assert_eq!(fresnel(0.5, 1.0 / 1.5), (1.0, 0.0));
    }
}
