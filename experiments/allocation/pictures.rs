//! Where the samples went, beside where the error is; and the best that any allocation of unfiltered
//! samples could do.

use prpf::adaptive::Sampling;
use prpf::filter::{blur, variance_of_mean};
use prpf::geometry::Accel;
use prpf::image::Planes;
use prpf::progressive::Denoiser;
use prpf::stats::{Part, Store};

use crate::bench::Bench;
use crate::curves::squared_error;
use crate::ledger::{Key, values};
use crate::picture;
use crate::trial::{Bed, Rendered, Trial};

/// Blur of the maps, in pixels: without it they show nothing but noise.
const SIGMA: f32 = 2.0;
/// The brightest colour of a map is this quantile of its values: single pixels would darken all others.
const BRIGHTEST: f64 = 0.99;

/// Writes a scene's filtered image, its samples and the true errors of adaptive and uniform sampling as one
/// picture. Returns the picture's file name, and what the best allocation would leave of uniform's
/// unfiltered relMSE.
pub fn take(bench: &mut Bench, bed: &Bed, accel: &Accel, spp: u32) -> anyhow::Result<(String, f64)> {
    let name = format!("maps-{}.png", bed.name);
    let path = bench.out.join(&name);
    bench.doing(format!("{}: maps", bed.name));
    let (width, height) = (bed.reference.image.width(), bed.reference.image.height());
    let key = Key::new(&bed.name, 0, format!("maps spp={spp} size={width}x{height}"));
    let measured = bench.ledger.measure(key, std::slice::from_ref(&path), || {
        let [uniform, adaptive] = [Sampling::Uniform, Sampling::Adaptive]
            .map(|sampling| Trial::new(sampling, Denoiser::Prpf, spp, 0).run(bed, accel));
        picture::write(&path, &row(bed, &uniform, &adaptive), 0.0)?;
        Ok(values([("ceiling", ceiling(&uniform.store, &bed.reference.image))]))
    })?;
    Ok((name, measured["ceiling"]))
}

fn row(bed: &Bed, uniform: &Rendered, adaptive: &Rendered) -> Planes {
    let error = |rendered: &Rendered| {
        let error = squared_error(&rendered.filtered.image, &bed.reference.image);
        smooth(&bed.reference.image, error.into_iter().map(|v| v as f32).collect())
    };
    let [of_uniform, of_adaptive] = [error(uniform), error(adaptive)];
    let counts = adaptive.store.counts(Part::Whole).iter().map(|&n| n as f32).collect();
    let samples = smooth(&bed.reference.image, counts);
    let most = quantile(&of_uniform, BRIGHTEST);
    picture::in_a_row(&[
        adaptive.filtered.image.clone(),
        picture::coloured(&samples, quantile(&samples, BRIGHTEST)),
        picture::coloured(&of_adaptive, most),
        picture::coloured(&of_uniform, most),
    ])
}

/// The square root of a blurred map, in which both ends of its range can be seen.
fn smooth(like: &Planes, map: Vec<f32>) -> Planes {
    let mut smooth = Planes::new(like.width(), like.height(), 1);
    let blurred = blur::gaussian(like.width(), like.height(), &map, SIGMA);
    smooth.data_mut().iter_mut().zip(blurred).for_each(|(out, value)| *out = value.max(0.0).sqrt());
    smooth
}

fn quantile(map: &Planes, share: f64) -> f32 {
    let mut sorted = map.data().to_vec();
    sorted.sort_by(f32::total_cmp);
    sorted[((sorted.len() - 1) as f64 * share) as usize].max(f32::MIN_POSITIVE)
}

/// If a pixel's part in relMSE is e/n after n samples, uniform sampling leaves Σe/n̄; with n ∝ √e that
/// becomes (Σ√e)²/(N·n̄) (Neyman 1934). The ratio of the two, with e from the samples' variances, of
/// independent samples, and the true radiance.
fn ceiling(store: &Store, reference: &Planes) -> f64 {
    const FLOOR: f64 = 0.01;
    let variance = variance_of_mean(store);
    let of = |i: usize, c: usize| {
        f64::from(variance.plane(c)[i]) / (f64::from(reference.plane(c)[i]).powi(2) + FLOOR)
    };
    let errors = (0..store.pixels()).map(|i| (0..3).map(|c| of(i, c)).sum::<f64>());
    let (mut roots, mut sum, mut count) = (0.0, 0.0, 0.0);
    for error in errors {
        roots += error.sqrt();
        sum += error;
        count += 1.0;
    }
    if sum > 0.0 { roots * roots / (count * sum) } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use prpf::stats::Layout;

    #[test]
    fn the_ceiling_is_what_samples_by_deviation_would_leave() {
        let mut store = Store::new(4, 1, Layout::with_blocks(|_| false), 0, 0);
        // Deviations 1, 1, 1 and 3: (Σσ)²/(N·Σσ²) = 36/48.
        for (x, deviation) in [1.0, 1.0, 1.0, 3.0].into_iter().enumerate() {
            for value in [10.0 - deviation, 10.0 + deviation] {
                store.push(x, 0, &[0.0, 0.0, value, value, value]);
            }
        }
        let mut reference = Planes::new(4, 1, 3);
        reference.data_mut().fill(10.0);
        assert!((ceiling(&store, &reference) - 0.75).abs() < 1e-5);
    }
}
