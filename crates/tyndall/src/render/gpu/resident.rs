//! A scene in the card's memory: the structure as the CPU or the card has built it, and colors by node. What changes in the scene is sent alone.

use std::sync::{Arc, Mutex, PoisonError};

use super::build::Hierarchy;
use super::confidence::Grid;
use super::device::Gpu;
use super::layout::{self, HitRecord, NONE, RayRecord};
use super::pages::Pages;
use super::shader::{Colors, HeapWalk, Heaps, Shape, Sizes, Walked};
use crate::error::{Error, Result};
use crate::math::Ray;
use crate::progress::Progress;
use crate::render::confidence::DensityGrid;
use crate::render::interactive::Changes;
use crate::scene::Scene;
use crate::scene::color::ColorColumn;
use crate::structure::bvh::{Arrays, SizeArrays};
use crate::structure::selection::Bits;
use crate::structure::{Hit, Store, Structure, heap};

/// Storage buffers of a pass besides the scene's: points, hits, sums, nearest hits. Tiles have one more, for those that are laid aside.
const PASS_BUFFERS: u64 = 4;
/// The array that is there only where not all particles are shown, after all others.
const SHOWN: &str = "shown";
/// Rays answered at once; bounds memory and the time of a dispatch.
const RAYS_AT_ONCE: usize = 1 << 20;

/// See the module.
pub struct Resident {
    gpu: Gpu,
    shape: Shape,
    outline: wgpu::Buffer,
    palette: wgpu::Buffer,
    /// In the order of their bindings.
    columns: Vec<(&'static str, Pages)>,
    bindings: Bindings,
    bound: Bound,
    /// The density grid that was counted last, for culling by confidence.
    grid: Mutex<Option<Arc<Grid>>>,
}

/// Bindings besides the scene's.
struct Bindings {
    pass: wgpu::BindGroupLayout,
    /// Of the first and of the second walk.
    aside: [wgpu::BindGroupLayout; 2],
    rays: wgpu::BindGroupLayout,
}

/// The scene's bindings, and the layouts of kernels with them.
struct Bound {
    group: wgpu::BindGroup,
    pass_layout: wgpu::PipelineLayout,
    walk_layouts: [wgpu::PipelineLayout; 2],
    ray_layout: wgpu::PipelineLayout,
    scene: wgpu::BindGroupLayout,
}

/// What is loaded.
struct Content<'a> {
    structure: Arranged<'a>,
    colors: (Colors, &'a [u8]),
    shown: Option<Bits<'a>>,
}

/// An array of the scene.
struct Column<'a> {
    name: &'static str,
    bytes: Bytes<'a>,
    follows: Follows,
}

/// With what an array changes.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Follows {
    Nothing,
    Radii,
    Colors,
    Shown,
}

/// Where the bytes of an array come from.
enum Bytes<'a> {
    /// They are there.
    Held(&'a [u8]),
    /// Made when they are sent.
    Spheres(&'a heap::Arrays<'a>),
    /// The particles' bits, filled up to whole elements, and those of the subtrees.
    Shown(Bits<'a>),
}

impl Bytes<'_> {
    fn len(&self) -> u64 {
        match self {
            Self::Held(bytes) => bytes.len() as u64,
            Self::Spheres(arrays) => size_of::<[f32; 4]>() as u64 * arrays.ids.len() as u64,
            Self::Shown(Bits { particles, subtrees }) => {
                (size_of_val(*particles).next_multiple_of(16) + subtrees.len()) as u64
            }
        }
    }

    fn read<R>(&self, take: impl FnOnce(&[u8]) -> R) -> R {
        match self {
            Self::Held(bytes) => take(bytes),
            Self::Spheres(arrays) => take(bytemuck::cast_slice(&arrays.spheres())),
            Self::Shown(Bits { particles, subtrees }) => {
                let mut bytes = bytemuck::cast_slice(particles).to_vec();
                bytes.resize(bytes.len().next_multiple_of(16), 0);
                bytes.extend_from_slice(subtrees);
                take(&bytes)
            }
        }
    }
}

/// The structure.
enum Arranged<'a> {
    Bvh(Arrays<'a>),
    Heaps(heap::Arrays<'a>),
}

impl<'a> Content<'a> {
    /// Fails with [`Error::Setting`] if the structure is none that the card walks.
    fn of(scene: &'a Scene) -> Result<Self> {
        if scene.shapes().is_some() {
            let allowed = "left out on the GPU; --device cpu draws them";
            return Err(Error::setting("shapes beside spheres", "drawn", allowed));
        }
        if scene.cut().is_some() {
            let allowed = "left out on the GPU, which cuts nothing; --device cpu does";
            return Err(Error::setting("--cut", "given", allowed));
        }
        if scene.structure().replicas().is_some() {
            let allowed = "1 on the GPU, which draws no periodic images; --device cpu does";
            return Err(Error::setting("--replicate", "more", allowed));
        }
        let structure = match &scene.structure().store {
            Store::Bvh(bvh) => Arranged::Bvh(bvh.arrays()),
            Store::Pkd(pkd) => Arranged::Heaps(pkd.arrays()),
            Store::Treelets(treelets) => Arranged::Heaps(treelets.arrays()),
            Store::Brute(_) => {
                let allowed = "bvh, treelets or pkd on the GPU; brute is for --device cpu";
                return Err(Error::setting("--structure", "brute", allowed));
            }
        };
        let colors = match scene.color_column() {
            ColorColumn::Constant(_) => (Colors::Constant, &[][..]),
            ColorColumn::Palette { places, .. } => (Colors::Palette, places),
            ColorColumn::Direct { bytes, .. } => (Colors::Direct, bytes),
        };
        Ok(Self { structure, colors, shown: scene.structure().shown_bits() })
    }

    /// The arrays, in the order of their bindings.
    fn columns(&self) -> Vec<Column<'_>> {
        let column = |name, bytes, follows| Column { name, bytes: Bytes::Held(bytes), follows };
        let mut columns = match &self.structure {
            Arranged::Bvh(arrays) => {
                // One radius for all moves all boxes alike: see `Bvh::scaled`.
                let is_uniform = matches!(arrays.sizes, SizeArrays::Uniform(_));
                let boxes = if is_uniform { Follows::Nothing } else { Follows::Radii };
                vec![
                    column("nodes", arrays.nodes, boxes),
                    column("blocks", arrays.blocks, Follows::Nothing),
                    column("sizes", sizes(&arrays.sizes).1, Follows::Nothing),
                    column("ids", bytemuck::cast_slice(arrays.ids), Follows::Nothing),
                ]
            }
            Arranged::Heaps(arrays) => vec![
                Column { name: "spheres", bytes: Bytes::Spheres(arrays), follows: Follows::Nothing },
                column("heaps", bytemuck::cast_slice(&arrays.heaps), Follows::Nothing),
                column("axes", arrays.axes, Follows::Nothing),
                column("ids", bytemuck::cast_slice(arrays.ids), Follows::Nothing),
            ],
        };
        if let Arranged::Heaps(heap::Arrays { nodes: Some(nodes), .. }) = &self.structure {
            columns.push(column("nodes", bytemuck::cast_slice(&nodes.nodes), Follows::Radii));
        }
        columns.push(column("colors", self.colors.1, Follows::Colors));
        if let Some(bits) = self.shown {
            columns.push(Column { name: SHOWN, bytes: Bytes::Shown(bits), follows: Follows::Shown });
        }
        columns
    }

    fn bytes(&self) -> u64 {
        self.columns().iter().map(|column| column.bytes.len()).sum()
    }

    /// Fails with [`Error::Memory`] if the card cannot hold or bind it.
    fn check(&self, gpu: &Gpu) -> Result<()> {
        let columns = self.columns();
        let pages: u64 =
            columns.iter().map(|column| Pages::count(column.bytes.len(), gpu.page_bytes())).sum();
        let direct_fits = self.colors.0 != Colors::Direct || self.colors.1.len() <= u32::MAX as usize;
        let elements_fit = columns.iter().all(|column| column.bytes.len() / 16 <= u64::from(u32::MAX));
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
                let &heap::Arrays { slack, radius_scale, ids, .. } = arrays;
                let outline = layout::Outline { particles: ids.len() as u32, slack, radius_scale, unused: 0 };
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
        radius_scale: arrays.radius_scale,
        ..bytemuck::Zeroable::zeroed()
    };
    for (level, of) in outline.levels.iter_mut().zip(arrays.levels) {
        [level[0], level[1]] = of;
    }
    match arrays.sizes {
        SizeArrays::Uniform(radius) => outline.radius = arrays.radius_scale * radius,
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

/// Buffers that stand before the columns among the scene's bindings: the outline and the palette.
const UNIFORMS: usize = 2;

/// Declares the columns.
fn declared(columns: &[(&'static str, Pages)]) -> String {
    let mut binding = UNIFORMS;
    let declare = |(name, pages): &(&'static str, Pages)| {
        let text = pages.declare(name, 1, binding);
        binding += pages.buffers.len();
        text
    };
    columns.iter().map(declare).collect()
}

impl Bindings {
    fn new(gpu: &Gpu) -> Self {
        let of_pass = [Binding::Uniform, Binding::Read, Binding::Written, Binding::Written, Binding::Written];
        Self {
            pass: gpu.layout(&of_pass, 5),
            aside: [Binding::Written, Binding::Read].map(|binding| gpu.layout(&[binding], 1)),
            rays: gpu.layout(&[Binding::Read, Binding::Written], 2),
        }
    }

    fn bind(
        &self,
        gpu: &Gpu,
        uniforms: [&wgpu::Buffer; UNIFORMS],
        columns: &[(&'static str, Pages)],
        walked: Walked,
    ) -> Bound {
        let pages = columns.iter().flat_map(|(_, pages)| &pages.buffers);
        let buffers: Vec<&wgpu::Buffer> = uniforms.into_iter().chain(pages).collect();
        let scene = gpu.layout(&[Binding::Uniform; UNIFORMS], buffers.len());
        Bound {
            group: gpu.bind(&scene, &buffers),
            pass_layout: gpu.pipeline_layout(&[&self.pass, &scene]),
            walk_layouts: self.aside.each_ref().map(|aside| match walked.has_tiles() {
                true => gpu.pipeline_layout(&[&self.pass, &scene, aside]),
                false => gpu.pipeline_layout(&[&self.pass, &scene]),
            }),
            ray_layout: gpu.pipeline_layout(&[&self.rays, &scene]),
            scene,
        }
    }
}

impl Resident {
    /// Copies the scene to the card. Fails with [`Error::Memory`] if it does not fit, with [`Error::Setting`] if its structure is none that
    /// the card walks.
    pub fn load(gpu: &Gpu, scene: &Scene, progress: &dyn Progress) -> Result<Self> {
        Self::of(gpu, scene, Vec::new(), progress)
    }

    /// Takes over a hierarchy that the card has built, and copies the colors; `scene` has the structure that was read back from it. Fails
    /// as [`Resident::load`] does.
    pub fn built(hierarchy: Hierarchy, scene: &Scene, progress: &dyn Progress) -> Result<Self> {
        let content = Content::of(scene)?;
        let sizes = content.columns().into_iter().map(|column| column.bytes.len());
        if !hierarchy.array_bytes().into_iter().eq(sizes.take(4)) {
            return Err(Error::Device("the scene's structure is not the one that the GPU has built".into()));
        }
        let mut resident = Self::of(hierarchy.gpu(), scene, hierarchy.into_arrays().into(), progress)?;
        // Radii may have been scaled since, and boxes with them.
        resident.update(scene, Changes { radii: true, ..Changes::default() })?;
        Ok(resident)
    }

    /// The first arrays stand on the card already, in the order of their bindings.
    fn of(gpu: &Gpu, scene: &Scene, there: Vec<Pages>, progress: &dyn Progress) -> Result<Self> {
        let content = Content::of(scene)?;
        content.check(gpu)?;
        let uploaded = content.columns().into_iter().skip(there.len()).map(|column| column.bytes.len());
        progress.begin("upload", Some(uploaded.sum()), "B");
        let mut there = there.into_iter();
        let uniform = |label, bytes: &[u8]| {
            let usage = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
            let buffer = gpu.buffer(label, bytes.len() as u64, usage)?;
            gpu.write(&buffer, 0, bytes);
            Ok(buffer)
        };
        let outline = uniform("structure", &content.outline())?;
        let palette = uniform("palette", bytemuck::cast_slice(&palette(scene)))?;
        let mut columns = Vec::new();
        for Column { name, bytes, .. } in content.columns() {
            let pages = match there.next() {
                Some(pages) => pages,
                None => bytes.read(|bytes| Pages::upload(gpu, name, bytes, progress))?,
            };
            columns.push((name, pages));
        }
        gpu.flush()?;
        let (walked, levels) = content.walked();
        let shape = Shape {
            walked,
            colors: content.colors.0,
            hides: content.shown.is_some(),
            // Few different numbers, so that kernels are seldom made anew.
            levels: levels.max(4).next_multiple_of(2),
            arrays: declared(&columns),
        };
        let bindings = Bindings::new(gpu);
        let bound = bindings.bind(gpu, [&outline, &palette], &columns, walked);
        Ok(Self {
            gpu: gpu.clone(),
            shape,
            outline,
            palette,
            columns,
            bindings,
            bound,
            grid: Mutex::default(),
        })
    }

    /// Takes over what changed in the scene. Whether kernels have to be made anew. Fails with [`Error::Memory`] if what is new does not fit.
    pub(super) fn update(&mut self, scene: &Scene, changes: Changes) -> Result<bool> {
        if changes == Changes::default() {
            return Ok(false);
        }
        let content = Content::of(scene)?;
        content.check(&self.gpu)?;
        let has_changed = |follows| match follows {
            Follows::Nothing => false,
            Follows::Radii => changes.radii,
            Follows::Colors => changes.colors,
            Follows::Shown => changes.shown,
        };
        // What has another length needs other memory.
        let mut fresh = Vec::new();
        for Column { name, bytes, .. } in
            content.columns().into_iter().filter(|column| has_changed(column.follows))
        {
            let held = self.columns.iter().find(|(held, pages)| *held == name && pages.bytes == bytes.len());
            match held {
                Some((_, pages)) => bytes.read(|bytes| pages.write(&self.gpu, bytes, &()))?,
                None => fresh.push((name, bytes.read(|bytes| Pages::upload(&self.gpu, name, bytes, &()))?)),
            }
        }
        if changes.radii || changes.shown {
            *self.grid.get_mut().unwrap_or_else(PoisonError::into_inner) = None;
        }
        if changes.radii {
            self.gpu.write(&self.outline, 0, &content.outline());
        }
        if changes.colors {
            self.gpu.write(&self.palette, 0, bytemuck::cast_slice(&palette(scene)));
        }
        let hides = if changes.shown { content.shown.is_some() } else { self.shape.hides };
        if fresh.is_empty() && hides == self.shape.hides {
            return Ok(false);
        }
        self.columns.retain(|(name, _)| hides || *name != SHOWN);
        for column in fresh {
            match self.columns.iter_mut().find(|(held, _)| *held == column.0) {
                Some(held) => *held = column,
                None => self.columns.push(column),
            }
        }
        let uniforms = [&self.outline, &self.palette];
        self.bound = self.bindings.bind(&self.gpu, uniforms, &self.columns, self.shape.walked);
        let colors = if changes.colors { content.colors.0 } else { self.shape.colors };
        let shape = Shape { colors, hides, arrays: declared(&self.columns), ..self.shape.clone() };
        let is_another = shape != self.shape;
        self.shape = shape;
        Ok(is_another)
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
    pub fn gpu(&self) -> &Gpu {
        &self.gpu
    }

    /// Memory that the scene takes on the card, in bytes.
    pub fn bytes(&self) -> u64 {
        self.columns.iter().map(|(_, pages)| pages.bytes).sum()
    }

    /// Storage buffers that a pass sees: its own and those of the scene.
    pub(super) fn buffers(&self) -> u64 {
        PASS_BUFFERS + self.columns.iter().map(|(_, pages)| pages.buffers.len() as u64).sum::<u64>()
    }

    /// A layout of the pass, the scene, and what else a kernel has.
    pub(super) fn layout_with(&self, others: &wgpu::BindGroupLayout) -> wgpu::PipelineLayout {
        self.gpu.pipeline_layout(&[&self.bindings.pass, &self.bound.scene, others])
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
        let grid = Arc::new(Grid::new(&self.gpu, &counted, voxel_count, progress)?);
        *kept = Some(grid.clone());
        Ok(grid)
    }

    pub(super) fn shape(&self) -> &Shape {
        &self.shape
    }

    pub(super) fn group(&self) -> &wgpu::BindGroup {
        &self.bound.group
    }

    pub(super) fn pass_bindings(&self) -> &wgpu::BindGroupLayout {
        &self.bindings.pass
    }

    pub(super) fn pass_layout(&self) -> &wgpu::PipelineLayout {
        &self.bound.pass_layout
    }

    /// Bindings of what is laid aside: of the first and of the second walk.
    pub(super) fn aside_bindings(&self) -> &[wgpu::BindGroupLayout; 2] {
        &self.bindings.aside
    }

    pub(super) fn walk_layouts(&self) -> &[wgpu::PipelineLayout; 2] {
        &self.bound.walk_layouts
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
        let group = self.gpu.bind(&self.bindings.rays, &[&input, &outputs]);
        let mut layouts = vec![&self.bindings.rays, &self.bound.scene];
        layouts.extend(others.map(|(layout, _)| layout));
        let layout = self.gpu.pipeline_layout(&layouts);
        let pipeline = self.gpu.pipeline(text, "evaluate", &layout, &()).unwrap();
        let mut encoder = self.gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            pass.set_bind_group(0, &group, &[]);
            pass.set_bind_group(1, &self.bound.group, &[]);
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
        let pipeline = self.gpu.pipeline(text, entry, &self.bound.ray_layout, progress)?;
        let mut encoder = self.gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            pass.set_bind_group(0, group, &[]);
            pass.set_bind_group(1, &self.bound.group, &[]);
            pass.set_pipeline(&pipeline);
            // No dimension may have more than 65535.
            let across = groups.min(1 << 15);
            pass.dispatch_workgroups(across, groups.div_ceil(across), 1);
        }
        Ok(self.gpu.submit(encoder))
    }

    /// Copies rays to the card; at least one.
    pub fn batch(&self, rays: &[Ray]) -> Result<Batch<'_>> {
        let records: Vec<RayRecord> = rays.iter().map(RayRecord::of).collect();
        let bytes = bytemuck::cast_slice(&records);
        let storage = wgpu::BufferUsages::STORAGE;
        let input = self.gpu.buffer("rays", bytes.len() as u64, storage | wgpu::BufferUsages::COPY_DST)?;
        self.gpu.write(&input, 0, bytes);
        let size = (rays.len() * size_of::<HitRecord>()) as u64;
        let hits = self.gpu.buffer("hits of rays", size, storage | wgpu::BufferUsages::COPY_SRC)?;
        let group = self.gpu.bind(&self.bindings.rays, &[&input, &hits]);
        Ok(Batch { resident: self, count: rays.len(), hits, group })
    }
}

/// Rays on the card, to be asked again and again.
pub struct Batch<'a> {
    resident: &'a Resident,
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
