//! A progressive path tracer whose **adaptive sampling is coupled to its denoiser**.
//!
//! A *scene* is *rendered* in batches into a *pixel-statistics store*; the *filter* turns the
//! store into an image and maps; the *allocator* turns the maps into the next batch; the
//! *progressive* loop runs that circle until a budget is spent.
//!
//! ```text
//! scene ──► render ──► stats ──► filter ──► image
//!    │          ▲         │          │
//!  effects      │         ▼          ▼
//!    │          └──── adaptive ◄── maps          progressive: owns the circle and the clock
//!    └─► which dimensions live                   cli and experiments: listen and steer
//! ```
//!
//! # Rooms, from the ground up
//!
//! Each imports only from those above it in this list.
//!
//! | room | holds |
//! | --- | --- |
//! | [`image`] | planes of `f32`; EXR and PNG files; tone mapping; error metrics |
//! | [`scene`] | what is in the picture: pbrt reader, shapes, materials, textures, lights, camera, and the [`scene::Effects`] it calls for |
//! | [`geometry`] | acceleration structure, intersection, instances, motion |
//! | [`stats`] | the sample vector's [`stats::Layout`], Welford moments, reservoir, the pixel-statistics [`stats::Store`] |
//! | [`render`] | samplers, BSDFs, light sampling, integrators; renders a batch into a store |
//! | [`filter`] | P-RPF, a file for each step of the paper, and the patch-distance filter of `standard` |
//! | [`adaptive`] | maps → priority per pixel → sample counts of the next batch |
//! | [`progressive`] | the loop: batches, budgets, events |
//! | [`cli`] | arguments → settings → loop → report |

pub mod adaptive;
pub mod cli;
pub mod filter;
pub mod geometry;
pub mod image;
pub mod progressive;
pub mod render;
pub mod scene;
pub mod stats;
