//! Which dimension of a sample's numbers serves which purpose.
//!
//! A purpose that the scene does not call for has no dimension, and no number is made for it; the
//! others move together, so that the film position shares its four-dimensional set with what
//! matters most next: the lens, or the light at the first hit.

use glam::Vec2;

use super::{Address, Addresses, SET, Source, hash};
use crate::geometry::{LANES, Lanes};

/// What the scene calls for.
#[derive(Clone, Copy, Debug)]
pub struct Needs {
    pub lens: bool,
    pub time: bool,
    /// There is more than one light to choose from.
    pub light_choice: bool,
    /// Lights have an extent.
    pub light_uv: bool,
    /// Materials have several lobes.
    pub lobe: bool,
    /// Directions are sampled from BSDFs.
    pub bsdf_uv: bool,
    /// Materials are mixed at random.
    pub mix: bool,
    pub roulette: bool,
}

/// Numbers of camera rays, and those of the first scattering event that are recorded.
#[derive(Clone, Copy, Debug)]
pub struct CameraNumbers {
    pub film: [Lanes; 2],
    pub lens: [Lanes; 2],
    pub time: Lanes,
    pub light_uv: [Lanes; 2],
    pub bsdf_uv: [Lanes; 2],
}

/// Numbers of one scattering event of each of sixteen paths; 0 where the scene does not call for one.
#[derive(Clone, Copy, Debug)]
pub struct BounceNumbers {
    pub light_uv: [Lanes; 2],
    pub bsdf_uv: [Lanes; 2],
    pub light: Lanes,
    pub lobe: Lanes,
    pub mix: Lanes,
    pub roulette: Lanes,
}

impl BounceNumbers {
    #[inline(always)]
    pub fn bsdf_uv_at(&self, lane: usize) -> Vec2 {
        Vec2::new(self.bsdf_uv[0][lane], self.bsdf_uv[1][lane])
    }

    /// The number for the next mix of the sample at `address` after `passes` others that let the path pass:
    /// another one each time, as what one layer was asked tells what the number is.
    #[inline]
    pub fn mix_after(&self, lane: usize, passes: u32, address: Address) -> f32 {
        let number = self.mix[lane];
        if passes == 0 {
            return number;
        }
        let sample = hash(address.key ^ u64::from(address.index));
        let bits = hash(sample ^ (u64::from(passes) << 32 | u64::from(number.to_bits())));
        (bits >> 40) as f32 / (1 << 24) as f32
    }
}

/// Sets that a block of numbers takes at most: that of a bounce has eight, and may start in the middle of one.
const MOST_SETS: usize = 3;

/// A block of numbers of each of sixteen samples.
type NumberBlock = [Lanes; MOST_SETS * SET as usize];

/// The dimension of each purpose. Those of a bounce count from the start of its block.
#[derive(Clone, Debug)]
pub struct Dimensions {
    lens: Option<u32>,
    time: Option<u32>,
    first_bounce: u32,
    bounce_size: u32,
    light_uv: Option<u32>,
    bsdf_uv: Option<u32>,
    light: Option<u32>,
    lobe: Option<u32>,
    mix: Option<u32>,
    roulette: Option<u32>,
}

const FILM: u32 = 0;

impl Dimensions {
    pub fn new(needs: &Needs) -> Self {
        let mut camera = Allotment { next: FILM + 2 };
        let lens = camera.take(needs.lens, 2);
        let time = camera.take(needs.time, 1);
        let mut bounce = Allotment { next: 0 };
        Self {
            lens,
            time,
            first_bounce: camera.end(),
            light_uv: bounce.take(needs.light_uv, 2),
            bsdf_uv: bounce.take(needs.bsdf_uv, 2),
            light: bounce.take(needs.light_choice, 1),
            lobe: bounce.take(needs.lobe, 1),
            mix: bounce.take(needs.mix, 1),
            roulette: bounce.take(needs.roulette, 1),
            bounce_size: bounce.end(),
        }
    }

    pub fn camera<S: Source>(&self, samples: &Addresses) -> CameraNumbers {
        // Both pairs come first in their block.
        let numbers = block::<S>(samples, &[FILM; LANES], self.first_bounce + 4);
        let pair = |d: Option<u32>| d.map_or([[0.0; LANES]; 2], |d| two(&numbers, d));
        CameraNumbers {
            film: two(&numbers, FILM),
            lens: pair(self.lens),
            time: self.time.map_or([0.0; LANES], |d| numbers[d as usize]),
            light_uv: pair(self.light_uv.map(|d| self.first_bounce + d)),
            bsdf_uv: pair(self.bsdf_uv.map(|d| self.first_bounce + d)),
        }
    }

    /// Numbers of the scattering event after `bounces` others.
    pub fn bounce<S: Source>(&self, samples: &Addresses, bounces: &Lanes<u32>) -> BounceNumbers {
        let mut starts = [0; LANES];
        for lane in 0..LANES {
            starts[lane] = self.first_bounce + bounces[lane] * self.bounce_size;
        }
        let numbers = block::<S>(samples, &starts, self.bounce_size);
        let pair = |d: Option<u32>| d.map_or([[0.0; LANES]; 2], |d| two(&numbers, d));
        let single = |d: Option<u32>| d.map_or([0.0; LANES], |d| numbers[d as usize]);
        BounceNumbers {
            light_uv: pair(self.light_uv),
            bsdf_uv: pair(self.bsdf_uv),
            light: single(self.light),
            lobe: single(self.lobe),
            mix: single(self.mix),
            roulette: single(self.roulette),
        }
    }
}

fn two(numbers: &NumberBlock, dimension: u32) -> [Lanes; 2] {
    [numbers[dimension as usize], numbers[dimension as usize + 1]]
}

/// The `size` dimensions from `starts` on, which are even: pairs are stratified together, and never straddle
/// two sets.
fn block<S: Source>(samples: &Addresses, starts: &Lanes<u32>, size: u32) -> NumberBlock {
    let mut sets = [0; LANES];
    let mut late = [0; LANES];
    let mut most = 0;
    for lane in 0..LANES {
        sets[lane] = starts[lane] / SET;
        late[lane] = starts[lane] % SET;
        most |= late[lane];
    }
    let mut numbers: NumberBlock = [[0.0; LANES]; MOST_SETS * SET as usize];
    let (made, _) = numbers.as_chunks_mut();
    for set in made.iter_mut().take((size + most).div_ceil(SET) as usize) {
        S::numbers(samples, &sets, set);
        sets.iter_mut().for_each(|set| *set += 1);
    }
    if most > 0 {
        for d in 0..size as usize {
            for lane in 0..LANES {
                let there = numbers[d + 2][lane];
                numbers[d][lane] = if late[lane] == 0 { numbers[d][lane] } else { there };
            }
        }
    }
    numbers
}

/// Gives out dimensions one after the other.
struct Allotment {
    next: u32,
}

impl Allotment {
    fn take(&mut self, needed: bool, count: u32) -> Option<u32> {
        let start = self.next;
        needed.then(|| {
            self.next += count;
            start
        })
    }

    /// The next even dimension, since pairs must not straddle two sets.
    fn end(&self) -> u32 {
        self.next.next_multiple_of(2)
    }
}

#[cfg(test)]
mod tests {
    use super::super::Sobol;
    use super::*;

    /// The same sample in every lane.
    fn sample() -> Addresses {
        let mut samples = Addresses::NONE;
        (0..LANES).for_each(|lane| samples.set(lane, Sobol::for_pixel(0, 0, 0).address(0)));
        samples
    }

    const NOTHING: Needs = Needs {
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
        let dimensions =
            Dimensions::new(&Needs { light_uv: true, bsdf_uv: true, light_choice: true, ..NOTHING });
        assert_eq!((dimensions.lens, dimensions.time), (None, None));
        assert_eq!(dimensions.first_bounce + dimensions.light_uv.unwrap(), 2);
        assert_eq!(dimensions.bounce_size, 6);
    }

    #[test]
    fn purposes_never_share_a_dimension() {
        let all = Needs {
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
        // Of eight bounces, each in a lane.
        let b = dimensions.bounce::<Sobol>(&samples, &std::array::from_fn(|lane| lane as u32));
        for lane in 0..8 {
            values.extend([b.light_uv[0][lane], b.light_uv[1][lane], b.bsdf_uv[0][lane], b.bsdf_uv[1][lane]]);
            values.extend([b.light[lane], b.lobe[lane], b.mix[lane], b.roulette[lane]]);
        }
        let count = values.len();
        values.sort_by(f32::total_cmp);
        values.dedup();
        assert_eq!(values.len(), count);
    }

    #[test]
    fn what_is_not_needed_is_not_made() {
        let dimensions = Dimensions::new(&NOTHING);
        assert_eq!((dimensions.first_bounce, dimensions.bounce_size), (2, 0));
        let b = dimensions.bounce::<Sobol>(&sample(), &[3; LANES]);
        assert_eq!((b.light_uv[0][0], b.light_uv[1][0], b.lobe[0], b.roulette[0]), (0.0, 0.0, 0.0, 0.0));
    }
}
