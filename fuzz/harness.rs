//! What is done with bytes that anybody may have written: shared by the coverage-guided targets of this
//! package and by `tests/fuzz_corpus.rs`, which replays their corpora with a stable compiler.
//!
//! Each function takes any bytes and panics if a promise is broken. A reader promises an error or a value
//! that the next room can work with, so what is read is used: scenes are rendered, states filtered.

use std::path::Path;

use glam::DVec3;
use prpf::adaptive::{self, PrioritySettings};
use prpf::filter::{Denoiser, FilterResult, nlm, prpf::PRPF};
use prpf::geometry::Accel;
use prpf::image::Planes;
use prpf::import::{Frame, FrameStore, LayerMap};
use prpf::preview::{Message, OrbitCamera};
use prpf::render::Renderer;
use prpf::scene::texture::{self, Content, Encoding, WrapMode};
use prpf::scene::{Camera, Integrator, Scene, Shape, pbrt};
use prpf::state::{self, Merge};
use prpf::stats::{Block, Layout, Part, Store};

/// What a target does with an input; it panics if something is wrong.
pub type Target = fn(&[u8]);

/// Every target by its name, that of its corpus.
pub const TARGETS: [(&str, Target); 9] = [
    ("scene", scene),
    ("ply", ply),
    ("texture", texture),
    ("spectrum", spectrum),
    ("brdf", brdf),
    ("state", state),
    ("message", message),
    ("store", store),
    ("import", import),
];

/// Scenes of more triangles or instances are read but not rendered: only their number would cost time.
const MOST_RENDERED: usize = 2000;
/// Films of this size are rendered whatever the scene says.
const SIDE: usize = 3;
const SAMPLES: u32 = 2;
/// Longer paths than this meet no other code.
const DEPTH: u32 = 4;

/// Scene files, separated by zero bytes: the first is the main one, the others are named `1`, `2`, ... and, for what
/// reads images, `1.pfm`, `2.pfm`, ...
pub fn scene(bytes: &[u8]) {
    const MOST_FILES: usize = 8;
    let folder = tempfile::tempdir().expect("a temporary folder can be made");
    for (i, text) in bytes.split(|&byte| byte == 0).take(MOST_FILES).enumerate() {
        write(folder.path(), &i.to_string(), text);
        if i > 0 {
            write(folder.path(), &format!("{i}.pfm"), text);
        }
    }
    match pbrt::read(&folder.path().join("0")) {
        Ok(scene) => render(scene),
        Err(error) => assert!(!error.to_string().contains(":0:0:"), "{error}"),
    }
}

/// A PLY file, gzipped or not.
pub fn ply(bytes: &[u8]) {
    const GZIP: [u8; 2] = [0x1f, 0x8b];
    let name = if bytes.starts_with(&GZIP) { "a.ply.gz" } else { "a.ply" };
    with_file(name, bytes, &format!("WorldBegin Shape \"plymesh\" \"string filename\" \"{name}\""));
}

/// An image file after a byte that tells its format and how it is read.
pub fn texture(bytes: &[u8]) {
    const NAMES: [&str; 7] = ["a.exr", "a.png", "a.jpg", "a.tga", "a.pfm", "a.hdr", "a.bmp"];
    let Some((kind, content)) = bytes.split_first() else { return };
    let folder = tempfile::tempdir().expect("a temporary folder can be made");
    let name = NAMES[usize::from(*kind) % NAMES.len()];
    write(folder.path(), name, content);
    let (encoding, content) = match usize::from(*kind) / NAMES.len() % 3 {
        0 => (Encoding::Srgb, Content::Colour),
        1 => (Encoding::Gamma(2.2), Content::Luminance),
        _ => (Encoding::Linear, Content::Light),
    };
    let Ok(image) = texture::load(&folder.path().join(name), encoding, content) else { return };
    let (width, height) = (image.width(), image.height());
    assert!(width > 0 && height > 0);
    for (x, y) in [(0, 0), (width - 1, 0), (width / 2, height / 2), (width - 1, height - 1)] {
        assert!(image.rgb(x, y).is_finite() && image.float(x, y).is_finite());
    }
    let corner: f32 = image.bilinear(glam::Vec2::ONE, WrapMode::Repeat);
    assert!(!corner.is_nan());
}

/// An EXR of another program, by itself and beside another image of the same frame: whatever becomes a store is filtered.
pub fn import(bytes: &[u8]) {
    let folder = tempfile::tempdir().expect("a temporary folder can be made");
    let frame = |name: &str, content: &[u8]| {
        write(folder.path(), name, content);
        Frame::read(&folder.path().join(name), &LayerMap::default(), &[])
    };
    let Ok(first) = frame("a.exr", bytes) else { return };
    let mut other = first.clone();
    other.colour.data_mut().iter_mut().for_each(|value| *value *= 0.5);
    let pairs = [vec![first.clone()], vec![first, other]];
    for made in pairs.iter().filter_map(|frames| FrameStore::new(frames, 0).ok()) {
        if made.store.pixels() <= 64 {
            check(&made.store, &nlm::DRAFT.filter(&made.store, 0));
        }
    }
}

/// A file of wavelengths and values.
pub fn spectrum(bytes: &[u8]) {
    let text = r#"WorldBegin LightSource "infinite" "spectrum L" "a.spd"
        Material "conductor" "spectrum eta" "a.spd" "spectrum k" "a.spd"
        Shape "sphere" Material "diffuse" "spectrum reflectance" "a.spd" Shape "disk""#;
    with_file("a.spd", bytes, text);
}

/// A measured BRDF after a byte that tells its format: text, or MERL's table.
pub fn brdf(bytes: &[u8]) {
    const NAMES: [&str; 2] = ["a.brdf", "a.binary"];
    let Some((kind, content)) = bytes.split_first() else { return };
    let name = NAMES[usize::from(*kind) % NAMES.len()];
    let text = format!(
        "WorldBegin LightSource \"infinite\" Material \"measured\" \"string filename\" \"{name}\" \
         Translate 0 0 2 Shape \"sphere\""
    );
    with_file(name, content, &text);
}

/// Decodes the bytes as a state file, and again as the header (up to the first zero byte) and the arrays of a file whose
/// lengths and checksum are right: no search gets past a checksum.
///
/// Whatever is decoded is encoded to the same bytes again and can be merged and filtered.
pub fn state(bytes: &[u8]) {
    let _ = state::decode(bytes);
    let Ok(read) = state::decode(&state_file(bytes)) else { return };
    let written = |state| {
        let mut file = Vec::new();
        state::encode(state, &mut file);
        file
    };
    let once = written(&read);
    let again = state::decode(&once).expect("what was read can be written and read again");
    assert!(written(&again) == once, "writing and reading change nothing");
    assert!(read.streams.iter().all(|stream| !stream.to_string().is_empty()));
    let mut merge = Merge::new(read.clone());
    let _ = merge.add(&again);
    let _ = merge.finish();
    if read.checkpoint.store.pixels() <= 64 {
        check(&read.checkpoint.store, &nlm::DRAFT.filter(&read.checkpoint.store, 0));
    }
}

/// Messages of the live page, one a line, to a camera of each kind.
pub fn message(bytes: &[u8]) {
    const DIRECTIVES: [&str; 2] =
        ["LookAt 0 1 -3 0 0 0 0 1 0 Camera \"perspective\"", "Scale -1 1 1 Camera \"orthographic\""];
    let mut cameras = DIRECTIVES.map(|directives| {
        let text = format!("{directives} WorldBegin");
        let scene = pbrt::read_str(&text, Path::new("")).expect("the scene is right");
        OrbitCamera::new(&scene.camera, None, 5.0)
    });
    for line in String::from_utf8_lossy(bytes).lines() {
        let Ok(Message::Camera(step)) = Message::parse(line) else { continue };
        let seen = step.focus_at.map(|[x, y]| DVec3::new(f64::from(x), f64::from(y), 1.0));
        for camera in &mut cameras {
            camera.apply(&step, seen);
            let Camera { to_render, screen_window, lens_radius, focal_distance, .. } = camera.camera();
            assert!(to_render.at_f64(0.5).is_finite(), "{camera:?}");
            assert!(screen_window.iter().all(|v| v.is_finite()), "{camera:?}");
            assert!(screen_window[0] < screen_window[1] && screen_window[2] < screen_window[3], "{camera:?}");
            assert!(lens_radius.is_finite() && focal_distance.is_finite(), "{camera:?}");
            assert!(*lens_radius >= 0.0 && *focal_distance > 0.0, "{camera:?}");
        }
    }
}

/// Sample vectors that no renderer would make, then a filter pass and an allocation. Two bytes choose the
/// layout's blocks, four more width, height, capacity of the reservoir and filter; then each sample vector
/// has a byte for its pixel and one for each value.
pub fn store(bytes: &[u8]) {
    const BLOCKS: [Block; 14] = [
        Block::Film,
        Block::Colour,
        Block::Position1,
        Block::Normal1,
        Block::Albedo,
        Block::Position2,
        Block::Normal2,
        Block::Lens,
        Block::Time,
        Block::Light1,
        Block::Bsdf1,
        Block::Radiance,
        Block::Emission,
        Block::Hit,
    ];
    let Some((&[low, high, width, height, capacity, denoiser], samples)) = bytes.split_first_chunk() else {
        return;
    };
    let enabled = u16::from_le_bytes([low, high]);
    let layout = Layout::with_blocks(|block| {
        BLOCKS.iter().position(|&b| b == block).is_some_and(|bit| enabled >> bit & 1 == 1)
    });
    let (width, height) = (1 + usize::from(width % 9), 1 + usize::from(height % 9));
    let denoisers: [&dyn Denoiser; 3] = [&nlm::DRAFT, &nlm::STANDARD, &PRPF];
    let denoiser = denoisers[usize::from(denoiser % 3)];
    let mut store = Store::new(width, height, layout.clone(), usize::from(capacity % 9), 0);
    let mut sample = Vec::with_capacity(layout.len());
    for bytes in samples.chunks_exact(1 + layout.len()) {
        let pixel = usize::from(bytes[0]) % store.pixels();
        sample.clear();
        sample.extend(bytes[1..].iter().map(|&byte| value(byte)));
        store.push(pixel % width, pixel / width, &sample);
    }
    let pushed = samples.len() / (1 + layout.len());
    assert_eq!(store.samples_taken(), pushed as u64);
    assert_eq!(store.samples() + store.rejected(), store.samples_taken());
    check(&store, &denoiser.filter(&store, 0));
}

/// A value of a sample: what is hard for floating point, or an even step of [0, 1].
fn value(byte: u8) -> f32 {
    const HARD: [f32; 16] = [
        f32::NAN,
        f32::INFINITY,
        f32::NEG_INFINITY,
        -0.0,
        f32::MIN_POSITIVE,
        1e-45,
        -1e-40,
        1e30,
        -1e30,
        f32::MAX,
        f32::MIN,
        1e19,
        1e8,
        -1.0,
        1e-19,
        16_777_217.0,
    ];
    HARD.get(usize::from(byte)).copied().unwrap_or_else(|| f32::from(byte - 16) / 239.0)
}

/// Holds a filter to its promises for a store of finite numbers, and asks where samples go next.
fn check(store: &Store, filtered: &FilterResult) {
    let no_nan = |planes: &Planes| planes.data().iter().all(|v| !v.is_nan());
    assert!(filtered.image.data().iter().all(|v| v.is_finite()), "{:?}", filtered.image);
    assert!(no_nan(&filtered.variance) && no_nan(&filtered.error) && no_nan(&filtered.residual));
    assert!(
        filtered.halves.iter().all(no_nan)
            && filtered.interpolation.iter().all(|found| no_nan(&found.failure))
    );
    let counts = store.counts(Part::Whole);
    let priority = adaptive::priority(store, filtered.into(), &PrioritySettings::default());
    let total = 3 * counts.len() as u64 + 1;
    let plan = adaptive::allocate(&priority, &counts, store.width(), total, u32::MAX, 0);
    let planned: u64 = plan.iter().map(|&n| u64::from(n)).sum();
    let room: u64 = counts.iter().map(|&n| u64::from(u32::MAX - n)).sum();
    assert_eq!(planned, total.min(room));
}

fn write(folder: &Path, name: &str, bytes: &[u8]) {
    std::fs::write(folder.join(name), bytes).expect("a temporary file can be written");
}

/// Reads a scene that needs one file more.
fn with_file(name: &str, content: &[u8], text: &str) {
    let folder = tempfile::tempdir().expect("a temporary folder can be made");
    write(folder.path(), name, content);
    if let Ok(scene) = pbrt::read_str(text, folder.path()) {
        render(scene);
    }
}

/// Renders a few samples.
fn render(mut scene: Scene) {
    let triangles = |shape: &Shape| if let Shape::Mesh(mesh) = shape { mesh.indices.len() } else { 1 };
    let count: usize = scene.primitives.iter().map(|p| triangles(&p.shape)).sum();
    if count.max(scene.instances.len()) > MOST_RENDERED {
        return;
    }
    scene.resize_film(SIDE, SIDE);
    scene.film.pixel_bounds = [0, SIDE, 0, SIDE];
    scene.integrator = match scene.integrator {
        Integrator::Path { max_depth } => Integrator::Path { max_depth: max_depth.min(DEPTH) },
        Integrator::Direct { max_depth } => Integrator::Direct { max_depth: max_depth.min(DEPTH) },
    };
    let accel = Accel::build(&scene);
    let renderer = Renderer::new(&scene, &accel, 0);
    let mut store = Store::new(SIDE, SIDE, renderer.layout().clone(), 1, 0);
    renderer.render_batch(&[SAMPLES; SIDE * SIDE], &mut store);
    assert_eq!(store.samples_taken(), u64::from(SAMPLES) * store.pixels() as u64);
}

/// Returns a state file with right lengths and checksum, from a header that ends with a zero byte, and arrays.
pub fn state_file(bytes: &[u8]) -> Vec<u8> {
    const PREAMBLE: usize = 28;
    const CHECKSUM: usize = 4;
    let header = bytes.iter().position(|&byte| byte == 0).unwrap_or(bytes.len());
    let (header, arrays) = (&bytes[..header], bytes.get(header + 1..).unwrap_or_default());
    let length = PREAMBLE + header.len() + arrays.len() + CHECKSUM;
    let mut file = b"prpfstat".to_vec();
    file.extend(state::VERSION.to_le_bytes());
    file.extend((length as u64).to_le_bytes());
    file.extend((header.len() as u64).to_le_bytes());
    file.extend(header);
    file.extend(arrays);
    file.extend(crc32fast::hash(&file).to_le_bytes());
    file
}
