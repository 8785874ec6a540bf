//! A scene in the card's memory: the structure as the CPU has built it, and colors by node.

use std::sync::{Arc, Mutex, PoisonError};

use super::confidence::Grid;
use super::device::Gpu;
use super::layout::{self, HitRecord, NONE, RayRecord};
use super::pages::Pages;
use super::shader::{Colors, HeapWalk, Heaps, Shape, Sizes, Walked};
use crate::error::{Error, Result};
use crate::math::Ray;
use crate::progress::Progress;
use crate::render::confidence::DensityGrid;
use crate::scene::Scene;
use crate::scene::color::ColorColumn;
use crate::structure::bvh::{Arrays, SizeArrays};
use crate::structure::{Hit, Store, Structure, heap};

/// Storage buffers of a pass besides the scene's: points, hits, sums, nearest hits. Tiles have one more, for those that are laid aside.
const PASS_BUFFERS: u64 = 4;
/// Rays answered at once; bounds memory and the time of a dispatch.
const RAYS_AT_ONCE: usize = 1 << 20;

/// See the module.
pub struct Resident<'a> {
    gpu: &'a Gpu,
    shape: Shape,
    group: wgpu::BindGroup,
    pass_bindings: wgpu::BindGroupLayout,
    pass_layout: wgpu::PipelineLayout,
    /// Of the first and of the second walk.
    aside_bindings: [wgpu::BindGroupLayout; 2],
    walk_layouts: [wgpu::PipelineLayout; 2],
    ray_bindings: wgpu::BindGroupLayout,
    ray_layout: wgpu::PipelineLayout,
    bytes: u64,
    scene_bindings: wgpu::BindGroupLayout,
    /// Storage buffers of the scene.
    buffers: u64,
    /// The density grid that was counted last, for culling by confidence.
    grid: Mutex<Option<Arc<Grid>>>,
}

/// What is loaded.
struct Content<'a> {
    structure: Arranged<'a>,
    colors: (Colors, &'a [u8]),
}

/// The structure.
enum Arranged<'a> {
    Bvh(Arrays<'a>),
    Heaps(heap::Arrays<'a>),
}

impl<'a> Content<'a> {
    /// Fails with [`Error::Setting`] or [`Error::Device`] if the structure is none that the card walks.
    fn of(scene: &'a Scene) -> Result<Self> {
        let structure = match &scene.structure().store {
            Store::Bvh(bvh) => Arranged::Bvh(bvh.arrays()),
            Store::Pkd(pkd) => Arranged::Heaps(pkd.arrays()),
            Store::Treelets(treelets) => Arranged::Heaps(treelets.arrays()),
            Store::Brute(_) => {
                let allowed = "bvh, treelets or pkd on the GPU; brute is for --device cpu";
                return Err(Error::setting("--structure", "brute", allowed));
            }
        };
        if !scene.structure().is_as_built() {
            let what = "particles that are hidden or scaled after the build are not for the GPU yet";
            return Err(Error::Device(format!("{what}; --device cpu")));
        }
        let colors = match scene.color_column() {
            ColorColumn::Constant(_) => (Colors::Constant, &[][..]),
            ColorColumn::Palette { places, .. } => (Colors::Palette, places),
            ColorColumn::Direct { bytes, .. } => (Colors::Direct, bytes),
        };
        Ok(Self { structure, colors })
    }

    /// The arrays, in the order of their bindings.
    fn columns(&self) -> Vec<(&'static str, &[u8])> {
        let mut columns = match &self.structure {
            Arranged::Bvh(arrays) => vec![
                ("nodes", arrays.nodes),
                ("blocks", arrays.blocks),
                ("sizes", sizes(&arrays.sizes).1),
                ("ids", bytemuck::cast_slice(arrays.ids)),
            ],
            Arranged::Heaps(arrays) => vec![
                ("spheres", bytemuck::cast_slice(&arrays.spheres)),
                ("heaps", bytemuck::cast_slice(&arrays.heaps)),
                ("axes", arrays.axes),
                ("ids", bytemuck::cast_slice(arrays.ids)),
            ],
        };
        if let Arranged::Heaps(heap::Arrays { nodes: Some(nodes), .. }) = &self.structure {
            columns.push(("nodes", bytemuck::cast_slice(&nodes.nodes)));
        }
        columns.push(("colors", self.colors.1));
        columns
    }

    fn bytes(&self) -> u64 {
        self.columns().iter().map(|(_, bytes)| bytes.len() as u64).sum()
    }

    /// Fails with [`Error::Memory`] if the card cannot hold or bind it.
    fn check(&self, gpu: &Gpu) -> Result<()> {
        let columns = self.columns();
        let pages: u64 =
            columns.iter().map(|(_, bytes)| Pages::count(bytes.len() as u64, gpu.page_bytes())).sum();
        let direct_fits = self.colors.0 != Colors::Direct || self.colors.1.len() <= u32::MAX as usize;
        let elements_fit = columns.iter().all(|(_, bytes)| bytes.len() as u64 / 16 <= u64::from(u32::MAX));
        let is_bound = pages + PASS_BUFFERS + u64::from(self.walked().0.has_tiles()) <= gpu.storage_buffers()
            && direct_fits
            && elements_fit;
        let has_room = gpu.info().memory_bytes.is_none_or(|bytes| self.bytes() <= bytes);
        if is_bound && has_room { Ok(()) } else { Err(gpu.too_small("the scene", self.bytes())) }
    }

    /// What the kernels read of the structure besides its arrays.
    fn outline(&self) -> Vec<u8> {
        match &self.structure {
            Arranged::Bvh(arrays) => bytemuck::bytes_of(&bvh_outline(arrays)).to_vec(),
            Arranged::Heaps(arrays) => {
                let particles = arrays.ids.len() as u32;
                let outline = layout::Outline { particles, slack: arrays.slack, unused_0: 0, unused_1: 0 };
                bytemuck::bytes_of(&outline).to_vec()
            }
        }
    }

    /// The structure, and more levels of nodes than it has.
    fn walked(&self) -> (Walked, u32) {
        match &self.structure {
            Arranged::Bvh(arrays) => (Walked::Bvh(arrays.packing, sizes(&arrays.sizes).0), arrays.top),
            Arranged::Heaps(arrays) => {
                let heaps = Heaps { upper_levels: arrays.upper_levels, walk: HeapWalk::default() };
                match &arrays.nodes {
                    Some(nodes) => (Walked::Treelets(heaps), nodes.levels),
                    None => (Walked::Pkd(heaps), 1),
                }
            }
        }
    }
}

/// How radii are held, and their array.
fn sizes<'a>(arrays: &SizeArrays<'a>) -> (Sizes, &'a [u8]) {
    match *arrays {
        SizeArrays::Uniform(_) => (Sizes::Uniform, &[]),
        SizeArrays::Table { codes, .. } => (Sizes::Table, codes),
        SizeArrays::Each(radii) => (Sizes::Each, radii),
        SizeArrays::Log(radii) => (Sizes::Log, radii),
    }
}

fn bvh_outline(arrays: &Arrays) -> layout::Bvh {
    let mut outline = layout::Bvh {
        top: arrays.top,
        particles: arrays.ids.len() as u32,
        slack: arrays.slack,
        ..bytemuck::Zeroable::zeroed()
    };
    for (level, of) in outline.levels.iter_mut().zip(arrays.levels) {
        [level[0], level[1]] = of;
    }
    match arrays.sizes {
        SizeArrays::Uniform(radius) => outline.radius = radius,
        SizeArrays::Table { radii, .. } => outline.radii = *radii,
        SizeArrays::Each(_) | SizeArrays::Log(_) => {}
    }
    outline
}

/// Colors that all particles share, or the linear values of bytes.
fn palette(scene: &Scene) -> [[f32; 4]; 256] {
    let mut palette = [[0.0; 4]; 256];
    let opaque = |[r, g, b]: [f32; 3]| [r, g, b, 1.0];
    match scene.color_column() {
        ColorColumn::Constant(color) => palette[0] = opaque(color),
        ColorColumn::Palette { colors, .. } => {
            palette.iter_mut().zip(colors).for_each(|(slot, &color)| *slot = opaque(color));
        }
        ColorColumn::Direct { linear_of_byte, .. } => {
            palette.iter_mut().zip(linear_of_byte).for_each(|(slot, &linear)| *slot = opaque([linear; 3]));
        }
    }
    palette
}

impl<'a> Resident<'a> {
    /// Copies the scene to the card. Fails with [`Error::Memory`] if it does not fit, with [`Error::Setting`] if its structure is none that
    /// the card walks.
    pub fn load(gpu: &'a Gpu, scene: &Scene, progress: &dyn Progress) -> Result<Self> {
        let content = Content::of(scene)?;
        content.check(gpu)?;
        progress.begin("upload", Some(content.bytes()), "B");
        let (outline, palette) = (content.outline(), palette(scene));
        let uniform = |label, bytes: &[u8]| {
            let usage = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
            let buffer = gpu.buffer(label, bytes.len() as u64, usage)?;
            gpu.write(&buffer, 0, bytes);
            Ok(buffer)
        };
        let mut buffers =
            vec![uniform("structure", &outline)?, uniform("palette", bytemuck::cast_slice(&palette))?];
        let uniforms = buffers.len();
        let mut arrays = String::new();
        for (name, bytes) in content.columns() {
            let pages = Pages::upload(gpu, name, bytes, progress)?;
            arrays += &pages.declare(name, 1, buffers.len());
            buffers.extend(pages.buffers);
        }
        gpu.flush()?;
        let (walked, levels) = content.walked();
        let shape = Shape {
            walked,
            colors: content.colors.0,
            // Few different numbers, so that kernels are seldom made anew.
            levels: levels.max(4).next_multiple_of(2),
            arrays,
        };
        let scene_bindings = gpu.layout(&vec![Binding::Uniform; uniforms], buffers.len());
        let group = gpu.bind(&scene_bindings, &buffers.iter().collect::<Vec<_>>());
        let pass_bindings = gpu.layout(
            &[Binding::Uniform, Binding::Read, Binding::Written, Binding::Written, Binding::Written],
            5,
        );
        let aside_bindings = [Binding::Written, Binding::Read].map(|binding| gpu.layout(&[binding], 1));
        let ray_bindings = gpu.layout(&[Binding::Read, Binding::Written], 2);
        Ok(Self {
            gpu,
            group,
            pass_layout: gpu.pipeline_layout(&[&pass_bindings, &scene_bindings]),
            walk_layouts: aside_bindings.each_ref().map(|aside| match shape.walked.has_tiles() {
                true => gpu.pipeline_layout(&[&pass_bindings, &scene_bindings, aside]),
                false => gpu.pipeline_layout(&[&pass_bindings, &scene_bindings]),
            }),
            aside_bindings,
            ray_layout: gpu.pipeline_layout(&[&ray_bindings, &scene_bindings]),
            shape,
            pass_bindings,
            ray_bindings,
            bytes: content.bytes(),
            scene_bindings,
            buffers: (buffers.len() - uniforms) as u64,
            grid: Mutex::default(),
        })
    }

    /// Walks the k-d trees of `pkd` and `treelets` in another way. What is found stays the same.
    pub fn with_heap_walk(mut self, walk: HeapWalk) -> Self {
        match &mut self.shape.walked {
            Walked::Pkd(heaps) | Walked::Treelets(heaps) => heaps.walk = walk,
            Walked::Bvh(..) => {}
        }
        self
    }

    /// The card.
    pub fn gpu(&self) -> &'a Gpu {
        self.gpu
    }

    /// Memory that the scene takes on the card, in bytes.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Storage buffers that a pass sees: its own and those of the scene.
    pub(super) fn buffers(&self) -> u64 {
        PASS_BUFFERS + self.buffers
    }

    /// A layout of the pass, the scene, and what else a kernel has.
    pub(super) fn layout_with(&self, others: &wgpu::BindGroupLayout) -> wgpu::PipelineLayout {
        self.gpu.pipeline_layout(&[&self.pass_bindings, &self.scene_bindings, others])
    }

    /// The density grid of so many slices of the scene that was loaded, counted at most once in a row.
    pub(super) fn grid(
        &self,
        structure: &Structure,
        voxel_count: u32,
        progress: &dyn Progress,
    ) -> Result<Arc<Grid>> {
        let mut kept = self.grid.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(grid) = kept.as_ref().filter(|grid| grid.voxel_count == voxel_count) {
            return Ok(grid.clone());
        }
        // The one before makes room first.
        *kept = None;
        let counted = DensityGrid::new(structure, voxel_count)?;
        let grid = Arc::new(Grid::new(self.gpu, &counted, voxel_count, progress)?);
        *kept = Some(grid.clone());
        Ok(grid)
    }

    pub(super) fn shape(&self) -> &Shape {
        &self.shape
    }

    pub(super) fn group(&self) -> &wgpu::BindGroup {
        &self.group
    }

    pub(super) fn pass_bindings(&self) -> &wgpu::BindGroupLayout {
        &self.pass_bindings
    }

    pub(super) fn pass_layout(&self) -> &wgpu::PipelineLayout {
        &self.pass_layout
    }

    /// Bindings of what is laid aside: of the first and of the second walk.
    pub(super) fn aside_bindings(&self) -> &[wgpu::BindGroupLayout; 2] {
        &self.aside_bindings
    }

    pub(super) fn walk_layouts(&self) -> &[wgpu::PipelineLayout; 2] {
        &self.walk_layouts
    }

    /// What each ray enters first; see [`Structure::intersect`]. `structure` is that of the scene that was loaded.
    pub fn intersect(
        &self,
        structure: &Structure,
        rays: &[Ray],
        progress: &dyn Progress,
    ) -> Result<Vec<Option<Hit>>> {
        let mut found = Vec::with_capacity(rays.len());
        for rays in rays.chunks(RAYS_AT_ONCE) {
            let batch = self.batch(rays)?;
            let submitted = batch.submit(progress)?;
            self.gpu.wait(submitted)?;
            let ids = structure.ids();
            let hit = |hit: &HitRecord| {
                (hit.node != NONE).then(|| Hit { t: hit.depth, id: ids[hit.node as usize], node: hit.node })
            };
            self.gpu.read(&batch.hits, 0..batch.hits.size(), |hits: &[HitRecord]| {
                found.extend(hits.iter().map(hit));
            })?;
        }
        Ok(found)
    }

    /// What the kernel `evaluate` of a text makes of records, a vector each: for tests of formulas. `others` is what it is bound to besides
    /// the scene.
    #[cfg(test)]
    pub(super) fn evaluate(
        &self,
        text: String,
        inputs: &[u8],
        count: usize,
        others: Option<(&wgpu::BindGroupLayout, &wgpu::BindGroup)>,
    ) -> Vec<[f32; 4]> {
        let storage = wgpu::BufferUsages::STORAGE;
        let usage = storage | wgpu::BufferUsages::COPY_DST;
        let input = self.gpu.buffer("inputs", inputs.len() as u64, usage).unwrap();
        self.gpu.write(&input, 0, inputs);
        let outputs =
            self.gpu.buffer("outputs", 16 * count as u64, storage | wgpu::BufferUsages::COPY_SRC).unwrap();
        let group = self.gpu.bind(&self.ray_bindings, &[&input, &outputs]);
        let mut layouts = vec![&self.ray_bindings, &self.scene_bindings];
        layouts.extend(others.map(|(layout, _)| layout));
        let layout = self.gpu.pipeline_layout(&layouts);
        let pipeline = self.gpu.pipeline(text, "evaluate", &layout, &()).unwrap();
        let mut encoder = self.gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            pass.set_bind_group(0, &group, &[]);
            pass.set_bind_group(1, &self.group, &[]);
            if let Some((_, others)) = others {
                pass.set_bind_group(2, others, &[]);
            }
            pass.set_pipeline(&pipeline);
            pass.dispatch_workgroups(count.div_ceil(64) as u32, 1, 1);
        }
        let submitted = self.gpu.submit(encoder);
        self.gpu.wait(submitted).unwrap();
        self.gpu.read(&outputs, 0..outputs.size(), |values: &[[f32; 4]]| values.to_vec()).unwrap()
    }

    /// Submits a kernel of single rays.
    fn dispatch(
        &self,
        text: String,
        entry: &'static str,
        group: &wgpu::BindGroup,
        groups: u32,
        progress: &dyn Progress,
    ) -> Result<wgpu::SubmissionIndex> {
        let pipeline = self.gpu.pipeline(text, entry, &self.ray_layout, progress)?;
        let mut encoder = self.gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            pass.set_bind_group(0, group, &[]);
            pass.set_bind_group(1, &self.group, &[]);
            pass.set_pipeline(&pipeline);
            // No dimension may have more than 65535.
            let across = groups.min(1 << 15);
            pass.dispatch_workgroups(across, groups.div_ceil(across), 1);
        }
        Ok(self.gpu.submit(encoder))
    }

    /// Copies rays to the card; at least one.
    pub fn batch(&'a self, rays: &[Ray]) -> Result<Batch<'a>> {
        let records: Vec<RayRecord> = rays.iter().map(RayRecord::of).collect();
        let bytes = bytemuck::cast_slice(&records);
        let storage = wgpu::BufferUsages::STORAGE;
        let input = self.gpu.buffer("rays", bytes.len() as u64, storage | wgpu::BufferUsages::COPY_DST)?;
        self.gpu.write(&input, 0, bytes);
        let size = (rays.len() * size_of::<HitRecord>()) as u64;
        let hits = self.gpu.buffer("hits of rays", size, storage | wgpu::BufferUsages::COPY_SRC)?;
        let group = self.gpu.bind(&self.ray_bindings, &[&input, &hits]);
        Ok(Batch { resident: self, count: rays.len(), hits, group })
    }
}

/// Rays on the card, to be asked again and again.
pub struct Batch<'a> {
    resident: &'a Resident<'a>,
    count: usize,
    hits: wgpu::Buffer,
    group: wgpu::BindGroup,
}

impl Batch<'_> {
    /// Asks what each ray meets; the answers stay on the card. Seconds that it took until all were there.
    pub fn time(&self, progress: &dyn Progress) -> Result<f64> {
        let start = std::time::Instant::now();
        let submitted = self.submit(progress)?;
        self.resident.gpu.wait(submitted)?;
        Ok(start.elapsed().as_secs_f64())
    }

    fn submit(&self, progress: &dyn Progress) -> Result<wgpu::SubmissionIndex> {
        let groups = self.count.div_ceil(64) as u32;
        let text = self.resident.shape.rays();
        self.resident.dispatch(text, "intersect_rays", &self.group, groups, progress)
    }
}

/// What a kernel does with a buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Binding {
    Uniform,
    Read,
    Written,
}

impl Gpu {
    /// A layout that begins with `bindings` and goes on with buffers that are read, `count` in all.
    pub(super) fn layout(&self, bindings: &[Binding], count: usize) -> wgpu::BindGroupLayout {
        let entry = |binding: usize| wgpu::BindGroupLayoutEntry {
            binding: binding as u32,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty: wgpu::BindingType::Buffer {
                ty: match bindings.get(binding).unwrap_or(&Binding::Read) {
                    Binding::Uniform => wgpu::BufferBindingType::Uniform,
                    Binding::Read => wgpu::BufferBindingType::Storage { read_only: true },
                    Binding::Written => wgpu::BufferBindingType::Storage { read_only: false },
                },
                has_dynamic_offset: false,
                min_binding_size: None,
            },
            count: None,
        };
        let entries: Vec<_> = (0..count).map(entry).collect();
        self.device
            .create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: None, entries: &entries })
    }

    pub(super) fn pipeline_layout(&self, groups: &[&wgpu::BindGroupLayout]) -> wgpu::PipelineLayout {
        let groups: Vec<_> = groups.iter().map(|&group| Some(group)).collect();
        self.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: None,
            bind_group_layouts: &groups,
            immediate_size: 0,
        })
    }
}
