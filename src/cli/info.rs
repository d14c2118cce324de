//! `prpf info`: the content of a scene, its effects, its sample vector, and what denoisers read of that.

use std::path::PathBuf;

use clap::Args;

use super::failure::Failure;
use super::terminal;
use super::terminal::escaped;
use crate::filter::{DENOISERS, Denoiser, Reads, SampleVectors};
use crate::output::Layers;
use crate::progressive::{RecordedStatistics, Settings};
use crate::render::sample_layout;
use crate::scene::{Integrator, Light, PixelFilter, Scene, Shape, pbrt};
use crate::stats::{Group, Layout, Store};

/// `prpf info`.
#[derive(Args)]
#[command(after_help = "Example:\n  prpf info scenes/pool/pool.pbrt")]
pub(super) struct InfoOptions {
    /// Scene in pbrt's format
    scene: PathBuf,
}

pub(super) fn run(options: &InfoOptions) -> Result<u8, Failure> {
    let scene = pbrt::read(&options.scene).map_err(|error| Failure::Input(error.into()))?;
    let warnings: String =
        scene.warnings.iter().map(|warning| format!("warning: {}\n", escaped(warning))).collect();
    let dark = if scene.is_lit() { "" } else { "warning: the scene has no light\n" };
    terminal::print(&(describe(&scene) + &warnings + dark)).map_err(Failure::Run)?;
    Ok(0)
}

fn describe(scene: &Scene) -> String {
    describe_scene(scene) + &describe_statistics(scene)
}

/// Describes the scene: film, integrator, geometry, lights, materials, memory.
fn describe_scene(scene: &Scene) -> String {
    // Count what it holds
    let film = &scene.film;
    let [x0, x1, y0, y1] = film.pixel_bounds;
    let integrator = match scene.integrator {
        Integrator::Path { max_depth } => format!("path tracing, depth {max_depth}"),
        Integrator::Direct { max_depth } => format!("direct lighting, specular depth {max_depth}"),
    };
    let (stored, instanced) = triangles(scene);
    let images = scene.textures.images();
    let image_bytes: usize = images.iter().map(|image| image.memory_bytes()).sum();
    let mesh_bytes: usize = scene.primitives.iter().map(|p| p.shape.memory_bytes()).sum();
    let emissive = scene.primitives.iter().filter(|p| p.area_light.is_some()).count();
    let environments = scene.lights.iter().filter(|l| matches!(l, Light::Environment(_))).count();

    // Describe it
    format!(
        "scene            {}\n\
         dialect          {}\n\
         film             {}x{}, pixels {x0},{x1},{y0},{y1}, {}\n\
         integrator       {integrator}, {} samples per pixel\n\
         geometry         {stored} triangles stored, {instanced} with instances; {} primitives, {} objects, {} instances\n\
         lights           {emissive} emissive shapes, {} without a surface ({environments} environment)\n\
         materials        {}; {} images\n\
         memory           {:.1} MB of meshes, {:.1} MB of images\n\
         effects          {}\n",
        escaped(&scene.source),
        scene.dialect.map_or_else(String::new, |dialect| dialect.to_string()),
        film.width,
        film.height,
        describe_filter(&film.filter),
        scene.spp,
        scene.primitives.len(),
        scene.objects.len(),
        scene.instances.len(),
        scene.lights.len(),
        scene.materials.len(),
        images.len(),
        mesh_bytes as f64 / 1e6,
        image_bytes as f64 / 1e6,
        scene.effects().names().join(", "),
    )
}

/// Describes the pixel filter: its name, its radius in pixels, and its shape.
fn describe_filter(filter: &PixelFilter) -> String {
    let (name, [x, y], shape) = match *filter {
        PixelFilter::Box { radius } => ("box", radius, String::new()),
        PixelFilter::Triangle { radius } => ("triangle", radius, String::new()),
        PixelFilter::Gaussian { radius, sigma } => ("Gaussian", radius, format!(", sigma {sigma}")),
        PixelFilter::Mitchell { radius, b, c } => ("Mitchell", radius, format!(", B {b}, C {c}")),
        PixelFilter::Sinc { radius, tau } => ("sinc", radius, format!(", tau {tau}")),
    };
    let radius = if x == y { x.to_string() } else { format!("{x} x {y}") };
    format!("{name} filter, radius {radius}{shape}")
}

/// Describes the sample vector, the store, and what each denoiser reads of it.
fn describe_statistics(scene: &Scene) -> String {
    // Count dimensions and bytes
    let layout = sample_layout(&scene.effects());
    let names: Vec<&str> = layout.dimensions().iter().map(|dimension| dimension.name).collect();
    let count = |group: fn(Group) -> bool| layout.dimensions().iter().filter(|d| group(d.group)).count();
    let features = count(|g| matches!(g, Group::Feature(_)));
    let randoms = count(|g| g == Group::Random);
    let vector = count(|g| g != Group::Auxiliary);
    let [x0, x1, y0, y1] = scene.film.pixel_bounds;
    let memory = |statistics| {
        let settings = Settings { statistics, ..Settings::default() };
        let blocks = settings.recorded_blocks(Layers::blocks_read(None));
        let bytes = Store::bytes_per_pixel(&layout.restricted_to(blocks), 0);
        format!("{bytes} bytes per pixel, {:.0} MB", (bytes * (x1 - x0) * (y1 - y0)) as f64 / 1e6)
    };
    let (needed, all) = (memory(RecordedStatistics::Needed), memory(RecordedStatistics::All));
    // Features and colours against random parameters and position, and colours against features.
    let pairs = (features + 3) * (randoms + 2) + 3 * features;

    // Describe them
    format!(
        "dimensions       {vector} of 27 enabled: {}\n\
         auxiliary        {}\n\
         pairs            {pairs} of mutual information, with --denoiser prpf\n\
         store            {needed} for this film; {all} with --statistics all\n{}",
        names[..vector].join(" "),
        names[vector..].join(" "),
        DENOISERS.map(|denoiser| describe_denoiser(denoiser, &layout)).concat(),
    )
}

/// Describes what a denoiser reads of the store, and the margin with which it filters parts of an image, if it can.
fn describe_denoiser(denoiser: &dyn Denoiser, layout: &Layout) -> String {
    let Reads { blocks, sample_vectors } = denoiser.reads();
    let read: usize = blocks.iter().filter_map(|&block| layout.block(block)).map(|dims| dims.len()).sum();
    let vector_bytes = Store::bytes_per_pixel(layout, 1) - Store::bytes_per_pixel(layout, 0);
    let vectors = match sample_vectors {
        SampleVectors::None => String::new(),
        SampleVectors::Reservoir(size) => {
            format!(" and {size} sample vectors of {vector_bytes} bytes per pixel")
        }
        SampleVectors::All { .. } => format!(" and all sample vectors of {vector_bytes} bytes"),
    };
    let margin = denoiser.parts().map_or_else(String::new, |parts| {
        format!(", filters parts of an image with a margin of {} pixels", parts.margin())
    });
    format!("{:<17}reads statistics of {read} dimensions{vectors}{margin}\n", denoiser.name().to_string())
}

/// Returns the number of triangles stored, and with every instance counted.
fn triangles(scene: &Scene) -> (usize, usize) {
    let of_object = |object: usize| -> usize {
        let primitives = &scene.primitives[scene.objects[object].primitives.clone()];
        let of_shape = |shape: &Shape| match shape {
            Shape::Mesh(mesh) => mesh.indices.len(),
            Shape::Sphere(_) | Shape::Disk(_) => 0,
        };
        primitives.iter().map(|p| of_shape(&p.shape)).sum()
    };
    let sizes: Vec<usize> = (0..scene.objects.len()).map(of_object).collect();
    let instanced: usize = scene.instances.iter().map(|instance| sizes[instance.object]).sum();
    (sizes.iter().sum(), sizes.first().unwrap_or(&0) + instanced)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pixel_filter_is_described_in_words() {
        let filter = PixelFilter::Box { radius: [0.5, 0.5] };
        assert_eq!(describe_filter(&filter), "box filter, radius 0.5");
        let filter = PixelFilter::Gaussian { radius: [1.5, 2.0], sigma: 0.5 };
        assert_eq!(describe_filter(&filter), "Gaussian filter, radius 1.5 x 2, sigma 0.5");
    }
}
