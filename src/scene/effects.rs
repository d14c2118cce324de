//! The effects that a scene calls for, and nothing else decides what is simulated.

use glam::Vec3;

use super::material::{Additive, Metal, Roughness, RoughnessScale};
use super::texture::RgbTextureId;
use super::{AnimatedTransform, Integrator, Light, MaterialId, MaterialKind, Scene};

/// What a render of a scene has to simulate. Everything downstream (random numbers drawn,
/// dimensions of the sample vector, planes of the store, terms of the filter) follows from this.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Effects {
    /// The camera has a lens.
    pub lens: bool,
    /// Something moves while the shutter is open.
    pub motion: bool,
    /// Some light has an extent: a surface or an environment, so that light sampling draws numbers
    /// that the colour depends on.
    pub extended_lights: bool,
    /// An environment surrounds the scene.
    pub environment: bool,
    /// Some emission (surface or environment) can be seen by the camera.
    pub visible_emission: bool,
    /// Some material scatters in more than a Lambertian or a perfectly specular way.
    pub glossy: bool,
    /// Some material is perfectly specular.
    pub specular: bool,
    /// Paths are followed beyond the first hit: indirect light, or specular chains.
    pub second_hit: bool,
    /// Light is gathered beyond the first scattering event.
    pub indirect: bool,
    /// Some reflectance varies over a surface.
    pub textures: bool,
    /// Some reflectance varies over a surface or between surfaces, so that the albedo is a feature.
    pub varied_albedo: bool,
    /// Some surface is cut out by an alpha texture.
    pub alpha: bool,
}

impl Effects {
    /// Reads off a scene what it calls for.
    pub fn of(scene: &Scene) -> Self {
        let camera = &scene.camera;
        let moves =
            |transform: &AnimatedTransform| transform.moves_during(camera.shutter_open, camera.shutter_close);
        let lit = |color: Vec3| color != Vec3::ZERO;
        let emits = scene.primitives.iter().any(|p| p.area_light.is_some_and(|light| lit(light.radiance)));
        let environment =
            scene.lights.iter().any(|light| matches!(light, Light::Environment(e) if lit(e.scale)));
        let mut looks = Looks::new(scene);
        scene.primitives.iter().for_each(|primitive| looks.see(primitive.material));
        let indirect = matches!(scene.integrator, Integrator::Path { max_depth: 2.. });
        Self {
            lens: camera.lens_radius > 0.0,
            motion: moves(&camera.to_render) || scene.instances.iter().any(|i| moves(&i.transform)),
            extended_lights: emits || environment,
            environment,
            visible_emission: emits || environment,
            glossy: looks.glossy,
            specular: looks.specular,
            second_hit: indirect || (looks.specular && scene.integrator.max_depth() >= 2),
            indirect,
            textures: looks.textured,
            varied_albedo: looks.textured || looks.varied,
            alpha: scene.primitives.iter().any(|primitive| primitive.alpha.is_some()),
        }
    }

    /// Names of the effects that are on, in pbrt's and the field's words.
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

/// What the materials in use amount to.
struct Looks<'s> {
    scene: &'s Scene,
    seen: Vec<bool>,
    glossy: bool,
    specular: bool,
    /// Some reflectance is no constant.
    textured: bool,
    /// Two reflectances differ.
    varied: bool,
    /// The reflectance of the first material, to compare the others with.
    reflectance: Option<Vec3>,
}

impl<'s> Looks<'s> {
    fn new(scene: &'s Scene) -> Self {
        Self {
            scene,
            seen: vec![false; scene.materials.len()],
            glossy: false,
            specular: false,
            textured: false,
            varied: false,
            reflectance: None,
        }
    }

    fn see(&mut self, id: MaterialId) {
        if std::mem::replace(&mut self.seen[id.0 as usize], true) {
            return;
        }
        match &self.scene.materials[id.0 as usize].kind {
            MaterialKind::Diffuse { reflectance } => self.reflects(*reflectance),
            MaterialKind::OrenNayar { reflectance, .. } => {
                self.reflects(*reflectance);
                self.glossy = true;
            }
            MaterialKind::Mirror { reflectance } => {
                self.reflects(*reflectance);
                self.specular = true;
            }
            MaterialKind::FresnelBlend { diffuse, specular, .. } => {
                self.reflects(*diffuse);
                self.reflects(*specular);
                self.glossy = true;
            }
            MaterialKind::Additive(parts) => self.additive(parts),
            MaterialKind::Measured(table) => {
                self.reflects_constant(table.albedo(1.0));
                self.glossy = true;
            }
            MaterialKind::DiffuseTransmission { reflectance, transmittance } => {
                self.reflects(*reflectance);
                self.reflects(*transmittance);
            }
            MaterialKind::Conductor { metal, roughness } => {
                self.metal(metal);
                self.interface(roughness);
            }
            MaterialKind::Dielectric { roughness, .. } => {
                self.reflects_constant(Vec3::ONE);
                self.interface(roughness);
            }
            MaterialKind::ThinDielectric { .. } => {
                self.reflects_constant(Vec3::ONE);
                self.specular = true;
            }
            MaterialKind::CoatedDiffuse { reflectance, roughness, .. } => {
                self.reflects(*reflectance);
                self.interface(roughness);
            }
            MaterialKind::CoatedConductor { metal, conductor_roughness, interface_roughness, .. } => {
                self.metal(metal);
                self.interface(conductor_roughness);
                self.interface(interface_roughness);
            }
            MaterialKind::Mix { first, second, .. } => {
                self.see(*first);
                self.see(*second);
            }
            MaterialKind::Interface => {}
        }
    }

    fn additive(&mut self, parts: &Additive) {
        let black = |id: &RgbTextureId| self.scene.textures.constant_rgb(*id) == Some(Vec3::ZERO);
        let seen = |colours: [Option<RgbTextureId>; 2]| {
            colours.into_iter().flatten().filter(|id| !black(id)).collect::<Vec<_>>()
        };
        let diffuse = seen(parts.diffuse);
        let gloss = parts.gloss.map_or(Vec::new(), |layer| seen(layer.colours));
        let dielectric = parts.dielectric.map_or(Vec::new(), |layer| seen(layer.colours));
        let see_through = parts.opacity.is_some_and(|id| {
            self.scene.textures.constant_rgb(id).is_none_or(|opacity| opacity != Vec3::ONE)
        });
        self.glossy |= !gloss.is_empty();
        self.specular |= see_through;
        if let Some(layer) = parts.dielectric.filter(|_| !dielectric.is_empty()) {
            self.interface(&layer.roughness);
        }
        // Together they are what a surface reflects.
        let colours = diffuse.into_iter().chain(gloss).chain(dielectric);
        let values: Option<Vec<Vec3>> = colours.map(|id| self.scene.textures.constant_rgb(id)).collect();
        match values {
            Some(values) => self.reflects_constant(values.into_iter().sum()),
            None => self.textured = true,
        }
    }

    /// A microfacet surface is specular where it has no roughness, and glossy where it has.
    fn interface(&mut self, roughness: &Roughness) {
        let smooth = |id| self.scene.textures.constant_float(id) == Some(0.0);
        let can_be_smooth = roughness.scale != RoughnessScale::InverseExponent;
        if can_be_smooth && smooth(roughness.u) && smooth(roughness.v) {
            self.specular = true;
        } else {
            self.glossy = true;
        }
    }

    fn metal(&mut self, metal: &Metal) {
        match metal {
            Metal::Reflectance(reflectance) => self.reflects(*reflectance),
            Metal::Fresnel { eta, k } => match self.constants(*eta, *k) {
                // At normal incidence.
                Some((eta, k)) => {
                    let (minus, plus, k2) = (eta - 1.0, eta + 1.0, k * k);
                    self.reflects_constant((minus * minus + k2) / (plus * plus + k2));
                }
                None => self.textured = true,
            },
        }
    }

    fn constants(&self, eta: RgbTextureId, k: RgbTextureId) -> Option<(Vec3, Vec3)> {
        self.scene.textures.constant_rgb(eta).zip(self.scene.textures.constant_rgb(k))
    }

    fn reflects(&mut self, reflectance: RgbTextureId) {
        match self.scene.textures.constant_rgb(reflectance) {
            Some(reflectance) => self.reflects_constant(reflectance),
            None => self.textured = true,
        }
    }

    fn reflects_constant(&mut self, reflectance: Vec3) {
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
    fn each_effect_is_called_for_by_what_makes_it() {
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
    fn materials_that_nothing_is_made_of_do_not_count() {
        let unused = "MakeNamedMaterial \"a\" \"string type\" \"dielectric\" Shape \"sphere\"";
        assert!(effects(DIRECT, unused).is_empty());
    }
}
