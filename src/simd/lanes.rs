//! Arrays of one value a lane, and bit masks of lanes.

use glam::Vec3;

/// Number of values that a packet of paths, a block of pixels or a row of a kernel works on at once: one
/// AVX-512 register of `f32`, or two AVX2 registers.
pub const LANES: usize = 16;

const _: () = assert!(LANES < u32::BITS as usize, "a mask has a bit for every lane");

/// Mask of all lanes.
pub const ALL_LANES: u32 = u32::MAX >> (u32::BITS - LANES as u32);

/// One value a lane.
pub type Lanes<T = f32> = [T; LANES];

/// One three-dimensional vector a lane.
#[derive(Clone, Copy, Debug)]
pub struct Lanes3 {
    pub x: Lanes,
    pub y: Lanes,
    pub z: Lanes,
}

impl Lanes3 {
    pub const ZERO: Self = Self { x: [0.0; LANES], y: [0.0; LANES], z: [0.0; LANES] };

    #[inline(always)]
    pub fn at(&self, lane: usize) -> Vec3 {
        Vec3::new(self.x[lane], self.y[lane], self.z[lane])
    }

    #[inline(always)]
    pub fn set(&mut self, lane: usize, v: Vec3) {
        (self.x[lane], self.y[lane], self.z[lane]) = (v.x, v.y, v.z);
    }

    /// Sets a lane if `is_on`, without a branch.
    #[inline(always)]
    pub fn set_if(&mut self, lane: usize, is_on: bool, v: Vec3) {
        self.x[lane] = if is_on { v.x } else { self.x[lane] };
        self.y[lane] = if is_on { v.y } else { self.y[lane] };
        self.z[lane] = if is_on { v.z } else { self.z[lane] };
    }
}

/// Iterates over the lanes of a mask, in ascending order.
#[inline]
pub fn lanes_in(mut mask: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let lane = mask.trailing_zeros() as usize;
        mask &= mask.wrapping_sub(1);
        (lane < LANES).then_some(lane)
    })
}

/// Returns the mask of the lanes for which `holds` is true.
#[inline(always)]
pub fn lane_mask(holds: impl Fn(usize) -> bool) -> u32 {
    (0..LANES).fold(0, |mask, lane| mask | u32::from(holds(lane)) << lane)
}

/// Groups the lanes of a mask by their values: calls `each` with every value and the mask of its lanes.
#[inline]
pub fn group_lanes(values: &Lanes<u32>, mut mask: u32, mut each: impl FnMut(u32, u32)) {
    while mask != 0 {
        let value = values[mask.trailing_zeros() as usize % LANES];
        let same = mask & lane_mask(|lane| values[lane] == value);
        mask &= !same;
        each(value, same);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lanes_are_grouped_by_value() {
        let values: Lanes<u32> = std::array::from_fn(|lane| lane as u32 % 3);
        let mut seen = Vec::new();
        group_lanes(&values, 0b1111_0000_0001_0110, |value, lanes| seen.push((value, lanes)));
        assert_eq!(
            seen,
            [(1, 0b0010_0000_0001_0010), (2, 0b0100_0000_0000_0100), (0, 0b1001_0000_0000_0000)]
        );
        assert_eq!(lanes_in(0b1001_0000_0000_0101).collect::<Vec<_>>(), [0, 2, 12, 15]);
    }
}
