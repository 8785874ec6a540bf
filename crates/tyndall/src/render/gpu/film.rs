//! The samples of a picture on the card: what they met in the band that is worked on, and the sums that are read back.

use std::ops::Range;

use super::Kernels;
use super::device::Gpu;
use super::layout::{HitRecord, NONE, Pass};
use super::resident::Resident;
use super::shader::MOST_ASIDE;
use crate::error::Result;
use crate::film::Image;
use crate::render::sampling::{PATTERN, Samples};
use crate::render::shade::mean_of;
use crate::scene::Scene;

/// Samples of a pattern, whatever their number a pixel: as many as a tile of the CPU has, so that both machines round the places of
/// their samples alike.
const PATTERN_SAMPLES: u32 = 1024;
/// Bytes of a hit.
const HIT_BYTES: u64 = size_of::<HitRecord>() as u64;

/// Pixels along the edge of the pattern.
pub(super) fn pattern_px(samples: u32) -> u32 {
    (PATTERN_SAMPLES / samples).isqrt()
}

/// See the module.
pub(super) struct Film {
    width: u32,
    height: u32,
    pass: wgpu::Buffer,
    samples: wgpu::Buffer,
    /// Of the band that is worked on, and the kernels' bindings.
    hits: Option<(wgpu::Buffer, wgpu::BindGroup)>,
    /// Tiles of the band that the second walk goes on with, for each walk's bindings.
    aside: wgpu::Buffer,
    aside_groups: [wgpu::BindGroup; 2],
    sum: wgpu::Buffer,
    nearest: wgpu::Buffer,
}

impl Film {
    /// Without samples.
    pub(super) fn new(gpu: &Gpu, resident: &Resident, [width, height]: [u32; 2]) -> Result<Self> {
        let pixels = u64::from(width) * u64::from(height);
        if 16 * pixels > gpu.binding_bytes() {
            return Err(gpu.too_small("the picture", 24 * pixels));
        }
        let storage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC;
        let written = wgpu::BufferUsages::COPY_DST;
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::INDIRECT | written;
        let aside = gpu.buffer("tiles laid aside", 4 * (4 + u64::from(MOST_ASIDE)), usage)?;
        let aside_groups = resident.aside_bindings().each_ref().map(|layout| gpu.bind(layout, &[&aside]));
        Ok(Self {
            aside,
            aside_groups,
            width,
            height,
            pass: gpu.buffer("pass", size_of::<Pass>() as u64, wgpu::BufferUsages::UNIFORM | written)?,
            samples: gpu.buffer(
                "samples",
                8 * u64::from(PATTERN_SAMPLES),
                wgpu::BufferUsages::STORAGE | written,
            )?,
            hits: None,
            sum: gpu.buffer("film", 16 * pixels, storage)?,
            nearest: gpu.buffer("film", HIT_BYTES * pixels, storage)?,
        })
    }

    /// Says where the samples of a pass lie.
    pub(super) fn set_samples(&self, gpu: &Gpu, added: &Samples) {
        let edge = pattern_px(added.count);
        let mut points: Vec<[f32; 2]> = Vec::with_capacity(PATTERN_SAMPLES as usize);
        for (row, column) in (0..edge).flat_map(|row| (0..edge).map(move |column| (row, column))) {
            let place = row as usize % PATTERN * PATTERN + column as usize % PATTERN;
            for sample in 0..added.count {
                let [x, y] = added.offset(place, sample);
                points.push([column as f32 + x, row as f32 + y]);
            }
        }
        gpu.write(&self.samples, 0, bytemuck::cast_slice(&points));
    }

    /// Says what the next band's kernels have in common.
    pub(super) fn set_pass(&self, gpu: &Gpu, pass: &Pass) {
        gpu.write(&self.pass, 0, bytemuck::bytes_of(pass));
    }

    /// Tiles that the first walk has laid aside.
    pub(super) fn aside(&self) -> &wgpu::Buffer {
        &self.aside
    }

    /// How many rows a band can have at most. Fails with [`Error::Memory`] if the card has no room for the hits of the fewest.
    pub(super) fn band_rows(&self, gpu: &Gpu, samples: u32) -> Result<u32> {
        let row_bytes = HIT_BYTES * u64::from(self.width) * u64::from(samples);
        let most = (gpu.binding_bytes() / row_bytes).min(u64::from(self.height));
        let whole = u32::try_from(most).unwrap_or(u32::MAX);
        match whole {
            rows if rows >= self.height => Ok(self.height),
            rows if rows >= super::BAND_ROWS => Ok(rows / super::BAND_ROWS * super::BAND_ROWS),
            _ => Err(gpu.too_small("a row of the picture", row_bytes * u64::from(super::BAND_ROWS))),
        }
    }

    /// The kernels' bindings, with room for the hits of a band.
    fn bind(&mut self, gpu: &Gpu, resident: &Resident, samples: u32, rows: u32) -> Result<wgpu::BindGroup> {
        let bytes = HIT_BYTES * u64::from(self.width) * u64::from(rows) * u64::from(samples);
        match &self.hits {
            Some((hits, group)) if hits.size() >= bytes => Ok(group.clone()),
            _ => {
                let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC;
                let hits = gpu.buffer("hits", bytes, usage)?;
                let buffers = [&self.pass, &self.samples, &hits, &self.sum, &self.nearest];
                let group = gpu.bind(resident.pass_bindings(), &buffers);
                self.hits = Some((hits, group.clone()));
                Ok(group)
            }
        }
    }

    /// Submits the kernels for a band of so many rows: first what the samples meet, then their light.
    pub(super) fn submit_band(
        &mut self,
        gpu: &Gpu,
        resident: &Resident,
        kernels: &Kernels,
        rows: u32,
        timer: Option<&Timer>,
    ) -> Result<wgpu::SubmissionIndex> {
        let group = self.bind(gpu, resident, kernels.samples, rows)?;
        let parts = kernels.tilings.parts();
        // What a dispatch of the second walk reads: workgroups across, which the first walk counts, down and deep.
        gpu.write(&self.aside, 0, bytemuck::bytes_of(&[0, parts[0] * parts[1], 1_u32]));
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let tile = kernels.tilings.first.tile;
        {
            let mut pass = begin(&mut encoder, timer, 0);
            pass.set_bind_group(0, &group, &[]);
            pass.set_bind_group(1, resident.group(), &[]);
            pass.set_bind_group(2, kernels.beside.as_ref().unwrap_or(&self.aside_groups[0]), &[]);
            pass.set_pipeline(&kernels.find_hits);
            // A tile has all its samples; of single rays a thread has one.
            let samples = if resident.shape().walked.has_tiles() { 1 } else { kernels.samples };
            pass.dispatch_workgroups(self.width.div_ceil(tile[0]), rows.div_ceil(tile[1]), samples);
            if let Some(go_on) = &kernels.go_on {
                pass.set_bind_group(2, &self.aside_groups[1], &[]);
                pass.set_pipeline(go_on);
                pass.dispatch_workgroups_indirect(&self.aside, 0);
            }
        }
        if let Some(shade) = &kernels.shade {
            let mut pass = begin(&mut encoder, timer, 1);
            pass.set_bind_group(0, &group, &[]);
            pass.set_bind_group(1, resident.group(), &[]);
            pass.set_pipeline(shade);
            pass.dispatch_workgroups(self.width.div_ceil(8), rows.div_ceil(8), 1);
        }
        if let Some(timer) = timer {
            timer.resolve(&mut encoder);
        }
        Ok(gpu.submit(encoder))
    }

    /// Waits, and draws the mean of `samples` samples a pixel over `image`, in those rows, over the scene's background. Without samples
    /// they stay as they are.
    pub(super) fn draw_over(
        &self,
        gpu: &Gpu,
        scene: &Scene,
        rows: Range<u32>,
        samples: u32,
        image: &mut Image,
    ) -> Result<()> {
        if samples == 0 || rows.is_empty() {
            return Ok(());
        }
        let mean = mean_of(samples, scene.background);
        let pixels = [rows.start, rows.end].map(|row| u64::from(row) * u64::from(self.width));
        let bytes = |size: u64| size * pixels[0]..size * pixels[1];
        let drawn = pixels[0] as usize..pixels[1] as usize;
        let colors = &mut image.color[drawn.clone()];
        gpu.read(&self.sum, bytes(16), |sums: &[[f32; 4]]| {
            colors.iter_mut().zip(sums).for_each(|(color, &sum)| *color = mean(sum));
        })?;
        let drawn = image.depth[drawn.clone()].iter_mut().zip(&mut image.id[drawn]);
        gpu.read(&self.nearest, bytes(HIT_BYTES), |hits: &[HitRecord]| {
            // Neighboring pixels often show the same particle.
            let mut last = (NONE, -1);
            for ((depth, id), hit) in drawn.zip(hits) {
                if hit.node != NONE && hit.node != last.0 {
                    last = (hit.node, scene.structure().place(hit.node) as i64);
                }
                (*depth, *id) = if hit.node == NONE { (f32::INFINITY, -1) } else { (hit.depth, last.1) };
            }
        })
    }

    /// Waits, and gives what the last band has written for its samples.
    pub(super) fn read_hits(&self, gpu: &Gpu, take: impl FnOnce(&[HitRecord])) -> Result<()> {
        match &self.hits {
            Some((hits, _)) => gpu.read(hits, 0..hits.size(), take),
            None => Ok(()),
        }
    }

    /// What the sample nearest the center of pixel (x, y) met.
    pub(super) fn nearest(&self, gpu: &Gpu, x: u32, y: u32) -> Result<HitRecord> {
        let at = HIT_BYTES * (u64::from(y) * u64::from(self.width) + u64::from(x));
        gpu.read(&self.nearest, at..at + HIT_BYTES, |hits: &[HitRecord]| hits[0])
    }
}

/// A pass of kernels, timed as step `step`.
fn begin<'a>(
    encoder: &'a mut wgpu::CommandEncoder,
    timer: Option<&'a Timer>,
    step: u32,
) -> wgpu::ComputePass<'a> {
    let timestamp_writes = timer.map(|timer| timer.writes(step));
    encoder.begin_compute_pass(&wgpu::ComputePassDescriptor { label: None, timestamp_writes })
}

/// The card's own clock around the two kernels of a band.
pub(super) struct Timer {
    queries: wgpu::QuerySet,
    ticks: wgpu::Buffer,
}

impl Timer {
    /// None if the card does not tell.
    pub(super) fn new(gpu: &Gpu) -> Result<Option<Self>> {
        if !gpu.is_timed() {
            return Ok(None);
        }
        let descriptor = wgpu::QuerySetDescriptor { label: None, ty: wgpu::QueryType::Timestamp, count: 4 };
        let queries = gpu.device.create_query_set(&descriptor);
        let usage = wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC;
        Ok(Some(Self { queries, ticks: gpu.buffer("ticks", 32, usage)? }))
    }

    fn writes(&self, step: u32) -> wgpu::ComputePassTimestampWrites<'_> {
        wgpu::ComputePassTimestampWrites {
            query_set: &self.queries,
            beginning_of_pass_write_index: Some(2 * step),
            end_of_pass_write_index: Some(2 * step + 1),
        }
    }

    fn resolve(&self, encoder: &mut wgpu::CommandEncoder) {
        encoder.resolve_query_set(&self.queries, 0..4, &self.ticks, 0);
    }

    /// Waits, and gives the seconds of both kernels.
    pub(super) fn secs(&self, gpu: &Gpu) -> Result<[f64; 2]> {
        let ticks = gpu.read(&self.ticks, 0..32, |ticks: &[u64]| [ticks[0], ticks[1], ticks[2], ticks[3]])?;
        Ok([0, 2].map(|at| ticks[at + 1].saturating_sub(ticks[at]) as f64 * gpu.tick_secs()))
    }
}
