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
    /// Of what it holds, without what fills the last element.
    pub(super) bytes: u64,
}

impl Pages {
    /// How many pages `bytes` need of at most `page_bytes`.
    pub(super) fn count(bytes: u64, page_bytes: u64) -> u64 {
        bytes.div_ceil(ELEMENT_BYTES << shift(page_bytes))
    }

    /// Copies `bytes` to the card. The end is filled up to whole elements; an empty array has no page.
    pub(super) fn upload(gpu: &Gpu, label: &str, bytes: &[u8], progress: &dyn Progress) -> Result<Self> {
        let pages = Self::room(gpu, label, bytes.len() as u64)?;
        pages.write(gpu, bytes, progress)?;
        Ok(pages)
    }

    /// Copies other bytes to the card, as many as there are.
    pub(super) fn write(&self, gpu: &Gpu, bytes: &[u8], progress: &dyn Progress) -> Result<()> {
        let nothing = [0_u8; ELEMENT_BYTES as usize];
        let page_bytes = (ELEMENT_BYTES << self.shift) as usize;
        for (buffer, page) in self.buffers.iter().zip(bytes.chunks(page_bytes)) {
            for (at, chunk) in (0..).step_by(CHUNK_BYTES).zip(page.chunks(CHUNK_BYTES)) {
                if progress.cancelled() {
                    return Err(Error::Interrupted);
                }
                // Only a last chunk has an end that is no whole element.
                let whole = chunk.len() / ELEMENT_BYTES as usize * ELEMENT_BYTES as usize;
                gpu.write(buffer, at, &chunk[..whole]);
                if whole < chunk.len() {
                    let mut end = nothing;
                    end[..chunk.len() - whole].copy_from_slice(&chunk[whole..]);
                    gpu.write(buffer, at + whole as u64, &end);
                }
                gpu.flush()?;
                progress.advance(chunk.len() as u64);
            }
        }
        Ok(())
    }

    /// Room for `bytes`, to be written and read back; no less than for one element.
    pub(super) fn empty(gpu: &Gpu, label: &str, bytes: u64) -> Result<Self> {
        Ok(Self { bytes, ..Self::room(gpu, label, bytes.max(1))? })
    }

    /// Room for `bytes`; nothing has no page.
    fn room(gpu: &Gpu, label: &str, bytes: u64) -> Result<Self> {
        let shift = shift(gpu.page_bytes());
        let page_bytes = ELEMENT_BYTES << shift;
        let size = bytes.next_multiple_of(ELEMENT_BYTES);
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC;
        let page = |first: u64| gpu.buffer(label, page_bytes.min(size - first), usage);
        let buffers = (0..size).step_by(page_bytes as usize).map(page).collect::<Result<_>>()?;
        Ok(Self { buffers, shift, bytes })
    }

    /// Waits, and reads back the first bytes.
    pub(super) fn read(&self, gpu: &Gpu, into: &mut [u8], progress: &dyn Progress) -> Result<()> {
        let page_bytes = (ELEMENT_BYTES << self.shift) as usize;
        for (page, into) in self.buffers.iter().zip(into.chunks_mut(page_bytes)) {
            for (at, into) in (0..).step_by(CHUNK_BYTES).zip(into.chunks_mut(CHUNK_BYTES)) {
                if progress.cancelled() {
                    return Err(Error::Interrupted);
                }
                // Whole elements are copied.
                let end = at + (into.len() as u64).next_multiple_of(ELEMENT_BYTES);
                gpu.read(page, at..end, |bytes: &[u8]| into.copy_from_slice(&bytes[..into.len()]))?;
                progress.advance(into.len() as u64);
            }
        }
        Ok(())
    }

    /// Waits, and reads back one element.
    pub(super) fn element(&self, gpu: &Gpu, at: u64) -> Result<[f32; 4]> {
        let page = (at >> self.shift) as usize;
        let first = ELEMENT_BYTES * (at & ((1 << self.shift) - 1));
        gpu.read(&self.buffers[page], first..first + ELEMENT_BYTES, |element: &[[f32; 4]]| element[0])
    }

    /// How many pages there are, and the binary logarithm of their elements.
    pub(super) fn outline(&self) -> (usize, u32) {
        (self.buffers.len(), self.shift)
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

/// Declares pages that are written from `first_binding` on, and the function `set_name` that writes an element; `name` reads one.
pub(super) fn declare_elements(name: &str, first_binding: usize, count: usize, shift: u32) -> String {
    let read =
        declare(name, (1, first_binding), count, shift).replace("<storage, read>", "<storage, read_write>");
    read + &setter(name, "vec4u", count, shift)
}

/// Declares pages that are written from `first_binding` on, and the function `set_name` that writes a word of four bytes.
pub(super) fn declare_words(name: &str, first_binding: usize, count: usize, shift: u32) -> String {
    let mut text = String::new();
    for page in 0..count {
        let binding = first_binding + page;
        // Writing to a string cannot fail.
        _ = writeln!(
            text,
            "@group(1) @binding({binding}) var<storage, read_write> {name}_{page}: array<u32>;"
        );
    }
    text + &setter(name, "u32", count, shift + 2)
}

/// The function that writes to pages of 2^`shift` of a type.
fn setter(name: &str, of: &str, count: usize, shift: u32) -> String {
    let mut text = format!("fn set_{name}(at: u32, value: {of}) {{\n");
    if count > 1 {
        _ = writeln!(text, "    let inside = at & {}u;\n    switch at >> {shift}u {{", (1_u64 << shift) - 1);
        for page in 1..count {
            _ = writeln!(text, "        case {page}u: {{ {name}_{page}[inside] = value; }}");
        }
        _ = writeln!(text, "        default: {{ {name}_0[inside] = value; }}\n    }}\n}}");
    } else {
        _ = writeln!(text, "    {name}_0[at] = value;\n}}");
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

    #[test]
    fn a_word_lies_in_the_page_of_its_element() {
        let text = declare_words("ids", 3, 2, 10);
        assert!(text.contains("@binding(4) var<storage, read_write> ids_1: array<u32>"), "{text}");
        assert!(text.contains("at >> 12u") && text.contains("at & 4095u"), "{text}");
    }
}
