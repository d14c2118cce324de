//! A progressive path tracer whose **adaptive sampling is coupled to its denoiser**.
//!
//! A *scene* is *rendered* in batches into a *pixel-statistics store*; the *filter* turns the store into an image and
//! maps; the *allocator* turns the maps into the next batch; the *progressive* loop repeats that until a budget is spent.
//!
//! ```text
//! scene ──► render ──► stats ──► filter ──► image
//!    │          ▲         │          │
//!  effects      │         ▼          ▼
//!    │          └──── adaptive ◄── maps          progressive: owns the loop, its state and the clock
//!    └─► which dimensions are enabled            preview, cli, experiments: drive it
//! ```
//!
//! # Rooms, from the ground up
//!
//! Each imports only from those above it in this list.
//!
//! | room | holds |
//! | --- | --- |
//! | [`simd`] | lane width and lane types, instruction-set targets, choice between them at run time |
//! | `hash` | the one hash function, of integers |
//! | `memory` | the memory that the process holds, what is available to it, and what new memory costs |
//! | [`files`] | files on disk: atomic replacement, locking, direct I/O |
//! | [`image`] | planes of `f32`; EXR and PNG files; tone mapping; error metrics |
//! | [`scene`] | the scene: pbrt reader, shapes, materials, textures, lights, camera, and the [`scene::Effects`] it calls for |
//! | [`geometry`] | acceleration structure, intersection, instances, motion |
//! | [`stats`] | the sample vector's [`stats::Layout`], Welford moments, reservoir, the pixel-statistics [`stats::Store`] |
//! | [`import`] | renders of other programs, as a store |
//! | [`render`] | samplers, BSDFs, light sampling, integrators; renders a batch into a store |
//! | [`filter`] | what a [`filter::Denoiser`] is, and the denoisers: P-RPF (`prpf` begins with Algorithm 1), cross-filtered non-local means, RPF, a learned filter, Open Image Denoise |
//! | [`adaptive`] | maps → priority per pixel → sample counts of the next batch |
//! | [`progressive`] | the render loop as plain state: checkpoint, next action, time constants, a blocking driver |
//! | `distributed` | one image by several processes under MPI (feature `mpi`) |
//! | [`state`] | a render as a file: to resume, to filter again, to merge |
//! | [`output`] | the outputs of a render: images with layers and attributes, the report |
//! | `render_builder` | [`RenderBuilder`]: a render in one expression |
//! | [`preview`] | the live page, its server and the interactive driver of the loop |
//! | [`cli`] | arguments → settings → loop → report |
//!
//! [`preview`] and [`cli`] belong to the feature `app`, which is on by default. With
//! `default-features = false` the crate is a library without their dependencies.
//!
//! # The filter without the renderer
//!
//! Any program can push its own sample vectors into a store and filter them:
//!
//! ```
//! use prpf::filter::{Denoiser, prpf::PRPF};
//! use prpf::stats::{Block, Layout, Store};
//!
//! // What a sample holds: film position and colour always, here first-hit normals as well.
//! let layout = Layout::with_blocks(|block| block == Block::Normal1);
//! let (width, height, seed) = (32, 32, 0);
//! let mut store = Store::new(width, height, layout.clone(), 8, seed);
//! let mut sample = vec![0.0; layout.len()];
//! for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
//!     for index in 0..4 {
//!         let noise = 0.4 + 0.2 * ((x * 7 + y * 13 + index * 5) % 3) as f32;
//!         layout.write(&mut sample, Block::Film, &[x as f32 + 0.5, y as f32 + 0.5]);
//!         layout.write(&mut sample, Block::Colour, &[noise; 3]);
//!         layout.write(&mut sample, Block::Normal1, &[0.0, 0.0, 1.0]);
//!         store.push(x, y, &sample);
//!     }
//! }
//! // The published method; `docs/method.md` compares the denoisers.
//! let filtered = PRPF.filter(&store, seed);
//! assert!((filtered.image.at(0, 16, 16) - 0.6).abs() < 0.1);
//! // The variance of each pixel, and where the interpolation of feature weights failed.
//! assert_eq!(filtered.variance.count(), 3);
//! assert!(filtered.interpolation.is_some());
//! ```

pub mod adaptive;
#[cfg(feature = "app")]
pub mod cli;
// The division of the image needs no MPI, and is tested without.
#[cfg(any(test, feature = "mpi"))]
mod distributed;
pub mod files;
pub mod filter;
pub mod geometry;
mod hash;
pub mod image;
pub mod import;
mod memory;
pub mod output;
#[cfg(feature = "app")]
pub mod preview;
pub mod progressive;
pub mod render;
mod render_builder;
pub mod scene;
pub mod simd;
pub mod state;
pub mod stats;

pub use render_builder::{RenderBuilder, RenderError, RenderedImage};
