//! The pages of a column of Parquet, one after the other, unpacked.
//!
//! The decoder of the values trusts how many there are and how large a page is; here both are checked first: a page becomes no larger than
//! its packed bytes could, and no column has more values than its metadata say. Source: Apache Parquet, `parquet.thrift` and
//! "Compression".

use std::io::Read;

use bytes::Bytes;
use parquet::basic::{CompressionCodec as Codec, Encoding};
use parquet::column::page::{Page, PageMetadata, PageReader};
use parquet::errors::{ParquetError, Result};

use super::MOST_RATIO;
use super::thrift::{Kind, Reader};

/// What a page's header says.
#[derive(Clone, Copy, Debug, Default)]
struct Header {
    kind: i64,
    packed: usize,
    unpacked: usize,
    values: u32,
    encoding: i64,
    definition_encoding: i64,
    repetition_encoding: i64,
    nulls: u32,
    rows: u32,
    definition_bytes: u32,
    repetition_bytes: u32,
    is_packed: bool,
    is_sorted: bool,
}

const DATA: i64 = 0;
const INDEX: i64 = 1;
const DICTIONARY: i64 = 2;
const DATA_2: i64 = 3;

/// The pages of a column of a row group.
pub(super) struct Pages {
    bytes: Bytes,
    place: usize,
    compression: Codec,
    /// How many values there still may be.
    left: u64,
}

fn fault(what: impl Into<String>) -> ParquetError {
    ParquetError::General(what.into())
}

impl Pages {
    /// Over the bytes of the column, with so many values.
    pub(super) fn new(bytes: Bytes, compression: Codec, values: u64) -> Self {
        Self { bytes, place: 0, compression, left: values }
    }

    /// The next header, and where its page begins; `None` at the end.
    fn header(&self) -> Result<Option<(Header, usize)>> {
        let rest = &self.bytes[self.place..];
        if rest.is_empty() {
            return Ok(None);
        }
        let mut reader = Reader::new(rest);
        let header = header(&mut reader).ok_or_else(|| fault("a page's header cannot be understood"))?;
        let begin = self.place + reader.place;
        if header.packed > self.bytes.len() - begin {
            return Err(fault("a page is larger than its column"));
        }
        if header.unpacked > header.packed.saturating_mul(MOST_RATIO).saturating_add(64) {
            return Err(fault("a page claims to be larger than its packed bytes can become"));
        }
        Ok(Some((header, begin)))
    }

    fn page(&mut self, header: &Header, body: Bytes) -> Result<Page> {
        let levels = match header.kind {
            DATA_2 => header.definition_bytes as usize + header.repetition_bytes as usize,
            _ => 0,
        };
        let is_packed = self.compression != Codec::UNCOMPRESSED && header.is_packed;
        let buf = match is_packed {
            false => body,
            true => {
                let (front, packed) =
                    body.split_at_checked(levels).ok_or_else(|| fault("a page is too small"))?;
                let size = header.unpacked.checked_sub(levels).ok_or_else(|| fault("a page is too small"))?;
                let mut all = front.to_vec();
                if size > 0 {
                    all.extend(unpacked(self.compression, packed, size)?);
                }
                all.into()
            }
        };
        if levels > buf.len() {
            return Err(fault("a page is too small"));
        }
        let encoding = encoding(header.encoding)?;
        if header.kind == DICTIONARY {
            // Words have a length of four bytes, numbers as much; only truth values are smaller, and have no dictionaries.
            if header.values as usize > buf.len() {
                return Err(fault("a dictionary has more entries than bytes"));
            }
            return Ok(Page::DictionaryPage {
                buf,
                num_values: header.values,
                encoding,
                is_sorted: header.is_sorted,
            });
        }
        self.left = self
            .left
            .checked_sub(header.values.into())
            .ok_or_else(|| fault("the pages have more values than the column"))?;
        if header.kind == DATA {
            return Ok(Page::DataPage {
                buf,
                num_values: header.values,
                encoding,
                def_level_encoding: self::encoding(header.definition_encoding)?,
                rep_level_encoding: self::encoding(header.repetition_encoding)?,
                statistics: None,
            });
        }
        Ok(Page::DataPageV2 {
            buf,
            num_values: header.values,
            encoding,
            num_nulls: header.nulls,
            num_rows: header.rows,
            def_levels_byte_len: header.definition_bytes,
            rep_levels_byte_len: header.repetition_bytes,
            is_compressed: false,
            statistics: None,
        })
    }
}

impl PageReader for Pages {
    fn get_next_page(&mut self) -> Result<Option<Page>> {
        while let Some((header, begin)) = self.header()? {
            let body = self.bytes.slice(begin..begin + header.packed);
            self.place = begin + header.packed;
            if header.kind != INDEX {
                return self.page(&header, body).map(Some);
            }
        }
        Ok(None)
    }

    fn peek_next_page(&mut self) -> Result<Option<PageMetadata>> {
        while let Some((header, begin)) = self.header()? {
            if header.kind != INDEX {
                return Ok(Some(PageMetadata {
                    num_rows: (header.kind == DATA_2).then_some(header.rows as usize),
                    num_levels: Some(header.values as usize),
                    is_dict: header.kind == DICTIONARY,
                }));
            }
            self.place = begin + header.packed;
        }
        Ok(None)
    }

    fn skip_next_page(&mut self) -> Result<()> {
        if let Some((header, begin)) = self.header()? {
            self.place = begin + header.packed;
        }
        Ok(())
    }
}

impl Iterator for Pages {
    type Item = Result<Page>;

    fn next(&mut self) -> Option<Self::Item> {
        self.get_next_page().transpose()
    }
}

fn header(reader: &mut Reader) -> Option<Header> {
    let mut header = Header { kind: -1, is_packed: true, ..Header::default() };
    let (mut packed, mut unpacked) = (-1, -1);
    reader.fields(|reader, number, kind| {
        match (number, kind) {
            (1, Kind::Integer) => header.kind = reader.integer()?,
            (2, Kind::Integer) => unpacked = reader.integer()?,
            (3, Kind::Integer) => packed = reader.integer()?,
            (5 | 7 | 8, Kind::Struct) => of_kind(reader, number, &mut header)?,
            _ => return Some(false),
        }
        Some(true)
    })?;
    header.packed = usize::try_from(packed).ok()?;
    header.unpacked = usize::try_from(unpacked).ok()?;
    (DATA..=DATA_2).contains(&header.kind).then_some(header)
}

/// The fields of a page of data (5), a dictionary (7) or a page of data of the second version (8).
fn of_kind(reader: &mut Reader, page: i64, header: &mut Header) -> Option<()> {
    reader.fields(|reader, number, kind| {
        match kind {
            Kind::True | Kind::False => match (page, number) {
                (7, 3) => header.is_sorted = kind == Kind::True,
                (8, 7) => header.is_packed = kind == Kind::True,
                _ => {}
            },
            Kind::Integer => {
                let value = reader.integer()?;
                let count = u32::try_from(value);
                match (page, number) {
                    (_, 1) => header.values = count.ok()?,
                    (5 | 7, 2) | (8, 4) => header.encoding = value,
                    (5, 3) => header.definition_encoding = value,
                    (5, 4) => header.repetition_encoding = value,
                    (8, 2) => header.nulls = count.ok()?,
                    (8, 3) => header.rows = count.ok()?,
                    (8, 5) => header.definition_bytes = count.ok().filter(|it| *it < 1 << 30)?,
                    (8, 6) => header.repetition_bytes = count.ok().filter(|it| *it < 1 << 30)?,
                    _ => {}
                }
            }
            _ => return Some(false),
        }
        Some(true)
    })
}

fn encoding(code: i64) -> Result<Encoding> {
    Ok(match code {
        0 => Encoding::PLAIN,
        2 => Encoding::PLAIN_DICTIONARY,
        3 => Encoding::RLE,
        5 => Encoding::DELTA_BINARY_PACKED,
        6 => Encoding::DELTA_LENGTH_BYTE_ARRAY,
        7 => Encoding::DELTA_BYTE_ARRAY,
        8 => Encoding::RLE_DICTIONARY,
        9 => Encoding::BYTE_STREAM_SPLIT,
        _ => return Err(fault(format!("an encoding is not known: {code}"))),
    })
}

/// `size` bytes, unpacked.
fn unpacked(compression: Codec, packed: &[u8], size: usize) -> Result<Vec<u8>> {
    let damaged = |error: &dyn std::fmt::Display| fault(format!("a page cannot be unpacked: {error}"));
    let raw = |packed: &[u8], size: usize| {
        let mut all = vec![0; size];
        let count = lz4_flex::block::decompress_into(packed, &mut all).map_err(|error| damaged(&error))?;
        all.truncate(count);
        Ok::<_, ParquetError>(all)
    };
    let all = match compression {
        Codec::SNAPPY => {
            let mut all = vec![0; size];
            let count =
                snap::raw::Decoder::new().decompress(packed, &mut all).map_err(|error| damaged(&error))?;
            all.truncate(count);
            all
        }
        Codec::GZIP => drained(flate2::read::MultiGzDecoder::new(packed), size)?,
        Codec::LZ4_RAW => raw(packed, size)?,
        // Of Hadoop: blocks with their sizes in front. Some writers leave these out.
        Codec::LZ4 => match hadoop(packed, size) {
            Some(blocks) => {
                blocks.into_iter().map(|(block, size)| raw(block, size)).collect::<Result<Vec<_>>>()?.concat()
            }
            None => raw(packed, size)?,
        },
        Codec::ZSTD => {
            let decoder = ruzstd::decoding::StreamingDecoder::new(packed).map_err(|error| damaged(&error))?;
            drained(decoder, size)?
        }
        other => {
            let name = other.to_string();
            let name = name.split('(').next().unwrap_or_default();
            return Err(fault(format!(
                "its pages are packed with {name}: write it with zstd, snappy, gzip or lz4"
            )));
        }
    };
    match all.len() == size {
        true => Ok(all),
        false => Err(fault(format!("a page has {} bytes, {size} were promised", all.len()))),
    }
}

fn drained(stream: impl Read, size: usize) -> Result<Vec<u8>> {
    let mut all = Vec::new();
    stream
        .take(size as u64 + 1)
        .read_to_end(&mut all)
        .map_err(|error| fault(format!("a page cannot be unpacked: {error}")))?;
    Ok(all)
}

/// Blocks of LZ4, each behind its size unpacked and packed; `None` if they do not fill the bytes.
fn hadoop(mut packed: &[u8], mut size: usize) -> Option<Vec<(&[u8], usize)>> {
    let mut blocks = Vec::new();
    while !packed.is_empty() {
        let (sizes, rest) = packed.split_first_chunk::<8>()?;
        let number = |at: usize| u32::from_be_bytes(std::array::from_fn(|byte| sizes[at + byte])) as usize;
        let (block, rest) = rest.split_at_checked(number(4))?;
        size = size.checked_sub(number(0))?;
        blocks.push((block, number(0)));
        packed = rest;
    }
    (size == 0).then_some(blocks)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_of_hadoop_have_their_sizes_in_front() {
        let content: Vec<u8> = (0..600u32).map(|it| (it / 7) as u8).collect();
        let block = |bytes: &[u8]| {
            let packed = lz4_flex::block::compress(bytes);
            let sizes = [bytes.len(), packed.len()].map(|it| (it as u32).to_be_bytes());
            [sizes.concat(), packed].concat()
        };
        let blocks = [block(&content[..400]), block(&content[400..])].concat();
        assert_eq!(unpacked(Codec::LZ4, &blocks, 600).unwrap(), content);
        assert_eq!(unpacked(Codec::LZ4, &lz4_flex::block::compress(&content), 600).unwrap(), content);
        assert!(unpacked(Codec::LZ4, &blocks[..blocks.len() - 1], 600).is_err());
        assert!(unpacked(Codec::LZ4, &blocks, 601).is_err());
    }

    #[test]
    fn a_page_is_no_larger_than_its_bytes_can_become() {
        // A page of data of 1 << 30 bytes, unpacked, with one value, in five bytes.
        let header = [
            0x15, 0, 0x15, 0x80, 0x80, 0x80, 0x80, 8, 0x15, 10, 0x2c, 0x15, 2, 0x15, 0, 0x15, 6, 0x15, 6, 0,
            0,
        ];
        let pages = |left: u64, header: &[u8]| {
            let bytes = Bytes::from([header, &[1, 2, 3, 4, 5]].concat());
            Pages::new(bytes, Codec::UNCOMPRESSED, left).get_next_page()
        };
        assert!(pages(1, &header).unwrap_err().to_string().contains("larger than its packed bytes"));
        let mut fits = header.to_vec();
        fits.splice(3..8, [10]);
        assert!(matches!(pages(1, &fits), Ok(Some(Page::DataPage { num_values: 1, .. }))));
        assert!(pages(0, &fits).unwrap_err().to_string().contains("more values than the column"));
        for length in 1..fits.len() {
            assert!(
                Pages::new(Bytes::copy_from_slice(&fits[..length]), Codec::SNAPPY, 9)
                    .get_next_page()
                    .is_err()
            );
        }
    }
}
