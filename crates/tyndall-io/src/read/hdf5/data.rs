//! A data set of an HDF5 file: what it is, and the few numbers and words of a small one.

use std::path::PathBuf;

use hdf5_reader::Dataset;
use hdf5_reader::error::Error as ReadError;
use hdf5_reader::messages::datatype::{CompoundField, Datatype};
use tyndall::{Error, Result};

use super::attributes::{Attributes, number_kind};
use super::chunks::Chunks;
use super::forms::Form;
use super::rows::{MOST_WIDTH, NATIVE, Native};
use super::tree::{fault, most_bytes};
use crate::read::numbers::{Kind, Order};
use crate::read::records::Source;

/// A data set.
pub(super) struct Data {
    pub(super) dataset: Dataset,
    /// Its chunks, if they are unpacked here.
    pub(super) chunks: Option<Chunks>,
    pub(super) path: String,
    pub(super) file: PathBuf,
    /// Bytes of the file and of those that links led to.
    pub(super) file_bytes: u64,
}

impl Data {
    /// Its path in the file.
    pub(super) fn path(&self) -> &str {
        &self.path
    }

    /// Its extent.
    pub(super) fn shape(&self) -> &[u64] {
        self.dataset.shape()
    }

    /// Whether it has numbers.
    pub(super) fn is_number(&self) -> bool {
        number_kind(self.dataset.dtype()).is_some()
    }

    /// The names of the members of its rows, if these are records.
    pub(super) fn member_names(&self) -> Vec<String> {
        match self.dataset.dtype() {
            Datatype::Compound { fields, .. } => fields.iter().map(|it| it.name.clone()).collect(),
            _ => Vec::new(),
        }
    }

    /// The members of its rows that are numbers, or arrays of some; none if its rows are no records.
    pub(super) fn members(&self) -> Vec<Member> {
        let Datatype::Compound { size, fields } = self.dataset.dtype() else { return Vec::new() };
        let member = |field: &CompoundField| {
            let (datatype, width) = match &field.datatype {
                Datatype::Array { base, dims } => {
                    (&**base, dims.iter().try_fold(1u64, |width, &it| width.checked_mul(it))?)
                }
                scalar => (scalar, 1),
            };
            let (kind, order) = number_kind(datatype).filter(|_| (1..=MOST_WIDTH).contains(&width))?;
            let (offset, width) = (field.byte_offset as usize, width as usize);
            let fits = offset + width * kind.size() <= *size as usize;
            fits.then(|| Member { name: field.name.clone(), kind, order, offset, width })
        };
        fields.iter().filter_map(member).collect()
    }

    /// The bytes of all its rows, as they are stored, and those of one, which are not none. Fails if the file cannot hold them.
    pub(super) fn records(&self) -> Result<(Vec<u8>, usize)> {
        let failed = |error: ReadError| fault(&self.file, &self.path, &error);
        let row = self.dataset.raw_element_size().map_err(failed)?;
        let bytes = self.dataset.raw_byte_len().map_err(failed)?;
        if row == 0 || bytes as u64 > most_bytes(self.file_bytes) {
            let what = format!("{bytes} bytes are more than a file of {} bytes can hold", self.file_bytes);
            return Err(Error::format(&self.file, &self.path, what, "was the file copied to its end?"));
        }
        Ok((self.dataset.read_raw_bytes().map_err(failed)?, row))
    }

    /// Where in their bytes its numbers are, if they are no machine's own.
    pub(super) fn form(&self) -> Option<Form> {
        Form::of(&self.dataset.raw_datatype().ok()?)
    }

    /// Bytes of the file and of those that links led to: more rows than these they cannot hold.
    pub(super) fn file_bytes(&self) -> u64 {
        self.file_bytes
    }

    /// Its attributes.
    pub(super) fn attributes(&self) -> Attributes {
        Attributes(self.dataset.attributes())
    }

    /// The number of places to which nothing was written, if the file says one.
    pub(super) fn fill(&self) -> Option<f64> {
        let (kind, order) = number_kind(self.dataset.dtype()).filter(|_| self.form().is_none())?;
        let bytes = self.dataset.fill_value()?.value.as_deref().filter(|it| it.len() == kind.size())?;
        Some(Source { bytes, kind, order, start: 0, stride: 0, step: 0 }.number(0))
    }

    /// The words that the numbers of an enumeration stand for, by number; none if it is no enumeration of words.
    pub(super) fn words(&self) -> Vec<(i64, String)> {
        let Datatype::Enum { base, members } = self.dataset.dtype() else { return Vec::new() };
        let Some((kind, order)) = number_kind(base) else { return Vec::new() };
        let fits = members.iter().filter(|it| it.value.len() == kind.size());
        fits.map(|member| {
            let bytes = &member.value;
            let source = Source { bytes, kind, order, start: 0, stride: 0, step: 0 };
            (source.number(0) as i64, member.name.clone())
        })
        .collect()
    }

    /// All its words, for a small data set of words; none if it has others.
    pub(super) fn texts(&self) -> Vec<String> {
        let small = self.dataset.num_elements().is_ok_and(|count| count <= 64);
        let texts = if small { self.dataset.read_strings().unwrap_or_default() } else { Vec::new() };
        texts.iter().map(|it| it.trim_matches(['\0', ' ']).to_string()).collect()
    }

    /// Its number, if it is a single one.
    pub(super) fn number(&self) -> Result<Option<f64>> {
        let Some((kind, _)) = number_kind(self.dataset.dtype()) else { return Ok(None) };
        if self.dataset.num_elements().is_ok_and(|count| count > 64) {
            return Ok(None);
        }
        let bytes =
            self.dataset.read_native_bytes().map_err(|error| fault(&self.file, &self.path, &error))?;
        let (bytes, kind) = match self.form() {
            Some(form) => (form.apply(&bytes, kind.size()), form.kind(kind)),
            None => (Native::of(bytes), kind),
        };
        let source = Source { bytes: &bytes, kind, order: NATIVE, start: 0, stride: 0, step: 0 };
        Ok((bytes.len() >= kind.size()).then(|| source.number(0)))
    }
}

/// Numbers in rows that are records.
pub(super) struct Member {
    pub(super) name: String,
    pub(super) kind: Kind,
    pub(super) order: Order,
    /// Where in a row it begins.
    pub(super) offset: usize,
    /// How many numbers it has.
    pub(super) width: usize,
}
