//! Arrays of a state file: little-endian numbers in a buffer of known size.

use crate::image::Planes;

/// Writes arrays to the front of a buffer, and shortens it by them.
pub(super) struct ArrayWriter<'b>(pub &'b mut [u8]);

/// Reads arrays from the front of a buffer, and shortens it by them. The caller knows from the header how long it is.
pub(super) struct ArrayReader<'b>(pub &'b [u8]);

impl ArrayWriter<'_> {
    /// Splits off the first `len` bytes.
    fn space(&mut self, len: usize) -> &mut [u8] {
        let (space, rest) = std::mem::take(&mut self.0).split_at_mut(len);
        self.0 = rest;
        space
    }

    pub fn planes(&mut self, planes: &Planes) {
        let space = self.space(size_of_val(planes.data()));
        space
            .chunks_exact_mut(4)
            .zip(planes.data())
            .for_each(|(out, v)| out.copy_from_slice(&v.to_le_bytes()));
    }

    pub fn counts(&mut self, counts: &[u32]) {
        let space = self.space(size_of_val(counts));
        space.chunks_exact_mut(4).zip(counts).for_each(|(out, v)| out.copy_from_slice(&v.to_le_bytes()));
    }
}

impl<'b> ArrayReader<'b> {
    /// # Panics
    /// If fewer bytes are left, as all methods.
    pub fn bytes(&mut self, len: usize) -> &'b [u8] {
        let (bytes, rest) = self.0.split_at(len);
        self.0 = rest;
        bytes
    }

    pub fn planes(&mut self, width: usize, height: usize, count: usize) -> Planes {
        let mut planes = Planes::new(width, height, count);
        let bytes = self.bytes(size_of_val(planes.data()));
        planes.data_mut().iter_mut().zip(bytes.as_chunks().0).for_each(|(v, &b)| *v = f32::from_le_bytes(b));
        planes
    }

    pub fn counts(&mut self, len: usize) -> Vec<u32> {
        self.bytes(4 * len).as_chunks().0.iter().map(|&b| u32::from_le_bytes(b)).collect()
    }
}
