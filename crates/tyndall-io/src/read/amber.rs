//! AMBER NetCDF: trajectories and restarts of AMBER, and the dumps of LAMMPS' style netcdf, in NetCDF classic.
//!
//! Positions are the variable `coordinates`, in Å unless its `units` say otherwise; `scale_factor` is a factor. The cell
//! (`cell_lengths`, `cell_angles`, and LAMMPS' `cell_origin`) is missing where there is none. All other variables with a number or a
//! vector an atom are attributes. Source: AMBER NetCDF Trajectory Convention 1.0.

use std::path::Path;

use tyndall::{DVec3, Error, Progress, Result};

use super::netcdf::{Directory, Variable, recognise as is_netcdf};
use super::records::{self, Field, Layout};
use super::{Index, Request, Span, molecules};
use crate::sequence::{Frame, Options};

/// Whether the file is NetCDF classic: which of them hold particles, their variables say.
pub(crate) fn recognise(head: &[u8]) -> bool {
    is_netcdf(head)
}

/// The directory, the variable of positions, and how many atoms there are.
fn open(path: &Path, bytes: &[u8]) -> Result<(Directory, usize, usize)> {
    let directory = Directory::read(path, bytes)?;
    let found = directory.variables.iter().position(|it| it.name == "coordinates" && it.kind.is_some());
    let Some(place) = found else {
        let names: Vec<&str> = directory.variables.iter().map(|it| it.name.as_str()).collect();
        let what = format!("no variable 'coordinates' among those of this NetCDF file: {}", names.join(", "));
        let hint =
            "AMBER's convention is read; of other NetCDF files save the columns as CSV or with numpy.savez";
        return Err(Error::format(path, "", what, hint));
    };
    let shape = directory.shape(&directory.variables[place]);
    let [count, 3] = shape[..] else {
        let what = format!("coordinates are wanted as atoms times 3, they are {shape:?}");
        return Err(Error::format(path, "coordinates", what, "write them as AMBER's convention says"));
    };
    Ok((directory, place, count as usize))
}

/// Finds the frames.
pub(crate) fn index(path: &Path, bytes: &[u8], _: &Options) -> Result<Index> {
    let (directory, place, count) = open(path, bytes)?;
    let mut index = Index::default();
    let variable = &directory.variables[place];
    let (frames, promised) = if directory.is_recorded(variable) {
        (directory.records, directory.promised.unwrap_or(directory.records))
    } else {
        let source = directory.source(bytes, variable, 0, 3);
        let whole =
            source.and_then(|it| it.end(count.max(1), 3)).is_some_and(|end| count == 0 || end <= bytes.len());
        (whole.into(), 1)
    };
    index.cut = frames < promised;
    // Of records without bytes there may be any number.
    let frames = frames.min(bytes.len() as u64);
    index.frames = (0..frames).map(|frame| Span { offset: frame, line: frame + 1, bytes: None }).collect();
    index.title = directory
        .text("Conventions")
        .filter(|it| it.contains("AMBERRESTART"))
        .map(|_| "AMBER NetCDF restart".into());
    Ok(index)
}

/// Reads the frame whose number is the offset of `span`.
pub(crate) fn frame(
    path: &Path,
    bytes: &[u8],
    span: Span,
    request: &Request,
    progress: &dyn Progress,
) -> Result<Frame> {
    let (directory, place, count) = open(path, bytes)?;
    let record = span.offset;
    let total: usize =
        directory.variables.iter().map(|it| it.kind.map_or(0, |kind| kind.size() * 3 * count)).sum();
    progress.begin("read", Some(total as u64), "B");
    let variable = &directory.variables[place];
    let wrong = |what: &str| Error::format(path, "coordinates", what, "copy or write the file again");
    let source =
        directory.source(bytes, variable, record, 3).ok_or_else(|| wrong("lie beyond the file's end"))?;

    let others = directory.variables.iter().filter(|it| it.name != "coordinates");
    let known = others.filter_map(|it| Some((it, field(&directory, bytes, it, record, count)?)));
    let (variables, fields): (Vec<&Variable>, Vec<Field>) = known.unzip();
    let axes = [0, 1, 2].map(|axis| Some(source.component(axis)));
    let mut columns = Layout { count, axes, fields }.gather(path, total, progress)?.into_columns();

    let mut conventions = Vec::new();
    let factor = |it: &Variable| it.number("scale_factor").filter(|&it| it != 1.0);
    if let Some(factor) = factor(variable) {
        conventions.push(format!("coordinates are scaled by {factor}, their scale_factor"));
        let position =
            |id: usize| DVec3::from_array([0, 1, 2].map(|axis| factor * source.component(axis).number(id)));
        columns.positions = records::positions(count, None, position);
    }
    for (attribute, variable) in columns.attributes.iter_mut().zip(&variables) {
        attribute.unit = variable.text("units").map(str::to_string);
        if let Some(factor) = factor(variable) {
            records::scale(attribute, factor, 0.0);
        }
    }
    let unit = variable.text("units");
    if unit.is_none() {
        conventions.push("lengths: Å (AMBER convention)".to_string());
    }
    let number = |name: &str| -> Option<[f64; 3]> {
        let variable = directory.variable(name)?;
        let numbers = directory.numbers::<3>(bytes, variable, record)?;
        Some(numbers.map(|it| it * factor(variable).unwrap_or(1.0)))
    };
    if let (Some(lengths), Some(angles)) = (number("cell_lengths"), number("cell_angles")) {
        columns.cell = molecules::cell_of_angles(lengths, angles);
        let origin = number("cell_origin").map(DVec3::from_array).filter(|it| it.is_finite());
        if let (Some(cell), Some(origin)) = (&mut columns.cell, origin) {
            cell.origin = origin;
        }
    }
    columns.time = directory.variable("time").and_then(|time| {
        let [value] = directory.numbers::<1>(bytes, time, record)?;
        Some(value * factor(time).unwrap_or(1.0))
    });
    let time_unit = directory.variable("time").and_then(|time| time.text("units"));
    columns.time_unit = match time_unit.map(str::to_ascii_lowercase).as_deref() {
        None | Some("picosecond" | "picoseconds") => Some("ps".to_string()),
        _ => time_unit.map(str::to_string),
    };
    columns.length_unit = match unit.map(str::to_ascii_lowercase).as_deref() {
        None | Some("angstrom" | "angstroms" | "a") => Some("Å".to_string()),
        Some("nanometer" | "nanometers" | "nm") => Some("nm".to_string()),
        Some("bohr") => Some("Bohr".to_string()),
        Some("lj" | "") => None,
        _ => unit.map(str::to_string),
    };
    request.complete(&mut columns, path, span, &mut conventions)?;
    records::frame(columns, conventions, vec![])
}

/// A variable that has a number or a vector for each atom, as an attribute under the name that other readers have for it.
fn field<'a>(
    directory: &Directory,
    bytes: &'a [u8],
    variable: &Variable,
    record: u64,
    count: usize,
) -> Option<Field<'a>> {
    let atoms = *variable.dimensions.get(usize::from(directory.is_recorded(variable)))?;
    if directory.dimensions[atoms].0 != "atom" {
        return None;
    }
    let components = match directory.shape(variable)[..] {
        [atoms] if atoms == count as u64 => 1,
        [atoms, components @ 1..=16] if atoms == count as u64 => components as usize,
        _ => return None,
    };
    let name = match variable.name.as_str() {
        "velocities" => "velocity",
        "forces" => "force",
        "atom_types" => "type",
        name => name,
    };
    let source = directory.source(bytes, variable, record, components)?;
    // What the file has no room for is not there, though the header says so.
    let there = count == 0 || source.end(count, components).is_some_and(|end| end <= bytes.len());
    there.then(|| Field { name: name.to_string(), components, source })
}

#[cfg(test)]
mod tests {
    use tyndall::particles::Values;

    use super::*;
    use crate::read::real_data;

    /// Writes NetCDF in a variant.
    struct Writer {
        variant: u8,
        file: Vec<u8>,
    }

    impl Writer {
        fn count(&mut self, count: u64) {
            if self.variant == 5 {
                self.file.extend(count.to_be_bytes())
            } else {
                self.file.extend((count as u32).to_be_bytes())
            }
        }

        fn list(&mut self, tag: u32, count: u64) {
            self.file.extend((if count == 0 { 0 } else { tag }).to_be_bytes());
            self.count(count);
        }

        fn name(&mut self, name: &str) {
            self.count(name.len() as u64);
            self.file.extend(name.bytes());
            self.file.resize(self.file.len().next_multiple_of(4), 0);
        }

        fn text(&mut self, name: &str, value: &str) {
            self.name(name);
            self.file.extend(2u32.to_be_bytes());
            self.name(value);
        }
    }

    /// What a file has.
    #[derive(Clone, Copy)]
    struct Sample {
        variant: u8,
        atoms: u64,
        cell: bool,
        factor: bool,
        /// Whether the writer knew how many frames it wrote.
        counted: bool,
    }

    const PLAIN: Sample = Sample { variant: 1, atoms: 2, cell: true, factor: true, counted: true };

    /// Two frames; numbers tell frame, atom and axis.
    fn sample(sample: Sample) -> Vec<u8> {
        let Sample { variant, atoms, .. } = sample;
        let mut writer = Writer { variant, file: vec![b'C', b'D', b'F', variant] };
        writer.count(if sample.counted { 2 } else { u64::MAX });
        writer.list(10, 3);
        for (name, length) in [("frame", 0), ("atom", atoms), ("spatial", 3)] {
            writer.name(name);
            writer.count(length);
        }
        writer.list(12, 1);
        writer.text("Conventions", "AMBER");
        // Name, dimensions, type, numbers a record.
        let all: [(&str, &[u64], u32, u64); 6] = [
            ("coordinates", &[0, 1, 2], 5, 3 * atoms),
            ("cell_lengths", &[0, 2], 6, 3),
            ("cell_angles", &[0, 2], 6, 3),
            ("time", &[0], 5, 1),
            ("velocities", &[0, 1, 2], 5, 3 * atoms),
            ("mark", &[0, 1], 3, atoms),
        ];
        let all: Vec<_> = all.into_iter().filter(|it| sample.cell || !it.0.starts_with("cell")).collect();
        let size = |kind: u32| match kind {
            3 => 2,
            5 => 4,
            _ => 8,
        };
        writer.list(11, all.len() as u64);
        let mut places = vec![];
        for (name, dimensions, kind, values) in &all {
            writer.name(name);
            writer.count(dimensions.len() as u64);
            dimensions.iter().for_each(|&it| writer.count(it));
            let scaled = sample.factor && (*name == "coordinates" || *name == "velocities");
            writer.list(12, if scaled { 2 } else { 1 });
            writer.text("units", if *name == "coordinates" { "angstrom" } else { "other" });
            if scaled {
                writer.name("scale_factor");
                writer.file.extend(6u32.to_be_bytes());
                writer.count(1);
                writer.file.extend(2.0f64.to_be_bytes());
            }
            writer.file.extend(kind.to_be_bytes());
            writer.count((values * size(*kind)).next_multiple_of(4));
            places.push(writer.file.len());
            if variant == 1 { writer.file.extend([0; 4]) } else { writer.file.extend([0; 8]) }
        }
        let mut start = writer.file.len() as u64;
        for (place, (_, _, kind, values)) in places.into_iter().zip(&all) {
            match variant {
                1 => writer.file[place..][..4].copy_from_slice(&(start as u32).to_be_bytes()),
                _ => writer.file[place..][..8].copy_from_slice(&start.to_be_bytes()),
            }
            start += (values * size(*kind)).next_multiple_of(4);
        }
        for frame in 0..2 {
            for (name, _, kind, values) in &all {
                for value in 0..*values {
                    let number = match *name {
                        "cell_angles" => 90.0,
                        "cell_lengths" => 5.0 + value as f64,
                        _ => f64::from(100 * frame) + value as f64,
                    };
                    match kind {
                        3 => writer.file.extend((number as i16).to_be_bytes()),
                        5 => writer.file.extend((number as f32).to_be_bytes()),
                        _ => writer.file.extend(number.to_be_bytes()),
                    }
                }
                writer.file.resize(writer.file.len().next_multiple_of(4), 0);
            }
        }
        writer.file
    }

    #[test]
    fn all_variants_are_read() {
        for variant in [1, 2, 5] {
            for (cell, factor, counted) in [(true, true, true), (false, false, false)] {
                let file = sample(Sample { variant, atoms: 3, cell, factor, counted });
                let frames = real_data::open(&file).unwrap();
                assert_eq!(frames.len(), 2, "{variant}");
                let particles = &frames[1].particles;
                let scale = if factor { 2.0 } else { 1.0 };
                assert_eq!(particles.positions().world(2), scale * DVec3::new(106.0, 107.0, 108.0));
                assert_eq!(particles.attribute("velocity").unwrap().number(1, 2), scale * 105.0);
                assert_eq!(particles.attribute("mark").unwrap().values, Values::I32(vec![100, 101, 102]));
                assert_eq!((particles.time(), particles.length_unit()), (Some(100.0), Some("Å")));
                assert_eq!(particles.cell().map(|it| it.vectors[2]), cell.then_some(7.0 * DVec3::Z));
                assert_eq!(frames[1].conventions.is_empty(), !factor);
            }
        }
        for atoms in [0, 1] {
            let frames = real_data::open(&sample(Sample { atoms, ..PLAIN })).unwrap();
            assert_eq!((frames.len(), frames[0].particles.len() as u64), (2, atoms));
        }
    }

    #[test]
    fn a_file_that_is_cut_keeps_its_whole_frames() {
        let file = sample(PLAIN);
        let record = (file.len() - sample_header(&file)) / 2;
        for length in file.len() - record..file.len() {
            let index = index(Path::new("test"), &file[..length], &Options::default()).unwrap();
            assert_eq!((index.frames.len(), index.cut), (1, true), "{length}");
        }
    }

    /// How long the header is: up to the first value.
    fn sample_header(file: &[u8]) -> usize {
        let directory = Directory::read(Path::new("test"), file).unwrap();
        let first = &directory.variables[0];
        directory.source(file, first, 0, 1).unwrap().start
    }

    #[test]
    fn other_files_are_explained_and_damage_never_panics() {
        let mut file = sample(PLAIN);
        let place = memchr::memmem::find(&file, b"coordinates").unwrap();
        file[place] = b'k';
        let message = real_data::open(&file).unwrap_err().to_string();
        assert!(
            message.contains("no variable 'coordinates'") && message.contains("koordinates"),
            "{message}"
        );
        for variant in [1, 5] {
            let file = sample(Sample { variant, ..PLAIN });
            let open = &real_data::recognised(&file).open;
            real_data::damage(&file, |file| drop(real_data::frames(open, file, &Options::default())));
        }
    }
}
