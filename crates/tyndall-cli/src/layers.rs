//! `--layers`: what an EXR has beside its colors.

use std::convert::Infallible;
use std::path::Path;
use std::str::FromStr;

use clap::ValueEnum;
use tyndall::Particles;
use tyndall::film::Surface;
use tyndall::names::nearest;
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

/// What `--layers` names.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Named {
    /// What all pictures can have.
    Layer(Layer),
    /// Numbers of the particles: an attribute, or what is made of some.
    Quantity(String),
}

impl FromStr for Named {
    type Err = Infallible;

    fn from_str(text: &str) -> Result<Self, Infallible> {
        let layer = Layer::from_str(text.trim(), false);
        Ok(layer.map_or_else(|_| Self::Quantity(text.trim().into()), Self::Layer))
    }
}

/// The layers that are asked for, each once; refuses those that are not in `possible` or not for that kind of file.
pub(crate) fn asked(picture: &Picture, path: &Path, possible: &[Layer]) -> Outcome<Vec<Named>> {
    let Some(named) = &picture.layers else { return Ok(Vec::new()) };
    if !write::takes_channels(path) {
        let text = format!("--layers is for .exr — {} has colors alone", path.display());
        return Err(Failure::Usage(text));
    }
    let other = named.iter().find_map(|it| match it {
        Named::Layer(layer) => (!possible.contains(layer)).then(|| layer.name()),
        Named::Quantity(text) => (!possible.contains(&Layer::Value)).then(|| text.clone()),
    });
    if let Some(other) = other {
        let names: Vec<String> = possible.iter().map(|layer| layer.name()).collect();
        return Err(Error::setting("--layers", other, format!("here {}", names.join(" "))).into());
    }
    let is_new = |place: &usize| !named[..*place].contains(&named[*place]);
    Ok((0..named.len()).filter(is_new).map(|place| named[place].clone()).collect())
}

/// The quantities among what is named, as they were written.
pub(crate) fn quantities(named: &[Named]) -> impl Iterator<Item = &str> {
    named.iter().filter_map(|it| match it {
        Named::Quantity(text) => Some(text.as_str()),
        Named::Layer(_) => None,
    })
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

/// A number of each particle, by its place in the file, and what it is called.
pub(crate) struct Numbers {
    name: String,
    by_place: Vec<f32>,
}

impl Numbers {
    /// What is named of all particles: of `value` the number that colors stand for, of a vector three. Fails if there are none.
    pub(crate) fn of(particles: &Particles, named: &[Named], coloring: &Coloring) -> Outcome<Vec<Self>> {
        let mut found = Vec::new();
        if named.contains(&Named::Layer(Layer::Value)) {
            let Coloring::Attribute { name, component } = coloring else {
                let allowed = "of --color ATTRIBUTE: the particles have no number as color";
                return Err(Error::setting("--layers", Layer::Value.name(), allowed).into());
            };
            let quantity = Quantity::find(particles, name, *component)?;
            found.push(Self::of_quantity(particles, Layer::Value.name(), &quantity));
        }
        for text in quantities(named) {
            let parts = Quantity::components(particles, text).map_err(|error| unknown(text, error))?;
            let is_text = |part: &Quantity| part.scalar().is_some_and(|it| it.values.type_name() == "text");
            if parts.iter().any(is_text) {
                return Err(Error::setting("--layers", text, "a number: it stands for words").into());
            }
            let is_vector = parts.len() > 1;
            found.extend(parts.iter().enumerate().map(|(axis, part)| {
                let name = if is_vector { component(text, axis) } else { plain(text) };
                Self::of_quantity(particles, name, part)
            }));
        }
        Ok(found)
    }

    fn of_quantity(particles: &Particles, name: String, quantity: &Quantity) -> Self {
        let places = (0..particles.len()).map(|id| particles.place(id) as usize);
        let mut by_place = vec![f32::NAN; places.clone().max().map_or(0, |most| most + 1)];
        for (id, place) in places.enumerate() {
            by_place[place] = quantity.value(id) as f32;
        }
        Self { name, by_place }
    }

    /// The channel of them: NaN where a pixel shows no particle, or the particle has no number.
    pub(crate) fn channel(&self, ids: &[i64]) -> (String, Vec<f32>) {
        let number = |id: &i64| usize::try_from(*id).ok().and_then(|place| self.by_place.get(place).copied());
        (self.name.clone(), ids.iter().map(|id| number(id).unwrap_or(f32::NAN)).collect())
    }
}

/// The channel of a vector's component: `velocity.X`, and beyond three `stress.3`.
fn component(vector: &str, axis: usize) -> String {
    match ["X", "Y", "Z"].get(axis) {
        Some(name) => format!("{vector}.{name}"),
        None => format!("{vector}.{axis}"),
    }
}

/// The channel of a quantity, which is not that of a color.
fn plain(text: &str) -> String {
    if ["R", "G", "B", "A", "Z"].contains(&text) { format!("attribute.{text}") } else { text.into() }
}

/// The error about a name that is neither a layer's nor an attribute's.
fn unknown(text: &str, error: Error) -> Error {
    let Error::Setting { value, allowed, .. } = error else { return error };
    let names = Layer::OF_SPHERES.map(Layer::name);
    let meant = nearest(text, names.iter().map(String::as_str))
        .map_or(String::new(), |name| format!("; the layer '{name}'?"));
    Error::setting("--layers", value, allowed + &meant)
}

/// A sky without light.
fn dark(sky: &Sky) -> Sky {
    Sky { zenith: 0.0, ground: 0.0, ..*sky }
}
