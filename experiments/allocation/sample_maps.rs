//! Draws the sample counts of adaptive sampling beside the true error, and computes the error that the optimal
//! allocation of unfiltered samples would leave.

use prpf::adaptive::{Sampling, expected_ratio};
use prpf::filter::DEFAULT;
use prpf::filter::{blur, variance_of_mean};
use prpf::geometry::Accel;
use prpf::image::Planes;
use prpf::stats::{Part, Store};

use crate::ledger::{Key, values};
use crate::picture;
use crate::session::Session;
use crate::test_scene::TestScene;
use crate::trial::{Rendered, Trial};

/// Standard deviation of the maps' blur, in pixels. Unblurred maps show only noise.
const SIGMA: f32 = 2.0;
/// Quantile of a map's values that gets its brightest colour. The maximum would darken all but single pixels.
const BRIGHTEST: f64 = 0.99;

/// Writes a scene's filtered image, its sample counts and the true errors of adaptive and uniform sampling as one
/// picture. Returns the picture's file name and the [optimal ratio](optimal_ratio).
pub fn write(
    session: &mut Session,
    test_scene: &TestScene,
    accel: &Accel,
    spp: u32,
) -> anyhow::Result<(String, f64)> {
    let name = format!("maps-{}.png", test_scene.name);
    let path = session.out.join(&name);
    session.show_status(format!("{}: maps", test_scene.name));
    let (width, height) = (test_scene.reference.image.width(), test_scene.reference.image.height());
    let key = Key::new(&test_scene.name, 0, format!("maps spp={spp} size={width}x{height}"));
    let measured = session.ledger.measure(key, std::slice::from_ref(&path), || {
        let [uniform, adaptive] = [Sampling::Uniform, Sampling::Adaptive]
            .map(|sampling| Trial::new(sampling, DEFAULT, spp, 0).run(test_scene, accel));
        picture::write(&path, &row(test_scene, &uniform, &adaptive), 0.0)?;
        Ok(values([("optimal ratio", optimal_ratio(&uniform.store, &test_scene.reference.image))]))
    })?;
    Ok((name, measured["optimal ratio"]))
}

/// The four pictures in a row. Both errors have the same scale.
fn row(test_scene: &TestScene, uniform: &Rendered, adaptive: &Rendered) -> Planes {
    let error = |rendered: &Rendered| {
        let error = test_scene.reference.pixel_relmse(&rendered.result.image);
        smooth(&test_scene.reference.image, error.into_iter().map(|v| v as f32).collect())
    };
    let [uniform_error, adaptive_error] = [error(uniform), error(adaptive)];
    let max = quantile(&uniform_error, BRIGHTEST);
    picture::in_a_row(&[
        adaptive.result.image.clone(),
        draw(&adaptive.result.image, sample_counts(adaptive)),
        picture::false_colour(&adaptive_error, max),
        picture::false_colour(&uniform_error, max),
    ])
}

/// The sample counts of the pixels.
pub fn sample_counts(rendered: &Rendered) -> Vec<f32> {
    rendered.store.counts(Part::Whole).iter().map(|&n| n as f32).collect()
}

/// The square root of a blurred map in false colours, on a scale of its own. `like` has its size.
pub fn draw(like: &Planes, map: Vec<f32>) -> Planes {
    let smooth = smooth(like, map);
    picture::false_colour(&smooth, quantile(&smooth, BRIGHTEST))
}

/// The square root of a blurred map, which shows both ends of its range.
fn smooth(like: &Planes, map: Vec<f32>) -> Planes {
    let mut smooth = Planes::new(like.width(), like.height(), 1);
    let blurred = blur::gaussian(like.width(), like.height(), &map, SIGMA);
    smooth.data_mut().iter_mut().zip(blurred).for_each(|(out, value)| *out = value.max(0.0).sqrt());
    smooth
}

fn quantile(map: &Planes, fraction: f64) -> f32 {
    let mut sorted = map.data().to_vec();
    sorted.sort_by(f32::total_cmp);
    sorted[((sorted.len() - 1) as f64 * fraction) as usize].max(f32::MIN_POSITIVE)
}

/// Ratio of the relMSE with the optimal allocation to that with uniform sampling, for independent samples: the
/// [`expected_ratio`] if errors follow from the samples' variance and the true radiance.
fn optimal_ratio(store: &Store, reference: &Planes) -> f64 {
    const FLOOR: f64 = 0.01;
    let variance = variance_of_mean(store);
    let channel_relmse = |i: usize, c: usize| {
        f64::from(variance.plane(c)[i]) / (f64::from(reference.plane(c)[i]).powi(2) + FLOOR)
    };
    let error = |i: usize| (0..3).map(|c| channel_relmse(i, c)).sum::<f64>();
    expected_ratio(&(0..store.pixels()).map(|i| error(i).sqrt() as f32).collect::<Vec<_>>())
}
