//! The scene under construction.
//!
//! The directives are methods of [`SceneBuilder`], defined in the files that carry them out.

use std::collections::{BTreeMap, HashMap, HashSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::{DAffine3, DVec3};
use rayon::prelude::*;
use sha2::{Digest, Sha256};

use super::{
    CameraFile, GraphicsState, ImageFiles, InstanceEntity, MaterialRef, NamedTextures, ObjectDefinition,
    ObjectPart, OptionStatement, ParserScope, PrimitiveGroup, RenderOptions, TransformSet,
};
use crate::scene::measured_brdf::MeasuredBrdf;
use crate::scene::pbrt::dialect::Dialect;
use crate::scene::pbrt::files;
use crate::scene::pbrt::parser::{FileLoc, ParseError, Result, Warnings};
use crate::scene::pbrt::read_progress::ReadProgress;
use crate::scene::texture::Textures;
use crate::scene::{Instance, Light, Material, MaterialId, Object, Primitive, Scene};

/// The scene under construction, and the state of the reader.
pub struct SceneBuilder {
    pub dialect: Dialect,
    /// Folder that file names are relative to.
    pub folder: PathBuf,
    /// Names of the scene files read; [`FileLoc::file`] is an index.
    pub files: Vec<String>,
    /// Scene files that are open, outermost first.
    pub open_files: Vec<PathBuf>,
    pub included_files: HashSet<PathBuf>,
    /// Bytes of the files that were included again.
    pub repeated_bytes: u64,
    pub warnings: Warnings,
    /// Digest of the scene files read so far.
    pub digest: Sha256,
    /// Meshes, images and other files that the scene names, in the order of their first reference.
    content: Vec<PathBuf>,
    content_seen: HashSet<PathBuf>,

    pub state: GraphicsState,
    /// Open blocks, outermost first.
    pub scopes: Vec<ParserScope>,
    pub coordinate_systems: HashMap<String, TransformSet>,
    pub transform_times: [f32; 2],

    /// Option directives by name, until `WorldBegin`.
    pub option_statements: BTreeMap<&'static str, OptionStatement>,
    /// The camera that replaces the scene's own; taken by `WorldBegin`.
    pub camera_file: Option<CameraFile>,
    /// Set by `WorldBegin`.
    pub options: Option<RenderOptions>,
    /// Set by `WorldEnd`.
    pub world_has_ended: bool,

    pub textures: Textures,
    pub named_textures: NamedTextures,
    pub images: ImageFiles,
    pub materials: Vec<Material>,
    /// Nesting depth of each material's mixes.
    pub mix_depths: Vec<usize>,
    pub named_materials: HashMap<String, MaterialRef>,
    /// Materials that are referenced before they are defined: their slot in `materials` and the
    /// location of the first reference.
    pub forward_materials: HashMap<String, (MaterialId, FileLoc)>,
    /// Location of the first mix that names a material before its definition.
    pub forward_mix: Option<FileLoc>,
    pub measured_brdfs: HashMap<PathBuf, Arc<MeasuredBrdf>>,

    pub lights: Vec<Light>,
    /// Primitives of the static group with an area light, and their locations.
    pub area_light_locs: Vec<(usize, FileLoc)>,
    /// Primitives of the static group whose area light has an image and a given power. The image is
    /// needed to scale them.
    pub area_lights_with_power: Vec<(usize, FileLoc)>,
    /// Environment lights with an image and a given illuminance, and that illuminance.
    pub environments_with_illuminance: Vec<(usize, f64, FileLoc)>,
    /// Goniometric and projection lights with a given power, and that power.
    pub projectors_with_power: Vec<(usize, f64, FileLoc)>,

    /// `groups[0]` is the static part of the scene.
    pub groups: Vec<PrimitiveGroup>,
    pub instances: Vec<Instance>,
    pub objects: HashMap<String, Vec<ObjectPart>>,
    /// Instances of objects that are not yet defined.
    pub forward_instances: Vec<InstanceEntity>,
    /// The object between `ObjectBegin` and `ObjectEnd`.
    pub current_object: Option<ObjectDefinition>,

    /// Called with `progress` after each shape.
    pub report_progress: Box<dyn Fn(ReadProgress)>,
    pub progress: ReadProgress,
}

impl SceneBuilder {
    /// An empty scene. `text` is the main scene file, from which the dialect is detected, `name` its
    /// name for messages, and `path` its path if it is a file.
    pub fn new(text: &[u8], name: String, folder: &Path, path: Option<&Path>) -> Self {
        Self {
            dialect: Dialect::detect(text, folder),
            folder: folder.into(),
            files: vec![name],
            open_files: path.and_then(|path| path.canonicalize().ok()).into_iter().collect(),
            included_files: HashSet::new(),
            repeated_bytes: 0,
            warnings: Warnings::default(),
            digest: Sha256::new(),
            content: Vec::new(),
            content_seen: HashSet::new(),
            state: GraphicsState::new(MaterialRef::default()),
            scopes: Vec::new(),
            coordinate_systems: HashMap::new(),
            transform_times: [0.0, 1.0],
            option_statements: BTreeMap::new(),
            camera_file: None,
            options: None,
            world_has_ended: false,
            textures: Textures::default(),
            named_textures: NamedTextures::default(),
            images: ImageFiles::default(),
            materials: Vec::new(),
            mix_depths: Vec::new(),
            named_materials: HashMap::new(),
            forward_materials: HashMap::new(),
            forward_mix: None,
            measured_brdfs: HashMap::new(),
            lights: Vec::new(),
            area_light_locs: Vec::new(),
            area_lights_with_power: Vec::new(),
            environments_with_illuminance: Vec::new(),
            projectors_with_power: Vec::new(),
            groups: vec![PrimitiveGroup::new("".into())],
            instances: Vec::new(),
            objects: HashMap::new(),
            forward_instances: Vec::new(),
            current_object: None,
            report_progress: Box::new(|_| {}),
            progress: ReadProgress::default(),
        }
    }

    /// Turns an error into a warning in the dialects whose pbrt goes on; `consequence` says with what.
    ///
    /// # Errors
    /// `error` itself in v4.
    pub fn warn_or_fail(&mut self, error: ParseError, consequence: &str) -> Result<()> {
        if !self.dialect.goes_on_after_errors() {
            return Err(error);
        }
        self.warnings.add(error.loc, format!("{}; {consequence}", error.message));
        Ok(())
    }

    /// World position of render space's origin.
    pub fn origin(&self) -> DVec3 {
        self.options.as_ref().map_or(DVec3::ZERO, |options| options.origin)
    }

    /// Current space to render space, at the first key time.
    pub fn to_render(&self) -> DAffine3 {
        DAffine3::from_translation(-self.origin()) * self.state.ctm[0]
    }

    /// The path of a file that the scene names.
    pub fn resolve(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    /// The path of a file whose content is part of the scene and enters its hash.
    pub fn resolve_content(&mut self, name: &str) -> PathBuf {
        let path = self.resolve(name);
        if self.content_seen.insert(path.clone()) {
            self.content.push(path.clone());
        }
        path
    }

    /// Adds the checksums of the content files to the digest.
    fn digest_content(&mut self) {
        let sums: Vec<_> = self.content.par_iter().map(|path| files::checksum(path)).collect();
        sums.into_iter().flatten().for_each(|sum| self.digest.update(sum));
    }

    /// The finished scene. Primitives of all groups are joined in one list, the static ones first.
    ///
    /// # Panics
    /// If there was no `WorldBegin`, which the reader checks.
    pub fn into_scene(mut self) -> Scene {
        // Join the primitives of all groups
        self.digest_content();
        let options = self.options.take().expect("the reader checks for WorldBegin");
        let mut primitives: Vec<Primitive> = Vec::new();
        let mut objects = Vec::new();
        for group in self.groups {
            let first = primitives.len();
            primitives.extend(group.primitives);
            objects.push(Object { name: group.name, primitives: first..primitives.len() });
        }

        // Assemble the scene
        Scene {
            source: String::new(),
            dialect: Some(self.dialect),
            files: self.open_files.into_iter().chain(self.included_files).chain(self.content).collect(),
            hash: self.digest.finalize().iter().map(|byte| format!("{byte:02x}")).collect(),
            origin: options.origin,
            camera: options.camera,
            film: options.film,
            integrator: options.integrator,
            sampler: options.sampler,
            spp: options.spp,
            textures: self.textures,
            materials: self.materials,
            primitives,
            objects,
            instances: self.instances,
            lights: self.lights,
            warnings: self.warnings.lines(&self.files),
        }
    }
}
