//! Arrays on the card: in pages, since a shader sees no more than a limited part of the memory through one binding.
//!
//! A page has a power of two of elements, so that a shader finds an element's page by a shift. Elements are sixteen bytes.

use std::fmt::Write;

use super::device::Gpu;
use crate::error::{Error, Result};
use crate::progress::Progress;

/// Bytes of an element.
const ELEMENT_BYTES: u64 = 16;
/// What is on its way to the card at one time.
const CHUNK_BYTES: usize = 32 << 20;

/// An array in pages.
pub(super) struct Pages {
    pub(super) buffers: Vec<wgpu::Buffer>,
    /// Binary logarithm of the elements of a page.
    pub(super) shift: u32,
}

impl Pages {
    /// How many pages `bytes` need of at most `page_bytes`.
    pub(super) fn count(bytes: u64, page_bytes: u64) -> u64 {
        bytes.div_ceil(ELEMENT_BYTES << shift(page_bytes))
    }

    /// Copies `bytes` to the card. The end is filled up to whole elements; an empty array has no page.
    pub(super) fn upload(gpu: &Gpu, label: &str, bytes: &[u8], progress: &dyn Progress) -> Result<Self> {
        let shift = shift(gpu.page_bytes());
        let page_bytes = (ELEMENT_BYTES << shift) as usize;
        let mut pages = Self { buffers: Vec::new(), shift };
        let nothing = [0_u8; ELEMENT_BYTES as usize];
        for page in bytes.chunks(page_bytes) {
            let size = (page.len() as u64).next_multiple_of(ELEMENT_BYTES);
            let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
            let buffer = gpu.buffer(label, size, usage)?;
            for (at, chunk) in (0..).step_by(CHUNK_BYTES).zip(page.chunks(CHUNK_BYTES)) {
                if progress.cancelled() {
                    return Err(Error::Interrupted);
                }
                // Only a last chunk has an end that is no whole element.
                let whole = chunk.len() / ELEMENT_BYTES as usize * ELEMENT_BYTES as usize;
                gpu.write(&buffer, at, &chunk[..whole]);
                if whole < chunk.len() {
                    let mut end = nothing;
                    end[..chunk.len() - whole].copy_from_slice(&chunk[whole..]);
                    gpu.write(&buffer, at + whole as u64, &end);
                }
                gpu.flush()?;
                progress.advance(chunk.len() as u64);
            }
            pages.buffers.push(buffer);
        }
        Ok(pages)
    }

    /// Declares the pages in `group` from `first_binding` on, and the function `name` that reads an element; without pages it reads
    /// zeros.
    pub(super) fn declare(&self, name: &str, group: u32, first_binding: usize) -> String {
        declare(name, (group, first_binding), self.buffers.len(), self.shift)
    }
}

/// See [`Pages::declare`].
pub(super) fn declare(name: &str, (group, first_binding): (u32, usize), count: usize, shift: u32) -> String {
    let mut text = String::new();
    // Writing to a string cannot fail.
    for page in 0..count {
        let binding = first_binding + page;
        _ = writeln!(
            text,
            "@group({group}) @binding({binding}) var<storage, read> {name}_{page}: array<vec4u>;"
        );
    }
    _ = writeln!(text, "fn {name}(at: u32) -> vec4u {{");
    if count == 0 {
        _ = writeln!(text, "    return vec4u();\n}}");
    } else if count > 1 {
        _ = writeln!(text, "    let inside = at & {}u;\n    switch at >> {shift}u {{", (1_u64 << shift) - 1);
        for page in 1..count {
            _ = writeln!(text, "        case {page}u: {{ return {name}_{page}[inside]; }}");
        }
        _ = writeln!(text, "        default: {{ return {name}_0[inside]; }}\n    }}\n}}");
    } else {
        _ = writeln!(text, "    return {name}_0[at];\n}}");
    }
    text
}

/// Binary logarithm of how many elements a page may have, no more than an index can name.
fn shift(page_bytes: u64) -> u32 {
    (page_bytes / ELEMENT_BYTES).max(1).ilog2().min(31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pages_are_as_large_as_a_binding_may_be() {
        assert_eq!(shift(128 << 20), 23);
        assert_eq!(shift((1 << 31) - 1), 26);
        assert_eq!(Pages::count(0, 1 << 20), 0);
        assert_eq!(Pages::count((1 << 20) + 1, 1 << 20), 2);
        assert_eq!(Pages::count(1 << 20, 1 << 20), 1);
    }
}
