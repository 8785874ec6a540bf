//! `--layers`: what an EXR has beside its colors.

use std::path::Path;

use clap::ValueEnum;
use tyndall::Particles;
use tyndall::film::Surface;
use tyndall::scene::coloring::Coloring;
use tyndall::scene::light::{KeyLight, Lighting, Lights, Paths, Sky};
use tyndall::scene::quantity::Quantity;
use tyndall::{Error, Image};
use tyndall_io::write;

use crate::args::Picture;
use crate::report::{Failure, Outcome};

/// What a pixel can have.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Layer {
    /// The colors
    Beauty,
    /// How much of the pixel is covered
    Alpha,
    /// The distance from the eye
    Depth,
    /// The particle's place in the file
    Id,
    /// How the surface faces
    Normal,
    /// Where the surface is, in the file's coordinates
    Position,
    /// The colors without light
    Albedo,
    /// The light of the key light
    Direct,
    /// The light of the sky
    Ambient,
    /// What is shown as color, as a number
    Value,
    /// Of a medium: what comes through
    Transmittance,
}

/// Names and values of channels.
pub(crate) type Channels = Vec<(String, Vec<f32>)>;

/// The layers that are asked for; refuses those that are not in `possible` or not for that kind of file.
pub(crate) fn asked<'a>(picture: &'a Picture, path: &Path, possible: &[Layer]) -> Outcome<&'a [Layer]> {
    let Some(layers) = &picture.layers else { return Ok(&[]) };
    if !write::takes_channels(path) {
        let text = format!("--layers is for .exr — {} has colors alone", path.display());
        return Err(Failure::Usage(text));
    }
    if let Some(other) = layers.iter().find(|layer| !possible.contains(layer)) {
        let names: Vec<String> = possible.iter().map(|layer| layer.name()).collect();
        return Err(Error::setting("--layers", other.name(), format!("here {}", names.join(" "))).into());
    }
    Ok(layers)
}

impl Layer {
    /// Those of spheres.
    pub(crate) const OF_SPHERES: [Self; 10] = [
        Self::Beauty,
        Self::Alpha,
        Self::Depth,
        Self::Id,
        Self::Normal,
        Self::Position,
        Self::Albedo,
        Self::Direct,
        Self::Ambient,
        Self::Value,
    ];
    /// Those of a medium.
    pub(crate) const OF_MEDIA: [Self; 5] =
        [Self::Beauty, Self::Alpha, Self::Depth, Self::Id, Self::Transmittance];

    pub(crate) fn name(self) -> String {
        self.to_possible_value().map_or(String::new(), |it| it.get_name().to_string())
    }

    /// Whether it is of the surface that the pixel's middle shows.
    pub(crate) fn is_of_surface(self) -> bool {
        matches!(self, Self::Normal | Self::Position)
    }

    /// The light that shows it, if it is a picture in another light. Fails if the scene's own light has no such part.
    pub(crate) fn light(self, own: &Lighting) -> Outcome<Option<Lighting>> {
        Ok(match (self, own) {
            (Self::Albedo, _) => Some(Lighting::Flat),
            (Self::Direct, Lighting::Studio(key, sky)) => Some(Lighting::Studio(*key, dark(sky))),
            (Self::Direct, Lighting::Paths(paths @ Paths { lights: Lights::Studio(key, sky), .. })) => {
                let lights = Lights::Studio(*key, dark(sky));
                Some(Lighting::Paths(Paths { lights, ..paths.clone() }))
            }
            (Self::Ambient, Lighting::Studio(key, sky)) => {
                Some(Lighting::Studio(KeyLight { strength: 0.0, ..*key }, *sky))
            }
            (Self::Ambient, Lighting::Paths(paths @ Paths { lights: Lights::Studio(key, sky), .. })) => {
                let lights = Lights::Studio(KeyLight { strength: 0.0, ..*key }, *sky);
                Some(Lighting::Paths(Paths { lights, ..paths.clone() }))
            }
            (Self::Direct | Self::Ambient, _) => {
                let allowed = "direct and ambient light are those of looks other than headlight, flat and toon, without --light";
                return Err(Error::setting("--layers", self.name(), allowed).into());
            }
            _ => None,
        })
    }

    /// The channels of three numbers a pixel.
    pub(crate) fn of_surfaces(self, surfaces: &[Surface]) -> Channels {
        let of = |surface: &Surface| if self == Self::Normal { surface.normal } else { surface.position };
        let channel = |(axis, name): (usize, &str)| {
            (format!("{}.{name}", self.name()), surfaces.iter().map(|surface| of(surface)[axis]).collect())
        };
        ["X", "Y", "Z"].into_iter().enumerate().map(channel).collect()
    }

    /// The channels of a picture's colors.
    pub(crate) fn of_colors(self, image: &Image) -> Channels {
        let channel = |(place, name): (usize, &str)| {
            (format!("{}.{name}", self.name()), image.color.iter().map(|color| color[place]).collect())
        };
        ["R", "G", "B"].into_iter().enumerate().map(channel).collect()
    }
}

/// The number that `--color` shows of each particle, by its place in the file.
pub(crate) struct Numbers(Vec<f32>);

impl Numbers {
    /// Of all particles. Fails if colors are not those of a number.
    pub(crate) fn of(particles: &Particles, coloring: &Coloring) -> Outcome<Self> {
        let Coloring::Attribute { name, component } = coloring else {
            let allowed = "of --color ATTRIBUTE: the particles have no number as color";
            return Err(Error::setting("--layers", Layer::Value.name(), allowed).into());
        };
        let quantity = Quantity::find(particles, name, *component)?;
        let places = (0..particles.len()).map(|id| particles.place(id) as usize);
        let mut numbers = vec![f32::NAN; places.clone().max().map_or(0, |most| most + 1)];
        for (id, place) in places.enumerate() {
            numbers[place] = quantity.value(id) as f32;
        }
        Ok(Self(numbers))
    }

    /// The channel of them: NaN where a pixel shows no particle, or the particle has no number.
    pub(crate) fn channel(&self, ids: &[i64]) -> (String, Vec<f32>) {
        let number = |id: &i64| usize::try_from(*id).ok().and_then(|place| self.0.get(place).copied());
        (Layer::Value.name(), ids.iter().map(|id| number(id).unwrap_or(f32::NAN)).collect())
    }
}

/// A sky without light.
fn dark(sky: &Sky) -> Sky {
    Sky { zenith: 0.0, ground: 0.0, ..*sky }
}
