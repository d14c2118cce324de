//! `plymesh`: triangle meshes in PLY files, ASCII or binary, gzipped or not.

use std::fmt;
use std::io::{self, BufRead, Read};
use std::path::Path;

use glam::{DVec2, DVec3};
use serde::de::{Deserialize, Deserializer, Error, SeqAccess, Visitor};
use serde_ply::{PlyHeader, PlyReader};

use super::mesh_description::MeshDescription;
use crate::memory::check_available;
use crate::scene::pbrt::files::{self, Source};

/// In bytes.
const LONGEST_HEADER: u64 = 1 << 20;

/// Reads a mesh. Quads become two triangles, whose corners are in pbrt-v3's order; other polygons become fans.
///
/// # Errors
/// One sentence, without the file's name.
pub fn read(path: &Path) -> Result<MeshDescription, String> {
    let Source { mut reader, max_length } = files::open(path)?;
    // The search for the end of the first line would read any other file to its end
    if !reader.fill_buf().map_err(|error| error.to_string())?.starts_with(b"ply") {
        return Err("the file does not begin with \"ply\"".into());
    }
    // The last number of an ASCII file needs a blank after it, which some files lack
    read_from(reader.chain(&b"\n"[..]), max_length)
}

/// Reads the header, of whose comments and names other characters than ASCII's become question marks: they may be in any encoding.
fn ascii_header(reader: &mut impl BufRead) -> io::Result<Vec<u8>> {
    let mut reader = reader.take(LONGEST_HEADER);
    let mut header = Vec::new();
    loop {
        let start = header.len();
        let length = reader.read_until(b'\n', &mut header)?;
        if length == 0 || header[start..].trim_ascii() == b"end_header" {
            header.iter_mut().filter(|byte| !byte.is_ascii()).for_each(|byte| *byte = b'?');
            return Ok(header);
        }
    }
}

/// Reads a mesh of at most `max_length` bytes.
fn read_from(mut reader: impl BufRead, max_length: u64) -> Result<MeshDescription, String> {
    let header = ascii_header(&mut reader).map_err(|error| error.to_string())?;
    let mut reader = PlyReader::from_reader(header.chain(reader)).map_err(|error| error.to_string())?;
    check(reader.header(), max_length)?;
    let mut mesh = MeshDescription::default();
    let mut missing = NEEDED.to_vec();
    // What follows is not read, however long it is
    while !missing.is_empty()
        && let Some(element) = reader.current_element()
    {
        missing.retain(|name| *name != element.name);
        let damaged = format!("the header states {} elements of \"{}\"", element.count, element.name);
        let damaged = |error: serde_ply::DeserializeError| format!("{damaged}: {error}");
        match element.name.as_str() {
            "vertex" => {
                let has = |names: &[&[&str]]| {
                    names.iter().all(|spellings| spellings.iter().any(|name| element.has_property(name)))
                };
                let has_normals = has(&[&["nx"], &["ny"], &["nz"]]);
                let has_uvs = has(&[U_NAMES, V_NAMES]);
                let vertices: Vertices = reader.next_element().map_err(damaged)?;
                mesh.positions = vertices.positions;
                mesh.normals = if has_normals { vertices.normals } else { Vec::new() };
                mesh.uvs = if has_uvs { vertices.uvs } else { Vec::new() };
            }
            "face" => mesh.indices = reader.next_element::<Faces>().map_err(damaged)?.0,
            _ => {
                reader.next_element::<Vec<Skipped>>().map_err(damaged)?;
            }
        }
    }
    Ok(mesh)
}

/// Rejects headers with more elements than a file of `max_length` bytes, or the memory, can hold.
fn check(header: &PlyHeader, max_length: u64) -> Result<(), String> {
    for name in NEEDED {
        if !header.has_element(name) {
            return Err(format!("the file has no element \"{name}\""));
        }
    }
    for element in &header.elem_defs {
        // A row takes at least a byte, unless it has no properties
        if element.properties.is_empty() || element.count as u64 > max_length {
            return Err(format!(
                "{} elements of \"{}\" with {} properties in a file that holds at most {max_length} bytes",
                element.count,
                element.name,
                element.properties.len()
            ));
        }
    }
    let count = |name: &str| header.get_element(name).map_or(0, |element| element.count as u64);
    let (vertices, faces) = (count("vertex"), count("face"));
    let most_rows = SKIPPED_ROWS.saturating_mul(vertices.saturating_add(faces).saturating_add(1));
    let last_read = header.elem_defs.iter().rposition(|element| NEEDED.contains(&element.name.as_str()));
    let mut read = header.elem_defs.iter().take(last_read.unwrap_or(0));
    if let Some(element) = read.find(|element| element.count as u64 > most_rows) {
        return Err(format!(
            "{} elements of \"{}\" beside {vertices} vertices and {faces} faces; at most {most_rows} are skipped",
            element.count, element.name
        ));
    }
    check_available(vertices * VERTEX_BYTES + faces * TRIANGLE_BYTES)
        .map_err(|problem| format!("the header states {vertices} vertices and {faces} faces: {problem}"))
}

/// Memory of a vertex: as [`Vertices`], and in the mesh that is made of them.
const VERTEX_BYTES: u64 = 3 * (2 * size_of::<DVec3>() + size_of::<DVec2>()) as u64 / 2;
/// Memory of a triangle: as [`Faces`], and in the mesh.
const TRIANGLE_BYTES: u64 = 2 * size_of::<[u32; 3]>() as u64;
/// The elements that a mesh is made of.
const NEEDED: [&str; 2] = ["vertex", "face"];
/// Most rows of an element that is skipped, for each vertex and face: edges are fewer than both together.
const SKIPPED_ROWS: u64 = 16;
/// Most corners of a face.
const MAX_CORNERS: usize = 1 << 16;

/// Names of texture coordinates, as in [`Vertex`].
const U_NAMES: &[&str] = &["u", "s", "texture_u", "texture_s"];
const V_NAMES: &[&str] = &["v", "t", "texture_v", "texture_t"];

#[derive(serde::Deserialize)]
struct Vertex {
    x: f64,
    y: f64,
    z: f64,
    #[serde(default)]
    nx: f64,
    #[serde(default)]
    ny: f64,
    #[serde(default)]
    nz: f64,
    #[serde(default, alias = "s", alias = "texture_u", alias = "texture_s")]
    u: f64,
    #[serde(default, alias = "t", alias = "texture_v", alias = "texture_t")]
    v: f64,
}

#[derive(serde::Deserialize)]
struct Face {
    #[serde(alias = "vertex_index")]
    vertex_indices: Corners,
}

/// The vertices of a face.
struct Corners(Vec<u32>);

impl<'de> Deserialize<'de> for Corners {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct CornersVisitor;

        impl<'de> Visitor<'de> for CornersVisitor {
            type Value = Corners;

            fn expecting(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
                formatter.write_str("the vertices of a face")
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Corners, A::Error> {
                let mut corners = Vec::with_capacity(4);
                while let Some(corner) = list.next_element()? {
                    if corners.len() == MAX_CORNERS {
                        return Err(A::Error::custom(format!("a face has more than {MAX_CORNERS} corners")));
                    }
                    corners.push(corner);
                }
                Ok(Corners(corners))
            }
        }

        deserializer.deserialize_seq(CornersVisitor)
    }
}

/// An element that is skipped.
#[derive(serde::Deserialize)]
struct Skipped {}

/// All vertices, one list per attribute.
#[derive(Default)]
struct Vertices {
    positions: Vec<DVec3>,
    normals: Vec<DVec3>,
    uvs: Vec<DVec2>,
}

/// All faces, triangulated.
#[derive(Default)]
struct Faces(Vec<[u32; 3]>);

/// A collection that is filled row by row.
trait Gather: Default {
    type Row: for<'de> Deserialize<'de>;

    /// Adds a row.
    ///
    /// # Errors
    /// Memory becomes scarce.
    fn gather(&mut self, row: Self::Row) -> Result<(), String>;
}

impl Gather for Vertices {
    type Row = Vertex;
    fn gather(&mut self, vertex: Vertex) -> Result<(), String> {
        let Vertex { x, y, z, nx, ny, nz, u, v } = vertex;
        self.positions.push(DVec3::new(x, y, z));
        self.normals.push(DVec3::new(nx, ny, nz));
        self.uvs.push(DVec2::new(u, v));
        Ok(())
    }
}

impl Gather for Faces {
    type Row = Face;
    fn gather(&mut self, Face { vertex_indices: Corners(corners) }: Face) -> Result<(), String> {
        let [first, rest @ ..] = &corners[..] else { return Ok(()) };
        // The header does not tell the number of corners.
        let triangles = self.0.len() + corners.len();
        if triangles > self.0.capacity() {
            check_available(2 * triangles as u64 * TRIANGLE_BYTES)
                .map_err(|problem| format!("too many triangles: {problem}"))?;
        }
        match corners[..] {
            // Default texture coordinates follow the order of the corners
            [a, b, c, d] => self.0.extend([[a, b, c], [d, a, c]]),
            _ => self.0.extend(rest.windows(2).map(|pair| [*first, pair[0], pair[1]])),
        }
        Ok(())
    }
}

struct Gatherer<G>(std::marker::PhantomData<G>);

impl<'de, G: Gather> Visitor<'de> for Gatherer<G> {
    type Value = G;

    fn expecting(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
        formatter.write_str("rows of a PLY file")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut rows: A) -> Result<G, A::Error> {
        let mut gathered = G::default();
        while let Some(row) = rows.next_element()? {
            gathered.gather(row).map_err(A::Error::custom)?;
        }
        Ok(gathered)
    }
}

impl<'de> Deserialize<'de> for Vertices {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_seq(Gatherer(std::marker::PhantomData))
    }
}

impl<'de> Deserialize<'de> for Faces {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_seq(Gatherer(std::marker::PhantomData))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    const ASCII: &str = "ply\nformat ascii 1.0\ncomment a square\nelement vertex 4\nproperty float x\n\
        property float y\nproperty float z\nproperty float s\nproperty float t\nelement face 1\n\
        property list uchar int vertex_indices\nend_header\n\
        0 0 0 0 0\n1 0 0 1 0\n1 1 0 1 1\n0 1 0 0 1\n4 0 1 2 3";

    fn read_bytes(name: &str, bytes: &[u8]) -> Result<MeshDescription, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        read(&path)
    }

    /// The square of [`ASCII`] without texture coordinates, and with another element between.
    fn binary(big_endian: bool) -> Vec<u8> {
        let format = if big_endian { "big" } else { "little" };
        let mut bytes = format!(
            "ply\nformat binary_{format}_endian 1.0\nelement vertex 4\nproperty float x\nproperty double y\n\
             property float z\nelement note 2\nproperty short a\nelement face 1\n\
             property uchar flags\nproperty list uchar uint vertex_index\nend_header\n"
        )
        .into_bytes();
        let float = |v: f32| if big_endian { v.to_be_bytes() } else { v.to_le_bytes() };
        let double = |v: f64| if big_endian { v.to_be_bytes() } else { v.to_le_bytes() };
        let index = |v: u32| if big_endian { v.to_be_bytes() } else { v.to_le_bytes() };
        for (x, y) in [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)] {
            bytes.extend(float(x));
            bytes.extend(double(y));
            bytes.extend(float(0.0));
        }
        bytes.extend([1, 2, 3, 4, 9, 4]);
        (0..4).for_each(|i| bytes.extend(index(i)));
        bytes
    }

    #[test]
    fn comments_may_be_in_any_encoding() {
        let latin_1 = ASCII.replace("a square", "K\u{1}rper");
        let bytes: Vec<u8> = latin_1.bytes().map(|byte| if byte == 1 { 0xF6 } else { byte }).collect();
        assert_square(&read_bytes("a.ply", &bytes).unwrap());
    }

    fn assert_square(mesh: &MeshDescription) {
        assert_eq!(mesh.positions, [DVec3::ZERO, DVec3::X, DVec3::new(1.0, 1.0, 0.0), DVec3::Y]);
        assert_eq!(mesh.indices, [[0, 1, 2], [3, 0, 2]]);
        assert!(mesh.normals.is_empty());
    }

    #[test]
    fn ascii_is_read_with_texture_coordinates_and_quads_are_triangulated() {
        let mesh = read_bytes("a.ply", ASCII.as_bytes()).unwrap();
        assert_square(&mesh);
        assert_eq!(mesh.uvs[2], DVec2::ONE);
    }

    #[test]
    fn binary_of_both_byte_orders_is_read() {
        for big_endian in [false, true] {
            let mesh = read_bytes("a.ply", &binary(big_endian)).unwrap();
            assert_square(&mesh);
            assert!(mesh.uvs.is_empty());
        }
    }

    #[test]
    fn gzipped_files_are_read() {
        let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
        encoder.write_all(&binary(false)).unwrap();
        assert_square(&read_bytes("a.ply.gz", &encoder.finish().unwrap()).unwrap());
    }

    #[test]
    fn every_truncation_is_an_error() {
        for bytes in [ASCII.as_bytes(), &binary(false)] {
            for length in 0..bytes.len() - 1 {
                assert!(read_bytes("a.ply", &bytes[..length]).is_err(), "{length} bytes");
            }
        }
    }

    #[test]
    fn impossible_element_counts_are_errors() {
        let huge = ASCII.replace("vertex 4", "vertex 4000000000000");
        assert!(read_bytes("a.ply", huge.as_bytes()).unwrap_err().contains("4000000000000"));
        let endless = ASCII.replace("element face", "element void 9\nelement face");
        assert!(read_bytes("a.ply", endless.as_bytes()).unwrap_err().contains("0 properties"));
    }

    #[test]
    fn other_elements_of_far_more_rows_are_errors_and_what_follows_the_faces_is_not_read() {
        let with_notes = |notes: usize| {
            let text = ASCII
                .replace("element face", &format!("element note {notes}\nproperty uchar a\nelement face"));
            text.replace("0 1 0 0 1\n", &format!("0 1 0 0 1\n{}", "7\n".repeat(notes)))
        };
        assert_square(&read_bytes("a.ply", with_notes(96).as_bytes()).unwrap());
        let message = read_bytes("a.ply", with_notes(97).as_bytes()).unwrap_err();
        assert_eq!(message, "97 elements of \"note\" beside 4 vertices and 1 faces; at most 96 are skipped");
        let endless = ASCII.replace("end_header", "element note 200\nproperty float a\nend_header");
        assert_square(&read_bytes("a.ply", endless.as_bytes()).unwrap());
    }

    #[test]
    fn a_small_file_of_more_than_the_memory_is_refused_by_its_header() {
        let pixels = 4_000_000_000_000_u64;
        let header = ASCII.replace("vertex 4", &format!("vertex {pixels}"));
        let message = read_from(header.as_bytes(), u64::MAX).unwrap_err();
        assert!(
            message.starts_with("the header states 4000000000000 vertices and 1 faces: it takes"),
            "{message}"
        );
    }

    #[test]
    fn faces_of_too_many_corners_are_errors() {
        let with_corners = |count: usize| {
            ASCII
                .replace("uchar int", "uint int")
                .replace("4 0 1 2 3", &format!("{count}{}", " 0".repeat(count)))
        };
        assert!(read_bytes("a.ply", with_corners(MAX_CORNERS).as_bytes()).is_ok());
        assert!(
            read_bytes("a.ply", with_corners(MAX_CORNERS + 1).as_bytes()).unwrap_err().contains("corners")
        );
    }

    #[test]
    fn negative_indices_and_files_without_faces_are_errors() {
        assert!(read_bytes("a.ply", ASCII.replace("4 0 1 2 3", "3 0 1 -2").as_bytes()).is_err());
        assert!(read_bytes("a.ply", ASCII.replace("element face", "element fish").as_bytes()).is_err());
        assert!(read_bytes("a.ply", b"solid cube").is_err());
    }
}
