//! Spectrum files, and missing or invalid files.

use std::path::Path;

use glam::Vec3;

use super::image_textures::{assert_near, at_uv, dialect_world, reflectance};
use super::{error, folder};
use crate::scene::pbrt::dialect::Dialect::{V2, V3, V4};
use crate::scene::pbrt::{read, read_str};
use crate::scene::{Light, Scene};

/// The colour of the first material that a scene names.
fn colour(scene: &Scene) -> Vec3 {
    reflectance(scene, 1, at_uv([0.5; 2]))
}

#[test]
fn a_spectrum_is_read_from_its_file() {
    let (folder, _) =
        folder(&[("gray.spd", "# nm value\n300 .25 # below\n\n900 .25\n"), ("half.spd", "300 .5 900 .5")]);
    let kd = |dialect, file: &str| {
        let material = format!("Material \"matte\" \"spectrum Kd\" \"{file}\"");
        colour(&dialect_world(dialect, folder.path(), &material))
    };
    assert_near(kd(V4, "gray.spd"), [0.25; 3], "gray.spd");
    assert_near(kd(V4, "half.spd"), [0.5; 3], "half.spd");
    // The older dialects' light of equal energy is not white: linear sRGB of XYZ = 1, 1, 1.
    for dialect in [V2, V3] {
        let found = kd(dialect, "gray.spd");
        assert!((found - 0.25 * Vec3::new(1.2048, 0.9482, 0.9088)).length() < 3e-3, "{found}");
    }
}

#[test]
fn a_spectrum_file_equals_an_inline_spectrum() {
    let numbers = "400 .1 500 .7 600 .3 700 .9";
    let (folder, _) = folder(&[("a.spd", &numbers.replace(" .", " 0.").replace(' ', "\n"))]);
    for dialect in [V2, V3, V4] {
        let material = |spectrum: &str| {
            let text = format!("Material \"matte\" \"spectrum Kd\" {spectrum}");
            colour(&dialect_world(dialect, folder.path(), &text))
        };
        let in_scene = material(&format!("[{numbers}]"));
        assert!(in_scene.max_element() - in_scene.min_element() > 0.1, "{in_scene}");
        assert_eq!(material("\"a.spd\""), in_scene);
        let light = |spectrum: &str| {
            let text = format!("LightSource \"point\" \"spectrum I\" {spectrum}");
            let scene = dialect_world(dialect, folder.path(), &text);
            let Light::Point { intensity, .. } = scene.lights[0] else { panic!() };
            intensity
        };
        assert_eq!(light("[\"a.spd\"]"), light(&format!("[{numbers}]")));
    }
}

#[test]
fn paths_in_included_files_are_relative_to_the_main_file() {
    let (folder, main) =
        folder(&[("main.pbrt", "WorldBegin Include \"parts/a.pbrt\""), ("a.spd", "300 .5 900 .5")]);
    let parts = folder.path().join("parts");
    std::fs::create_dir(&parts).unwrap();
    std::fs::write(parts.join("a.pbrt"), "Material \"diffuse\" \"spectrum reflectance\" \"a.spd\"").unwrap();
    std::fs::write(parts.join("a.spd"), "300 .1 900 .1").unwrap();
    assert_near(colour(&read(&main).unwrap()), [0.5; 3], "beside the main file");
}

#[test]
fn a_missing_or_broken_spectrum_is_an_error_at_its_parameter() {
    let missing = error("WorldBegin\nMaterial \"matte\"\n  \"spectrum Kd\" \"nowhere.spd\"");
    assert_eq!((missing.line, missing.column), (3, 3), "{missing}");
    assert!(missing.message.contains("\"Kd\"") && missing.message.contains("nowhere.spd"), "{missing}");
    for (text, part) in [
        ("400 .5\n500 x\n", "\"x\" in line 2"),
        ("400 .5 500", "3 numbers"),
        ("400 nan", "\"nan\" in line 1"),
        ("# nothing", "0 numbers"),
    ] {
        let main = "WorldBegin\n Material \"diffuse\" \"spectrum reflectance\" \"a.spd\"";
        let (_folder, main) = folder(&[("main.pbrt", main), ("a.spd", text)]);
        let error = read(&main).unwrap_err();
        assert_eq!((error.line, error.column), (2, 21), "{error}");
        assert!(error.message.contains(part), "{error}");
    }
}

#[test]
fn a_missing_image_is_an_error_at_its_first_reference() {
    let texture = r#"Texture "t" "float" "imagemap" "string filename" "nowhere.png""#;
    for directive in [
        texture,
        r#"Material "diffuse" "string normalmap" "nowhere.png""#,
        r#"LightSource "infinite" "string filename" "nowhere.png""#,
        r#"AreaLightSource "diffuse" "string filename" "nowhere.png""#,
    ] {
        let error = error(&format!("WorldBegin\n\n  {directive}\n{directive}"));
        assert_eq!((error.line, error.column), (3, 3), "{error}");
        assert!(error.message.contains("image \"nowhere.png\""), "{error}");
    }
    let other = texture.replace("nowhere", "elsewhere");
    let (_folder, main) = folder(&[
        ("main.pbrt", &format!("WorldBegin Include \"a.pbrt\"\n{other}")),
        ("a.pbrt", &format!("\n {texture}")),
    ]);
    let error = read(&main).unwrap_err();
    assert!(error.file.ends_with("a.pbrt"), "{error}");
    assert_eq!((error.line, error.column), (2, 2), "{error}");
    assert!(error.message.contains("nowhere.png"), "{error}");
}

#[test]
fn an_invalid_image_is_an_error_at_its_reference() {
    let (folder, _) = folder(&[("a.png", "no image"), ("a.gif", "")]);
    for (name, part) in [("a.png", "a.png"), ("a.gif", "image format \"gif\"")] {
        let text =
            format!("WorldBegin\n Texture \"t\" \"float\" \"imagemap\" \"string filename\" \"{name}\"");
        let error = read_str(&text, folder.path()).unwrap_err();
        assert_eq!((error.line, error.column), (2, 2), "{error}");
        assert!(error.message.contains(part), "{error}");
    }
    assert!(error("WorldBegin LightSource \"infinite\" \"string filename\" \"a\"").message.contains("\"a\""));
    assert!(read_str("WorldBegin LightSource \"infinite\" \"string filename\" \"\"", Path::new("")).is_ok());
}

#[test]
fn contents_of_referenced_files_change_the_hash() {
    let spectrum = "400 .2 700 .4";
    let hash = |main: &str, spectrum: &str| {
        let (_folder, main) = folder(&[("main.pbrt", main), ("a.spd", spectrum)]);
        read(&main).unwrap().hash
    };
    let names = "WorldBegin Material \"diffuse\" \"spectrum reflectance\" \"a.spd\"";
    let one = hash(names, spectrum);
    assert_eq!(one, hash(names, spectrum));
    assert_ne!(one, hash(names, "400 .2 700 .5"));
    // Not that of others that lie beside it.
    assert_eq!(hash("WorldBegin", spectrum), hash("WorldBegin", "400 .2 700 .5"));
}
