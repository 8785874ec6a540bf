//! A density from a file in place of particles: the table `[grid]` of a scene file.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use tyndall::{DVec3, Error};
use tyndall_io::read::{self, Described, RawGrid, Sample};

use crate::report::{Outcome, Report};

/// The table `[grid]`: a file of samples, raw or one that says where they lie (OpenDX, OpenVDB, VTK).
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Grid {
    pub(super) file: PathBuf,
    /// The density of a sample of value 1.
    #[serde(default = "one")]
    scale: f64,
    /// Of a file that says itself where its samples lie: which array.
    #[serde(skip_serializing_if = "Option::is_none")]
    array: Option<String>,
    /// Of a raw file: samples along x, y and z.
    #[serde(skip_serializing_if = "Option::is_none")]
    size: Option<[u32; 3]>,
    /// Of a raw file: how a sample is stored, u16 or f32.
    #[serde(skip_serializing_if = "Option::is_none")]
    sample: Option<String>,
    /// Of a raw file: the distance of samples.
    #[serde(skip_serializing_if = "Option::is_none")]
    spacing: Option<f64>,
    /// Of a raw file: where the first sample lies.
    #[serde(skip_serializing_if = "Option::is_none")]
    origin: Option<[f64; 3]>,
}

/// The keys of `[grid]`, and what each is; those of [`Grid`], as a test sees to.
pub(super) const KEYS: [(&str, &str, &str); 7] = [
    (
        "file",
        "string",
        "File of samples, relative to the scene file: raw (x fastest, little-endian; zlib, gzip, zstd or plain), OpenDX, OpenVDB or VTK",
    ),
    ("scale", "number", "The density of a sample of value 1"),
    ("array", "string", "Of a file that says itself where its samples lie: which array"),
    ("size", "array", "Of a raw file: samples along x, y and z"),
    ("sample", "string", "Of a raw file: how a sample is stored, u16 or f32"),
    ("spacing", "number", "Of a raw file: distance of samples"),
    ("origin", "array", "Of a raw file: where the first sample lies"),
];

fn one() -> f64 {
    1.0
}

impl Grid {
    /// The file of the samples.
    pub(crate) fn file(&self) -> &Path {
        &self.file
    }

    /// Reads the density, or the first array of `names` that the same file has.
    pub(crate) fn density(&self, names: &[&str], report: &Report) -> Outcome<Described> {
        let Self { file, scale, .. } = self;
        let (size, spacing) = match (self.size, self.spacing) {
            (Some(_), Some(_)) if !names.is_empty() => {
                return Err(read::absent(names, "a raw file has one grid, without a name").into());
            }
            (Some(size), Some(spacing)) if self.array.is_none() => (size, spacing),
            (None, None) if self.sample.is_none() && self.origin.is_none() => {
                // The scale is that of the density alone.
                let scale = if names.is_empty() { *scale } else { 1.0 };
                let of_density = self.array.as_deref();
                let names = if names.is_empty() { of_density.as_slice() } else { names };
                return Ok(read::described_density(file, names, scale, report.progress())?);
            }
            _ => {
                let what = "[grid] is neither that of a raw file nor that of an OpenDX, OpenVDB or VTK file";
                let hint = "a raw file needs size and spacing and has no array; others say size, sample, spacing and origin themselves";
                return Err(Error::format(file, "", what, hint).into());
            }
        };
        let raw = RawGrid {
            size,
            sample: Sample::named(self.sample.as_deref().unwrap_or("u16"))?,
            scale: *scale,
            origin: DVec3::from(self.origin.unwrap_or_default()).as_vec3(),
            spacing: spacing as f32,
        };
        let grid = read::density(file, &raw, report.progress())?;
        Ok(Described { grid, name: String::new(), conventions: Vec::new() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_keys_are_those_that_are_told() {
        let full = "file = 'a'\nscale = 2.0\narray = 'b'\nsize = [1, 2, 3]\nsample = 'u16'\nspacing = 0.5\norigin = [0, 1, 2]\n";
        let grid: Grid = toml::from_str(full).unwrap();
        let written = toml::Value::try_from(&grid).unwrap();
        let mut told = KEYS.map(|(name, ..)| name);
        told.sort_unstable();
        assert!(written.as_table().unwrap().keys().eq(told));
        let again: Grid = written.try_into().unwrap();
        assert_eq!(again, grid);
    }
}
