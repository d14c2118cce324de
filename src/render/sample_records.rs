//! Records of samples: all values that a sample vector can hold, one path a lane.

use glam::{Mat3, Vec3};

use crate::simd::{LANES, Lanes, Lanes3, apply, multiversioned};
use crate::stats::{Layout, MAX_DIMENSIONS};

/// The values of all blocks of a [`Layout`], one path a lane.
#[derive(Clone, Copy, Debug)]
pub struct SampleRecords {
    /// Film position, in pixels of the whole image.
    pub film: [Lanes; 2],
    /// Radiance from light sampling.
    pub light_sampled: Lanes3,
    /// Radiance of emission that scattered rays hit (BSDF sampling).
    pub bsdf_sampled: Lanes3,
    /// Emission seen by the camera, directly or by perfectly specular scattering only.
    pub visible_emission: Lanes3,
    /// Positions of hits are in scene diameters.
    pub position1: Lanes3,
    pub normal1: Lanes3,
    pub albedo: Lanes3,
    pub position2: Lanes3,
    pub normal2: Lanes3,
    /// Sample values in [0, 1).
    pub lens: [Lanes; 2],
    pub time: Lanes,
    pub light1: [Lanes; 2],
    pub bsdf1: [Lanes; 2],
    /// 1 where the camera ray met a surface.
    pub hit: Lanes,
}

impl SampleRecords {
    pub const NONE: Self = {
        let (zero, pair, vector) = ([0.0; LANES], [[0.0; LANES]; 2], Lanes3::ZERO);
        Self {
            film: pair,
            light_sampled: vector,
            bsdf_sampled: vector,
            visible_emission: vector,
            position1: vector,
            normal1: vector,
            albedo: vector,
            position2: vector,
            normal2: vector,
            lens: pair,
            time: zero,
            light1: pair,
            bsdf1: pair,
            hit: zero,
        }
    };

    /// Computes the sample vectors, a row of `values` for each dimension that is enabled in the layout.
    /// `enabled` is [`Self::enabled_dimensions`]; `exposure` is the factor from radiance to pixel value.
    #[inline]
    pub fn sample_vectors(&self, exposure: f32, enabled: &[usize], values: &mut [Lanes]) {
        sample_vectors(self, exposure, enabled, values);
    }

    /// Returns the records with the radiance multiplied by a matrix. Channels below 0 become 0, because stores have no
    /// negative radiance.
    pub fn white_balanced(&self, matrix: &Mat3) -> Self {
        let mut balanced = Self { bsdf_sampled: Lanes3::ZERO, ..*self };
        for lane in 0..LANES {
            // Scattered light is clamped as a whole
            let scattered = self.light_sampled.at(lane) + self.bsdf_sampled.at(lane);
            balanced.light_sampled.set(lane, without_negative_channels(*matrix * scattered));
            let visible = self.visible_emission.at(lane);
            balanced.visible_emission.set(lane, without_negative_channels(*matrix * visible));
        }
        balanced
    }

    /// Returns the index of each of a layout's dimensions in the layout that has every block.
    pub fn enabled_dimensions(layout: &Layout) -> Vec<usize> {
        let all = Layout::with_blocks(|_| true);
        let index = |name| all.dimensions().iter().position(|d| d.name == name);
        let dimensions = layout.dimensions().iter();
        dimensions.map(|d| index(d.name).expect("a layout with every block has every dimension")).collect()
    }
}

/// Returns a colour with its negative channels set to 0. A channel that is not a number stays, for the store to reject.
fn without_negative_channels(colour: Vec3) -> Vec3 {
    Vec3::select(colour.cmplt(Vec3::ZERO), Vec3::ZERO, colour)
}

/// See [`SampleRecords::sample_vectors`]. All loads and stores are of whole vectors, because a store of another
/// width cannot be forwarded to a load.
#[apply(multiversioned!)]
fn sample_vectors(records: &SampleRecords, exposure: f32, enabled: &[usize], values: &mut [Lanes]) {
    // Compute the pixel values
    let (sampled, found, seen) = (&records.light_sampled, &records.bsdf_sampled, &records.visible_emission);
    let mut colour = Lanes3::ZERO;
    let mut visible = Lanes3::ZERO;
    let mut radiance = Lanes3::ZERO;
    for lane in 0..LANES {
        // Light and BSDF sampling have a sum each, so that their order of arrival makes no difference.
        colour.x[lane] = exposure * (sampled.x[lane] + found.x[lane]);
        colour.y[lane] = exposure * (sampled.y[lane] + found.y[lane]);
        colour.z[lane] = exposure * (sampled.z[lane] + found.z[lane]);
        visible.x[lane] = exposure * seen.x[lane];
        visible.y[lane] = exposure * seen.y[lane];
        visible.z[lane] = exposure * seen.z[lane];
        radiance.x[lane] = colour.x[lane] + visible.x[lane];
        radiance.y[lane] = colour.y[lane] + visible.y[lane];
        radiance.z[lane] = colour.z[lane] + visible.z[lane];
    }

    // List all dimensions in the order of the layout
    let ([film_x, film_y], [lens_u, lens_v]) = (&records.film, &records.lens);
    let ([light_u, light_v], [bsdf_u, bsdf_v]) = (&records.light1, &records.bsdf1);
    let (p1, n1, a) = (&records.position1, &records.normal1, &records.albedo);
    let (p2, n2) = (&records.position2, &records.normal2);
    let (c, r, e) = (&colour, &radiance, &visible);
    let all: [&Lanes; MAX_DIMENSIONS] = [
        film_x,
        film_y,
        &c.x,
        &c.y,
        &c.z,
        &p1.x,
        &p1.y,
        &p1.z,
        &n1.x,
        &n1.y,
        &n1.z,
        &a.x,
        &a.y,
        &a.z,
        &p2.x,
        &p2.y,
        &p2.z,
        &n2.x,
        &n2.y,
        &n2.z,
        lens_u,
        lens_v,
        &records.time,
        light_u,
        light_v,
        bsdf_u,
        bsdf_v,
        &r.x,
        &r.y,
        &r.z,
        &e.x,
        &e.y,
        &e.z,
        &records.hit,
    ];

    // Copy the enabled dimensions
    for (to, &index) in values.iter_mut().zip(enabled) {
        *to = *all[index];
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stats::Block;

    #[test]
    fn sample_vectors_follow_the_layout() {
        // Record distinct values
        let mut records = SampleRecords::NONE;
        let lane = 5;
        records.film = [[1.0; LANES], [2.0; LANES]];
        records.light_sampled.set(lane, Vec3::new(2.0, 4.0, 4.0));
        records.bsdf_sampled.set(lane, Vec3::new(1.0, 0.0, 1.0));
        records.visible_emission.set(lane, Vec3::splat(10.0));
        records.position1.set(lane, Vec3::splat(6.0));
        records.normal1.set(lane, Vec3::splat(7.0));
        records.albedo.set(lane, Vec3::splat(8.0));
        records.position2.set(lane, Vec3::splat(9.0));
        records.normal2.set(lane, Vec3::splat(10.0));
        records.lens = [[11.0; LANES]; 2];
        records.time = [12.0; LANES];
        records.light1 = [[13.0; LANES]; 2];
        records.bsdf1 = [[14.0; LANES]; 2];
        records.hit[lane] = 1.0;

        // Compare with the blocks of the layout
        let layout = Layout::with_blocks(|_| true);
        let mut values = vec![[0.0; LANES]; layout.len()];
        records.sample_vectors(1.0, &SampleRecords::enabled_dimensions(&layout), &mut values);
        let values: Vec<f32> = values.iter().map(|lanes| lanes[lane]).collect();
        let expected: [(Block, &[f32]); 14] = [
            (Block::Film, &[1.0, 2.0]),
            (Block::Colour, &[3.0, 4.0, 5.0]),
            (Block::Position1, &[6.0; 3]),
            (Block::Normal1, &[7.0; 3]),
            (Block::Albedo, &[8.0; 3]),
            (Block::Position2, &[9.0; 3]),
            (Block::Normal2, &[10.0; 3]),
            (Block::Lens, &[11.0; 2]),
            (Block::Time, &[12.0]),
            (Block::Light1, &[13.0; 2]),
            (Block::Bsdf1, &[14.0; 2]),
            (Block::Radiance, &[13.0, 14.0, 15.0]),
            (Block::Emission, &[10.0; 3]),
            (Block::Hit, &[1.0]),
        ];
        for (block, expected) in expected {
            assert_eq!(values[layout.block(block).unwrap()], *expected, "{block:?}");
        }
    }

    #[test]
    fn white_balance_multiplies_the_radiance_and_clamps_negative_channels() {
        let mut records = SampleRecords::NONE;
        records.light_sampled.set(3, Vec3::new(1.0, 2.0, 3.0));
        records.bsdf_sampled.set(3, Vec3::new(0.0, 1.0, 0.0));
        records.visible_emission.set(3, Vec3::new(0.0, 4.0, f32::NAN));
        let matrix = Mat3::from_cols(Vec3::new(1.0, 0.0, 0.0), Vec3::new(-1.0, 2.0, 0.0), Vec3::Z);
        let balanced = records.white_balanced(&matrix);
        assert_eq!(balanced.light_sampled.at(3), Vec3::new(0.0, 6.0, 3.0));
        assert_eq!(balanced.bsdf_sampled.at(3), Vec3::ZERO);
        assert!(balanced.visible_emission.at(3).z.is_nan());
        assert_eq!(balanced.light_sampled.at(0), Vec3::ZERO);
    }

    #[test]
    fn disabled_dimensions_are_left_out() {
        let layout = Layout::with_blocks(|block| block == Block::Hit);
        assert_eq!(SampleRecords::enabled_dimensions(&layout), [0, 1, 2, 3, 4, 33]);
    }
}
