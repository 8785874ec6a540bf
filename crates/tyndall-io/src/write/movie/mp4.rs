//! MP4 around H.264: pictures first, what describes them last.
//!
//! Sources: ISO/IEC 14496-12 (2022), sections 12.1.5 (`colr`) and 11.1 (`uuid`); 14496-15 (2022), section 5.3 (`avcC`).

use std::fs;
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::num::NonZeroU32;

use shiguredo_mp4::boxes::{Avc1Box, AvccBox, SampleEntry, UnknownBox, VisualSampleEntryFields};
use shiguredo_mp4::mux::{Mp4FileMuxer, Sample};
use shiguredo_mp4::{BoxSize, BoxType, TrackKind, Uint};

use super::{Frames, duration, h264};
use crate::xmp;

/// Units of time a second: those of 24, 25, 30 and 60 pictures a second, and of 29.97, are whole.
const TIMESCALE: NonZeroU32 = NonZeroU32::new(90_000).expect("not zero");
/// Colors as the encoder is given them: primaries and matrix of BT.709, brightness of sRGB, from 16 to 235.
const COLORS: [u8; 11] = [b'n', b'c', b'l', b'x', 0, 1, 0, 13, 0, 1, 0];

pub(super) struct File {
    file: BufWriter<fs::File>,
    muxer: Mp4FileMuxer,
    stream: h264::Stream,
    size: [u32; 2],
    rate: f64,
    count: u64,
}

impl File {
    pub(super) fn new(file: fs::File, size: [u32; 2], rate: f64) -> io::Result<Self> {
        let muxer = Mp4FileMuxer::new().map_err(io::Error::other)?;
        let mut file = BufWriter::new(file);
        file.write_all(muxer.initial_boxes_bytes())?;
        Ok(Self { file, muxer, stream: h264::Stream::new(size, rate)?, size, rate, count: 0 })
    }

    /// What a player must know before the first picture.
    fn entry(&self, coded: &h264::Coded) -> io::Result<SampleEntry> {
        let [_, profile, compatibility, level, ..] = coded.sequence[..] else {
            return Err(io::Error::other("H.264: the first picture came without its parameters"));
        };
        // Profiles beyond these say how colors are sampled: 4:2:0 in 8 bits.
        let is_high = !matches!(profile, 66 | 77 | 88);
        let avcc_box = AvccBox {
            avc_profile_indication: profile,
            profile_compatibility: compatibility,
            avc_level_indication: level,
            length_size_minus_one: Uint::new(3),
            sps_list: vec![coded.sequence.clone()],
            pps_list: vec![coded.picture.clone()],
            chroma_format: is_high.then(|| Uint::new(1)),
            bit_depth_luma_minus8: is_high.then(|| Uint::new(0)),
            bit_depth_chroma_minus8: is_high.then(|| Uint::new(0)),
            sps_ext_list: Vec::new(),
        };
        let colors = UnknownBox {
            box_type: BoxType::Normal(*b"colr"),
            box_size: BoxSize::U32(8 + COLORS.len() as u32),
            payload: COLORS.to_vec(),
        };
        let [width, height] = self.size.map(|it| it as u16);
        let visual = VisualSampleEntryFields {
            data_reference_index: VisualSampleEntryFields::DEFAULT_DATA_REFERENCE_INDEX,
            width,
            height,
            horizresolution: VisualSampleEntryFields::DEFAULT_HORIZRESOLUTION,
            vertresolution: VisualSampleEntryFields::DEFAULT_VERTRESOLUTION,
            frame_count: VisualSampleEntryFields::DEFAULT_FRAME_COUNT,
            compressorname: VisualSampleEntryFields::NULL_COMPRESSORNAME,
            depth: VisualSampleEntryFields::DEFAULT_DEPTH,
        };
        Ok(SampleEntry::Avc1(Avc1Box { visual, avcc_box, unknown_boxes: vec![colors] }))
    }
}

impl Frames for File {
    fn add(&mut self, pixels: &[u8]) -> io::Result<()> {
        let coded = self.stream.code(pixels)?;
        let sample = Sample {
            track_kind: TrackKind::Video,
            sample_entry: if self.count == 0 { Some(self.entry(&coded)?) } else { None },
            keyframe: coded.is_key,
            timescale: TIMESCALE,
            duration: duration(self.count, self.rate, TIMESCALE.get().into()) as u32,
            composition_time_offset: None,
            data_offset: self.file.stream_position()?,
            data_size: coded.units.len(),
        };
        self.file.write_all(&coded.units)?;
        self.count += 1;
        self.muxer.append_sample(&sample).map_err(io::Error::other)
    }

    fn finish(mut self: Box<Self>, metadata: &[(String, String)]) -> io::Result<()> {
        let boxes = self.muxer.finalize().map_err(io::Error::other)?;
        for (offset, bytes) in boxes.offset_and_bytes_pairs() {
            self.file.seek(SeekFrom::Start(offset))?;
            self.file.write_all(bytes)?;
        }
        self.file.seek(SeekFrom::End(0))?;
        append_metadata(&mut self.file, metadata)?;
        self.file.flush()
    }
}

/// Writes XMP where an MP4 ends.
pub(super) fn append_metadata(file: &mut impl Write, metadata: &[(String, String)]) -> io::Result<()> {
    let packet = xmp::packet(metadata);
    let size = 8 + xmp::UUID.len() + packet.len();
    file.write_all(&(size as u32).to_be_bytes())?;
    file.write_all(b"uuid")?;
    file.write_all(&xmp::UUID)?;
    file.write_all(packet.as_bytes())
}
