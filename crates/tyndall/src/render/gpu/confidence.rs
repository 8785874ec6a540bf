//! Culling by confidence on the card: what its pixels know, and the kernels that drive it. Twin of render/cpu/confidence.rs.
//!
//! The density grid is counted by the CPU, once a scene. A frame is a kernel with a thread a pixel, band by band; then the neighborhood's
//! kernels decide for all pixels. The histograms of a band's pixels stand in a buffer, so that a thread keeps nothing whose size depends on the
//! scene.

use std::sync::Arc;

use super::device::Gpu;
use super::layout::{self, Level};
use super::pages::Pages;
use super::resident::{Binding, Resident};
use super::shader::Sampling;
use crate::error::{Error, Result};
use crate::progress::Progress;
use crate::render::confidence::{
    Accumulator, DensityGrid, Interpolation, Neighborhood, Options, Population, Report,
};
use crate::render::sampling::Samples;

/// Most bytes of the histograms of a band, where a band need not have more rows.
const HISTOGRAM_BYTES: u64 = 256 << 20;
/// Storage buffers of a frame besides those of a pass, of the scene and of the grid: the record, pixels, pairs and histograms.
const FRAME_BUFFERS: u64 = 4;
/// Bindings before the grid's pages.
const FIRST_PAGE: usize = 4;
/// Pixels along the edge of a workgroup.
pub(super) const GROUP_EDGE: u32 = 8;

/// A density grid on the card.
pub(super) struct Grid {
    pub(super) voxel_count: u32,
    pages: Pages,
    /// What kernels read of it besides its counts; the rest is left empty.
    record: layout::Culling,
    bytes: u64,
}

impl Grid {
    /// Counts the particles and copies the counts. Fails with [`Error::Setting`] if there would be too many voxels, with
    /// [`Error::Memory`] if the card has no room for them.
    pub(super) fn new(
        gpu: &Gpu,
        grid: &DensityGrid,
        voxel_count: u32,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let pages = Pages::upload(gpu, "density grid", bytemuck::cast_slice(grid.counts()), progress)?;
        let bounds = grid.bounds();
        // The box of nothing has no finite corners; nor is anything met there.
        let corner = |corner: glam::Vec3| if bounds.is_empty() { [0.0; 3] } else { corner.to_array() };
        let [radius, radius_sq] = grid.mean_radius();
        let record = layout::Culling {
            low: corner(bounds.min),
            high: corner(bounds.max),
            unit: grid.unit(),
            radius,
            radius_sq,
            edge: grid.edge().to_array(),
            inv_edge: (1.0 / grid.edge()).to_array(),
            voxels: grid.voxels().map(|voxels| voxels as u32),
            ..bytemuck::Zeroable::zeroed()
        };
        Ok(Self { voxel_count, pages, record, bytes: grid.bytes() })
    }
}

/// A kernel of the neighborhood, with what it reads and writes.
struct Step {
    entry: &'static str,
    group: wgpu::BindGroup,
    /// Workgroups across and down.
    groups: [u32; 2],
}

/// See the module.
pub(super) struct Confidence {
    options: Options,
    size: [u32; 2],
    grid: Arc<Grid>,
    record: layout::Culling,
    record_buffer: wgpu::Buffer,
    pixels: wgpu::Buffer,
    /// Depth and confidence, by level of the pyramid.
    pairs: Vec<wgpu::Buffer>,
    /// How many pixels are final.
    converged: wgpu::Buffer,
    /// Of a frame's bindings behind those of the pass and of the scene.
    bindings: wgpu::BindGroupLayout,
    frame_layout: wgpu::PipelineLayout,
    /// With room for the histograms of so many pixels.
    frame: Option<(u32, wgpu::BindGroup)>,
    decide_layout: wgpu::PipelineLayout,
    steps: Vec<Step>,
}

impl Confidence {
    /// For pictures of `size` pixels, which know nothing yet. Fails with [`Error::Memory`] if they do not fit, with [`Error::Device`] if the
    /// card's kernels see too few buffers.
    pub(super) fn new(
        resident: &Resident,
        grid: Arc<Grid>,
        size: [u32; 2],
        options: Options,
    ) -> Result<Self> {
        let gpu = resident.gpu();
        let buffers = resident.buffers() + FRAME_BUFFERS + grid.pages.buffers.len() as u64;
        if buffers > gpu.storage_buffers() {
            let (name, most) = (&gpu.info().name, gpu.storage_buffers());
            let what = format!("{name} gives a kernel {most} buffers, culling by confidence needs {buffers}");
            return Err(Error::Device(format!("{what} — use --device cpu, or --culling certified")));
        }
        let accumulator = Accumulator::new(options.sample_budget, options.population);
        let (kernel, level) = match options.neighborhood {
            Neighborhood::Kernel(edge) => (edge, 0),
            Neighborhood::Pyramid(level) => (1, level),
        };
        let mut record = layout::Culling {
            convergence_samples: options.convergence_samples,
            sample_budget: options.sample_budget,
            occlusion_confidence: options.occlusion_confidence,
            depth_quantization: options.depth_quantization.into(),
            trilinear: (options.density_interpolation == Interpolation::Trilinear).into(),
            up_to_depth: (options.population == Population::UpToDepth).into(),
            kernel,
            level,
            is_new: 1,
            normal_limit: accumulator.integral().limit(),
            ..grid.record
        };
        let normal = record.normal.as_flattened_mut();
        normal.iter_mut().zip(accumulator.integral().values()).for_each(|(slot, &value)| *slot = value);

        let storage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC;
        let written = wgpu::BufferUsages::COPY_DST;
        let record_buffer = |bytes| gpu.buffer("culling", bytes, wgpu::BufferUsages::STORAGE | written);
        let pixel_count = u64::from(size[0]) * u64::from(size[1]);
        let pixel_bytes = size_of::<layout::Pixel>() as u64 * pixel_count;
        if pixel_bytes > gpu.binding_bytes() {
            return Err(gpu.too_small("what the picture's pixels know", pixel_bytes));
        }
        let pixels = gpu.buffer("what pixels know", pixel_bytes, storage)?;
        let sizes: Vec<[u32; 2]> =
            (0..=level).map(|level| size.map(|edge| edge.div_ceil(1 << level))).collect();
        let pairs = sizes
            .iter()
            .map(|[width, height]| {
                gpu.buffer("confidences", 8 * u64::from(*width) * u64::from(*height), storage)
            })
            .collect::<Result<Vec<_>>>()?;
        let converged = gpu.buffer("final pixels", 4, storage | written)?;
        let culling = record_buffer(size_of::<layout::Culling>() as u64)?;

        // One kernel for each level of the pyramid, and one that decides.
        let decide_bindings = gpu.layout(
            &[
                Binding::Read,
                Binding::Read,
                Binding::Read,
                Binding::Written,
                Binding::Written,
                Binding::Written,
            ],
            6,
        );
        // What `decide` has no use for, but the layout has.
        let nothing = gpu.buffer("nothing", 8, storage)?;
        let mut steps = Vec::new();
        for (at, from) in pairs.iter().enumerate() {
            let is_last = at + 1 == pairs.len();
            let to_size = if is_last { size } else { sizes[at + 1] };
            let level = record_buffer(size_of::<Level>() as u64)?;
            gpu.write(&level, 0, bytemuck::bytes_of(&Level { from_size: sizes[at], to_size }));
            let to = if is_last { &nothing } else { &pairs[at + 1] };
            let group = gpu.bind(&decide_bindings, &[&culling, &level, from, to, &pixels, &converged]);
            let entry = if is_last { "decide" } else { "halve" };
            steps.push(Step { entry, group, groups: to_size.map(|edge| edge.div_ceil(GROUP_EDGE)) });
        }

        let frame_bindings = [Binding::Read, Binding::Written, Binding::Written, Binding::Written];
        let bindings = gpu.layout(&frame_bindings, FIRST_PAGE + grid.pages.buffers.len());
        Ok(Self {
            frame_layout: resident.layout_with(&bindings),
            decide_layout: gpu.pipeline_layout(&[&decide_bindings]),
            options,
            size,
            grid,
            record,
            record_buffer: culling,
            pixels,
            pairs,
            converged,
            bindings,
            frame: None,
            steps,
        })
    }

    /// Samples a pixel and frame.
    pub(super) fn frame_samples(&self) -> u32 {
        self.options.frame_samples
    }

    /// Forgets what the pixels know, for another view.
    pub(super) fn restart(&mut self) {
        (self.record.is_new, self.record.convergence_samples) = (1, self.options.convergence_samples);
    }

    /// Takes the depths at which rays end for final.
    pub(super) fn settle(&mut self) {
        self.record.convergence_samples = 0;
    }

    /// The kernel that finds what the samples of a frame meet.
    pub(super) fn pipeline(
        &self,
        resident: &Resident,
        sampling: Sampling,
        progress: &dyn Progress,
    ) -> Result<wgpu::ComputePipeline> {
        let gpu = resident.gpu();
        // Both are made before the first frame waits for them.
        self.deciding("decide", gpu, progress)?;
        gpu.pipeline(self.text(resident, sampling), "find_hits", &self.frame_layout, progress)
    }

    /// The text of that kernel, with all formulas.
    pub(super) fn text(&self, resident: &Resident, sampling: Sampling) -> String {
        resident.shape().culled(sampling) + &self.grid.pages.declare("voxels", 2, FIRST_PAGE)
    }

    fn deciding(
        &self,
        entry: &'static str,
        gpu: &Gpu,
        progress: &dyn Progress,
    ) -> Result<wgpu::ComputePipeline> {
        gpu.pipeline(super::shader::neighborhood(), entry, &self.decide_layout, progress)
    }

    /// Entries of a pixel's histogram at most.
    fn entries(&self) -> u64 {
        // A slab more at either end, and one entry more than slabs.
        u64::from(self.record.voxels.into_iter().max().unwrap_or(0)) + 3
    }

    /// How many rows a band may have; `step` at least. Fails with [`Error::Memory`] if not even these fit.
    pub(super) fn band_rows(&self, gpu: &Gpu, step: u32) -> Result<u32> {
        let row_bytes = 4 * self.entries() * u64::from(self.size[0]);
        if row_bytes * u64::from(step) > gpu.binding_bytes() {
            return Err(
                gpu.too_small("how many particles are in front of the pixels", row_bytes * u64::from(step))
            );
        }
        let rows = HISTOGRAM_BYTES.min(gpu.binding_bytes()) / row_bytes / u64::from(step) * u64::from(step);
        Ok(rows.clamp(step.into(), u64::from(self.size[1]).max(step.into())) as u32)
    }

    /// Says which samples a frame adds, and gives what its kernel is bound to, with room for bands of so many rows.
    pub(super) fn begin(&mut self, gpu: &Gpu, added: &Samples, rows: u32) -> Result<wgpu::BindGroup> {
        let room = self.size[0] * rows;
        let group = match &self.frame {
            Some((pixels, group)) if *pixels >= room => group.clone(),
            _ => {
                let storage = wgpu::BufferUsages::STORAGE;
                let histograms = gpu.buffer("histograms", 4 * self.entries() * u64::from(room), storage)?;
                let mut buffers = vec![&self.record_buffer, &self.pixels, &self.pairs[0], &histograms];
                buffers.extend(&self.grid.pages.buffers);
                let group = gpu.bind(&self.bindings, &buffers);
                self.record.stride = room;
                self.frame = Some((room, group.clone()));
                group
            }
        };
        (self.record.first, self.record.samples, self.record.seed) = (added.first, added.count, added.seed);
        gpu.write(&self.record_buffer, 0, bytemuck::bytes_of(&self.record));
        Ok(group)
    }

    /// Decides, after a frame, where the rays of the next one end.
    pub(super) fn decide(&mut self, gpu: &Gpu, progress: &dyn Progress) -> Result<()> {
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        encoder.clear_buffer(&self.converged, 0, None);
        for Step { entry, group, groups: [across, down] } in &self.steps {
            let pipeline = self.deciding(entry, gpu, progress)?;
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            pass.set_bind_group(0, group, &[]);
            pass.set_pipeline(&pipeline);
            pass.dispatch_workgroups(*across, *down, 1);
        }
        gpu.submit(encoder);
        self.record.is_new = 0;
        Ok(())
    }

    /// Waits, and tells how far it is, and what it takes.
    pub(super) fn report(&self, gpu: &Gpu) -> Result<Report> {
        let pixel_count = self.size[0] as usize * self.size[1] as usize;
        let (mut depths, mut converged) = (vec![f32::INFINITY; pixel_count], 0.0);
        if self.record.is_new == 0 {
            depths = gpu.read(&self.pixels, 0..self.pixels.size(), |pixels: &[layout::Pixel]| {
                let depth =
                    |pixel: &layout::Pixel| if pixel.clip < f32::MAX { pixel.clip } else { f32::INFINITY };
                pixels.iter().map(depth).collect()
            })?;
            let count = gpu.read(&self.converged, 0..4, |counts: &[u32]| counts[0])?;
            converged = f64::from(count) / pixel_count as f64;
        }
        if self.record.convergence_samples == 0 {
            converged = 1.0;
        }
        let buffers = self.pairs.iter().chain([&self.pixels]);
        Ok(Report {
            depths,
            converged,
            voxels: self.record.voxels.map(|voxels| voxels as usize),
            grid_bytes: self.grid.bytes,
            pixel_bytes: buffers.map(wgpu::Buffer::size).sum(),
        })
    }

    /// What the kernel `evaluate` behind the formulas makes of records, a vector each, with room for as many histograms as there are pixels:
    /// for tests.
    #[cfg(test)]
    pub(super) fn evaluate(
        &mut self,
        resident: &Resident,
        text: String,
        inputs: &[u8],
        count: usize,
    ) -> Vec<[f32; 4]> {
        let added = Samples { seed: 5, first: 0, count: 4, centered: false };
        let group = self.begin(resident.gpu(), &added, self.size[1]).unwrap();
        resident.evaluate(text, inputs, count, Some((&self.bindings, &group)))
    }
}
