//! Building the hierarchy on the card: particles are sorted along a curve, and leaves and nodes written over them.
//!
//! Takes centers and radii as they are, gives the arrays that the kernels walk, in the very layout of `structure::bvh`: [`Hierarchy`].
//! The CPU reads a copy back, so that whatever asks a structure finds one, of the same bits. Steps: `keys.wgsl` (a record of sixteen bytes a
//! particle), `sort.wgsl` (eight digits of eight bits), `leaves.wgsl` (blocks, radii, ids), `tree.wgsl` (nodes, level by level). Equal keys
//! stay in the order of ids, so that the result does not depend on the card's schedule.

mod order;
mod stage;

use glam::Vec3;
use rayon::prelude::*;

use super::Gpu;
use super::layout::{self, Task};
use super::pages::Pages;
use super::resident::Binding;
use super::shader::Sizes;
use crate::error::{Error, Result};
use crate::math::Bounds;
use crate::particles::{Particles, Radii};
use crate::progress::Progress;
use crate::structure::bvh::{Array, Law, Outline};
use crate::structure::{Packing, Spheres, Structure};
#[cfg(test)]
pub(super) use order::CURVE_BITS;
pub(super) use order::Order;
pub(super) use stage::Stage;
#[cfg(test)]
pub(super) use stage::formulas;
use stage::{Access, ROUNDS};

/// Bits of a key, of which a step of the sort takes eight.
const KEY_BITS: u32 = 64;
/// Different digits.
const RADIX: u32 = 256;
/// Records that a workgroup sorts.
const RUN: u32 = 256 * ROUNDS;
/// Counts that a workgroup sums.
const BLOCK: u32 = 2048;
/// Particles of a dispatch, so that it takes a few milliseconds; a whole number of runs and of workgroups of all kernels.
const AT_ONCE: u32 = 1 << 22;
/// Dispatches that are on their way at one time.
const AHEAD: u32 = 8;
/// Bytes of a record, and of a box.
const RECORD_BYTES: u64 = 16;
const BOX_BYTES: u64 = 32;
/// Bytes of the different radii.
const TABLE_BYTES: u64 = 4 * 256;

/// A hierarchy that the card has built and holds.
pub struct Hierarchy<'a> {
    gpu: &'a Gpu,
    outline: Outline,
    bounds: Bounds,
    /// In the order of [`Array`].
    arrays: [Pages; 4],
}

impl<'a> Hierarchy<'a> {
    /// Builds over `spheres`. Fails with [`Error::Memory`] if the card cannot hold or bind what that takes, some 65 bytes a particle with
    /// exact packing, and with [`Error::Interrupted`].
    pub fn build(gpu: &'a Gpu, spheres: Spheres, packing: Packing, progress: &dyn Progress) -> Result<Self> {
        let uniform = spheres.uniform();
        // A zero without a sign, so that bits have the order of numbers.
        let radii = uniform.is_none().then(|| {
            let ids = (0..spheres.len()).into_par_iter().with_min_len(1 << 14);
            ids.map(|id| spheres.radius(id) + 0.0).collect::<Vec<f32>>()
        });
        let outline = match (uniform, &radii) {
            (None, Some(radii)) => Outline::of(radii, packing),
            (radius, _) => Outline::uniform(spheres.len(), radius.unwrap_or(0.0), packing),
        };
        let plan = Plan::of(&outline);
        plan.check(gpu)?;
        let mut builder = Builder::new(gpu, &outline, plan, progress)?;
        let (mut arrays, bounds) = builder.build(spheres, radii.as_deref())?;
        // Kernels that write need a page to write to; those that read need none of what is empty.
        let empty = arrays.iter_mut().zip(outline.bytes()).filter(|(_, bytes)| *bytes == 0);
        empty.for_each(|(pages, _)| pages.buffers.clear());
        Ok(Self { gpu, outline, bounds, arrays })
    }

    /// Memory that it takes on the card, in bytes.
    pub fn bytes(&self) -> u64 {
        self.outline.bytes().iter().sum()
    }

    /// Reads back a copy for the CPU. `particles`, `radii` and `radius_scale` are those that it was built over; the particles are used up.
    ///
    /// Fails with [`Error::Interrupted`], and with [`Error::Device`] and what has gone wrong on the card.
    pub fn structure(
        &self,
        particles: Particles,
        radii: &Radii,
        radius_scale: f32,
        progress: &dyn Progress,
    ) -> Result<Structure> {
        progress.begin("read back", Some(self.bytes()), "B");
        let bvh = self.outline.read(self.bounds, |array, into| {
            self.arrays[array as usize].read(self.gpu, into, progress)?;
            let is_wrong = |&id: &u32| id as usize >= self.outline.particles;
            if array == Array::Ids && bytemuck::cast_slice(into).par_iter().any(is_wrong) {
                let what = "has built a hierarchy over particles that are not there — use --build cpu";
                return Err(Error::Device(format!("{} {what}", self.gpu.info().name)));
            }
            Ok(())
        })?;
        Ok(Structure::of_hierarchy(bvh, particles, radii, radius_scale))
    }

    pub(super) fn gpu(&self) -> &'a Gpu {
        self.gpu
    }

    /// Bytes of the arrays, in the order of [`Array`].
    pub(super) fn array_bytes(&self) -> [u64; 4] {
        self.outline.bytes()
    }

    /// The arrays, in the order of [`Array`].
    pub(super) fn into_arrays(self) -> [Pages; 4] {
        self.arrays
    }
}

/// The key by which the card sorts a particle of these, by center and radius: for tests.
#[cfg(test)]
pub(crate) fn order_of(spheres: Spheres) -> impl Fn(Vec3, f32) -> u64 + use<> {
    let order = Order::of(spheres);
    move |center, radius| order.key(center, radius)
}

/// How much memory the build takes.
#[derive(Clone, Copy)]
struct Plan {
    /// A coordinate, or the radii, of all particles.
    column: u64,
    columns: u64,
    /// Records once, or the boxes of all levels, whichever is more: these take the place of the second records.
    records: u64,
    counts: u64,
    /// In the order of [`Array`].
    arrays: [u64; 4],
}

impl Plan {
    fn of(outline: &Outline) -> Self {
        let particles = outline.particles as u64;
        let boxes: u64 = outline.levels().iter().map(|[_, count]| u64::from(*count)).sum();
        let (mut counts, mut level) = (1, u64::from(RADIX) * particles.div_ceil(RUN.into()));
        while level > 1 {
            counts += level;
            level = level.div_ceil(BLOCK.into());
        }
        Self {
            column: 4 * particles,
            columns: if matches!(outline.law(), Law::Uniform(_)) { 3 } else { 4 },
            records: (RECORD_BYTES * particles).max(BOX_BYTES * boxes),
            counts: 4 * counts,
            arrays: outline.bytes(),
        }
    }

    fn bytes(&self) -> u64 {
        let arrays: u64 = self.arrays.iter().sum();
        self.columns * self.column + 2 * self.records + self.counts + arrays
    }

    /// Fails with [`Error::Memory`] if the card cannot hold or bind it.
    fn check(&self, gpu: &Gpu) -> Result<()> {
        let pages = |bytes: u64| Pages::count(bytes, gpu.page_bytes()).max(1);
        let [nodes, blocks, sizes, ids] = self.arrays.map(pages);
        let (column, records) = (pages(self.column), pages(self.records));
        // What each stage binds, and the counts.
        let bound = [
            4 * column + records,
            2 * records,
            3 * column + records + pages(TABLE_BYTES) + blocks + sizes + ids,
            nodes + blocks + sizes + ids + records,
        ];
        let is_bound = bound.iter().all(|&arrays| arrays < gpu.storage_buffers());
        let words_fit = self.arrays.iter().all(|bytes| bytes / 4 <= u64::from(u32::MAX));
        let has_room = gpu.info().memory_bytes.is_none_or(|bytes| self.bytes() <= bytes);
        if is_bound && words_fit && self.counts <= gpu.binding_bytes() && has_room {
            return Ok(());
        }
        Err(Error::Memory {
            what: format!("building the hierarchy on {}", gpu.info().name),
            needed_bytes: self.bytes(),
            available_bytes: gpu.info().memory_bytes.unwrap_or(0),
            hint: "use --build cpu".into(),
        })
    }
}

/// A kernel and what it is bound to.
struct Kernel {
    pipeline: wgpu::ComputePipeline,
    arrays: wgpu::BindGroup,
}

/// What the steps share.
struct Builder<'a> {
    gpu: &'a Gpu,
    progress: &'a dyn Progress,
    outline: &'a Outline,
    plan: Plan,
    sizes: Sizes,
    task: wgpu::Buffer,
    /// The outline, as walks read it.
    hierarchy: wgpu::Buffer,
    shared_bindings: wgpu::BindGroupLayout,
    shared: wgpu::BindGroup,
    /// Dispatches so far, and one of those that are on their way.
    dispatches: u32,
    mark: Option<wgpu::SubmissionIndex>,
}

impl<'a> Builder<'a> {
    fn new(gpu: &'a Gpu, outline: &'a Outline, plan: Plan, progress: &'a dyn Progress) -> Result<Self> {
        let usage = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
        let task = gpu.buffer("task", size_of::<Task>() as u64, usage)?;
        let hierarchy = gpu.buffer("hierarchy", size_of::<layout::Bvh>() as u64, usage)?;
        gpu.write(&hierarchy, 0, bytemuck::bytes_of(&written(outline)));
        let counts = gpu.buffer("counts of digits", plan.counts.max(16), wgpu::BufferUsages::STORAGE)?;
        let shared_bindings = gpu.layout(&[Binding::Uniform, Binding::Written], 2);
        let shared = gpu.bind(&shared_bindings, &[&task, &counts]);
        let sizes = match outline.law() {
            Law::Uniform(_) => Sizes::Uniform,
            Law::Table(_) => Sizes::Table,
            Law::Each => Sizes::Each,
            Law::Log => Sizes::Log,
        };
        Ok(Self {
            gpu,
            progress,
            outline,
            plan,
            sizes,
            task,
            hierarchy,
            shared_bindings,
            shared,
            dispatches: 0,
            mark: None,
        })
    }

    /// The arrays, and the box of all.
    fn build(&mut self, spheres: Spheres, radii: Option<&[f32]>) -> Result<([Pages; 4], Bounds)> {
        let (gpu, progress) = (self.gpu, self.progress);
        let upload =
            |label, numbers: &[f32]| Pages::upload(gpu, label, bytemuck::cast_slice(numbers), progress);
        progress.begin("upload", Some(self.plan.columns * self.plan.column), "B");
        let [xs, ys, zs] = spheres.particles.positions().offsets();
        let centers = [upload("x", xs)?, upload("y", ys)?, upload("z", zs)?];
        let records = [
            Pages::empty(gpu, "records", self.plan.records)?,
            Pages::empty(gpu, "records", self.plan.records)?,
        ];
        let particles = self.outline.particles as u32;
        progress.begin("build", Some(u64::from(particles) * u64::from(KEY_BITS / 8)), "records");
        let order = Order::of(spheres);
        let task = Task {
            low: order.low.to_array(),
            inv_edge: order.inv_edge,
            giant: order.giant,
            count: particles,
            ..bytemuck::Zeroable::zeroed()
        };
        {
            let radii = upload("radii", radii.unwrap_or(&[]))?;
            let [xs, ys, zs] = &centers;
            let bound = [xs, ys, zs, &radii, &records[0]];
            let write_records = self.kernel(Stage::Keys, "write_records", &bound)?;
            self.run(&write_records, task, particles.div_ceil(64), 64)?;
        }
        self.sort(&records, task)?;
        let arrays = self.leaves(&centers, &records[0], task)?;
        drop(centers);
        let bounds = self.tree(&arrays, &records[1])?;
        Ok((arrays, bounds))
    }

    /// Sorts the first records by their keys, with the second ones as a place to put them.
    fn sort(&mut self, records: &[Pages; 2], task: Task) -> Result<()> {
        let runs = task.count.div_ceil(RUN);
        let kernels = |builder: &Self, from: &Pages, to: &Pages| {
            let kernel = |entry| builder.kernel(Stage::Sort, entry, &[from, to]);
            Ok::<_, Error>([
                kernel("count_digits")?,
                kernel("sum_blocks")?,
                kernel("add_blocks")?,
                kernel("scatter_records")?,
            ])
        };
        let [first, second] = records;
        // An even number of digits: the last one puts the records back where they were.
        let ways = [kernels(self, first, second)?, kernels(self, second, first)?];
        for (bit, [count_digits, sum_blocks, add_blocks, scatter_records]) in
            (0..KEY_BITS).step_by(8).zip(ways.iter().cycle())
        {
            let task = Task { runs, bit, ..task };
            self.run(count_digits, task, runs, RUN)?;
            let mut levels = Vec::new();
            let (mut level, mut count) = (0, RADIX * runs);
            while count > 1 {
                levels.push(Task { level, next_level: level + count, count, ..task });
                (level, count) = (level + count, count.div_ceil(BLOCK));
            }
            for &level in &levels {
                self.run(sum_blocks, level, level.count.div_ceil(BLOCK), BLOCK)?;
            }
            for &level in levels.iter().rev().skip(1) {
                self.run(add_blocks, level, level.count.div_ceil(BLOCK), BLOCK)?;
            }
            self.run(scatter_records, task, runs, RUN)?;
            self.progress.advance(task.count.into());
        }
        Ok(())
    }

    /// Writes blocks, radii and ids, and makes room for nodes.
    fn leaves(&mut self, centers: &[Pages; 3], sorted: &Pages, task: Task) -> Result<[Pages; 4]> {
        let [nodes, blocks, sizes, ids] = self.plan.arrays;
        let empty = |label, bytes| Pages::empty(self.gpu, label, bytes);
        let arrays =
            [empty("nodes", nodes)?, empty("blocks", blocks)?, empty("sizes", sizes)?, empty("ids", ids)?];
        let mut table = [u32::MAX; 256];
        if let Law::Table(radii) = self.outline.law() {
            table.iter_mut().zip(radii).for_each(|(bits, radius)| *bits = radius.to_bits());
        }
        let table = Pages::upload(self.gpu, "radii", bytemuck::cast_slice(&table), &())?;
        let ([xs, ys, zs], [_, blocks, sizes, ids]) = (centers, &arrays);
        let bound = [sorted, xs, ys, zs, &table, blocks, sizes, ids];
        let mut entries = vec!["write_blocks", "write_ids"];
        if self.sizes != Sizes::Uniform {
            entries.push("write_sizes");
        }
        for entry in entries {
            let kernel = self.kernel(Stage::Leaves, entry, &bound)?;
            self.run(&kernel, task, task.count.div_ceil(256), 256)?;
        }
        Ok(arrays)
    }

    /// Writes the nodes, and gives the box of the root.
    fn tree(&mut self, arrays: &[Pages; 4], boxes: &Pages) -> Result<Bounds> {
        let [nodes, blocks, sizes, ids] = arrays;
        let bound = [nodes, blocks, sizes, ids, boxes];
        let [write_leaf_boxes, write_nodes] = [
            self.kernel(Stage::Tree, "write_leaf_boxes", &bound)?,
            self.kernel(Stage::Tree, "write_nodes", &bound)?,
        ];
        let levels = self.outline.levels();
        let mut task = Task { count: levels[0][1], ..bytemuck::Zeroable::zeroed() };
        self.run(&write_leaf_boxes, task, task.count.div_ceil(64), 1024)?;
        for [first, nodes] in levels.into_iter().skip(1).take(self.outline.top() as usize) {
            task = Task { nodes: first, next_level: task.level + task.count, ..task };
            self.run(&write_nodes, task, nodes.div_ceil(64), 512)?;
            task = Task { level: task.next_level, count: nodes, ..task };
        }
        self.gpu.flush()?;
        if self.outline.particles == 0 {
            return Ok(Bounds::EMPTY);
        }
        let corner = |at| boxes.element(self.gpu, at).map(|[x, y, z, _]| Vec3::new(x, y, z));
        let root = 2 * u64::from(task.level);
        Ok(Bounds { min: corner(root)?, max: corner(root + 1)? })
    }

    /// A kernel of a stage, bound to the stage's arrays.
    fn kernel(&self, stage: Stage, entry: &'static str, arrays: &[&Pages]) -> Result<Kernel> {
        let gpu = self.gpu;
        let text = stage.text(self.outline.packing, self.sizes, arrays.iter().map(|pages| pages.outline()));
        let mut bindings = vec![Binding::Uniform];
        let mut buffers = vec![&self.hierarchy];
        for (pages, (_, access)) in arrays.iter().zip(stage.arrays()) {
            let binding = if *access == Access::Read { Binding::Read } else { Binding::Written };
            bindings.extend(pages.buffers.iter().map(|_| binding));
            buffers.extend(&pages.buffers);
        }
        let layout = gpu.layout(&bindings, bindings.len());
        let pipeline_layout = gpu.pipeline_layout(&[&self.shared_bindings, &layout]);
        let pipeline = gpu.pipeline(text, entry, &pipeline_layout, self.progress)?;
        Ok(Kernel { pipeline, arrays: gpu.bind(&layout, &buffers) })
    }

    /// Submits a kernel of so many workgroups, each with so many particles or as much work, in dispatches that take a bounded time.
    fn run(&mut self, kernel: &Kernel, task: Task, groups: u32, group_particles: u32) -> Result<()> {
        let gpu = self.gpu;
        // No dimension may have more than 65535.
        let at_once = (AT_ONCE / group_particles).min(1 << 15);
        for first in (0..groups).step_by(at_once as usize) {
            if self.progress.cancelled() {
                return Err(Error::Interrupted);
            }
            gpu.write(&self.task, 0, bytemuck::bytes_of(&Task { first, ..task }));
            let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            {
                let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
                pass.set_bind_group(0, &self.shared, &[]);
                pass.set_bind_group(1, &kernel.arrays, &[]);
                pass.set_pipeline(&kernel.pipeline);
                pass.dispatch_workgroups(at_once.min(groups - first), 1, 1);
            }
            let submitted = gpu.submit(encoder);
            self.dispatches += 1;
            if self.dispatches.is_multiple_of(AHEAD)
                && let Some(before) = self.mark.replace(submitted)
            {
                gpu.wait(before)?;
            }
        }
        Ok(())
    }
}

/// The outline, as kernels read it.
fn written(outline: &Outline) -> layout::Bvh {
    let mut written = layout::Bvh {
        top: outline.top(),
        particles: outline.particles as u32,
        radius_scale: 1.0,
        radii: *outline.table(),
        radius: if let Law::Uniform(radius) = outline.law() { *radius } else { 0.0 },
        ..bytemuck::Zeroable::zeroed()
    };
    for (level, of) in written.levels.iter_mut().zip(outline.levels()) {
        [level[0], level[1]] = of;
    }
    written
}
