//! Records of single samples, for whoever wants all of them.
//!
//! A record is little endian: column and row of the pixel in the rendered image and the sample's index there (`u32`
//! each), then the sample vector (`f32` each, in the order of the layout). Rejected samples have one as well.

use crate::simd::{LANES, Lanes, lanes_in};
use crate::stats::{Layout, Row};

/// Takes records of samples.
pub trait SampleSink {
    /// Takes the records of some rows of a step, in the order of rows.
    fn take(&mut self, records: Vec<u8>);
}

/// Names of the values before the sample vector.
pub const RECORD_INDICES: [&str; 3] = ["x", "y", "index"];

/// Returns the bytes of a record.
pub fn record_bytes(layout: &Layout) -> usize {
    (RECORD_INDICES.len() + layout.len()) * size_of::<f32>()
}

/// Appends the records of the samples in a mask's lanes, which `row` is about to take into its block of pixels: one row of
/// `values` for each dimension.
pub fn append_records(records: &mut Vec<u8>, y: usize, row: &Row, block: usize, mask: u32, values: &[Lanes]) {
    for lane in lanes_in(mask) {
        let x = block * LANES + lane;
        for index in [x as u32, y as u32, row.next_index(x)] {
            records.extend(index.to_le_bytes());
        }
        values.iter().for_each(|lanes| records.extend(lanes[lane].to_le_bytes()));
    }
}
