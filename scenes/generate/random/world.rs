//! A world in the making: its text and its files.

use std::fmt::{Display, Write};

use crate::Asset;
use crate::mesh::Mesh;

/// The world of a scene.
pub struct World {
    /// Name of the scene's folder.
    folder: String,
    text: String,
    files: Vec<Asset>,
    /// Number of names given so far.
    names: usize,
}

impl World {
    pub fn new(folder: String) -> Self {
        Self { folder, text: String::new(), files: Vec::new(), names: 0 }
    }

    /// Adds a line.
    pub fn line(&mut self, line: impl Display) {
        writeln!(self.text, "{line}").expect("strings grow");
    }

    /// Adds lines between `AttributeBegin` and `AttributeEnd`.
    pub fn attribute(&mut self, add: impl FnOnce(&mut Self)) {
        self.line("AttributeBegin");
        add(self);
        self.line("AttributeEnd");
    }

    /// Adds a file to the scene's folder.
    pub fn add_file(&mut self, name: &str, bytes: Vec<u8>) {
        self.files.push(Asset::new(format!("{}/{name}", self.folder), bytes));
    }

    /// Adds a file and returns its name, which ends with `extension`.
    pub fn file(&mut self, extension: &str, bytes: Vec<u8>) -> String {
        let name = format!("{}.{extension}", self.name("file"));
        self.add_file(&name, bytes);
        name
    }

    /// Adds a mesh as a shape, with further parameters.
    pub fn mesh(&mut self, mesh: &Mesh, parameters: &str) {
        let name = self.file("ply", mesh.ply());
        self.line(format!("Shape \"plymesh\" \"string filename\" \"{name}\" {parameters}"));
    }

    /// Returns a name that the world does not use yet.
    pub fn name(&mut self, kind: &str) -> String {
        self.names += 1;
        format!("{kind}-{}", self.names)
    }

    /// Returns all files, the world's text among them.
    pub fn into_assets(mut self) -> Vec<Asset> {
        let text = std::mem::take(&mut self.text);
        self.add_file("world.pbrt", text.into_bytes());
        self.files
    }
}
