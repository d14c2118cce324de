//! Which dimension of a sample's numbers serves which purpose.
//!
//! A purpose that the scene does not call for has no dimension, and no number is made for it; the
//! others move together, so that the film position shares its four-dimensional set with what
//! matters most next: the lens, or the light at the first hit.

use glam::Vec2;

use super::{Source, Stream};

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

/// Numbers of the camera ray.
#[derive(Clone, Copy, Debug)]
pub struct CameraNumbers {
    pub film: Vec2,
    pub lens: Vec2,
    pub time: f32,
}

/// Numbers of one scattering event; 0 where the scene does not call for one.
#[derive(Clone, Copy, Debug)]
pub struct BounceNumbers {
    pub light_uv: Vec2,
    pub bsdf_uv: Vec2,
    pub light: f32,
    pub lobe: f32,
    pub mix: f32,
    pub roulette: f32,
}

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

    #[inline]
    pub fn camera<S: Source>(&self, numbers: &mut Stream<S>) -> CameraNumbers {
        CameraNumbers {
            film: numbers.two(FILM),
            lens: self.lens.map_or(Vec2::ZERO, |d| numbers.two(d)),
            time: self.time.map_or(0.0, |d| numbers.one(d)),
        }
    }

    /// Numbers of the scattering event after `bounce` others.
    #[inline]
    pub fn bounce<S: Source>(&self, numbers: &mut Stream<S>, bounce: u32) -> BounceNumbers {
        let start = self.first_bounce + bounce * self.bounce_size;
        let mut pair = |d: Option<u32>| d.map_or(Vec2::ZERO, |d| numbers.two(start + d));
        let (light_uv, bsdf_uv) = (pair(self.light_uv), pair(self.bsdf_uv));
        let mut single = |d: Option<u32>| d.map_or(0.0, |d| numbers.one(start + d));
        BounceNumbers {
            light_uv,
            bsdf_uv,
            light: single(self.light),
            lobe: single(self.lobe),
            mix: single(self.mix),
            roulette: single(self.roulette),
        }
    }
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
        let source = Sobol::for_pixel(0, 0, 0);
        let mut stream = Stream::new(source, 0);
        let camera = dimensions.camera(&mut stream);
        let mut values = vec![camera.film.x, camera.film.y, camera.lens.x, camera.lens.y, camera.time];
        for bounce in 0..8 {
            let b = dimensions.bounce(&mut stream, bounce);
            values.extend([b.light_uv.x, b.light_uv.y, b.bsdf_uv.x, b.bsdf_uv.y]);
            values.extend([b.light, b.lobe, b.mix, b.roulette]);
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
        let source = Sobol::for_pixel(0, 0, 0);
        let mut stream = Stream::new(source, 0);
        let b = dimensions.bounce(&mut stream, 3);
        assert_eq!((b.light_uv, b.lobe, b.roulette), (Vec2::ZERO, 0.0, 0.0));
    }
}
