//! Materials, by the names and defaults of pbrt-v4.

use std::rc::Rc;
use std::sync::Arc;

use glam::Vec3;

use super::directives::Statement;
use super::params::{ParamType, Params};
use super::spectrum::Spectrum;
use super::state::Reader;
use super::{Fault, Place, Result, measured};
use crate::scene::material::{MaterialKind, Metal, Roughness, RoughnessScale};
use crate::scene::texture::{Channels, Encoding, FloatTextureId, ImageTexture, Mapping, Texture, Wrap};
use crate::scene::{Material, MaterialId};

/// Deepest mix of mixes.
const MAX_MIX_DEPTH: usize = 8;
/// Index of refraction where none is given.
const DEFAULT_ETA: f64 = 1.5;
/// Absorption of the pigments of hair, by channel and concentration, and the concentration in hair
/// that nothing is said of (pbrt-v4, section 9.9).
const EUMELANIN: Vec3 = Vec3::new(0.419, 0.697, 1.37);
const PHEOMELANIN: Vec3 = Vec3::new(0.187, 0.4, 1.05);
const DEFAULT_EUMELANIN: f64 = 1.3;

/// Colour of a volume of hair, by absorption and azimuthal roughness (the fit of Chiang et al.
/// 2016).
fn hair_colour(absorption: Vec3, roughness: f32) -> Vec3 {
    let coefficients = [5.969, -0.215, 2.532, -10.73, 5.574, 0.245];
    let fit = coefficients.iter().rev().fold(0.0, |sum, c| sum * roughness + c);
    absorption.map(|a| (-a.max(0.0).sqrt() * fit).exp().min(1.0))
}

/// What a material was made of.
struct Recipe {
    name: String,
    kind: String,
    params: Params,
    place: Place,
}

/// A material, with its recipe where shapes may change it.
#[derive(Clone, Default)]
pub struct Chosen {
    pub id: MaterialId,
    recipe: Option<Rc<Recipe>>,
}

fn unknown_material(name: &str, place: Place) -> Fault {
    Fault::new(
        place,
        format!("material \"{name}\"; one that MakeNamedMaterial made before would be accepted"),
    )
}

impl Reader {
    /// The material of a scene that names none.
    pub fn add_default_material(&mut self) {
        let reflectance = self.textures.add(Texture::Constant(Vec3::splat(0.5)));
        self.state.material.id = self.add_material(Material {
            name: String::new(),
            kind: MaterialKind::Diffuse { reflectance },
            displacement: None,
            normal_map: None,
        });
        if self.dialect.shapes_change_materials() {
            let (name, params) = (String::new(), Params::none(Place::default()));
            let recipe = Recipe { name, kind: "matte".into(), params, place: Place::default() };
            self.state.material.recipe = Some(Rc::new(recipe));
        }
    }

    fn add_material(&mut self, material: Material) -> MaterialId {
        let depth = match &material.kind {
            MaterialKind::Mix { first, second, .. } => {
                1 + [first, second].map(|id| self.mix_depths[id.0 as usize]).into_iter().max().unwrap_or(0)
            }
            _ => 0,
        };
        self.materials.push(material);
        self.mix_depths.push(depth);
        MaterialId((self.materials.len() - 1) as u32)
    }

    pub fn material(&mut self, statement: &Statement) -> Result<()> {
        let params = self.params_for("material", statement);
        let (kind, place) = (&statement.strings[0], statement.place);
        let id = self.make_material("", kind, &params, place)?;
        statement.params.mark_used_in(&params);
        let recipe = self.dialect.shapes_change_materials().then(|| {
            Rc::new(Recipe {
                name: String::new(),
                kind: kind.clone(),
                params: params.into_owned().without_unused(),
                place,
            })
        });
        self.state.material = Chosen { id, recipe };
        Ok(())
    }

    pub fn make_named_material(&mut self, statement: &Statement) -> Result<()> {
        let params = self.params_for("material", statement);
        let name = &statement.strings[0];
        let Some(kind) = params.string("type")?.map(String::from) else {
            let message = format!("material \"{name}\" without a type; \"string type\" would be accepted");
            return Err(Fault::new(statement.place, message));
        };
        let place = statement.place;
        let id = self.make_material(name, &kind, &params, place)?;
        statement.params.mark_used_in(&params);
        let recipe = self.dialect.shapes_change_named_materials().then(|| {
            Rc::new(Recipe { name: name.clone(), kind, params: params.into_owned().without_unused(), place })
        });
        let id = self.put_where_awaited(name, id);
        self.named_materials.insert(name.clone(), Chosen { id, recipe });
        Ok(())
    }

    /// Moves the newest material to where its name is awaited, if it is; where it is then.
    fn put_where_awaited(&mut self, name: &str, newest: MaterialId) -> MaterialId {
        let Some((slot, _)) = self.awaited_materials.remove(name) else { return newest };
        self.materials.swap_remove(slot.0 as usize);
        self.mix_depths.swap_remove(slot.0 as usize);
        slot
    }

    /// The slot of a material that is named before it is made. Mixes take none of these, so that none is in itself.
    fn await_material(&mut self, name: &str, place: Place) -> Chosen {
        let id = match self.awaited_materials.get(name) {
            Some(&(id, _)) => id,
            None => {
                let id = self.add_material(self.materials[0].clone());
                self.awaited_materials.insert(name.into(), (id, place));
                id
            }
        };
        Chosen { id, recipe: None }
    }

    /// # Errors
    /// At the first name of a material that was never made.
    pub fn check_awaited_materials(&self) -> Result<()> {
        match self.awaited_materials.iter().min_by_key(|(_, (id, _))| id.0) {
            Some((name, (_, place))) => Err(unknown_material(name, *place)),
            None => Ok(()),
        }
    }

    pub fn named_material(&mut self, statement: &Statement) -> Result<()> {
        let (name, place) = (&statement.strings[0], statement.place);
        match self.find_material(name, place) {
            Ok(material) => self.state.material = material,
            Err(fault) if self.dialect.unknown_materials_are_forgiven() => {
                self.warnings.add(fault.place, fault.message);
            }
            Err(_) if self.dialect.names_may_come_first() => {
                self.state.material = self.await_material(name, place);
            }
            Err(fault) => return Err(fault),
        }
        Ok(())
    }

    fn find_material(&self, name: &str, place: Place) -> Result<Chosen> {
        self.named_materials.get(name).cloned().ok_or_else(|| unknown_material(name, place))
    }

    /// The material of a shape with these parameters, all of which it has asked for by then: the current one, or
    /// one of its own if the shape says something of it.
    pub fn material_of_shape(&mut self, params: &Params) -> Result<MaterialId> {
        let Chosen { id, recipe } = self.state.material.clone();
        let Some(recipe) = recipe.filter(|_| params.unused().next().is_some()) else { return Ok(id) };
        let all = recipe.params.followed_by_unused(params);
        let changed = self.make_material(&recipe.name, &recipe.kind, &all, recipe.place)?;
        if params.mark_used_at_end_of(&all) {
            return Ok(changed);
        }
        // What is left over is not the material's either.
        self.materials.pop();
        self.mix_depths.pop();
        Ok(id)
    }

    fn make_material(&mut self, name: &str, kind: &str, params: &Params, place: Place) -> Result<MaterialId> {
        let kind = self.material_kind(kind, params, place)?;
        self.warn_of_clamped(name, &kind, place);
        let displacement = match (params.get("displacement"), params.get("bumpmap")) {
            (None, None) => None,
            (Some(_), _) => Some(self.float_texture_or(params, "displacement", 0.0)?),
            (None, Some(_)) => Some(self.float_texture_or(params, "bumpmap", 0.0)?),
        };
        let displacement = displacement.filter(|id| self.textures.constant_float(*id).is_none());
        let file = params.string("normalmap")?.filter(|file| !file.is_empty()).map(String::from);
        let normal_map = match file {
            None => None,
            Some(file) => {
                let image = self.image(&file, Some(Encoding::Linear), Channels::All, params.place);
                let mapping = Mapping::Uv { scale: glam::Vec2::new(1.0, -1.0), offset: glam::Vec2::Y };
                let texture = ImageTexture { image, mapping, wrap: Wrap::Repeat, scale: 1.0, invert: false };
                Some(self.textures.add(Texture::<Vec3>::Image(texture)))
            }
        };
        Ok(self.add_material(Material { name: name.into(), kind, displacement, normal_map }))
    }

    /// What reflects more light than it gets is taken to reflect all.
    fn warn_of_clamped(&mut self, name: &str, kind: &MaterialKind, place: Place) {
        /// White that was rounded on its way through a colour space.
        const ROUNDING: f32 = 1e-3;
        let reflectances = match kind {
            MaterialKind::Diffuse { reflectance } | MaterialKind::CoatedDiffuse { reflectance, .. } => {
                vec![*reflectance]
            }
            MaterialKind::DiffuseTransmission { reflectance, transmittance } => {
                vec![*reflectance, *transmittance]
            }
            MaterialKind::Conductor { metal: Metal::Reflectance(reflectance), .. }
            | MaterialKind::CoatedConductor { metal: Metal::Reflectance(reflectance), .. } => {
                vec![*reflectance]
            }
            _ => Vec::new(),
        };
        for id in reflectances {
            if let Some(value) = self.textures.constant_rgb(id).filter(|v| v.max_element() > 1.0 + ROUNDING) {
                let of = if name.is_empty() { String::new() } else { format!(" of material \"{name}\"") };
                let [r, g, b] = value.to_array();
                let message = format!("reflectance {r} {g} {b}{of}: what is above 1 is taken for 1");
                self.warnings.add(place, message);
            }
        }
    }

    fn material_kind(&mut self, kind: &str, params: &Params, place: Place) -> Result<MaterialKind> {
        Ok(match kind {
            "diffuse" => MaterialKind::Diffuse {
                reflectance: self.rgb_texture_or(params, "reflectance", Vec3::splat(0.5))?,
            },
            "diffusetransmission" => {
                let quarter = Vec3::splat(0.25);
                let factor = params.float_or("scale", 1.0)? as f32;
                let factor = self.textures.add(Texture::Constant(Vec3::splat(factor)));
                let [reflectance, transmittance] = ["reflectance", "transmittance"].map(|name| {
                    let first = self.rgb_texture_or(params, name, quarter)?;
                    Ok(self.textures.add(Texture::<Vec3>::Product { first, second: factor }))
                });
                MaterialKind::DiffuseTransmission { reflectance: reflectance?, transmittance: transmittance? }
            }
            "conductor" => MaterialKind::Conductor {
                metal: self.metal(params, "")?,
                roughness: self.roughness(params, "", 0.0)?,
            },
            "dielectric" => MaterialKind::Dielectric {
                eta: self.refractive_index(params, "eta", DEFAULT_ETA)?,
                roughness: self.roughness(params, "", 0.0)?,
            },
            "thindielectric" => {
                MaterialKind::ThinDielectric { eta: self.refractive_index(params, "eta", DEFAULT_ETA)? }
            }
            "coateddiffuse" => {
                self.ignore_coat_details(params, place)?;
                MaterialKind::CoatedDiffuse {
                    reflectance: self.rgb_texture_or(params, "reflectance", Vec3::splat(0.5))?,
                    eta: self.refractive_index(params, "eta", DEFAULT_ETA)?,
                    roughness: self.roughness(params, "", 0.0)?,
                }
            }
            "coatedconductor" => {
                self.ignore_coat_details(params, place)?;
                MaterialKind::CoatedConductor {
                    metal: self.metal(params, "conductor.")?,
                    conductor_roughness: self.roughness(params, "conductor.", 0.0)?,
                    eta: self.refractive_index(params, "interface.eta", DEFAULT_ETA)?,
                    interface_roughness: self.roughness(params, "interface.", 0.0)?,
                }
            }
            "mix" => self.mix(params, place)?,
            "interface" | "" | "none" => MaterialKind::Interface,
            "measured" => self.measured(params, place)?,
            "hair" => self.hair(params, place)?,
            "subsurface" | "kdsubsurface" | "disney" | "fourier" => {
                self.warnings.add(place, format!("material \"{kind}\" is read as \"diffuse\""));
                let named =
                    ["color", "Kd", "reflectance"].into_iter().find(|name| params.get(name).is_some());
                params.mark_all_used();
                let name = named.unwrap_or("reflectance");
                MaterialKind::Diffuse { reflectance: self.rgb_texture_or(params, name, Vec3::splat(0.5))? }
            }
            other => match self.old_material(other, params, place)? {
                Some(kind) => kind,
                None => {
                    let message = format!(
                        "material \"{other}\"; diffuse, coateddiffuse, conductor, coatedconductor, dielectric, \
                         thindielectric, diffusetransmission, mix and interface are accepted"
                    );
                    return Err(Fault::new(place, message));
                }
            },
        })
    }

    /// A measured BRDF, each file of which is read once.
    fn measured(&mut self, params: &Params, place: Place) -> Result<MaterialKind> {
        let Some(name) = params.string("filename")? else {
            let message = "a measured material without a file; \"string filename\" would be accepted";
            return Err(Fault::new(place, message));
        };
        let path = self.resolve_content(name);
        if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("bsdf")) {
            self.warnings.add(place, "measured BRDFs of pbrt-v4 (.bsdf) are read as \"diffuse\"");
            return Ok(MaterialKind::Diffuse {
                reflectance: self.textures.add(Texture::Constant(Vec3::splat(0.5))),
            });
        }
        if let Some(table) = self.measured_brdfs.get(&path) {
            return Ok(MaterialKind::Measured(table.clone()));
        }
        let named = |message: String| {
            let accepted = "a table of measurements (.brdf, or MERL's) would be accepted";
            Fault::new(place, format!("BRDF \"{}\": {message}; {accepted}", path.display()))
        };
        let table = Arc::new(measured::read(&path).map_err(named)?);
        self.measured_brdfs.insert(path, table.clone());
        Ok(MaterialKind::Measured(table))
    }

    /// Hair is a surface of the colour that much of it has together.
    fn hair(&mut self, params: &Params, place: Place) -> Result<MaterialKind> {
        self.warnings.add(place, "material \"hair\" is read as \"diffuse\" of the hair's colour");
        for name in ["eta", "beta_m", "alpha"] {
            params.get(name);
        }
        let number = |name, default: f64| match params.get(name) {
            Some(param) if param.kind == ParamType::Texture => Ok(default),
            _ => params.float_or(name, default),
        };
        let roughness = number("beta_n", 0.3)?;
        let absorption = match params.get("sigma_a").map(|param| param.kind) {
            Some(kind) if kind != ParamType::Texture => {
                self.spectrum(params, "sigma_a")?.map(|s| s.unadapted())
            }
            _ => None,
        };
        let named = ["reflectance", "color"].into_iter().find(|name| params.get(name).is_some());
        let reflectance = match (absorption, named) {
            (None, Some(name)) => self.rgb_texture_or(params, name, Vec3::splat(0.5))?,
            (absorption, _) => {
                let is_dyed = ["eumelanin", "pheomelanin"].iter().any(|name| params.get(name).is_some());
                let brown = if is_dyed { 0.0 } else { DEFAULT_EUMELANIN };
                let pigments = number("eumelanin", brown)? as f32 * EUMELANIN
                    + number("pheomelanin", 0.0)? as f32 * PHEOMELANIN;
                let colour = hair_colour(absorption.unwrap_or(pigments), roughness as f32);
                self.textures.add(Texture::Constant(colour))
            }
        };
        Ok(MaterialKind::Diffuse { reflectance })
    }

    fn mix(&mut self, params: &Params, place: Place) -> Result<MaterialKind> {
        let [first, second] = self.mixed_names(params, place)?;
        let (first, second) = (self.find_material(first, place)?.id, self.find_material(second, place)?.id);
        if [first, second].iter().any(|id| self.mix_depths[id.0 as usize] >= MAX_MIX_DEPTH) {
            let message = format!("mixes more than {MAX_MIX_DEPTH} deep; fewer would be accepted");
            return Err(Fault::new(place, message));
        }
        let amount = if self.dialect.mixes_by_colour() {
            let colour = self.rgb_texture_or(params, "amount", Vec3::splat(0.5))?;
            let same = |value: Vec3| value == Vec3::splat(value.x);
            if !self.textures.constant_rgb(colour).is_some_and(same) {
                self.warnings
                    .add(place, "a mix by colour goes by its mean, which is what a single choice can follow");
            }
            self.textures.add(Texture::<f32>::Mean(colour))
        } else {
            self.float_texture_or(params, "amount", 0.5)?
        };
        Ok(MaterialKind::Mix { first, second, amount })
    }

    /// The coat is one interface: its thickness and what may be dissolved in it are not simulated.
    fn ignore_coat_details(&mut self, params: &Params, place: Place) -> Result<()> {
        if params.get("albedo").is_some() {
            self.warnings.add(place, "the medium in a coat (\"albedo\", \"g\") is not simulated");
        }
        for name in ["thickness", "g", "maxdepth", "nsamples"] {
            params.get(name);
        }
        Ok(())
    }

    /// Indices of refraction `eta` and `k`, or `reflectance`; copper if there are none.
    pub fn metal(&mut self, params: &Params, prefix: &str) -> Result<Metal> {
        let named = |name: &str| Spectrum::named(name).map_or(Vec3::ZERO, |spectrum| spectrum.reflectance());
        if params.get("reflectance").is_some() {
            return Ok(Metal::Reflectance(self.rgb_texture_or(params, "reflectance", Vec3::ONE)?));
        }
        Ok(Metal::Fresnel {
            eta: self.rgb_texture_or(params, &format!("{prefix}eta"), named("metal-Cu-eta"))?,
            k: self.rgb_texture_or(params, &format!("{prefix}k"), named("metal-Cu-k"))?,
        })
    }

    /// `uroughness` and `vroughness`, each in default of which `roughness`.
    pub fn roughness(&mut self, params: &Params, prefix: &str, default: f64) -> Result<Roughness> {
        let common = self.float_texture_or(params, &format!("{prefix}roughness"), default)?;
        let mut along = |axis: &str| -> Result<FloatTextureId> {
            let name = format!("{prefix}{axis}roughness");
            if params.get(&name).is_some() {
                self.float_texture_or(params, &name, default)
            } else {
                Ok(common)
            }
        };
        let (u, v) = (along("u")?, along("v")?);
        let remap = params.bool_or("remaproughness", true)?;
        Ok(Roughness { u, v, scale: self.dialect.roughness_scale(remap) })
    }

    /// No roughness at all.
    pub fn smooth(&mut self) -> Roughness {
        let zero = self.textures.add(Texture::Constant(0.0));
        Roughness { u: zero, v: zero, scale: RoughnessScale::Alpha }
    }

    /// One index of refraction: a number or a spectrum, of which the d line counts.
    pub fn refractive_index(&mut self, params: &Params, name: &str, default: f64) -> Result<f32> {
        let Some(param) = params.get(name) else { return Ok(default as f32) };
        let eta = match param.kind {
            ParamType::Float | ParamType::Integer => params.float_or(name, default)?,
            _ => {
                self.warnings
                    .add(param.place, "dispersion is not simulated: of a spectrum the d line counts");
                self.spectrum(params, name)?.map_or(default, |spectrum| spectrum.refractive_index())
            }
        };
        let single = eta as f32;
        if single > 0.0 && single.is_finite() {
            return Ok(single);
        }
        Err(param.fault(eta, "an index of refraction above 0"))
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::scene::pbrt::read_str;

    #[test]
    fn hair_has_its_colour_and_says_that_it_is_a_surface() {
        let colour = |params: &str| {
            let scene = read_str(&format!("WorldBegin Material \"hair\" {params}"), Path::new("")).unwrap();
            assert_eq!(scene.warnings.len(), 1, "{:?}", scene.warnings);
            assert!(scene.warnings[0].starts_with("<text>:1:") && scene.warnings[0].contains("\"hair\""));
            let MaterialKind::Diffuse { reflectance } = scene.materials[1].kind else { panic!() };
            scene.textures.constant_rgb(reflectance).unwrap()
        };
        assert_eq!(colour("\"rgb color\" [.3 .2 .1] \"float beta_n\" .2"), Vec3::new(0.3, 0.2, 0.1));
        let brown = colour("\"float beta_m\" .4");
        assert!(brown.x > 2.0 * brown.z && brown.x < 0.2, "{brown}");
        assert_eq!(colour("\"float eumelanin\" 1.3"), brown);
        assert_eq!(colour("\"rgb sigma_a\" [0 0 0] \"float eumelanin\" 8"), Vec3::ONE);
        assert!(colour("\"float eumelanin\" 8").max_element() < 0.01);
    }

    #[test]
    fn materials_have_their_parameters_and_defaults() {
        let scene = read_str(
        "WorldBegin Texture \"half\" \"float\" \"constant\" \"float value\" .5
         Material \"conductor\" \"texture uroughness\" \"half\" \"float roughness\" .25 \"bool remaproughness\" false
         Material \"dielectric\" \"spectrum eta\" \"glass-BK7\"
         MakeNamedMaterial \"a\" \"string type\" \"coateddiffuse\" \"rgb reflectance\" [.1 .2 .3]
         Material \"mix\" \"string materials\" [\"a\" \"a\"] \"float amount\" .3",
        Path::new(""),
    )
    .unwrap();
        let kinds: Vec<_> = scene.materials.iter().skip(1).map(|material| &material.kind).collect();
        let MaterialKind::Conductor { roughness, .. } = kinds[0] else { panic!() };
        let constant = |id| scene.textures.constant_float(id);
        assert_eq!(
            (constant(roughness.u), constant(roughness.v), roughness.scale),
            (Some(0.5), Some(0.25), RoughnessScale::Alpha)
        );
        let MaterialKind::Dielectric { eta, .. } = kinds[1] else { panic!() };
        assert_eq!(*eta, 1.5168);
        let MaterialKind::CoatedDiffuse { reflectance, eta, .. } = kinds[2] else { panic!() };
        assert_eq!(scene.textures.constant_rgb(*reflectance), Some(Vec3::new(0.1, 0.2, 0.3)));
        assert_eq!(*eta, 1.5);
        assert!(matches!(kinds[3], MaterialKind::Mix { .. }));
        assert!(
            scene.warnings.len() == 1 && scene.warnings[0].contains("dispersion"),
            "{:?}",
            scene.warnings
        );
    }
}
