//! Measures a scene: P-RPF and `nlm` on the whole image, everything else on a crop.

use prpf::geometry::Accel;
use prpf::render::Renderer;
use prpf::scene::Scene;

use super::crop::Crop;
use super::crop_measurement::{CropMeasurement, PICTURES};
use super::interpretations::published;
use super::method::Method;
use super::scene_results::{SceneResults, WHOLE};
use super::settings::{SceneSettings, Settings};
use crate::ledger::{Key, Values};
use crate::picture;
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
        rpf_spp: Vec::new(),
        runs: Default::default(),
    };
    if settings.whole_spp > 0 {
        let values = measure_whole(session, settings, scene_settings, &scene)?;
        results.runs.insert(WHOLE.to_owned(), values);
    }

    // Render the reference of the crop
    let film = (scene.film.width, scene.film.height);
    let crop = Crop::new(scene_settings.crop, settings.crop_fraction, settings.margin, film);
    scene.film.pixel_bounds = crop.inner;
    let show = |status| session.show_status(status);
    let reference = reference(&scene, name, settings.reference_spp, &session.cache, show)?;
    let pictures = session.out.join(PICTURES);
    std::fs::create_dir_all(&pictures)?;
    let path = pictures.join(format!("{name}-reference.png"));
    picture::write(&path, &reference.image, scene_settings.exposure)?;

    // Measure the crop
    scene.film.pixel_bounds = crop.outer;
    let accel = Accel::build(&scene);
    let renderer = Renderer::new(&scene, &accel, settings.seed);
    let measurement = CropMeasurement {
        settings,
        scene_settings,
        renderer: &renderer,
        crop,
        film_pixels: film.0 * film.1,
        reference: &reference,
        pictures,
    };
    measurement.measure(session, &mut results)?;
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
    let key = Key::new(&scene_settings.name, settings.seed, format!("whole image, spp={spp}"));
    session.show_status(format!("{}: whole image", scene_settings.name));
    session.ledger.measure(key, &[], || {
        let accel = Accel::build(scene);
        let renderer = Renderer::new(scene, &accel, settings.seed);
        let method = Method::Prpf(published(scene_settings.sigma8_squared));
        let mut store = sampling::store(&renderer, method.capacity(spp), settings.seed);
        let render = sampling::add(&renderer, &mut store, spp);
        let (_, mut values) = method.run(&store, settings.seed, 1);
        let (_, nlm) = Method::Nlm.run(&store, settings.seed, 1);
        values.insert("render seconds".to_owned(), render);
        values.insert("nlm seconds".to_owned(), nlm["seconds"]);
        values.insert("pixels".to_owned(), store.pixels() as f64);
        Ok(values)
    })
}
