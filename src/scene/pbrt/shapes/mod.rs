//! `Shape`: analytic shapes, and meshes of everything else.

mod bilinear_mesh;
mod curve;
mod height_field;
mod loop_subdivision;
mod mesh_description;
mod ply;
mod primitives;
mod revolution;
mod shape_directive;
mod triangle_grid;
mod triangle_meshes;
