//! Attributes of HDF5 groups and data sets, and the types of numbers: both in the words of the reader's crate.

use hdf5_reader::messages::datatype::{Datatype, ReferenceType};
use hdf5_reader::{Attribute, ByteOrder};

use crate::read::numbers::{Kind, Order};
use crate::read::records::Source;

/// The attributes of a group or data set.
pub(super) struct Attributes(pub(super) Vec<Attribute>);

impl Attributes {
    fn find(&self, name: &str) -> Option<&Attribute> {
        self.0.iter().find(|it| it.name == name)
    }

    /// Whether there is an attribute of that name.
    pub(super) fn has(&self, name: &str) -> bool {
        self.find(name).is_some()
    }

    /// The numbers of an attribute; none if there is no such attribute, or if it has no numbers.
    pub(super) fn numbers(&self, name: &str) -> Vec<f64> {
        let Some(attribute) = self.find(name) else { return Vec::new() };
        let Some((kind, order)) = number_kind(&attribute.datatype) else { return Vec::new() };
        let count = attribute.num_elements().unwrap_or(0) as usize;
        if count == 0 || attribute.raw_data.len() / kind.size() < count {
            return Vec::new();
        }
        let bytes = &attribute.raw_data;
        let source = Source { bytes, kind, order, start: 0, stride: kind.size(), step: 0 };
        (0..count).map(|place| source.number(place)).collect()
    }

    /// The first number of an attribute.
    pub(super) fn number(&self, name: &str) -> Option<f64> {
        self.numbers(name).first().copied()
    }

    /// The words of an attribute; none if there is no such attribute, or if it has no words.
    pub(super) fn texts(&self, name: &str) -> Vec<String> {
        let Some(attribute) = self.find(name) else { return Vec::new() };
        let texts = attribute.read_strings().or_else(|_| attribute.read_string().map(|it| vec![it]));
        texts.unwrap_or_default().iter().map(|it| it.trim_matches(['\0', ' ', '\n']).to_string()).collect()
    }

    /// The address of the group or data set to which an attribute refers.
    pub(super) fn reference(&self, name: &str) -> Option<u64> {
        let attribute = self.find(name)?;
        let is_object =
            matches!(attribute.datatype, Datatype::Reference { ref_type: ReferenceType::Object, size: 8 });
        let bytes = attribute.raw_data.first_chunk::<8>().filter(|_| is_object)?;
        Some(u64::from_le_bytes(*bytes))
    }

    /// The first word of an attribute.
    pub(super) fn text(&self, name: &str) -> Option<String> {
        self.texts(name).into_iter().next()
    }
}

/// The kind of the numbers of a type, and their order of bytes. Truth values and other enumerations are the numbers they stand for.
pub(super) fn number_kind(datatype: &Datatype) -> Option<(Kind, Order)> {
    let order = |order: &ByteOrder| match order {
        ByteOrder::LittleEndian => Order::Little,
        ByteOrder::BigEndian => Order::Big,
    };
    match datatype {
        Datatype::FixedPoint { size, signed, byte_order } => {
            let kind = match (size, signed) {
                (1, true) => Kind::I8,
                (1, false) => Kind::U8,
                (2, true) => Kind::I16,
                (2, false) => Kind::U16,
                (4, true) => Kind::I32,
                (4, false) => Kind::U32,
                (8, true) => Kind::I64,
                (8, false) => Kind::U64,
                _ => return None,
            };
            Some((kind, order(byte_order)))
        }
        Datatype::FloatingPoint { size, byte_order } => {
            let kind = match size {
                2 => Kind::F16,
                4 => Kind::F32,
                8 => Kind::F64,
                _ => return None,
            };
            Some((kind, order(byte_order)))
        }
        Datatype::Enum { base, .. } => number_kind(base),
        _ => None,
    }
}
