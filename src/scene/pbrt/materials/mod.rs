//! `Material`, `MakeNamedMaterial` and `NamedMaterial`.

mod hair;
mod irregular_brdf;
mod material_directives;
mod material_kinds;
mod measured_material;
mod merl_brdf;
mod mix;
mod older_materials;
mod surface_parameters;
