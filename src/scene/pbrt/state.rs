//! The reader: the graphics state, its stack, and what has been read so far.

use std::collections::{BTreeMap, HashMap, HashSet};
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::sync::Arc;

use glam::{DAffine3, DVec3};
use rayon::prelude::*;
use sha2::{Digest, Sha256};

use super::color_space::ColorSpace;
use super::dialect::Dialect;
use super::directives::Statement;
use super::image_files::ImageFiles;
use super::materials::Chosen;
use super::objects::{Group, Part, Placed};
use super::params::Defaults;
use super::textures::TextureNames;
use super::warnings::Warnings;
use super::{Fault, Place, Reading, Result, SceneError, camera_film, files};
use crate::scene::measured::MeasuredBrdf;
use crate::scene::texture::Textures;
use crate::scene::{AreaLight, Instance, Light, Material, MaterialId, Object, Primitive, Scene};

/// Blocks inside blocks, each of which may keep the parameters that `Attribute` has set so far.
const MAX_BLOCKS: usize = 1024;

/// Transforms at the two key times.
pub type Keys = [DAffine3; 2];

/// An area light before its surface is known.
#[derive(Clone, Copy)]
pub struct Emission {
    pub light: AreaLight,
    /// Power that the surface is to emit, instead of its radiance saying so.
    pub power: Option<f64>,
}

/// What `AttributeBegin` saves and `AttributeEnd` restores.
#[derive(Clone)]
pub struct GraphicsState {
    /// The current transform at the two key times.
    pub ctm: Keys,
    /// Which of the two the transform directives change.
    pub active: [bool; 2],
    pub reverse_orientation: bool,
    pub material: Chosen,
    pub area_light: Option<Emission>,
    pub color_space: ColorSpace,
    /// Parameters set by `Attribute`, by what they are for.
    pub defaults: Rc<HashMap<String, Rc<Defaults>>>,
}

/// What opened a block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Block {
    Attribute,
    Transform,
    Object,
}

impl Block {
    fn name(self) -> &'static str {
        match self {
            Block::Attribute => "Attribute",
            Block::Transform => "Transform",
            Block::Object => "Object",
        }
    }
}

struct Frame {
    saved: GraphicsState,
    block: Block,
    place: Place,
}

/// A directive of the header, kept until `WorldBegin`, with the transform at its place.
pub struct Kept {
    pub statement: Statement,
    pub ctm: Keys,
}

/// Everything that reading goes through. The directives are methods of it.
pub struct Reader {
    pub dialect: Dialect,
    /// Where file names are relative to.
    pub folder: PathBuf,
    /// Names of the files read, by number.
    pub files: Vec<String>,
    /// The files that are being read now, outermost first.
    pub open: Vec<PathBuf>,
    /// How often each file was included.
    pub inclusions: HashMap<PathBuf, usize>,
    pub warnings: Warnings,
    /// Of the texts read so far.
    pub digest: Sha256,
    /// Files beside the texts, in the order in which they are named first.
    content: Vec<PathBuf>,
    content_seen: HashSet<PathBuf>,

    pub state: GraphicsState,
    stack: Vec<Frame>,
    pub coordinate_systems: HashMap<String, Keys>,
    pub transform_times: [f32; 2],

    header: BTreeMap<&'static str, Kept>,
    /// Set by `WorldBegin`.
    pub view: Option<camera_film::View>,

    pub textures: Textures,
    pub texture_names: TextureNames,
    pub images: ImageFiles,
    pub materials: Vec<Material>,
    pub named_materials: HashMap<String, Chosen>,
    /// Those that are named and not made yet, by name: their slots, and the place of the first name.
    pub awaited_materials: HashMap<String, (MaterialId, Place)>,
    /// How deep a mix of mixes each material is.
    pub mix_depths: Vec<usize>,
    pub measured_brdfs: HashMap<PathBuf, Arc<MeasuredBrdf>>,
    pub lights: Vec<Light>,
    /// Primitives of the static part that emit an image and have their power given, and environment
    /// images that have their illuminance given: brought to it when the images are read. With the place of the
    /// shape or light.
    pub powered_images: Vec<(usize, Place)>,
    pub lit_environments: Vec<(usize, f64, Place)>,
    /// Projectors whose power is given, with it and their place: their images are read last.
    pub powered_projectors: Vec<(usize, f64, Place)>,
    /// `groups[0]` is the static part of the scene.
    pub groups: Vec<Group>,
    pub instances: Vec<Instance>,
    pub objects: HashMap<String, Vec<Part>>,
    /// Instances of objects that are not made yet.
    pub awaited_instances: Vec<Placed>,
    /// The object between `ObjectBegin` and `ObjectEnd`: its name and parts.
    pub current_object: Option<(String, Vec<Part>)>,
    /// Told how far reading has come.
    pub report: Box<dyn Fn(Reading)>,
    pub reading: Reading,
}

impl Reader {
    /// A reader of the main file's text.
    pub fn new(text: &[u8], name: String, folder: &Path, path: Option<&Path>) -> Self {
        let mut reader = Self {
            dialect: Dialect::detect(text, folder),
            folder: folder.into(),
            files: vec![name],
            open: path.and_then(|path| path.canonicalize().ok()).into_iter().collect(),
            inclusions: HashMap::new(),
            warnings: Warnings::default(),
            digest: Sha256::new(),
            content: Vec::new(),
            content_seen: HashSet::new(),
            state: GraphicsState {
                ctm: [DAffine3::IDENTITY; 2],
                active: [true; 2],
                reverse_orientation: false,
                material: Chosen::default(),
                area_light: None,
                color_space: ColorSpace::Srgb,
                defaults: Rc::default(),
            },
            stack: Vec::new(),
            coordinate_systems: HashMap::new(),
            transform_times: [0.0, 1.0],
            header: BTreeMap::new(),
            view: None,
            textures: Textures::default(),
            texture_names: TextureNames::default(),
            images: ImageFiles::default(),
            materials: Vec::new(),
            named_materials: HashMap::new(),
            awaited_materials: HashMap::new(),
            mix_depths: Vec::new(),
            measured_brdfs: HashMap::new(),
            lights: Vec::new(),
            powered_images: Vec::new(),
            lit_environments: Vec::new(),
            powered_projectors: Vec::new(),
            groups: vec![Group::new("".into())],
            instances: Vec::new(),
            objects: HashMap::new(),
            awaited_instances: Vec::new(),
            current_object: None,
            report: Box::new(|_| {}),
            reading: Reading::default(),
        };
        reader.add_default_material();
        reader
    }

    /// Reads the main file.
    pub fn read(mut self, text: &[u8]) -> std::result::Result<Scene, SceneError> {
        match self.read_all(text) {
            Ok(()) => Ok(self.into_scene()),
            Err(Fault { place, message }) => Err(SceneError {
                file: self.files[place.file as usize].clone(),
                line: place.line as usize,
                column: place.column as usize,
                message,
            }),
        }
    }

    fn read_all(&mut self, text: &[u8]) -> Result<()> {
        self.read_text(text, 0)?;
        self.check_end()?;
        self.check_awaited_materials()?;
        self.place_awaited_instances()?;
        self.load_images()?;
        self.normalise_lights()
    }

    /// World position of render space's origin.
    pub fn origin(&self) -> DVec3 {
        self.view.as_ref().map_or(DVec3::ZERO, |view| view.origin)
    }

    /// The current transform at shutter open, to render space.
    pub fn to_render(&self) -> DAffine3 {
        DAffine3::from_translation(-self.origin()) * self.state.ctm[0]
    }

    pub fn is_animated(&self) -> bool {
        self.state.ctm[0] != self.state.ctm[1]
    }

    /// A path that a scene names.
    pub fn resolve(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    /// The path of a file that a scene names for what it holds: that is part of what the scene is.
    pub fn resolve_content(&mut self, name: &str) -> PathBuf {
        let path = self.resolve(name);
        if self.content_seen.insert(path.clone()) {
            self.content.push(path.clone());
        }
        path
    }

    /// Takes what the files hold into the digest.
    fn digest_content(&mut self) {
        let sums: Vec<_> = self.content.par_iter().map(|path| files::checksum(path)).collect();
        sums.into_iter().flatten().for_each(|sum| self.digest.update(sum));
    }

    /// Keeps a directive of the header until the world begins; a second one replaces the first.
    pub fn keep(&mut self, statement: &Statement) -> Result<()> {
        if statement.name == "Camera" {
            self.coordinate_systems.insert("camera".into(), self.state.ctm.map(|ctm| ctm.inverse()));
        }
        let kept = Kept { statement: statement.clone(), ctm: self.state.ctm };
        self.header.insert(statement.name, kept);
        Ok(())
    }

    pub fn world_begin(&mut self, statement: &Statement) -> Result<()> {
        let header = std::mem::take(&mut self.header);
        let view = camera_film::View::new(self, &header, statement.place)?;
        for kept in header.values() {
            self.report_unused(&kept.statement);
        }
        self.view = Some(view);
        self.state.ctm = [DAffine3::IDENTITY; 2];
        self.state.active = [true; 2];
        self.coordinate_systems.insert("world".into(), self.state.ctm);
        Ok(())
    }

    /// Opens a block.
    pub fn push(&mut self, block: Block, place: Place) -> Result<()> {
        if self.stack.len() >= MAX_BLOCKS {
            let message = format!("blocks more than {MAX_BLOCKS} deep; fewer would be accepted");
            return Err(Fault::new(place, message));
        }
        self.stack.push(Frame { saved: self.state.clone(), block, place });
        Ok(())
    }

    /// Closes a block; where none is open there is nothing to close, in any dialect.
    pub fn pop(&mut self, block: Block, place: Place) -> Result<()> {
        let Some(frame) = self.stack.pop() else {
            let name = block.name();
            self.warnings.add(place, format!("{name}End without {name}Begin is left out"));
            return Ok(());
        };
        let crosses = frame.block != block && (frame.block == Block::Object || block == Block::Object);
        if crosses && !self.dialect.blocks_may_cross() {
            let (found, opened) = (block.name(), frame.block.name());
            let line = frame.place.line;
            let message =
                format!("{found}End inside {opened}Begin of line {line}; {opened}End would be accepted");
            return Err(Fault::new(place, message));
        }
        if block == Block::Transform && self.dialect.transform_blocks_hold_transforms_only() {
            self.state.ctm = frame.saved.ctm;
            self.state.active = frame.saved.active;
        } else {
            self.state = frame.saved;
        }
        Ok(())
    }

    fn check_end(&mut self) -> Result<()> {
        while let Some(frame) = self.stack.pop() {
            let begin = format!("{}Begin without an end", frame.block.name());
            if !self.dialect.worlds_end_blocks() {
                let name = frame.block.name();
                let message = format!("{begin}; {name}End would be accepted before the file ends");
                return Err(Fault::new(frame.place, message));
            }
            self.warnings.add(frame.place, format!("{begin} ends with the world"));
        }
        if self.view.is_none() {
            return Err(Fault::new(Place::default(), "no WorldBegin in the file; a scene needs one"));
        }
        Ok(())
    }

    /// One warning for each parameter that nothing asked for.
    pub fn report_unused(&mut self, statement: &Statement) {
        let what = match statement.strings.last() {
            Some(kind) if statement.name != "MakeNamedMaterial" => format!("{} \"{kind}\"", statement.name),
            _ => statement.name.to_string(),
        };
        for param in statement.params.unused() {
            self.warnings.add(param.place, format!("parameter \"{}\" of {what} is not used", param.name));
        }
    }

    /// Puts the primitives of all groups into one list, the static ones first.
    fn into_scene(mut self) -> Scene {
        self.digest_content();
        let view = self.view.take().expect("the end was checked");
        let mut primitives: Vec<Primitive> = Vec::new();
        let mut objects = Vec::new();
        for group in self.groups {
            let first = primitives.len();
            primitives.extend(group.primitives);
            objects.push(Object { name: group.name, primitives: first..primitives.len() });
        }
        Scene {
            source: String::new(),
            dialect: Some(self.dialect),
            files: self.open.into_iter().chain(self.inclusions.into_keys()).chain(self.content).collect(),
            hash: self.digest.finalize().iter().map(|byte| format!("{byte:02x}")).collect(),
            origin: view.origin,
            camera: view.camera,
            film: view.film,
            integrator: view.integrator,
            sampler: view.sampler,
            spp: view.spp,
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
