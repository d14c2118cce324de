//! The effects that a scene uses. They determine which dimensions a render samples and stores.

use glam::Vec3;

use super::material::{Additive, Metal};
use super::texture::RgbTextureId;
use super::{AnimatedTransform, Integrator, Light, MaterialId, MaterialKind, MaterialTraits, Scene};

/// The effects that a scene uses.
///
/// Random numbers, dimensions of the sample vector, planes of the store and terms of the filter all
/// follow from these flags.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Effects {
    /// The camera has a lens of nonzero radius.
    pub lens: bool,
    /// The camera or an instance moves while the shutter is open.
    pub motion: bool,
    /// A light has an extent (a surface or an environment), so that light sampling uses random
    /// numbers that the colour depends on.
    pub extended_lights: bool,
    /// An environment surrounds the scene.
    pub environment: bool,
    /// The camera can see emission (of a surface or an environment).
    pub visible_emission: bool,
    /// A material is neither Lambertian nor perfectly specular.
    pub glossy: bool,
    /// A material is perfectly specular.
    pub specular: bool,
    /// Paths continue beyond the first hit: indirect light, or specular chains.
    pub second_hit: bool,
    /// Paths gather light after more than one scattering event.
    pub indirect: bool,
    /// A reflectance is textured.
    pub textures: bool,
    /// A reflectance varies over a surface or between surfaces, so that albedo is a useful feature.
    pub varied_albedo: bool,
    /// A surface has an alpha texture.
    pub alpha: bool,
}

impl Scene {
    /// The effects that the scene uses.
    pub fn effects(&self) -> Effects {
        Effects::new(self)
    }
}

impl Effects {
    /// Determines the effects of a scene.
    pub fn new(scene: &Scene) -> Self {
        let camera = &scene.camera;
        let moves =
            |transform: &AnimatedTransform| transform.moves_during(camera.shutter_open, camera.shutter_close);
        let lit = |color: Vec3| color != Vec3::ZERO;
        let emits = scene.primitives.iter().any(|p| p.area_light.is_some_and(|light| lit(light.radiance)));
        let environment =
            scene.lights.iter().any(|light| matches!(light, Light::Environment(e) if lit(e.scale)));
        let mut summary = MaterialSummary::new(scene);
        scene.primitives.iter().for_each(|primitive| summary.add(primitive.material));
        let indirect = matches!(scene.integrator, Integrator::Path { max_depth: 2.. });
        Self {
            lens: camera.lens_radius > 0.0,
            motion: moves(&camera.to_render) || scene.instances.iter().any(|i| moves(&i.transform)),
            extended_lights: emits || environment,
            environment,
            visible_emission: emits || environment,
            glossy: summary.glossy,
            specular: summary.specular,
            second_hit: indirect || (summary.specular && scene.integrator.max_depth() >= 2),
            indirect,
            textures: summary.textured,
            varied_albedo: summary.textured || summary.varied,
            alpha: scene.primitives.iter().any(|primitive| primitive.alpha.is_some()),
        }
    }

    /// Names of the enabled effects.
    pub fn names(&self) -> Vec<&'static str> {
        [
            (self.lens, "depth-of-field"),
            (self.motion, "motion-blur"),
            (self.extended_lights, "area-lights"),
            (self.environment, "environment"),
            (self.visible_emission, "visible-emission"),
            (self.glossy, "glossy"),
            (self.specular, "specular"),
            (self.second_hit, "second-hit"),
            (self.indirect, "indirect"),
            (self.textures, "textures"),
            (self.varied_albedo, "varied-albedo"),
            (self.alpha, "alpha"),
        ]
        .into_iter()
        .filter_map(|(on, name)| on.then_some(name))
        .collect()
    }
}

/// Properties of the materials in use.
struct MaterialSummary<'s> {
    scene: &'s Scene,
    visited: Vec<bool>,
    glossy: bool,
    specular: bool,
    /// A reflectance is not constant.
    textured: bool,
    /// Two reflectances differ.
    varied: bool,
    /// Reflectance of the first material, which the others are compared with.
    reflectance: Option<Vec3>,
}

impl<'s> MaterialSummary<'s> {
    fn new(scene: &'s Scene) -> Self {
        Self {
            scene,
            visited: vec![false; scene.materials.len()],
            glossy: false,
            specular: false,
            textured: false,
            varied: false,
            reflectance: None,
        }
    }

    /// Adds a material, once.
    fn add(&mut self, id: MaterialId) {
        if std::mem::replace(&mut self.visited[id.0 as usize], true) {
            return;
        }
        let material = &self.scene.materials[id.0 as usize];
        let traits = MaterialTraits::new(&self.scene.textures, material);
        self.glossy |= traits.is_glossy;
        self.specular |= traits.is_specular;
        match &material.kind {
            // One reflectance
            MaterialKind::Diffuse { reflectance }
            | MaterialKind::OrenNayar { reflectance, .. }
            | MaterialKind::Mirror { reflectance }
            | MaterialKind::CoatedDiffuse { reflectance, .. } => self.add_reflectance(*reflectance),
            MaterialKind::Conductor { metal, .. } | MaterialKind::CoatedConductor { metal, .. } => {
                self.add_conductor(metal);
            }
            MaterialKind::Dielectric { .. } | MaterialKind::ThinDielectric { .. } => {
                self.add_constant_reflectance(Vec3::ONE);
            }
            MaterialKind::Measured(table) => self.add_constant_reflectance(table.albedo(1.0)),
            // Several reflectances
            MaterialKind::FresnelBlend { diffuse: first, specular: second, .. }
            | MaterialKind::DiffuseTransmission { reflectance: first, transmittance: second } => {
                self.add_reflectance(*first);
                self.add_reflectance(*second);
            }
            MaterialKind::Additive(parts) => self.add_lobes(parts),
            // Mixes and interfaces
            MaterialKind::Mix { first, second, .. } => {
                self.add(*first);
                self.add(*second);
            }
            MaterialKind::Interface => {}
        }
    }

    fn add_lobes(&mut self, parts: &Additive) {
        let black = |id: &RgbTextureId| self.scene.textures.constant_rgb(*id) == Some(Vec3::ZERO);
        let layers = [parts.gloss, parts.dielectric].into_iter().flatten().flat_map(|layer| layer.colours);
        let colours = parts.diffuse.into_iter().chain(layers).flatten().filter(|id| !black(id));
        // The reflectance is the sum of all lobes
        let values: Option<Vec<Vec3>> = colours.map(|id| self.scene.textures.constant_rgb(id)).collect();
        match values {
            Some(values) => self.add_constant_reflectance(values.into_iter().sum()),
            None => self.textured = true,
        }
    }

    fn add_conductor(&mut self, metal: &Metal) {
        match metal {
            Metal::Reflectance(reflectance) => self.add_reflectance(*reflectance),
            Metal::Fresnel { eta, k } => match self.constants(*eta, *k) {
                // Compute the Fresnel reflectance at normal incidence
                Some((eta, k)) => {
                    let (minus, plus, k2) = (eta - 1.0, eta + 1.0, k * k);
                    self.add_constant_reflectance((minus * minus + k2) / (plus * plus + k2));
                }
                None => self.textured = true,
            },
        }
    }

    fn constants(&self, eta: RgbTextureId, k: RgbTextureId) -> Option<(Vec3, Vec3)> {
        self.scene.textures.constant_rgb(eta).zip(self.scene.textures.constant_rgb(k))
    }

    fn add_reflectance(&mut self, reflectance: RgbTextureId) {
        match self.scene.textures.constant_rgb(reflectance) {
            Some(reflectance) => self.add_constant_reflectance(reflectance),
            None => self.textured = true,
        }
    }

    fn add_constant_reflectance(&mut self, reflectance: Vec3) {
        self.varied |= *self.reflectance.get_or_insert(reflectance) != reflectance;
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use crate::scene::pbrt::read_str;

    fn effects(header: &str, world: &str) -> Vec<&'static str> {
        read_str(&format!("{header} WorldBegin {world}"), Path::new("")).unwrap().effects().names()
    }

    const SPHERE: &str = "Shape \"sphere\" ";
    const DIRECT: &str = "Integrator \"path\" \"integer maxdepth\" 1 ";

    #[test]
    fn a_plain_scene_calls_for_nothing() {
        assert!(effects(DIRECT, SPHERE).is_empty());
        assert!(effects(DIRECT, "").is_empty());
    }

    #[test]
    fn each_effect_follows_from_its_cause() {
        let light = "AreaLightSource \"diffuse\" Shape \"sphere\"";
        let cases: [(&str, &str, &[&str]); 10] = [
            ("Camera \"perspective\" \"float lensradius\" 1", SPHERE, &["depth-of-field"]),
            ("", "ActiveTransform EndTime Translate 1 0 0 Shape \"sphere\"", &["motion-blur"]),
            ("", light, &["area-lights", "visible-emission"]),
            ("", "LightSource \"infinite\"", &["area-lights", "environment", "visible-emission"]),
            ("", "Material \"conductor\" \"float roughness\" .1 Shape \"sphere\"", &["glossy"]),
            ("", "Material \"dielectric\" Shape \"sphere\"", &["specular"]),
            (
                "",
                "Shape \"sphere\" Material \"diffuse\" \"rgb reflectance\" [1 0 0] Shape \"sphere\"",
                &["varied-albedo"],
            ),
            (
                "",
                "Texture \"t\" \"spectrum\" \"checkerboard\" Material \"diffuse\" \"texture reflectance\" \"t\" \
                 Shape \"sphere\"",
                &["textures", "varied-albedo"],
            ),
            (
                "",
                "Texture \"t\" \"color\" \"marble\" Material \"plastic\" \"texture Kd\" \"t\" Shape \"sphere\"",
                &["glossy", "textures", "varied-albedo"],
            ),
            ("", "Shape \"sphere\" \"float alpha\" .5", &["alpha"]),
        ];
        for (header, world, expected) in cases {
            assert_eq!(effects(&format!("{DIRECT}{header}"), world), expected, "{header} {world}");
        }
    }

    #[test]
    fn long_paths_and_specular_chains_reach_a_second_hit() {
        assert_eq!(effects("", SPHERE), ["second-hit", "indirect"]);
        let direct = "SurfaceIntegrator \"directlighting\"";
        assert!(effects(direct, SPHERE).is_empty());
        let glass = "Material \"dielectric\" Shape \"sphere\"";
        assert_eq!(effects(direct, glass), ["specular", "second-hit"]);
    }

    #[test]
    fn unused_materials_are_ignored() {
        let unused = "MakeNamedMaterial \"a\" \"string type\" \"dielectric\" Shape \"sphere\"";
        assert!(effects(DIRECT, unused).is_empty());
    }
}
