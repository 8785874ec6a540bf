//! Density grids of files that say themselves where their samples lie: OpenDX, VTK's image data and structured points, OpenVDB.
//!
//! Takes a file, gives a grid of cubes: where the file's samples lie at other distances along one axis than along another, values are
//! interpolated at the smallest of the three. OpenDX: text, z fastest. Source: the OpenDX user's guide, appendix B; VTK's formats as in
//! the module `vtk`; OpenVDB's in [`mod@crate::vdb`].

use std::path::Path;

use rayon::prelude::*;
use tyndall::medium::Grid;
use tyndall::{Error, Progress, Result, Vec3};

use super::column::{self, Separator};
use super::{Packing, vtk};
use crate::vdb;

/// Distances that differ by no more than this share count as equal.
const EQUAL: f64 = 1e-4;

/// A density from a file, and what was done to it.
#[derive(Debug)]
pub struct Described {
    /// The density.
    pub grid: Grid,
    /// What the file calls it; empty if it has no name.
    pub name: String,
    /// What was guessed or changed, one line each.
    pub conventions: Vec<String>,
}

/// Samples that stand in a box, x fastest.
#[derive(Debug, Default)]
pub(super) struct Samples {
    /// How many there are along x, y, z.
    pub(super) size: [usize; 3],
    pub(super) origin: [f64; 3],
    /// Distances of neighbors along x, y, z.
    pub(super) spacing: [f64; 3],
    pub(super) values: Vec<f32>,
}

/// Reads a grid from a file that says where its samples lie: an OpenDX field (`.dx`), a VTK image (`.vti`), legacy VTK structured
/// points, or OpenVDB (`.vdb`). Of several arrays or grids it is the first of `names` that the file has, or the file's density if no names
/// are given; `scale` is the density of a sample of value 1.
///
/// Fails with [`Error::Format`] if the file is damaged or of another format, and with [`Error::Setting`] if it has nothing of those
/// names (see [`is_absent`]) and where [`Grid::from_dense`] does: a negative density, for example.
pub fn described_density(
    path: &Path,
    names: &[&str],
    scale: f64,
    progress: &dyn Progress,
) -> Result<Described> {
    if !(scale >= 0.0 && scale.is_finite()) {
        return Err(Error::setting("scale", scale, "a finite number of at least 0"));
    }
    let (head, packing) = super::head(path)?;
    if vdb::recognise(&head) {
        return vdb::described(path, names, scale, progress);
    }
    if !vtk::recognise(&head) && !is_dx(&head) {
        let what = "neither OpenDX, OpenVDB nor a VTK image: the file does not say where its samples lie";
        return Err(Error::format(path, "", what, "give size and spacing of a raw grid in [grid]"));
    }
    let (map, unpacked);
    let bytes: &[u8] = match packing {
        Packing::Plain => {
            map = super::map(path)?;
            &map
        }
        _ => {
            unpacked = super::unpacked(path, packing, progress)?;
            &unpacked
        }
    };
    progress.begin("read", Some(bytes.len() as u64), "B");
    let mut conventions = Vec::new();
    let (samples, name) = if vtk::recognise(&head) {
        let (samples, name) = vtk::image(path, bytes, names)?;
        conventions.push(format!("density: array '{name}'"));
        (samples, name)
    } else if names.is_empty() {
        (dx(path, bytes)?, String::new())
    } else {
        return Err(absent(names, "an OpenDX file has one grid, without a name"));
    };
    progress.advance(bytes.len() as u64);
    let (mut samples, changed) = samples.cubic(path)?;
    conventions.extend(changed);
    samples.values.par_iter_mut().for_each(|it| *it = (f64::from(*it) * scale) as f32);
    let origin = Vec3::from_array(samples.origin.map(|it| it as f32));
    let size = samples.size.map(|it| it as u32);
    let grid = Grid::from_dense(origin, samples.spacing[0] as f32, size, &samples.values)?;
    Ok(Described { grid, name, conventions })
}

/// The setting that names one of several arrays or grids of a file.
const ARRAY: &str = "array";

/// Why a file has no array or grid of any of `names`: what it has instead.
pub fn absent(names: &[&str], found: &str) -> Error {
    Error::setting(ARRAY, names.join(", "), found)
}

/// Whether an array or a grid could not be read only because the file has nothing of that name.
pub fn is_absent(error: &Error) -> bool {
    matches!(error, Error::Setting { name, .. } if name == ARRAY)
}

impl Samples {
    /// How many samples a box of that size has, if that is a number that memory can hold.
    pub(super) fn count(size: [usize; 3]) -> Option<usize> {
        let count = size.iter().try_fold(1usize, |count, &it| count.checked_mul(it));
        count.filter(|&it| it < 1 << 40 && size.iter().all(|&it| it < 1 << 31))
    }

    /// The same at equal distances; says so if values had to be interpolated.
    fn cubic(self, path: &Path) -> Result<(Self, Option<String>)> {
        let bad = |it: f64| !(it > 0.0 && it.is_finite());
        if self.spacing.into_iter().any(bad) || self.origin.iter().any(|it| !it.is_finite()) {
            let what = format!("samples {:?} apart from {:?} on were found", self.spacing, self.origin);
            return Err(Error::format(
                path,
                "",
                what,
                "distances must be above 0: turn the grid before it is saved",
            ));
        }
        let [least, most] = [f64::min, f64::max].map(|of| self.spacing.into_iter().reduce(of).unwrap_or(1.0));
        if most - least <= EQUAL * least {
            return Ok((Self { spacing: [least; 3], ..self }, None));
        }
        let length = |axis: usize| (self.size[axis] - 1) as f64 * self.spacing[axis] / least;
        let size = [0, 1, 2].map(|axis| ((length(axis) + 1e-6).floor() as usize).saturating_add(1));
        let too_large = || {
            let what =
                format!("samples {:?} apart would become {size:?} samples {least} apart", self.spacing);
            Error::format(path, "", what, "save a grid with equal distances along all axes")
        };
        let count = Self::count(size).filter(|it| it / 64 <= self.values.len()).ok_or_else(too_large)?;
        let mut values = vec![0.0; count];
        let planes = values.par_chunks_mut((size[0] * size[1]).max(1)).enumerate();
        planes.for_each(|(z, plane)| {
            for (y, row) in plane.chunks_mut(size[0]).enumerate() {
                for (x, value) in row.iter_mut().enumerate() {
                    *value =
                        self.value([0, 1, 2].map(|axis| [x, y, z][axis] as f64 * least / self.spacing[axis]));
                }
            }
        });
        let note = format!(
            "samples are {} × {} × {} apart: interpolated to {least} along all axes",
            self.spacing[0], self.spacing[1], self.spacing[2]
        );
        Ok((Self { size, values, spacing: [least; 3], origin: self.origin }, Some(note)))
    }

    /// The value between eight samples; places count samples from the first.
    fn value(&self, place: [f64; 3]) -> f32 {
        let [x_size, y_size, _] = self.size;
        let first = [0, 1, 2].map(|axis| (place[axis] as usize).min(self.size[axis] - 1));
        (0..8)
            .map(|corner| {
                let steps = [0, 1, 2].map(|axis| corner >> axis & 1);
                let shares = [0, 1, 2].map(|axis| {
                    let share = (place[axis] - first[axis] as f64).clamp(0.0, 1.0);
                    if steps[axis] == 1 { share } else { 1.0 - share }
                });
                let [x, y, z] = [0, 1, 2].map(|axis| (first[axis] + steps[axis]).min(self.size[axis] - 1));
                shares.iter().product::<f64>() * f64::from(self.values[(z * y_size + y) * x_size + x])
            })
            .sum::<f64>() as f32
    }
}

/// A file whose samples are a grid, where particles were wanted.
pub(crate) fn no_particles(path: &Path, kind: &str) -> Error {
    let what = format!("this is a grid of samples ({kind}), it has no particles");
    let hint =
        "a uniform grid can be rendered as a medium: name it as file in the table [grid] of a scene file";
    Error::format(path, "", what, hint)
}

/// Whether the file begins like an OpenDX field: with comments, then an object.
pub(super) fn is_dx(head: &[u8]) -> bool {
    let mut lines = super::whole_lines(head).filter(|it| !it.is_empty() && it[0] != b'#');
    lines.next().is_some_and(|line| line.starts_with(b"object"))
}

/// Reads an OpenDX field of one scalar at each sample.
fn dx(path: &Path, bytes: &[u8]) -> Result<Samples> {
    let hint = "write it as a regular grid of scalars, as text, with positions along the axes";
    let mut samples = Samples::default();
    let mut deltas: Vec<[f64; 3]> = Vec::new();
    let mut place = 0;
    for (line_number, line) in (1..).zip(bytes.split_inclusive(|&byte| byte == b'\n')) {
        place += line.len();
        let fault = |what: String| Error::format(path, format!("line {line_number}"), what, hint);
        let line = String::from_utf8_lossy(line);
        let words: Vec<&str> = line.split_whitespace().collect();
        let numbers = |words: &[&str]| -> Result<[f64; 3]> {
            let numbers: Option<Vec<f64>> = words.iter().map(|it| it.parse().ok()).collect();
            let numbers = numbers.and_then(|it| it.try_into().ok());
            numbers
                .ok_or_else(|| fault(format!("three numbers were wanted, '{}' was found", words.join(" "))))
        };
        match words.as_slice() {
            ["origin", rest @ ..] => samples.origin = numbers(rest)?,
            ["delta", rest @ ..] => deltas.push(numbers(rest)?),
            ["object", _, "class", "gridpositions", "counts", rest @ ..] => {
                let size = numbers(rest)?;
                if size.iter().any(|it| !(1.0..2e9).contains(it) || it.fract() != 0.0) {
                    return Err(fault(format!("three counts were wanted, {size:?} were found")));
                }
                samples.size = size.map(|it| it as usize);
            }
            ["object", _, "class", "array", rest @ ..] => {
                let after =
                    |name: &str| rest.iter().position(|it| *it == name).and_then(|at| rest.get(at + 1));
                if after("rank").is_some_and(|it| *it != "0")
                    || rest.contains(&"lsb")
                    || rest.contains(&"msb")
                {
                    return Err(fault("an array of scalars as text was wanted".into()));
                }
                if !rest.contains(&"follows") {
                    return Err(fault("the array stands in another file".into()));
                }
                let count = Samples::count(samples.size);
                let told = after("items").and_then(|it| it.parse::<usize>().ok());
                let Some(count) = count.filter(|&count| told == Some(count) && count > 0) else {
                    return Err(fault(format!(
                        "{:?} samples need another count of items than {told:?}",
                        samples.size
                    )));
                };
                let axial = |axis: usize| {
                    deltas.get(axis).is_some_and(|it| (0..3).all(|other| other == axis || it[other] == 0.0))
                };
                if deltas.len() != 3 || !(0..3).all(axial) {
                    return Err(fault(format!(
                        "three deltas along x, y, z were wanted, {deltas:?} were found"
                    )));
                }
                samples.spacing = [0, 1, 2].map(|axis| deltas[axis][axis]);
                samples.values = dx_values(&bytes[place..], samples.size, count).map_err(|what| {
                    Error::format(
                        path,
                        format!("after line {line_number}"),
                        what,
                        "was the file copied to its end?",
                    )
                })?;
                return Ok(samples);
            }
            _ => {}
        }
    }
    Err(Error::format(path, "", "there is no array of samples", hint))
}

/// The numbers of an array, which are z fastest in the file.
fn dx_values(text: &[u8], size: [usize; 3], count: usize) -> std::result::Result<Vec<f32>, String> {
    if count > text.len().div_ceil(2) {
        return Err(format!("{count} numbers were wanted, {} bytes are there", text.len()));
    }
    let mut values = vec![0.0; count];
    let mut tokens = text.split(u8::is_ascii_whitespace).filter(|it| !it.is_empty());
    for place in 0..count {
        let token = tokens.next().ok_or_else(|| format!("the file ends after {place} of {count} numbers"))?;
        let number = column::number(token, Separator::BLANKS).filter(|(_, taken)| *taken == token.len());
        let (number, _) = number.ok_or_else(|| {
            format!(
                "a number was wanted, '{}' was found",
                String::from_utf8_lossy(&token[..token.len().min(40)])
            )
        })?;
        let [x, y, z] = [place / (size[1] * size[2]), place / size[2] % size[1], place % size[2]];
        values[(z * size[1] + y) * size[0] + x] = number as f32;
    }
    Ok(values)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(bytes: &[u8], names: &[&str]) -> Result<Described> {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), bytes).unwrap();
        described_density(file.path(), names, 2.0, &())
    }

    const DX: &str = "# a comment\nobject 1 class gridpositions counts 2 3 4\norigin 1 2 3\ndelta 0.5 0 0\ndelta 0 0.5 0\n\
        delta 0 0 0.5\nobject 2 class gridconnections counts 2 3 4\n\
        object 3 class array type double rank 0 items 24 data follows\n0 1 2\n3 4 5\n6 7 8\n9 10 11\n12 13 14\n15 16 17\n\
        18 19 20\n21 22 23\nattribute \"dep\" string \"positions\"\n";

    #[test]
    fn a_field_has_z_fastest_and_a_vtk_image_x() {
        let Described { grid, conventions, .. } = read(DX.as_bytes(), &[]).unwrap();
        assert_eq!((grid.size(), grid.origin(), grid.spacing()), ([2, 3, 4], Vec3::new(1.0, 2.0, 3.0), 0.5));
        assert_eq!([grid.value(0, 0, 1), grid.value(0, 1, 0), grid.value(1, 2, 3)], [2.0, 8.0, 46.0]);
        assert!(conventions.is_empty());
        let numbers: Vec<String> = (0..24).map(|it| it.to_string()).collect();
        let vti = format!(
            "<VTKFile type='ImageData'><ImageData WholeExtent='1 2 0 2 0 3' Origin='0.5 2 3' Spacing='0.5 0.5 0.5'>\
             <Piece Extent='1 2 0 2 0 3'><PointData><DataArray type='Int8' Name='v' NumberOfComponents='3'/>\
             <DataArray type='Float64' Name='rho'>{}</DataArray></PointData></Piece></ImageData></VTKFile>",
            numbers.join(" ")
        );
        let vtk = format!(
            "# vtk DataFile Version 3.0\n\nASCII\nDATASET STRUCTURED_POINTS\nDIMENSIONS 2 3 4\nORIGIN 1 2 3\n\
             SPACING 0.5 0.5 0.5\nPOINT_DATA 24\nSCALARS rho int\nLOOKUP_TABLE default\n{}\n",
            numbers.join(" ")
        );
        for text in [&vti, &vtk] {
            for names in [&[][..], &["rho"], &["T", "rho", "v"]] {
                let Described { grid, name, conventions } = read(text.as_bytes(), names).unwrap();
                assert_eq!(
                    (grid.size(), grid.origin(), grid.spacing()),
                    ([2, 3, 4], Vec3::new(1.0, 2.0, 3.0), 0.5)
                );
                assert_eq!([grid.value(1, 0, 0), grid.value(0, 1, 0), grid.value(1, 2, 3)], [2.0, 4.0, 46.0]);
                assert_eq!((&*name, conventions), ("rho", vec!["density: array 'rho'".to_string()]));
            }
            super::super::real_data::damage(text.as_bytes(), |bytes| drop(read(bytes, &[])));
            let error = read(text.as_bytes(), &["T", "heat"]).unwrap_err().to_string();
            assert!(error.contains("'T, heat'") && error.contains("rho"), "{error}");
        }
        // Values of cells stand at the cells' middles.
        let cells = vti.replace("PointData", "CellData").replace("1 2 0 2 0 3", "1 3 0 3 0 4");
        let Described { grid, .. } = read(cells.as_bytes(), &[]).unwrap();
        assert_eq!((grid.size(), grid.origin()), ([2, 3, 4], Vec3::new(1.25, 2.25, 3.25)));
        // A flat piece at the far side has no place in them.
        let flat = cells.replace("Piece Extent='1 3", "Piece Extent='3 3");
        assert!(read(flat.as_bytes(), &[]).unwrap_err().to_string().contains("not within"));
    }

    #[test]
    fn unequal_distances_are_interpolated() {
        // A plane through space stays one: 12 x + 4 y + z in samples.
        let text = DX.replace("delta 0 0.5 0", "delta 0 0.25 0").replace("delta 0 0 0.5", "delta 0 0 1");
        let Described { grid, conventions, .. } = read(text.as_bytes(), &[]).unwrap();
        assert_eq!((grid.size(), grid.spacing()), ([3, 3, 13], 0.25));
        for (x, y, z) in [(0, 0, 0), (1, 0, 0), (1, 2, 5), (2, 2, 12)] {
            let wanted = 2.0 * (6.0 * f64::from(x) + 4.0 * f64::from(y) + 0.25 * f64::from(z));
            assert!((f64::from(grid.value(x, y, z)) - wanted).abs() < 1e-5, "{x} {y} {z}");
        }
        assert_eq!(conventions.len(), 1);
    }

    #[test]
    fn what_is_no_grid_is_refused() {
        for (from, to, what) in [
            ("rank 0", "rank 1", "scalars"),
            ("items 24", "items 25", "another count"),
            ("counts 2 3 4\norigin", "counts 2 3 0\norigin", "three counts"),
            ("counts 2 3 4\norigin", "counts 1900000000 1900000000 1900000000\norigin", "another count"),
            ("22 23", "22", "was found"),
            ("delta 0.5 0 0", "delta 0.5 0.1 0", "three deltas"),
            ("delta 0.5 0 0", "delta -0.5 0 0", "above 0"),
            ("delta 0.5 0 0", "delta 1e-9 0 0", "would become"),
            ("0 1 2\n", "-1 1 2\n", "density"),
            ("0 1 2\n", "0 1 x\n", "'x' was found"),
            ("object", "abject", "neither OpenDX"),
        ] {
            let error = read(DX.replacen(from, to, 1).as_bytes(), &[]).unwrap_err().to_string();
            assert!(error.contains(what), "{to}: {error}");
        }
        let points = "# vtk DataFile Version 3.0\n\nASCII\nDATASET POLYDATA\nPOINTS 1 float\n1 2 3\n";
        assert!(read(points.as_bytes(), &[]).unwrap_err().to_string().contains("no image"));
        super::super::real_data::damage(DX.as_bytes(), |bytes| drop(read(bytes, &[])));
    }

    #[test]
    fn a_real_field_is_as_its_expected_values_say() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/volume/hf.dx");
        if !path.exists() {
            println!("skipped: no {}", path.display());
            return;
        }
        let samples = dx(&path, &std::fs::read(&path).unwrap()).unwrap();
        assert_eq!((samples.size, samples.values.len()), ([57, 52, 26], 77064));
        assert_eq!(samples.origin, [-4.24702, -6.57508, -3.33478]);
        assert_eq!(samples.spacing, [0.257021, 0.255063, 0.264779]);
        let greatest = samples.values.iter().copied().fold(0.0, f32::max);
        assert_eq!((samples.values[0], *samples.values.last().unwrap(), greatest), (0.0, 0.0, 12.6768));
        let Described { grid, conventions, .. } = described_density(&path, &[], 1.0, &()).unwrap();
        assert_eq!((grid.size(), grid.spacing(), conventions.len()), ([57, 52, 26], 0.255063, 1));
    }
}
