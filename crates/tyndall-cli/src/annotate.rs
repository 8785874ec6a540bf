//! What is written over pictures: flags to annotations, and annotations onto each picture before it is written.
//!
//! Places are found on the first picture and kept, so that nothing jumps in a movie. In an EXR annotations are a layer of their own.

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

use clap::Args;
use tyndall::scene::camera::Camera;
use tyndall::scene::color::Legend;
use tyndall::scene::coloring;
use tyndall::{Cell, DVec3, Error, Image};
use tyndall_io::annotation::{
    Annotations, Arrangement, Behind, Font, Frame, Item, Layout, Length, Place, ScaleBar, Style, Surface,
    What, directions, key_svg, title,
};
use tyndall_io::write;

use crate::layers::Channels;
use crate::output::Pattern;
use crate::report::{Failure, Outcome, Report};
use crate::values::{LabelFormat, length};

/// What is written over the picture. Places are: left right top bottom top-left top-right bottom-left bottom-right [default: where the
/// first picture shows nothing].
#[derive(Args)]
#[command(next_help_heading = "Annotations")]
pub(crate) struct Annotate {
    /// A color bar of what --color shows, or a list of types or elements with their colors; of a medium what its --emission shows where it is thick, as colors add up where it is seen
    /// through. Under this heading [default: the quantity and its unit]
    #[arg(long, value_name = "HEADING", num_args = 0..=1, default_missing_value = "auto")]
    bar: Option<String>,
    /// Where the color bar stands: left right top bottom top-left top-right bottom-left bottom-right [default: where the first picture shows nothing; say it
    /// where pictures of a series are made by several runs]
    #[arg(long, value_name = "PLACE", requires = "bar")]
    bar_at: Option<Place>,
    /// Writes the color bar alone, as SVG, whose texts can be edited
    #[arg(long, value_name = "FILE")]
    bar_file: Option<PathBuf>,
    /// A scale bar of that length, such as 1nm, or 10 in the file's unit [default: a round one of about a fifth of the picture]. In perspective it is true
    /// at the distance of what the camera looks at
    #[arg(long, value_name = "LENGTH", num_args = 0..=1, default_missing_value = "auto")]
    scalebar: Option<Scalebar>,
    /// Where the scale bar stands, as --bar-at
    #[arg(long, value_name = "PLACE", requires = "scalebar")]
    scalebar_at: Option<Place>,
    /// Arrows along x, y and z
    #[arg(long)]
    axes: bool,
    /// Where the arrows stand, as --bar-at
    #[arg(long, value_name = "PLACE", requires = "axes")]
    axes_at: Option<Place>,
    /// The edges of the simulation's cell, as thin lines behind what is nearer
    #[arg(long)]
    cell: bool,
    /// A title
    #[arg(long, value_name = "TEXT")]
    title: Option<String>,
    /// Where the title stands, as --bar-at
    #[arg(long, value_name = "PLACE", requires = "title")]
    title_at: Option<Place>,
    /// The frame's time with its unit, its step or its redshift, as the file says; or a text with {time}, {time:.2}, {unit}, {z} or {frame} in it
    #[arg(long, value_name = "FORMAT", num_args = 0..=1, default_missing_value = "auto")]
    time_label: Option<LabelFormat>,
    /// Where the time stands, as --bar-at
    #[arg(long, value_name = "PLACE", requires = "time_label")]
    time_label_at: Option<Place>,
    /// Color of texts and lines: #rrggbb or a color's name [default: black, or white before what is dark]
    #[arg(long, value_name = "COLOR", value_parser = coloring::color)]
    annotation_color: Option<[u8; 3]>,
    /// What the size of annotations is multiplied with; it follows the picture's
    #[arg(long, value_name = "S", default_value = "1", value_parser = length, allow_hyphen_values = true)]
    annotation_scale: f32,
    /// A TrueType or OpenType file with the font [default: DejaVu Sans, which is built in]
    #[arg(long, value_name = "FILE")]
    font: Option<PathBuf>,
}

impl Annotate {
    /// The flag that asks what colors mean, if there is one.
    pub(crate) fn of_colors(&self) -> Option<&'static str> {
        self.bar.as_ref().map(|_| "--bar").or(self.bar_file.as_ref().map(|_| "--bar-file"))
    }
}

/// The length of a scale bar; none if it is to be found.
#[derive(Clone, Debug)]
struct Scalebar(Option<Length>);

impl std::str::FromStr for Scalebar {
    type Err = Error;

    fn from_str(text: &str) -> tyndall::Result<Self> {
        if text == "auto" { Ok(Self(None)) } else { text.parse().map(|length| Self(Some(length))) }
    }
}

/// A picture, or that of one eye.
pub(crate) struct Seen {
    pub(crate) image: Image,
    /// What an EXR has beside its colors.
    pub(crate) channels: Channels,
    pub(crate) camera: Camera,
    pub(crate) frame: Frame,
}

/// What a picture shows.
pub(crate) struct Shown<'a> {
    pub(crate) behind: Behind,
    /// What colors mean, and how they were chosen.
    pub(crate) colors: (Option<&'a Legend>, &'a str),
    pub(crate) frame: usize,
    /// With its unit.
    pub(crate) time: (Option<f64>, Option<&'a str>),
    pub(crate) length_unit: Option<&'a str>,
    pub(crate) cell: Option<Cell>,
}

/// What is written over a picture, before it has places.
#[derive(Clone)]
struct Over {
    annotations: Annotations,
    cell: Option<Cell>,
    camera: Camera,
    frame: Frame,
    behind: Behind,
    /// What is to be said of it.
    described: Option<String>,
}

impl Over {
    /// Draws the cell over rows of the picture.
    fn draw_cell(&self, first_row: u32, depth: &[f32], color: &mut [[f32; 4]]) -> tyndall::Result<()> {
        let Some(cell) = &self.cell else { return Ok(()) };
        let surface = Surface { frame: self.frame, first_row, depth, behind: self.behind };
        self.annotations.draw_cell(cell, &self.camera, &surface, color)
    }
}

/// What is written over the bands of a picture.
pub(crate) struct Bands {
    over: Over,
    layout: Layout,
}

impl Bands {
    /// Writes over the band that begins with a row.
    pub(crate) fn annotate(&self, first_row: u32, band: &mut Image) -> tyndall::Result<()> {
        self.over.draw_cell(first_row, &band.depth, &mut band.color)?;
        self.layout.draw(first_row, &mut band.color);
        Ok(())
    }

    /// What is to be said of it.
    pub(crate) fn description(&self) -> Option<&str> {
        self.over.described.as_deref()
    }
}

/// Writes over pictures.
pub(crate) struct Annotator<'a> {
    args: &'a Annotate,
    report: &'a Report,
    style: Style,
    /// Of the first picture.
    arrangement: Option<Arrangement>,
    /// The bar that stands in a file without a number.
    bar_written: Option<Legend>,
}

impl<'a> Annotator<'a> {
    /// Refuses before the work what cannot be.
    pub(crate) fn new(args: &'a Annotate, report: &'a Report) -> Outcome<Self> {
        if let Some(path) = &args.bar_file {
            if !path.extension().is_some_and(|it| it.eq_ignore_ascii_case("svg")) {
                return Err(Error::setting(
                    "--bar-file",
                    path.display(),
                    "the name of an SVG file: NAME.svg",
                )
                .into());
            }
            write::check_place(&Pattern::new(path).name(0)).map_err(Failure::Output)?;
        }
        let font = match &args.font {
            None => Font::embedded(),
            Some(path) => {
                let bytes = fs::read(path).map_err(|error| Error::io(path, error))?;
                let allowed = "the file of a TrueType or OpenType font (.ttf, .otf)";
                Font::from_bytes(bytes).map_err(|_| Error::setting("--font", path.display(), allowed))?
            }
        };
        let style = Style { font, color: args.annotation_color, scale: args.annotation_scale };
        Ok(Self { args, report, style, arrangement: None, bar_written: None })
    }

    /// Refuses what cannot be written over a picture that a camera sees so, before it is made.
    pub(crate) fn check(&self, shown: &Shown, (camera, frame): (&Camera, &Frame)) -> Outcome<()> {
        self.items(shown, (camera, frame)).map(|_| ())
    }

    /// Writes over a picture, or that of one eye, which goes to `path`; into a layer if it is an EXR. Returns what is to be said of it.
    pub(crate) fn annotate(
        &mut self,
        path: &Path,
        seen: &mut Seen,
        shown: &Shown,
    ) -> Outcome<Option<String>> {
        let Some(over) = self.over(shown, (&seen.camera, &seen.frame))? else { return Ok(None) };
        let is_first = self.arrangement.is_none();
        let is_layer = path.extension().is_some_and(|it| it.eq_ignore_ascii_case("exr"));
        let Seen { image, channels, frame, .. } = seen;
        let mut layer = if is_layer { vec![[0.0; 4]; image.color.len()] } else { Vec::new() };
        over.draw_cell(0, &image.depth, if is_layer { &mut layer } else { &mut image.color })?;
        let layout = self.lay_out(&over, frame.size(), image);
        layout.draw(0, if is_layer { &mut layer } else { &mut image.color });
        if is_layer {
            for (channel, name) in ["R", "G", "B", "A"].into_iter().enumerate() {
                let values = layer.iter().map(|pixel| pixel[channel]).collect();
                channels.push((format!("annotation.{name}"), values));
            }
            if is_first {
                let text = "note: annotations are the layer 'annotation' of the EXR, not in its picture";
                self.report.note(text);
            }
        }
        Ok(over.described)
    }

    /// What is written over the bands of a picture, of which `preview` gives a small one; `None` if nothing is.
    pub(crate) fn bands(
        &mut self,
        seen: (Camera, Frame),
        shown: &Shown,
        preview: impl FnOnce() -> Outcome<Image>,
    ) -> Outcome<Option<Bands>> {
        let (camera, frame) = seen;
        let Some(over) = self.over(shown, (&camera, &frame))? else { return Ok(None) };
        let mut preview = preview()?;
        let small = Over { frame: Frame::whole([preview.width, preview.height]), ..over.clone() };
        small.draw_cell(0, &preview.depth, &mut preview.color)?;
        let layout = self.lay_out(&over, frame.size(), &preview);
        Ok(Some(Bands { over, layout }))
    }

    /// What is written over a picture that a camera sees so, if anything is; says what of it cannot be.
    fn over(&self, shown: &Shown, (camera, frame): (&Camera, &Frame)) -> Outcome<Option<Over>> {
        let (items, described) = self.items(shown, (camera, frame))?;
        if self.args.cell && shown.cell.is_none() {
            self.report.warn("--cell: the file has no cell");
        }
        let cell = shown.cell.filter(|_| self.args.cell);
        if items.is_empty() && cell.is_none() {
            return Ok(None);
        }
        let annotations = Annotations { style: self.style.clone(), items };
        if let Some(letter) = annotations.missing_character() {
            self.report.warn(&format!(
                "the font has no '{letter}', a box stands for it — --font FILE takes another"
            ));
        }
        let (camera, frame) = (*camera, *frame);
        Ok(Some(Over { annotations, cell, camera, frame, behind: shown.behind, described }))
    }

    /// Lays out a picture of that size, like `image`: at the places of the first one.
    fn lay_out(&mut self, over: &Over, size: [u32; 2], image: &Image) -> Layout {
        let Over { annotations, behind, described, .. } = over;
        if self.arrangement.is_none() {
            if let Some(text) = described {
                self.report.note(format_args!("note: {text}"));
            }
            if *behind == Behind::Nothing && self.style.color.is_none() {
                let text = "note: annotations are black, for a bright page behind the picture; --annotation-color white for a dark one";
                self.report.note(text);
            }
        }
        let arrangement = self.arrangement.get_or_insert_with(|| annotations.arrange(size, image, *behind));
        annotations.lay_out(arrangement, size, *behind)
    }

    /// All that is asked for and can be, and what is to be said of it.
    fn items(
        &self,
        shown: &Shown,
        (camera, frame): (&Camera, &Frame),
    ) -> Outcome<(Vec<Item>, Option<String>)> {
        let args = self.args;
        let (mut items, mut described) = (Vec::new(), None);
        let mut add = |what: What, at: Option<Place>| items.push(Item { what, at });
        if let Some(text) = &args.title {
            add(What::Title(text.clone()), args.title_at);
        }
        if args.bar.is_some()
            && let Some(legend) = self.legend("--bar", shown)
        {
            add(What::Key(legend.clone(), self.heading(legend)), args.bar_at);
        }
        if args.axes {
            let view = camera.view(DVec3::ZERO, frame.seen[0], frame.seen[1])?;
            add(What::Axes(directions(&view)), args.axes_at);
        }
        if let Some(Scalebar(wanted)) = &args.scalebar {
            let bar = ScaleBar::new(camera, frame, wanted.as_ref(), shown.length_unit)?;
            let unit = match shown.length_unit {
                Some(_) => "",
                None => ", in the file's unit, which it does not say (set --units Å)",
            };
            described = Some(format!("{}{unit}", bar.description));
            add(What::ScaleBar(bar), args.scalebar_at);
        }
        if let Some(format) = &args.time_label {
            match format.text(shown.time, shown.frame) {
                Some(text) => add(What::Label(text), args.time_label_at),
                None => {
                    let text = "the frame has no time, so it has no label — --time-label 'frame {frame}' shows its number";
                    self.report.warn(text);
                }
            }
        }
        Ok((items, described))
    }

    /// What colors mean, or a warning that they mean nothing.
    fn legend<'b>(&self, flag: &str, shown: &Shown<'b>) -> Option<&'b Legend> {
        let (legend, description) = shown.colors;
        if legend.is_none() {
            let description = description.strip_prefix("color ").unwrap_or(description);
            self.report.warn(&format!(
                "{flag}: colors stand for no numbers or kinds ({description}) — --color NAME chooses some"
            ));
        }
        legend
    }

    fn heading(&self, legend: &Legend) -> String {
        let given = self.args.bar.as_ref().filter(|text| *text != "auto");
        given.cloned().unwrap_or_else(|| title(legend))
    }

    /// Writes the bar alone: once, or with each frame's number in its name.
    pub(crate) fn write_bar(&mut self, shown: &Shown) -> Outcome<()> {
        let Some(path) = &self.args.bar_file else { return Ok(()) };
        let Some(legend) = self.legend("--bar-file", shown) else { return Ok(()) };
        let pattern = Pattern::new(path);
        if let Some(written) = self.bar_written.as_ref().filter(|_| !pattern.is_numbered()) {
            if written != legend {
                let text = "--bar-file is that of the first picture, others have other numbers — --fixed-range keeps them, NAME.%04d.svg writes all";
                self.report.warn(text);
            }
            return Ok(());
        }
        let svg = key_svg(legend, &self.heading(legend), &self.style);
        let path = pattern.name(shown.frame);
        write::atomically(&path, |file| file.write_all(svg.as_bytes())).map_err(Failure::Output)?;
        if self.bar_written.is_none() {
            self.report.note(format_args!("{}  color bar", path.display()));
        }
        self.bar_written = Some(legend.clone());
        Ok(())
    }
}
