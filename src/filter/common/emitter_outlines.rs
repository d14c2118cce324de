//! Finds the pixels beside an emitter: those outside its outline.
//!
//! A few samples may miss an emitter by chance, so noise explains the difference of a pixel to its neighbours, and a filter
//! gives the pixel their emission: on a dark wall beside a bright lamp thousands of times its own radiance.

use rayon::prelude::*;

/// Distance within which two pixels that met an emitter hold another between them, in pixels.
const REACH: isize = 4;

/// Directions of the lines on which they lie.
const LINES: [(isize, isize); 4] = [(1, 0), (0, 1), (1, 1), (1, -1)];

/// Returns for each pixel whether it lies outside all emitters: none of its samples met one, and it does not lie between two
/// pixels whose samples did, on an emitter's rim or in its image out of focus. Outside a convex outline no pixel does.
/// `met_emitter`: whether a sample of the pixel met an emitter, row by row.
pub fn outside_emitters(width: usize, met_emitter: &[bool]) -> Vec<bool> {
    if !met_emitter.contains(&true) {
        return vec![true; met_emitter.len()];
    }
    let height = met_emitter.len() / width.max(1);
    let met_at = |x: usize, y: usize, dx: isize, dy: isize| {
        let x = x.checked_add_signed(dx).filter(|&x| x < width);
        let y = y.checked_add_signed(dy).filter(|&y| y < height);
        x.zip(y).is_some_and(|(x, y)| met_emitter[y * width + x])
    };
    let shows_emitter: Vec<bool> = met_emitter.chunks(width).map(|row| row.contains(&true)).collect();
    let is_near = |y: usize| {
        let reach = REACH.unsigned_abs();
        shows_emitter[y.saturating_sub(reach)..(y + reach + 1).min(height)].contains(&true)
    };
    let is_between = |i: usize| {
        let ends = |dx: isize, dy: isize| (1..=REACH).any(|k| met_at(i % width, i / width, k * dx, k * dy));
        is_near(i / width) && LINES.into_iter().any(|(dx, dy)| ends(dx, dy) && ends(-dx, -dy))
    };
    (0..met_emitter.len()).into_par_iter().map(|i| !met_emitter[i] && !is_between(i)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIDE: usize = 12;

    fn outside(met_emitter: impl Fn(usize, usize) -> bool) -> Vec<bool> {
        let met: Vec<bool> = (0..SIDE * SIDE).map(|i| met_emitter(i % SIDE, i / SIDE)).collect();
        outside_emitters(SIDE, &met)
    }

    #[test]
    fn all_pixels_but_those_of_a_lamp_lie_outside() {
        let is_lamp = |x: usize, y: usize| (4..8).contains(&x) && (4..8).contains(&y);
        for (i, outside) in outside(is_lamp).into_iter().enumerate() {
            assert_eq!(outside, !is_lamp(i % SIDE, i / SIDE), "{i}");
        }
        assert!(outside(|_, _| false).into_iter().all(|outside| outside));
    }

    #[test]
    fn pixels_between_others_that_met_the_lamp_do_not() {
        // A lamp out of focus, which only some pixels have met
        let outside = outside(|x, y| (x + 2 * y).is_multiple_of(5));
        for (x, y) in (4..8).flat_map(|y| (4..8).map(move |x| (x, y))) {
            assert!(!outside[y * SIDE + x], "{x} {y}");
        }
    }
}
