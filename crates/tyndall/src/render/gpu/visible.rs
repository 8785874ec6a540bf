//! The visible set on the card: what a pass notes of its walk, so that later passes of the same view need not walk there again.
//!
//! The first pass writes down, by tile, the leaves that it drew and the subtrees that it left out because they lay behind every sample.
//! Together they hold every particle that touches the tile: a later pass draws the leaves, and looks only into subtrees that are no longer behind.
//! Tiles without room for all of it, and those that were laid aside, begin at the root every time.

use super::device::Gpu;
use super::film::Film;
use super::resident::{Binding, Resident};
use super::shader::{NOTED, Tiling};
use crate::error::{Error, Result};

/// No more than this part of a card's memory holds notes.
const MEMORY_SHARE: u64 = 8;

/// See the module.
pub(super) struct VisibleSet {
    tiling: Tiling,
    is_noted: bool,
    /// Passes that began with it.
    passes: u64,
    counts: wgpu::Buffer,
    group: wgpu::BindGroup,
    layout: wgpu::PipelineLayout,
}

impl VisibleSet {
    /// For pictures of `size` pixels in tiles of a shape. None if the card has too little memory for it.
    pub(super) fn new(
        resident: &Resident,
        film: &Film,
        size: [u32; 2],
        tiling: Tiling,
    ) -> Result<Option<Self>> {
        let gpu = resident.gpu();
        let tiles: u64 = (0..2).map(|axis| u64::from(size[axis].div_ceil(tiling.tile[axis]))).product();
        let bytes = 8 * tiles * u64::from(NOTED[0] + NOTED[1]);
        let has_room = gpu.info().memory_bytes.is_none_or(|memory| bytes <= memory / MEMORY_SHARE);
        // Two more than what tiles have anyway.
        if bytes > gpu.binding_bytes() || !has_room || resident.buffers() + 3 > gpu.storage_buffers() {
            return Ok(None);
        }
        let storage = wgpu::BufferUsages::STORAGE;
        let made = gpu
            .buffer("counts of what was drawn", 8 * tiles, storage | wgpu::BufferUsages::COPY_SRC)
            .and_then(|counts| Ok((counts, gpu.buffer("what was drawn", bytes, storage)?)));
        let (counts, entries) = match made {
            Ok(made) => made,
            Err(Error::Memory { .. }) => return Ok(None),
            Err(error) => return Err(error),
        };
        let bindings = gpu.layout(&[Binding::Written; 3], 3);
        Ok(Some(Self {
            tiling,
            is_noted: false,
            passes: 0,
            group: gpu.bind(&bindings, &[film.aside(), &counts, &entries]),
            layout: resident.layout_with(&bindings),
            counts,
        }))
    }

    /// Forgets it, for another view.
    pub(super) fn restart(&mut self) {
        (self.is_noted, self.passes) = (false, 0);
    }

    /// Whether it can be noted by tiles of this shape.
    pub(super) fn is_of(&self, tiling: Tiling) -> bool {
        self.tiling == tiling
    }

    /// Whether it has been noted.
    pub(super) fn is_noted(&self) -> bool {
        self.is_noted
    }

    /// A pass has noted it, or begun with it.
    pub(super) fn used(&mut self) {
        self.passes += u64::from(self.is_noted);
        self.is_noted = true;
    }

    /// What a walk is bound to besides pass and scene.
    pub(super) fn group(&self) -> &wgpu::BindGroup {
        &self.group
    }

    pub(super) fn layout(&self) -> &wgpu::PipelineLayout {
        &self.layout
    }

    /// Waits, and counts the leaves that passes knew of before they began, over all tiles.
    pub(super) fn remembered_leaves(&self, gpu: &Gpu) -> Result<u64> {
        if self.passes == 0 {
            // Perhaps nothing was written yet.
            return Ok(0);
        }
        let leaves = gpu.read(&self.counts, 0..self.counts.size(), |counts: &[[u32; 2]]| {
            let known = counts.iter().filter(|[leaves, _]| *leaves != super::layout::NONE);
            known.map(|&[leaves, _]| u64::from(leaves)).sum::<u64>()
        })?;
        Ok(leaves * self.passes)
    }
}
