//! Measures a scene: P-RPF and `nlm` on the whole image, everything else on a crop.

use prpf::geometry::Accel;
use prpf::render::Renderer;
use prpf::scene::Scene;

use super::crop::{Crop, middle};
use super::crop_measurement::{CropMeasurement, PICTURES};
use super::interpretations::published;
use super::method::Method;
use super::scene_results::{SceneResults, WHOLE};
use super::settings::{SceneSettings, Settings};
use crate::ledger::{Key, Values};
use crate::reference::reference;
use crate::sampling;
use crate::scenes::{SceneFile, View};
use crate::session::Session;

/// Takes all measurements of a scene.
///
/// # Errors
/// A scene that cannot be loaded, or files that cannot be written.
pub fn measure(
    session: &mut Session,
    settings: &Settings,
    scene_settings: &SceneSettings,
    file: &SceneFile,
) -> anyhow::Result<SceneResults> {
    // Load the scene and measure the whole image
    let name = &scene_settings.name;
    session.show_status(format!("{name}: reading"));
    let mut scene = file.load(View::default())?;
    let mut results = SceneResults {
        name: name.clone(),
        from_paper: scene_settings.from_paper,
        rpf_runs: settings.rpf_runs(scene_settings),
        runs: Default::default(),
    };
    if settings.whole_spp > 0 {
        let values = measure_whole(session, settings, scene_settings, &scene)?;
        results.add(WHOLE, values);
    }

    // Render the reference of the crop
    let film = (scene.film.width, scene.film.height);
    let inner = settings.inner(scene_settings);
    scene.film.pixel_bounds = inner;
    let show = |status| session.show_status(status);
    let reference = reference(&scene, name, settings.reference_spp, &session.cache, show)?;
    let pictures = session.out.join(PICTURES);
    std::fs::create_dir_all(&pictures)?;

    // Measure all methods but RPF on the crop, then RPF on the squares in its middle
    let [x0, x1, y0, y1] = inner;
    let mut sides: Vec<usize> = results.rpf_runs.iter().map(|runs| runs.side).collect();
    sides.sort_unstable();
    sides.dedup();
    let squares = sides.into_iter().rev().map(|side| (side, side));
    for (index, size) in std::iter::once((x1 - x0, y1 - y0)).chain(squares).enumerate() {
        let crop = Crop::new(middle(inner, size), settings.margin, film);
        scene.film.pixel_bounds = crop.outer;
        let accel = Accel::build(&scene);
        let mut measurement = CropMeasurement {
            settings,
            scene_settings,
            scene: &scene,
            accel: &accel,
            crop,
            whole: inner,
            reference: &reference,
            pictures: &pictures,
            samples: None,
        };
        if index == 0 {
            measurement.measure_all_but_rpf(session, &mut results)?;
        } else {
            measurement.measure_rpf(size.0, session, &mut results)?;
        }
    }
    Ok(results)
}

/// Measures P-RPF and `nlm` on the whole image.
fn measure_whole(
    session: &mut Session,
    settings: &Settings,
    scene_settings: &SceneSettings,
    scene: &Scene,
) -> anyhow::Result<Values> {
    let spp = settings.whole_spp;
    let key = Key::new(&scene_settings.name, 0, format!("whole image, spp={spp}"));
    session.show_status(format!("{}: whole image", scene_settings.name));
    session.ledger.measure(key, &[], || {
        let accel = Accel::build(scene);
        let renderer = Renderer::new(scene, &accel, 0);
        let method = Method::Prpf(published(scene_settings.sigma8_squared));
        let mut store = sampling::store(&renderer, method.capacity(spp), 0);
        let render = sampling::add(&renderer, &mut store, spp);
        let (_, mut values) = method.run(&store, 0);
        let (_, nlm) = Method::Nlm.run(&store, 0);
        values.insert("render seconds".to_owned(), render);
        values.insert("nlm seconds".to_owned(), nlm["seconds"]);
        values.insert("pixels".to_owned(), store.pixels() as f64);
        Ok(values)
    })
}
