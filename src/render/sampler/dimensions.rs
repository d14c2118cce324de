//! Allots the dimensions of a sampler to purposes.
//!
//! A purpose that the scene does not require has no dimension, and no value is generated for it. The others
//! are consecutive, so that the film position shares its set of four dimensions with those that matter most
//! next: the lens, or light sampling at the first hit.

use super::bounce_samples::BounceSamples;
use super::camera_samples::CameraSamples;
use super::sample_address::SampleAddresses;
use super::sampler::Sampler;
use super::value_block::{value_block, value_pair};
use crate::simd::{LANES, Lanes};

/// Purposes for which the scene requires sample values.
#[derive(Clone, Copy, Debug)]
pub struct RequiredDimensions {
    pub lens: bool,
    pub time: bool,
    /// There is more than one light to choose from.
    pub light_choice: bool,
    /// Some light has an extent.
    pub light_uv: bool,
    /// Some material has several lobes.
    pub lobe: bool,
    /// BSDFs are sampled.
    pub bsdf_uv: bool,
    /// Some material is a random mix of others.
    pub mix: bool,
    pub roulette: bool,
}

/// The first dimension of each purpose. Those of a bounce count from the start of its block.
#[derive(Clone, Debug)]
pub struct Dimensions {
    lens: Option<u32>,
    time: Option<u32>,
    first_bounce: u32,
    bounce_size: u32,
    light_uv: Option<u32>,
    bsdf_uv: Option<u32>,
    light_choice: Option<u32>,
    lobe: Option<u32>,
    mix: Option<u32>,
    roulette: Option<u32>,
}

const FILM: u32 = 0;

impl Dimensions {
    pub fn new(required: &RequiredDimensions) -> Self {
        let mut camera = Allotment { next: FILM + 2 };
        let lens = camera.take(required.lens, 2);
        let time = camera.take(required.time, 1);
        let mut bounce = Allotment { next: 0 };
        Self {
            lens,
            time,
            first_bounce: camera.end(),
            light_uv: bounce.take(required.light_uv, 2),
            bsdf_uv: bounce.take(required.bsdf_uv, 2),
            light_choice: bounce.take(required.light_choice, 1),
            lobe: bounce.take(required.lobe, 1),
            mix: bounce.take(required.mix, 1),
            roulette: bounce.take(required.roulette, 1),
            bounce_size: bounce.end(),
        }
    }

    /// Generates the sample values of camera rays.
    pub fn camera<S: Sampler>(&self, samples: &SampleAddresses) -> CameraSamples {
        // Both pairs of the first bounce come first in its block.
        let values = value_block::<S>(samples, &[FILM; LANES], self.first_bounce + 4);
        let pair = |d: Option<u32>| d.map_or([[0.0; LANES]; 2], |d| value_pair(&values, d));
        CameraSamples {
            film: value_pair(&values, FILM),
            lens: pair(self.lens),
            time: self.time.map_or([0.0; LANES], |d| values[d as usize]),
            light_uv: pair(self.light_uv.map(|d| self.first_bounce + d)),
            bsdf_uv: pair(self.bsdf_uv.map(|d| self.first_bounce + d)),
        }
    }

    /// Generates the sample values of the scattering event after `bounces` others.
    pub fn bounce<S: Sampler>(&self, samples: &SampleAddresses, bounces: &Lanes<u32>) -> BounceSamples {
        let mut starts = [0; LANES];
        for lane in 0..LANES {
            starts[lane] = self.first_bounce + bounces[lane] * self.bounce_size;
        }
        let values = value_block::<S>(samples, &starts, self.bounce_size);
        let pair = |d: Option<u32>| d.map_or([[0.0; LANES]; 2], |d| value_pair(&values, d));
        let single = |d: Option<u32>| d.map_or([0.0; LANES], |d| values[d as usize]);
        BounceSamples {
            light_uv: pair(self.light_uv),
            bsdf_uv: pair(self.bsdf_uv),
            light_choice: single(self.light_choice),
            lobe: single(self.lobe),
            mix: single(self.mix),
            roulette: single(self.roulette),
        }
    }
}

/// Allots consecutive dimensions.
struct Allotment {
    next: u32,
}

impl Allotment {
    fn take(&mut self, is_required: bool, count: u32) -> Option<u32> {
        let start = self.next;
        is_required.then(|| {
            self.next += count;
            start
        })
    }

    /// Returns the next even dimension: pairs must not straddle two sets.
    fn end(&self) -> u32 {
        self.next.next_multiple_of(2)
    }
}

#[cfg(test)]
mod tests {
    use super::super::sobol::Sobol;
    use super::*;

    /// Returns the address of one sample, in every lane.
    fn sample() -> SampleAddresses {
        let mut samples = SampleAddresses::NONE;
        (0..LANES).for_each(|lane| samples.set(lane, Sobol::for_pixel(0, 0, 0).address(0)));
        samples
    }

    const NONE: RequiredDimensions = RequiredDimensions {
        lens: false,
        time: false,
        light_choice: false,
        light_uv: false,
        lobe: false,
        bsdf_uv: false,
        mix: false,
        roulette: false,
    };

    #[test]
    fn a_pinhole_leaves_the_first_set_to_film_and_light() {
        let dimensions = Dimensions::new(&RequiredDimensions {
            light_uv: true,
            bsdf_uv: true,
            light_choice: true,
            ..NONE
        });
        assert_eq!((dimensions.lens, dimensions.time), (None, None));
        assert_eq!(dimensions.first_bounce + dimensions.light_uv.unwrap(), 2);
        assert_eq!(dimensions.bounce_size, 6);
    }

    #[test]
    fn purposes_never_share_a_dimension() {
        let all = RequiredDimensions {
            lens: true,
            time: true,
            light_choice: true,
            light_uv: true,
            lobe: true,
            bsdf_uv: true,
            mix: true,
            roulette: true,
        };
        let dimensions = Dimensions::new(&all);
        let samples = sample();
        let camera = dimensions.camera::<Sobol>(&samples);
        let mut values = vec![camera.film[0][0], camera.film[1][0], camera.lens[0][0], camera.lens[1][0]];
        values.push(camera.time[0]);
        // Of eight bounces, one a lane.
        let b = dimensions.bounce::<Sobol>(&samples, &std::array::from_fn(|lane| lane as u32));
        for lane in 0..8 {
            values.extend([b.light_uv[0][lane], b.light_uv[1][lane], b.bsdf_uv[0][lane], b.bsdf_uv[1][lane]]);
            values.extend([b.light_choice[lane], b.lobe[lane], b.mix[lane], b.roulette[lane]]);
        }
        let count = values.len();
        values.sort_by(f32::total_cmp);
        values.dedup();
        assert_eq!(values.len(), count);
    }

    #[test]
    fn purposes_that_are_not_required_have_no_values() {
        let dimensions = Dimensions::new(&NONE);
        assert_eq!((dimensions.first_bounce, dimensions.bounce_size), (2, 0));
        let b = dimensions.bounce::<Sobol>(&sample(), &[3; LANES]);
        assert_eq!((b.light_uv[0][0], b.light_uv[1][0], b.lobe[0], b.roulette[0]), (0.0, 0.0, 0.0, 0.0));
    }
}
