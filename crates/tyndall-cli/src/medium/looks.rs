//! Looks of a medium by name: sets of defaults for what nobody says, such as how much of the light scatters and how thick it is.
//!
//! Whatever the command line says counts more than the look. Albedos and mean cosines are usual ones of such matter in visible light; those of
//! clouds scatter forward less than water drops do (0.85), which all orders of scattering together hardly show.

use super::emission::EmissionSpec;
use super::values::NoiseAmount;
use crate::looks::LightLook;

/// What a look says.
pub(crate) struct MediumLook {
    pub(super) name: &'static str,
    /// Share of the extinction that scatters.
    pub(super) albedo: [f32; 3],
    /// Mean cosine of scattering.
    pub(super) g: f32,
    /// Optical thickness of the median column.
    pub(super) thickness: f32,
    pub(super) emission: EmissionSpec,
    /// Position noise.
    pub(super) noise: Option<NoiseAmount>,
}

/// The look of that name, if it is one of media.
pub(crate) fn of(look: LightLook) -> Option<MediumLook> {
    let plain = |name, albedo, g, thickness, noise: f32| MediumLook {
        name,
        albedo,
        g,
        thickness,
        emission: EmissionSpec::None,
        noise: (noise > 0.0).then_some(NoiseAmount { amplitude: noise, octaves: 4 }),
    };
    let flames = EmissionSpec::Flames;
    Some(match look {
        LightLook::Smoke => plain("smoke", [0.8, 0.8, 0.82], 0.3, 5.0, 0.4),
        LightLook::Cloud => plain("cloud", [0.999; 3], 0.6, 20.0, 0.5),
        LightLook::Steam => plain("steam", [0.99; 3], 0.5, 2.5, 0.5),
        LightLook::Dust => plain("dust", [0.93, 0.85, 0.7], 0.4, 4.0, 0.3),
        LightLook::Fire => MediumLook { emission: flames, ..plain("fire", [0.2; 3], 0.0, 2.0, 0.4) },
        LightLook::Explosion => {
            MediumLook { emission: flames, ..plain("explosion", [0.5, 0.48, 0.45], 0.3, 12.0, 0.5) }
        }
        LightLook::Nebula => MediumLook {
            emission: EmissionSpec::Even([0.9, 0.25, 0.35]),
            ..plain("nebula", [0.5, 0.55, 0.7], 0.5, 1.0, 0.5)
        },
        LightLook::Spray => plain("spray", [0.995; 3], 0.7, 1.5, 0.0),
        LightLook::Foam => plain("foam", [0.99, 0.995, 1.0], 0.2, 12.0, 0.0),
        _ => return None,
    })
}
