//! The options block: everything before `WorldBegin`.

use std::collections::BTreeMap;

use glam::DAffine3;

use super::camera::{exposure, make_camera};
use super::film::{exposure_time, make_film};
use super::option_entity::OptionEntity;
use super::pixel_filter::make_pixel_filter;
use crate::scene::integrator::MAX_DEPTH;
use crate::scene::pbrt::builder::{CameraFile, GraphicsState, OptionStatement, RenderOptions, SceneBuilder};
use crate::scene::pbrt::parser::{FileLoc, ParameterDictionary, ParseError, Result, Statement};
use crate::scene::{Integrator, SamplerKind};

/// Largest number of samples per pixel.
const MAX_SPP: u32 = 1 << 30;
/// Diagonal of the film in mm, pbrt's default.
const FILM_DIAGONAL: f64 = 35.0;

impl SceneBuilder {
    /// Keeps an option directive until `WorldBegin`; a second one of its name replaces the first.
    pub fn keep_option(&mut self, statement: &Statement) -> Result<()> {
        if statement.name == "Camera" {
            self.coordinate_systems.insert("camera".into(), self.state.ctm.map(|ctm| ctm.inverse()));
        }
        let option = OptionStatement { statement: statement.clone(), ctm: self.state.ctm };
        self.option_statements.insert(statement.name, option);
        Ok(())
    }

    /// `WorldBegin`: evaluates the options and resets the current transform.
    pub fn world_begin(&mut self, statement: &Statement) -> Result<()> {
        let mut statements = std::mem::take(&mut self.option_statements);
        if let Some(file) = self.camera_file.take() {
            statements.insert("Camera", self.read_camera(&file)?);
        }
        let options = make_options(self, &statements, statement.loc)?;
        for option in statements.values() {
            self.report_unused(&option.statement);
        }
        self.options = Some(options);
        self.state.ctm = [DAffine3::IDENTITY; 2];
        self.state.active = [true; 2];
        self.coordinate_systems.insert("world".into(), self.state.ctm);
        Ok(())
    }

    /// Reads the `Camera` of a file of its own. What the scene has placed by its own camera stays where it is.
    fn read_camera(&mut self, file: &CameraFile) -> Result<OptionStatement> {
        // Begin with the state of a scene's first line
        let (times, systems) = (self.transform_times, self.coordinate_systems.clone());
        let initial = GraphicsState::new(self.state.material.clone());
        let state = std::mem::replace(&mut self.state, initial);

        // Carry out the directives
        self.files.push(file.path.display().to_string());
        let index = (self.files.len() - 1) as u32;
        self.included_files.insert(file.path.canonicalize().unwrap_or_else(|_| file.path.clone()));
        self.read_text(&file.text, index)?;
        let loc = FileLoc { file: index, line: 1, column: 1 };
        if self.options.is_some() {
            let message = "found WorldBegin in a camera's file; expected only LookAt, Camera and their like";
            return Err(ParseError::new(loc, message));
        }
        let camera = std::mem::take(&mut self.option_statements).remove("Camera");

        // Go on with the scene's own state
        (self.transform_times, self.coordinate_systems, self.state) = (times, systems, state);
        camera.ok_or_else(|| ParseError::new(loc, "found no Camera; expected LookAt and Camera"))
    }
}

/// Evaluates the option directives. `loc` is the location of `WorldBegin`.
fn make_options(
    builder: &mut SceneBuilder,
    statements: &BTreeMap<&'static str, OptionStatement>,
    loc: FileLoc,
) -> Result<RenderOptions> {
    let none = ParameterDictionary::empty(loc);
    let entry = |names: &[&'static str], default: &'static str| match names
        .iter()
        .find_map(|name| statements.get(name))
    {
        Some(OptionStatement { statement: Statement { strings, params, loc, .. }, ctm }) => {
            OptionEntity { kind: strings[0].as_str(), params, loc: *loc, ctm: *ctm }
        }
        None => OptionEntity { kind: default, params: &none, loc, ctm: [DAffine3::IDENTITY; 2] },
    };
    let filter = match statements.get("PixelFilter") {
        Some(_) => make_pixel_filter(builder.dialect, &entry(&["PixelFilter"], ""))?,
        None => builder.dialect.default_filter(),
    };
    let camera_entry = entry(&["Camera"], "perspective");
    let film_entry = entry(&["Film"], "rgb");
    let mut film = make_film(builder, &film_entry, filter, exposure_time(builder, &camera_entry)?)?;
    let exposure = exposure(builder, &camera_entry)? as f32;
    film.scale = (film.scale * exposure).clamp(f32::MIN_POSITIVE, f32::MAX);
    let diagonal = film_entry.params.positive_or("diagonal", FILM_DIAGONAL)?;
    let (camera, origin) = make_camera(builder, &camera_entry, &film, diagonal)?;
    let default_integrator = builder.dialect.default_integrator();
    let integrator =
        make_integrator(builder, &entry(&["Integrator", "SurfaceIntegrator"], default_integrator))?;
    let (sampler, spp) = make_sampler(builder, &entry(&["Sampler"], "zsobol"))?;
    Ok(RenderOptions { origin, camera, film, integrator, sampler, spp })
}

fn make_integrator(builder: &mut SceneBuilder, entry: &OptionEntity) -> Result<Integrator> {
    let OptionEntity { kind, params, loc, .. } = entry;
    let max_depth = params.integer_in("maxdepth", 5, 0..=MAX_DEPTH)?;
    let max_events = builder.dialect.max_scattering_events(max_depth);
    Ok(match *kind {
        "path" | "volpath" => Integrator::Path { max_depth: max_events },
        "directlighting" => Integrator::Direct { max_depth },
        other => {
            // Ambient occlusion has no need of lights, so its scenes may have none
            let effect =
                if other == "ambientocclusion" { ", whose image is black without lights" } else { "" };
            let message = format!("integrator \"{other}\" is not supported; using \"path\"{effect}");
            builder.warnings.add(*loc, message);
            Integrator::Path { max_depth: max_events }
        }
    })
}

/// The sampler and the number of samples per pixel.
fn make_sampler(builder: &mut SceneBuilder, entry: &OptionEntity) -> Result<(SamplerKind, u32)> {
    let OptionEntity { kind, params, loc, .. } = entry;
    let sampler = match *kind {
        "independent" | "random" => SamplerKind::Independent,
        "sobol" | "zsobol" | "paddedsobol" | "halton" | "stratified" | "pmj02bn" | "lowdiscrepancy"
        | "02sequence" => SamplerKind::Sobol,
        other => {
            builder.warnings.add(*loc, format!("sampler \"{other}\" is not supported; using \"zsobol\""));
            SamplerKind::Sobol
        }
    };
    let default = match *kind {
        "stratified" => {
            let side = |name| params.integer_in(name, 4, 1..=1 << 12);
            side("xsamples")? * side("ysamples")?
        }
        "independent" => 4,
        _ => 16,
    };
    Ok((sampler, params.integer_in("pixelsamples", default, 1..=MAX_SPP)?))
}
