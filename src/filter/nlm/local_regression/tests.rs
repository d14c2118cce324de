//! Fits against the solution of the normal equations in double precision.

use rand::{RngExt, SeedableRng};

use super::*;

const SIZE: usize = 33;

/// Fits a function of column, row and a feature, with a constant guide. Returns the function's values and the fit.
fn fitted(value: impl Fn(f32, f32, f32) -> f32) -> (Vec<f32>, LinearEstimate) {
    let feature: Vec<f32> = (0..SIZE * SIZE).map(|i| (i * 7919 % 101) as f32 / 101.0).collect();
    let truth: Vec<f32> =
        (0..SIZE * SIZE).map(|i| value((i % SIZE) as f32, (i / SIZE) as f32, feature[i])).collect();
    let (flat, variance) = (vec![1.0; SIZE * SIZE], vec![1e-2; SIZE * SIZE]);
    let mut features = [flat.as_slice(); FEATURES];
    features[0] = &feature;
    let settings = DistanceSettings { radius: 5, k: 1.0, epsilon: 1e-6, symmetric_weights: false };
    let fitted = fit(SIZE, SIZE, [&truth; 3], guide([&flat; 3], [&variance; 3]), features, settings);
    (truth, fitted)
}

fn guide<'a>(value: [&'a [f32]; 3], variance: [&'a [f32]; 3]) -> ColourGuide<'a> {
    ColourGuide { value, variance, features: &[], feature_inverse_bandwidth: 0.0 }
}

#[test]
fn functions_that_are_linear_in_position_and_features_are_reproduced() {
    let (truth, fitted) = fitted(|x, y, f| 1.0 + 0.02 * x + 0.01 * y + 0.5 * f);
    for (value, truth) in fitted.value.plane(1).iter().zip(&truth) {
        assert!((value / truth - 1.0).abs() < 2e-3, "{value} {truth}");
    }
}

#[test]
fn the_derivative_is_the_change_of_the_result_with_the_own_value() {
    let at = 12 * SIZE + 3;
    let value =
        |bump: f32| move |x: f32, y: f32, f: f32| 5.0 + f + if (x, y) == (3.0, 12.0) { bump } else { 0.0 };
    let (without, with) = (fitted(value(0.0)).1, fitted(value(1.0)).1);
    let change = with.value.plane(0)[at] - without.value.plane(0)[at];
    assert!((change - with.derivative[at]).abs() < 1e-4, "{change} {}", with.derivative[at]);
    assert!(change > 0.0 && change < 0.2);
}

const WIDTH: usize = TILE.0 + 5;
const HEIGHT: usize = TILE.1 + 2;
const PIXELS: usize = WIDTH * HEIGHT;
const SETTINGS: DistanceSettings =
    DistanceSettings { radius: 2, k: 1.0, epsilon: 1e-2, symmetric_weights: false };

/// Random images.
struct Images {
    original: [Vec<f32>; 3],
    value: [Vec<f32>; 3],
    variance: [Vec<f32>; 3],
    features: [Vec<f32>; FEATURES],
}

impl Images {
    fn random() -> Self {
        let mut rng = rand_pcg::Pcg32::seed_from_u64(8);
        let mut random = |max: f32| (0..PIXELS).map(|_| max * rng.random::<f32>()).collect::<Vec<f32>>();
        Self {
            original: [(); 3].map(|()| random(1.0)),
            value: [(); 3].map(|()| random(1.0)),
            variance: [(); 3].map(|()| random(0.3)),
            features: [(); FEATURES].map(|()| random(1.0)),
        }
    }

    fn guide(&self) -> ColourGuide<'_> {
        guide(self.value.each_ref().map(Vec::as_slice), self.variance.each_ref().map(Vec::as_slice))
    }

    fn fit(&self, guide: ColourGuide) -> LinearEstimate {
        let original = self.original.each_ref().map(Vec::as_slice);
        fit(WIDTH, HEIGHT, original, guide, self.features.each_ref().map(Vec::as_slice), SETTINGS)
    }

    /// Returns regressors, values and weight of each neighbour of each pixel.
    fn equations(&self) -> Vec<Vec<Equation>> {
        let mut equations: Vec<Vec<Equation>> = vec![Vec::new(); PIXELS];
        let distance = PatchDistance::<PATCH>::new(WIDTH, HEIGHT, self.guide(), SETTINGS);
        let whole = Tile { x: 0, y: 0, width: WIDTH, height: HEIGHT };
        distance.for_each_neighbour(whole, |neighbours| {
            let (dx, dy) = neighbours.offset;
            let Some(y) = neighbours.row.checked_add_signed(dy).filter(|&y| y < HEIGHT) else { return };
            for (x_i, &weight) in neighbours.weights.iter().enumerate() {
                let Some(x) = x_i.checked_add_signed(dx).filter(|&x| x < WIDTH) else { continue };
                let (i, j) = (neighbours.row * WIDTH + x_i, y * WIDTH + x);
                let change = |plane: &Vec<f32>| f64::from(plane[j]) - f64::from(plane[i]);
                let mut regressors = [1.0; K];
                regressors.iter_mut().zip(&self.features).for_each(|(r, f)| *r = change(f));
                regressors[FEATURES] = dx as f64 / SETTINGS.radius as f64;
                regressors[FEATURES + 1] = dy as f64 / SETTINGS.radius as f64;
                equations[i].push((regressors, self.original.each_ref().map(change), f64::from(weight)));
            }
        });
        equations
    }
}

type Equation = ([f64; K], [f64; 3], f64);

/// Eliminates the normal equations of a pixel. Returns the last row: the pivot of the constant, then the
/// right-hand sides.
fn last_row(equations: &[Equation]) -> [f64; K + 3] {
    // The pixel itself adds to the constant only
    let mut m = [[0.0; K + 3]; K];
    m[K - 1][K - 1] = 1.0;
    for (x, v, w) in equations {
        for r in 0..K {
            (0..K).for_each(|c| m[r][c] += w * x[r] * x[c]);
            (0..3).for_each(|c| m[r][K + c] += w * x[r] * v[c]);
        }
    }
    let total = m[K - 1][K - 1];
    (0..K - 1).for_each(|r| m[r][r] += 1e-3 * m[r][r] + 1e-7 * total);
    for r in 0..K - 1 {
        for s in r + 1..K {
            let factor = m[s][r] / m[r][r];
            (r..K + 3).for_each(|c| m[s][c] -= factor * m[r][c]);
        }
    }
    m[K - 1]
}

#[test]
fn fits_solve_the_normal_equations_across_tiles() {
    let images = Images::random();
    let fitted = images.fit(images.guide());
    let equations = images.equations();
    for i in (0..PIXELS).step_by(3) {
        let last = last_row(&equations[i]);
        let product = f64::from(fitted.derivative[i]) * last[K - 1];
        assert!((product - 1.0).abs() < 0.01, "{i}: the derivative is off by the factor {product}");
        for c in 0..3 {
            let expected = (f64::from(images.original[c][i]) + last[K + c] / last[K - 1]).max(0.0);
            let found = f64::from(fitted.value.plane(c)[i]);
            assert!((found - expected).abs() < 0.01, "{i} {c}: {found} for {expected}");
        }
    }
}

#[test]
fn images_do_not_change_if_the_guide_has_no_noise_and_empty_images_are_accepted() {
    let images = Images::random();
    let zero = vec![0.0; PIXELS];
    let fitted = images.fit(ColourGuide { variance: [&zero; 3], ..images.guide() });
    assert!((0..3).all(|c| fitted.value.plane(c) == images.original[c]));
    assert!(fitted.derivative.iter().all(|&a| a == 1.0));
    for (width, height) in [(0, 4), (4, 0)] {
        let empty = fit(width, height, [&[]; 3], guide([&[]; 3], [&[]; 3]), [&[]; FEATURES], SETTINGS);
        assert!(empty.derivative.is_empty());
    }
}
