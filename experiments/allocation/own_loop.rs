//! Measures P-RPF in its own loop: its interim passes, with their failures of interpolation and residuals, place the
//! samples of its image.

use prpf::adaptive::Sampling;
use prpf::filter::FilterResult;
use prpf::geometry::Accel;
use prpf::image::Planes;

use super::ablation::{self, Ablation, prpf};
use super::map_effects::{self, AblatedScene};
use super::report::format_interval;
use super::sample_maps::{draw, sample_counts};
use super::scene_results::SceneResults;
use super::settings::OwnLoopSettings;
use crate::curves::{EqualCost, Metric, Point, measure_trial, ratios, use_median_seconds};
use crate::ledger::{Key, Values};
use crate::picture;
use crate::report::{Report, number};
use crate::session::Session;
use crate::statistics::{Interval, geometric_mean};
use crate::test_scene::{TestScene, groups};
use crate::trial::{Rendered, Trial};

/// The measurements on a scene.
#[derive(Default)]
pub struct OwnLoop {
    uniform: Vec<Point>,
    adaptive: Vec<Point>,
    /// The images of each selection of maps.
    ablations: Vec<(Ablation, Vec<Point>)>,
    /// File name of the picture of its maps.
    picture: String,
}

/// Measures uniform and adaptive sampling and the selections of maps, and draws the maps of adaptive sampling.
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
    let (spp, seeds) = (settings.spp, settings.ablation_seeds);
    let ablations = ablation::measure(session, test_scene, accel, &ablation::prpf_maps(), (spp, seeds))?;

    let picture = format!("prpf-maps-{}.png", test_scene.name);
    let path = session.out.join(&picture);
    session.show_status(format!("{}: maps of prpf", test_scene.name));
    let key = Key::new(&test_scene.name, 0, format!("maps of prpf spp={}", settings.spp));
    session.ledger.measure(key, std::slice::from_ref(&path), || {
        let rendered = Trial::new(Sampling::Adaptive, prpf(), settings.spp, 0).run(test_scene, accel);
        picture::write(&path, &row(test_scene, &rendered), 0.0)?;
        Ok(Values::new())
    })?;
    Ok(OwnLoop { uniform, adaptive, ablations, picture })
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

/// The selections of maps on a scene.
fn ablated(m: &SceneResults) -> AblatedScene<'_> {
    let OwnLoop { uniform, ablations, .. } = &m.own_loop;
    AblatedScene { scene: &m.scene, uniform, ablations }
}

/// The finding on P-RPF's own maps, in a sentence each.
pub fn finding(settings: &OwnLoopSettings, all: &[SceneResults]) -> String {
    let scenes: Vec<_> = all.iter().map(ablated).collect();
    let verdicts = map_effects::verdicts(&ablation::prpf_maps(), &scenes, EqualCost::Samples);
    format!(
        "P-RPF's own maps in its own loop, at {} samples per pixel: {}",
        settings.spp,
        verdicts.join(" And ")
    )
}

/// Writes the section.
pub fn report(report: &mut Report, settings: &OwnLoopSettings, all: &[SceneResults]) {
    report.section("P-RPF in its own loop");
    report.paragraph(&format!(
        "`--denoiser prpf`, {} samples per pixel: its own interim passes place the samples by the failures of its \
         interpolation, its residual and its variance. Ratios of adaptive to uniform sampling, geometric mean over {} seeds \
         (95 % interval); errors at equal samples, with and without the worst 0.1 % of the pixels.",
        settings.spp, settings.seeds
    ));
    let ratio = |m: &SceneResults, error: Metric| {
        let OwnLoop { uniform, adaptive, .. } = &m.own_loop;
        geometric_mean(&ratios(adaptive, uniform, EqualCost::Samples, error))
    };
    let metrics: [Metric; 2] = [|p| p.error, |p| p.trimmed];
    let seconds = |m: &SceneResults| {
        let seconds = |points: &[Point]| points.first().map_or(f64::NAN, |p| p.seconds);
        seconds(&m.own_loop.adaptive) / seconds(&m.own_loop.uniform)
    };
    let row = |name: String, errors: [Interval; 2], seconds: f64| {
        let [relmse, trimmed] = errors.map(format_interval);
        vec![name, relmse, trimmed, number(seconds, 2)]
    };
    let mut rows: Vec<Vec<String>> =
        all.iter().map(|m| row(m.scene.clone(), metrics.map(|error| ratio(m, error)), seconds(m))).collect();
    for (group, scenes) in groups(all, |m| m.is_public) {
        let over_scenes = |ratio: &dyn Fn(&SceneResults) -> f64| {
            geometric_mean(&scenes.iter().map(|m| ratio(m)).collect::<Vec<_>>())
        };
        let errors = metrics.map(|error| over_scenes(&|m| ratio(m, error).mean));
        rows.push(row(format!("**{group}**"), errors, over_scenes(&seconds).mean));
    }
    report.table(&["scene", "relMSE", "relMSE, 99.9 %", "seconds"], &rows);
    report.paragraph(
        "What its own maps, beside the variances, contribute, if samples follow the maps whatever gain is predicted:",
    );
    let scenes: Vec<_> = all.iter().map(ablated).collect();
    map_effects::write(report, &ablation::prpf_maps(), &scenes, &[EqualCost::Samples]);
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
