//! What is drawn over pictures of spheres, as the command line has it.

use clap::Args;
use tyndall::render::illustration::{Contours, Halo, Illustration};
use tyndall::scene::coloring::{self, linear};

use crate::args;
use crate::looks::LightLook;
use crate::report::{Failure, Outcome};
use crate::values::Background;

/// Lines, rims, and what fades with depth.
#[derive(Args)]
#[command(next_help_heading = "Illustration")]
pub(crate) struct Illustrate {
    /// Draws lines around what stands before something else or before nothing, and where spheres cut each other. WIDTH is in pixels of a picture of
    /// 1080 rows, and grows with the picture; around what is small lines are thinner, at most a third of its radius; 0 draws none [default: 2; without this flag none, of --look toon 2]
    #[arg(long, value_name = "WIDTH", num_args = 0..=1, default_missing_value = "2")]
    pub(crate) outline: Option<f32>,
    /// Color of the lines: #rrggbb or a color's name [default: black]
    #[arg(long, value_name = "COLOR", value_parser = coloring::color)]
    pub(crate) outline_color: Option<[u8; 3]>,
    /// How far behind a line the next surface lies at least, in the line's widths; spheres that cut each other have a line if their radius is larger.
    /// More leaves fewer lines [default: 2]
    #[arg(long, value_name = "WIDTHS", allow_hyphen_values = true)]
    pub(crate) outline_jump: Option<f32>,
    /// Draws rims around what stands before something else, on what lies behind; the wider and the stronger the further behind. WIDTH is that between nearest and
    /// farthest, in pixels of a picture of 1080 rows [default: 24; without this flag none]
    #[arg(long, value_name = "WIDTH", num_args = 0..=1, default_missing_value = "24")]
    pub(crate) halo: Option<f32>,
    /// Color of the rims: #rrggbb or a color's name, such as black for shade [default: the background's; without one they are transparent]
    #[arg(long, value_name = "COLOR", value_parser = coloring::color, requires = "halo")]
    pub(crate) halo_color: Option<[u8; 3]>,
    /// Fades what is far away into the background; without one it becomes transparent. AMOUNT is how much of the farthest is gone, 0 to 1; between it and the nearest, which stays
    /// as it is, it is in proportion to the distance [default: 0.7; without this flag none]
    #[arg(long, value_name = "AMOUNT", num_args = 0..=1, default_missing_value = "0.7")]
    pub(crate) depth_cue: Option<f32>,
    /// Distances from the eye of nearest and farthest, for --depth-cue and --halo, in the unit of the file, so that they stay the same from picture to picture [default: those of
    /// what each picture shows]
    #[arg(long, value_name = "NEAR:FAR", value_parser = crate::values::depths)]
    pub(crate) depth_range: Option<[f32; 2]>,
}

impl Illustrate {
    /// The first flag that is given, if one is.
    pub(crate) fn name(&self) -> Option<&'static str> {
        let flags = [
            ("--outline", self.outline.is_some()),
            ("--outline-color", self.outline_color.is_some()),
            ("--outline-jump", self.outline_jump.is_some()),
            ("--halo", self.halo.is_some()),
            ("--depth-cue", self.depth_cue.is_some()),
            ("--depth-range", self.depth_range.is_some()),
        ];
        flags.into_iter().find_map(|(name, is_given)| is_given.then_some(name))
    }

    /// Fails if something is given; `mode` has no surfaces.
    pub(crate) fn refuse(&self, mode: &str) -> Outcome<()> {
        match self.name() {
            Some(flag) => Err(Failure::Usage(format!("{flag} is for spheres — leave it out with {mode}"))),
            None => Ok(()),
        }
    }

    /// The lines, if there are any.
    fn contours(&self, look: LightLook) -> Outcome<Option<Contours>> {
        let usual = Contours::default();
        let of_look = if look == LightLook::Toon { usual.width } else { 0.0 };
        let width = self.outline.unwrap_or(of_look);
        if width == 0.0 {
            let flags = [
                ("--outline-color", self.outline_color.is_some()),
                ("--outline-jump", self.outline_jump.is_some()),
            ];
            return match flags.iter().find(|(_, is_given)| *is_given) {
                Some((flag, _)) => Err(Failure::Usage(format!("{flag} is of lines — give --outline too"))),
                None => Ok(None),
            };
        }
        let color = self.outline_color.map_or(usual.color, linear);
        Ok(Some(Contours { width, color, jump: self.outline_jump.unwrap_or(usual.jump) }))
    }

    /// The rims, if there are any.
    fn halo(&self) -> Option<Halo> {
        let width = self.halo.filter(|width| *width != 0.0)?;
        Some(Halo { width, color: self.halo_color.map(linear) })
    }
}

/// What is to be drawn. Fails if it cannot be.
pub(crate) fn illustration(args: &args::Render) -> Outcome<Illustration> {
    let given = &args.illustrate;
    let (contours, halo) = (given.contours(args.look.look)?, given.halo());
    let depth_cue = given.depth_cue.filter(|amount| *amount != 0.0);
    if given.depth_range.is_some() && halo.is_none() && depth_cue.is_none() {
        let text = "--depth-range is that of --depth-cue and --halo — give one of them too";
        return Err(Failure::Usage(text.into()));
    }
    let fades = [("--halo", halo.is_some_and(|it| it.color.is_none())), ("--depth-cue", depth_cue.is_some())];
    if args.picture.background == Some(Background::Sky)
        && let Some((flag, _)) = fades.iter().find(|(_, is_given)| *is_given)
    {
        let text = format!(
            "{flag} fades into a background of one color, --background sky has many — give --halo-color, or another background"
        );
        return Err(Failure::Usage(text));
    }
    let illustration = Illustration { contours, halo, depth_cue, depths: given.depth_range };
    let without_edges = [
        (args.look.aperture.map(|_| "--aperture"), "which blurs edges"),
        (args.look.drawn(), "with which each sample has edges of its own"),
    ];
    if let Some((Some(other), why)) = without_edges.iter().find(|(other, _)| other.is_some())
        && !illustration.is_empty()
    {
        let flag = given.name().unwrap_or("the outline of --look toon");
        return Err(Failure::Usage(format!("{flag} is not for {other}, {why} — leave out one of them")));
    }
    illustration.check()?;
    Ok(illustration)
}
