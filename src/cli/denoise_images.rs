//! `prpf denoise` of images of any renderer: two renders of one frame with different seeds, or one with its variance.

use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{bail, ensure};
use rayon::prelude::*;

use super::command_line::{command_line, quoted};
use super::denoise::DenoiseOptions;
use super::failure::Failure;
use super::summary::describe;
use super::terminal::{escaped, print, print_error};
use crate::files::open_regular;
use crate::filter::{DEFAULT, DENOISERS, Denoiser, FilterResult, SampleVectors, weights_of};
use crate::image::exr_file::{self, Attribute, Channel, Precision, attribute_names};
use crate::image::{OutputFormat, Planes, png_file};
use crate::import::{Frame, FrameStore, Role};
use crate::output::Layers;
use crate::progressive::{ErrorEstimate, HalfImages};
use crate::state::ImageMetadata;
use crate::stats::Store;

/// Layers that an EXR gets beside the image, where they exist.
const LAYERS: [&str; 7] = ["Noisy", "Albedo", "Ns", "Variance", "Error", "FilterResidual", "TileError"];

/// Returns whether a file is an image, by its first bytes.
pub(super) fn is_image(path: &Path) -> bool {
    use std::io::Read;
    let mut start = [0; exr_file::MAGIC.len()];
    let file = open_regular(path).ok();
    file.is_some_and(|(mut file, _)| file.read_exact(&mut start).is_ok()) && start == exr_file::MAGIC
}

/// Filters images and writes the result.
///
/// # Errors
/// Options or images that are wrong; a filter or an output that fails.
pub(super) fn denoise(options: &DenoiseOptions, outfiles: &[PathBuf], start: Instant) -> Result<u8, Failure> {
    // Read the images
    let denoiser = choose(options).map_err(Failure::Input)?;
    let names = layer_names(options).map_err(Failure::Input)?;
    let map = options.map.clone().unwrap_or_default();
    let aovs = options.aovs.clone().unwrap_or_default();
    let frames: Result<Vec<Frame>, _> =
        options.inputs.iter().map(|path| Frame::read(path, &map, &aovs)).collect();
    let frames = frames.map_err(|error| Failure::Input(error.into()))?;
    let FrameStore { store, aovs, empty_pixels } =
        FrameStore::new(&frames, 0).map_err(|error| Failure::Input(error.into()))?;
    if !options.quiet {
        warn(&frames, empty_pixels);
    }

    // Filter them
    let (result, filtered) = filter(denoiser, &store, &aovs).map_err(Failure::Run)?;
    let halves = HalfImages::new(denoiser, &store, |half| denoiser.filter(half, 0));
    let estimate = ErrorEstimate::new(&result, &store, halves.as_ref());

    // Write the image
    let metadata = metadata(store.width(), store.height());
    let layers = |names: &[String]| Layers::new(&result, &store, estimate.as_ref(), &metadata, Some(names));
    if options.layers.is_some() {
        let all = layers(&LAYERS.map(str::to_owned));
        all.check_present(&names).map_err(|error| Failure::Input(error.into()))?;
    }
    let layers = layers(&names);
    let alpha = mean_alpha(&frames);
    let mut channels = layers.channels();
    channels.extend(alpha.iter().map(|alpha| Channel::new("A", alpha, Precision::Float)));
    for ((name, _), planes) in aovs.iter().zip(&filtered) {
        let channel =
            |(c, suffix)| Channel::new(format!("{name}.{suffix}"), planes.plane(c), Precision::Float);
        channels.extend(["R", "G", "B"].into_iter().enumerate().map(channel));
    }
    write(&frames, &result, &channels, outfiles).map_err(Failure::Run)?;
    if !options.quiet {
        print(&summary(&frames, &result, estimate.as_ref(), outfiles, start)).map_err(Failure::Run)?;
    }
    Ok(0)
}

/// Returns the names of the layers that are written beside the image.
fn layer_names(options: &DenoiseOptions) -> anyhow::Result<Vec<String>> {
    let names = options.layers.clone().unwrap_or_else(|| LAYERS.map(str::to_owned).to_vec());
    if let Some(name) = options.aovs.iter().flatten().find(|name| names.contains(name)) {
        bail!(
            "--aovs {name}: found the name of a layer that is written beside the image; accepted with --layers that leave it out"
        );
    }
    match names.iter().find(|name| !LAYERS.contains(&name.as_str())) {
        Some(name) => bail!("--layers: found `{name}`; accepted with images are {}", LAYERS.join(", ")),
        None => Ok(names),
    }
}

/// Filters a store, and layers that sum to its colour.
fn filter(
    denoiser: &dyn Denoiser,
    store: &Store,
    aovs: &[(String, [Planes; 2])],
) -> anyhow::Result<(FilterResult, Vec<Planes>)> {
    let planes: Vec<[Planes; 2]> = aovs.iter().map(|(_, planes)| planes.clone()).collect();
    let (result, filtered) = match denoiser.layers() {
        Some(denoiser) => denoiser.filter_with_layers(store, 0, &planes),
        None => (denoiser.filter(store, 0), Vec::new()),
    };
    match &result.failure {
        Some(failure) => bail!("{failure}"),
        None => Ok((result, filtered)),
    }
}

/// Returns what is known of an image that comes from no scene.
fn metadata(width: usize, height: usize) -> ImageMetadata {
    ImageMetadata {
        source: String::new(),
        hash: String::new(),
        film: [width, height],
        pixel_bounds: [0, width, 0, height],
        integrator: String::new(),
        effects: Vec::new(),
        origin: [0.0; 3],
        diameter: 1.0,
        camera: String::new(),
    }
}

/// Writes the image to every file, with the first image's metadata. The error names all files that failed.
fn write(
    frames: &[Frame],
    result: &FilterResult,
    channels: &[Channel],
    outfiles: &[PathBuf],
) -> anyhow::Result<()> {
    let attributes = attributes(frames, result);
    let Frame { windows, metadata: of_first, .. } = &frames[0];
    let write = |path: &PathBuf| match OutputFormat::from_path(path)? {
        OutputFormat::Png => png_file::write(path, &result.image, 0.0),
        OutputFormat::Exr => {
            exr_file::write_with_metadata(path, *windows, channels, &attributes, of_first, still_holds)
        }
    };
    let errors: Vec<_> = outfiles.par_iter().filter_map(|path| write(path).err()).collect();
    let lines: Vec<String> = errors.iter().map(ToString::to_string).collect();
    ensure!(lines.is_empty(), "{}", lines.join("; "));
    Ok(())
}

/// Returns the mean of the frames' alphas, if all have one: it is not filtered.
fn mean_alpha(frames: &[Frame]) -> Option<Vec<f32>> {
    let alphas =
        frames.iter().map(|frame| Some(frame.alpha.as_ref()?.plane(0))).collect::<Option<Vec<_>>>()?;
    let mean = |i: usize| alphas.iter().map(|alpha| alpha[i]).sum::<f32>() / alphas.len() as f32;
    Some((0..alphas.first()?.len()).map(mean).collect())
}

/// Returns the denoiser, which images have to suffice for.
fn choose(options: &DenoiseOptions) -> anyhow::Result<&'static dyn Denoiser> {
    let denoiser = options.denoiser.choose(DEFAULT)?;
    let name = denoiser.name();
    ensure!(
        denoiser.reads().sample_vectors == SampleVectors::None,
        "--denoiser {name}: found a denoiser that reads sample vectors, which images do not have; accepted are {}",
        methods(|denoiser| denoiser.reads().sample_vectors == SampleVectors::None)
    );
    ensure!(
        options.aovs.is_none() || denoiser.layers().is_some(),
        "--aovs: found --denoiser {name}, whose weights cannot filter other layers; accepted are {}",
        methods(|denoiser| denoiser.layers().is_some())
    );
    Ok(denoiser)
}

/// Returns the methods of the denoisers that are accepted, for a message.
fn methods(is_accepted: impl Fn(&dyn Denoiser) -> bool) -> String {
    let accepted = DENOISERS.into_iter().filter(|denoiser| is_accepted(*denoiser));
    let mut methods: Vec<_> = accepted.map(|denoiser| denoiser.name().method).collect();
    methods.dedup();
    methods.join(", ")
}

/// Prints what may make the image worse than it could be.
fn warn(frames: &[Frame], empty_pixels: usize) {
    let negative: usize = frames.iter().map(|frame| frame.negative_values).sum();
    let mut warnings = Vec::new();
    if let [_] = frames {
        warnings.push(
            "one image: its halves are made by adding noise of the variance that it states. That variance comes from the same \
             samples as the image, so fireflies and dark noise stay in part; two renders with different seeds are better"
                .to_owned(),
        );
    }
    let lacks = |role: Role| frames.iter().any(|frame| !frame.found.iter().any(|(found, _)| *found == role));
    if lacks(Role::Normal) {
        warnings.push(
            "no normals: edges between surfaces of one colour may be blurred; --map normal=LAYER names them"
                .to_owned(),
        );
    }
    if lacks(Role::Albedo) {
        warnings.push("no albedo: textures may be blurred; --map albedo=LAYER names it".to_owned());
    }
    if negative > 0 {
        warnings.push(format!("{negative} negative values of the colour were set to 0"));
    }
    if empty_pixels > 0 {
        warnings
            .push(format!("{empty_pixels} pixels without finite values are filled from their neighbours"));
    }
    warnings.iter().for_each(|warning| print_error(&format!("warning: {warning}")));
}

/// Returns whether an attribute of the first image holds for the filtered one: not if it is about one render's samples, about
/// layers that are left out, or was written by this program.
fn still_holds(name: &str) -> bool {
    use attribute_names::{MSE, RENDER_TIME_SECONDS, SAMPLES_PER_PIXEL};
    let begins = |with: &str| name.starts_with(with);
    ![MSE, RENDER_TIME_SECONDS, SAMPLES_PER_PIXEL].contains(&name)
        && !begins("cryptomatte/")
        && !begins("prpf.")
}

fn attributes(frames: &[Frame], result: &FilterResult) -> Vec<(String, Attribute)> {
    let sources = frames.iter().map(|frame| frame.path.to_string_lossy().into_owned());
    let own = |name: &str, value: String| (format!("prpf.{name}"), Attribute::Text(value));
    let mut attributes = vec![
        own("version", env!("CARGO_PKG_VERSION").to_owned()),
        own("commandLine", command_line()),
        own("sources", quoted(sources)),
        own("denoiser", result.made_by.to_string()),
    ];
    attributes.extend(weights_of(result.made_by).map(|weights| own("weights", weights.to_owned())));
    let spp = frames.iter().try_fold(0_i32, |sum, frame| sum.checked_add(i32::try_from(frame.spp?).ok()?));
    attributes.extend(spp.map(|spp| (attribute_names::SAMPLES_PER_PIXEL.to_owned(), Attribute::Int(spp))));
    attributes
}

fn summary(
    frames: &[Frame],
    result: &FilterResult,
    estimate: Option<&ErrorEstimate>,
    outfiles: &[PathBuf],
    start: Instant,
) -> String {
    let role = |(role, layer): &(Role, String)| {
        let shown = if layer.is_empty() { "(no name)" } else { layer };
        format!("{} {shown}", role.name())
    };
    let mut lines: Vec<String> = frames
        .iter()
        .map(|frame| {
            let found: Vec<String> = frame.found.iter().map(role).collect();
            escaped(&format!("{}: {}", frame.path.display(), found.join(", ")))
        })
        .collect();
    let error = estimate.map(|estimate| format!("{}, ", describe(estimate))).unwrap_or_default();
    lines.push(format!("{:.2} s, {error}by {}", start.elapsed().as_secs_f64(), result.made_by));
    lines.extend(outfiles.iter().map(|path| escaped(&path.to_string_lossy())));
    lines.push(String::new());
    lines.join("\n")
}
