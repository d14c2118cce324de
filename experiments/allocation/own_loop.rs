//! Measures P-RPF in its own loop: its interim passes, with their failures of interpolation and residuals, place the
//! samples of its image.

use prpf::adaptive::Sampling;
use prpf::filter::{DENOISERS, Denoiser, FilterResult};
use prpf::geometry::Accel;
use prpf::image::Planes;

use super::report::format_interval;
use super::sample_maps::{draw, sample_counts};
use super::scene_results::SceneResults;
use super::settings::OwnLoopSettings;
use crate::curves::{EqualCost, Point, measure_trial, ratios, use_median_seconds};
use crate::ledger::{Key, Values};
use crate::picture;
use crate::report::{Report, number};
use crate::session::Session;
use crate::statistics::geometric_mean;
use crate::test_scene::{TestScene, groups};
use crate::trial::{Rendered, Trial};

/// The measurements on a scene.
pub struct OwnLoop {
    uniform: Vec<Point>,
    adaptive: Vec<Point>,
    /// File name of the picture of its maps.
    picture: String,
}

/// P-RPF at its full quality.
fn prpf() -> &'static dyn Denoiser {
    DENOISERS
        .into_iter()
        .find(|denoiser| denoiser.name().method == "prpf")
        .expect("the method's own denoiser")
}

/// Measures uniform and adaptive sampling, and draws the maps of adaptive sampling.
pub fn measure(
    session: &mut Session,
    test_scene: &TestScene,
    accel: &Accel,
    settings: &OwnLoopSettings,
) -> anyhow::Result<OwnLoop> {
    let mut points = |sampling: Sampling| {
        let mut points = Vec::new();
        for seed in 0..settings.seeds {
            let trial = Trial::new(sampling, prpf(), settings.spp, seed);
            let values = measure_trial(session, test_scene, accel, &trial, &format!("{sampling:?}, prpf"))?;
            points.push(Point::new(&trial, &values));
        }
        use_median_seconds(&mut points);
        anyhow::Ok(points)
    };
    let (uniform, adaptive) = (points(Sampling::Uniform)?, points(Sampling::Adaptive)?);

    let picture = format!("prpf-maps-{}.png", test_scene.name);
    let path = session.out.join(&picture);
    session.show_status(format!("{}: maps of prpf", test_scene.name));
    let key = Key::new(&test_scene.name, 0, format!("maps of prpf spp={}", settings.spp));
    session.ledger.measure(key, std::slice::from_ref(&path), || {
        let rendered = Trial::new(Sampling::Adaptive, prpf(), settings.spp, 0).run(test_scene, accel);
        picture::write(&path, &row(test_scene, &rendered), 0.0)?;
        Ok(Values::new())
    })?;
    Ok(OwnLoop { uniform, adaptive, picture })
}

/// The image, its sample counts, its failures of interpolation, its residual and its true error in a row.
fn row(test_scene: &TestScene, rendered: &Rendered) -> Planes {
    let FilterResult { image, residual, interpolation, .. } = &rendered.result;
    let failure =
        interpolation.as_ref().map_or_else(|| vec![0.0; image.pixels()], |i| i.failure.plane(0).to_vec());
    let error = test_scene.reference.pixel_relmse(image).into_iter().map(|v| v as f32).collect();
    let maps = [sample_counts(rendered), failure, residual.plane(0).to_vec(), error];
    let pictures: Vec<Planes> =
        std::iter::once(image.clone()).chain(maps.map(|map| draw(image, map))).collect();
    picture::in_a_row(&pictures)
}

/// Writes the section.
pub fn report(report: &mut Report, settings: &OwnLoopSettings, all: &[SceneResults]) {
    report.section("P-RPF in its own loop");
    report.paragraph(&format!(
        "`--denoiser prpf`, {} samples per pixel: its own interim passes place the samples by the failures of its \
         interpolation, its residual and its variance. Ratios of adaptive to uniform sampling, geometric mean over {} seeds \
         (95 % interval); relMSE at equal samples.",
        settings.spp, settings.seeds
    ));
    let relmse = |m: &SceneResults| {
        let OwnLoop { uniform, adaptive, .. } = &m.own_loop;
        geometric_mean(&ratios(adaptive, uniform, EqualCost::Samples, |p| p.error))
    };
    let seconds = |m: &SceneResults| {
        let seconds = |points: &[Point]| points.first().map_or(f64::NAN, |p| p.seconds);
        seconds(&m.own_loop.adaptive) / seconds(&m.own_loop.uniform)
    };
    let mut rows: Vec<Vec<String>> = all
        .iter()
        .map(|m| vec![m.scene.clone(), format_interval(relmse(m)), number(seconds(m), 2)])
        .collect();
    for (group, scenes) in groups(all, |m| m.is_public) {
        let over_scenes = |ratio: &dyn Fn(&SceneResults) -> f64| {
            geometric_mean(&scenes.iter().map(|m| ratio(m)).collect::<Vec<_>>())
        };
        let [error, time] = [over_scenes(&|m| relmse(m).mean), over_scenes(&seconds)];
        rows.push(vec![format!("**{group}**"), format_interval(error), number(time.mean, 2)]);
    }
    report.table(&["scene", "relMSE", "seconds"], &rows);
    for m in all {
        report.picture(
            &m.own_loop.picture,
            &format!(
                "{}: image; sample counts; failures of interpolation; residual; true error (each on a scale of its own).",
                m.scene
            ),
        );
    }
}
