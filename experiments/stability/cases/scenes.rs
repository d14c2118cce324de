//! Cases on scenes: degenerate meshes, empty and dark scenes, enclosed cameras, moved and scaled scenes.

use prpf::scene::{Scene, pbrt};
use prpf::stats::{Part, Store};

use super::case::Bound::{AtMost, Exactly};
use super::case::{Case, largest, relative};
use super::effort::Effort;
use super::renders::{NOISY, green, noisy, render, scene};
use super::stores::{FILTERS, filtered, not_finite};

pub fn cases(_: Effort) -> Vec<Case> {
    let mut cases = vec![degenerate_triangles(), broken_mesh()];
    cases.extend(dark_scenes());
    cases.extend(enclosed());
    cases.extend(transformed());
    cases
}

const HEAD: &str = r#"
LookAt 0 0 -4  0 0 0  0 1 0
Camera "perspective" "float fov" 40
Integrator "path" "integer maxdepth" 5
Film "rgb" "integer xresolution" 24 "integer yresolution" 24
WorldBegin
"#;

fn with_head(world: &str) -> Scene {
    scene(&[HEAD, world].concat())
}

fn brightest(store: &Store) -> f64 {
    largest(green(store, Part::Whole))
}

/// Triangles without area change no pixel.
fn degenerate_triangles() -> Case {
    // A point, a line, and a triangle whose area f32 does not resolve
    let slivers = r#"
        Shape "trianglemesh" "integer indices" [ 0 0 0  0 1 2  3 4 5 ] "point3 P"
          [ 0 0 0  1 1 0  2 2 0  -0.5 1 -1  -0.5 1 -1  -0.5 1.0000001 -1 ]"#;
    let images = [NOISY.to_owned(), [NOISY, slivers].concat()]
        .map(|text| green(&render(&scene(&text), 8, 1), Part::Whole));
    let changed = images[0].iter().zip(&images[1]).filter(|(a, b)| a != b).count();
    Case::new("triangles without area", "changed pixels", Exactly(0.0), changed as f64)
}

/// Mesh files with coordinates that are not finite are refused.
fn broken_mesh() -> Case {
    let vertex = |value: f32| {
        let mut file =
            b"ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\nproperty float y\n\
            property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
                .to_vec();
        let corners: [f32; 9] = [0.0, 0.0, 0.0, 1.0, value, 0.0, 0.0, 1.0, 0.0];
        corners.iter().for_each(|v| file.extend(v.to_le_bytes()));
        file.push(3);
        [0i32, 1, 2].iter().for_each(|v| file.extend(v.to_le_bytes()));
        file
    };
    let folder = tempfile::tempdir().expect("a temporary folder can be made");
    let text = [HEAD, "Shape \"plymesh\" \"string filename\" \"mesh.ply\""].concat();
    let reads = |value: f32| {
        std::fs::write(folder.path().join("mesh.ply"), vertex(value)).expect("it can be written to");
        pbrt::read_str(&text, folder.path())
    };
    let refused = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY].iter().filter(|&&value| {
        reads(value).is_err_and(|error| {
            error.to_string().lines().count() == 1 && error.to_string().contains("mesh.ply")
        })
    });
    let refused = refused.count() + usize::from(reads(0.5).is_ok());
    Case::new(
        "NaN and ±∞ in a mesh file, and a valid file",
        "files handled correctly, of 4",
        Exactly(4.0),
        refused as f64,
    )
}

/// Scenes that have to render black.
fn dark_scenes() -> Vec<Case> {
    let unlit_sphere = r#"Shape "sphere" "float radius" 1 "#;
    let scenes = [
        ("an empty scene", String::new()),
        ("a scene without lights", unlit_sphere.to_owned()),
        (
            "lights without area",
            format!(
                r#"{unlit_sphere} AreaLightSource "diffuse" "rgb L" [ 9 9 9 ]
                Shape "trianglemesh" "integer indices" [ 0 1 2  0 0 2  0 1 3 ]
                "point3 P" [ 0 0 -2  0 0 -2  1 1 -2  0.5 0.5 -2 ]"#
            ),
        ),
        (
            "a light inside a closed box",
            r#"AttributeBegin AreaLightSource "diffuse" "rgb L" [ 9 9 9 ] Shape "sphere" "float radius" 0.3 AttributeEnd
            LightSource "point" "rgb I" [ 100 100 100 ]
            Shape "trianglemesh" "integer indices"
              [ 0 1 3 0 3 2  4 6 7 4 7 5  0 4 5 0 5 1  2 3 7 2 7 6  0 2 6 0 6 4  1 5 7 1 7 3 ]
              "point3 P" [ -1 -1 -1  1 -1 -1  -1 1 -1  1 1 -1  -1 -1 1  1 -1 1  -1 1 1  1 1 1 ]"#
                .to_owned(),
        ),
    ];
    let case = |(name, world): (&str, String)| {
        let store = render(&with_head(&world), 16, 1);
        let filtered = FILTERS.map(|(denoiser, _)| filtered(&store, denoiser));
        let wrong = filtered.iter().map(not_finite).sum::<usize>() as f64;
        let light = filtered.iter().flat_map(|filtered| filtered.image.data()).map(|&v| f64::from(v));
        let dark = largest(light.chain([brightest(&store)]));
        let bad = store.rejected() as f64 + wrong;
        Case::new(name, "brightest pixel, samples rejected, values not finite", Exactly(0.0), dark + bad)
    };
    scenes.map(case).to_vec()
}

/// Cameras inside a lamp and inside glass.
fn enclosed() -> Vec<Case> {
    let inside = |world: &str, samples: u32| {
        let text = HEAD.replace("0 0 -4  0 0 0", "0.2 0 0  1 0 0.3");
        render(&scene(&[&text, world].concat()), samples, 3)
    };
    let lamp = r#"AreaLightSource "diffuse" "rgb L" [ 3 3 3 ] "bool twosided" true
        Material "diffuse" "rgb reflectance" [ 0 0 0 ] Shape "sphere" "float radius" 1"#;
    let glowing = largest(green(&inside(lamp, 4), Part::Whole).into_iter().map(|v| relative(v, 3.0)));
    let glass = r#"LightSource "infinite" "rgb L" [ 1 1 1 ]
        Material "dielectric" Shape "sphere" "float radius" 1"#;
    let store = inside(glass, 256);
    let (mean, _) = super::renders::mean(&green(&store, Part::Whole));
    // From a fifth of the radius, no ray is totally reflected. Reflected light meets the surface again at the same
    // angle, until all but 0.04⁵ of it has left. Radiance inside glass is that outside times the squared index.
    const SQUARED_INDEX: f64 = 2.25;
    vec![
        Case::new("a camera inside a lamp", "relative error", AtMost(1e-6), glowing),
        Case::new(
            "a camera inside a glass sphere",
            "samples rejected",
            Exactly(0.0),
            store.rejected() as f64,
        ),
        Case::new(
            "the same",
            "relative error of the mean, 1.5² under a sky of 1",
            AtMost(1e-5),
            relative(mean, SQUARED_INDEX),
        ),
    ]
}

/// The noisy scene, moved and scaled.
fn transformed() -> Vec<Case> {
    // Render the scene in another place or size
    let render_transformed = |scale: f64, shift: f64| {
        let transformed = |p: [f64; 3]| p.map(|v| (v * scale + shift).to_string()).join(" ");
        let camera =
            format!("LookAt {} {} 0 1 0", transformed([0.0, 1.0, -3.4]), transformed([0.0, 0.9, 0.0]));
        let lens = format!("\"float lensradius\" {} \"float focaldistance\" {}", 0.05 * scale, 3.2 * scale);
        let text = NOISY
            .replace("LookAt 0 1 -3.4  0 0.9 0  0 1 0", &camera)
            .replace("\"float lensradius\" 0.05 \"float focaldistance\" 3.2", &lens)
            .replace(
                "WorldBegin",
                &format!("WorldBegin Translate {shift} {shift} {shift} Scale {scale} {scale} {scale}"),
            );
        render(&scene(&text), 16, 1)
    };

    // Compare it with the original, unfiltered and filtered
    let reference = render(&noisy(), 16, 1);
    let mut cases = Vec::new();
    for (what, store) in [
        ("moved by 10⁶", render_transformed(1.0, 1e6)),
        ("scaled by 10⁻³", render_transformed(1e-3, 0.0)),
        ("scaled by 10³", render_transformed(1e3, 0.0)),
    ] {
        let (a, b) = (green(&store, Part::Whole), green(&reference, Part::Whole));
        // At outlines, rounding decides which surface is hit, and whether a path continues.
        let differing = a.iter().zip(&b).filter(|(a, b)| relative(**a, **b) > 1e-3).count();
        cases.push(Case::new(
            format!("a scene {what}"),
            "fraction of pixels that differ by over 0.1 %",
            AtMost(0.02),
            differing as f64 / b.len() as f64,
        ));
        for (denoiser, name) in FILTERS {
            let [a, b] = [&store, &reference].map(|store| filtered(store, denoiser).image);
            let squares = a.data().iter().zip(b.data()).map(|(&a, &b)| relative(a.into(), b.into()).powi(2));
            let rms = (squares.sum::<f64>() / b.data().len() as f64).sqrt();
            cases.push(Case::new(
                format!("the same, filtered, {name}"),
                "rms relative difference",
                AtMost(0.01),
                rms,
            ));
        }
    }
    cases
}
