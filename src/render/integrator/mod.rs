//! Path tracing (Kajiya 1986) with light sampling at every scattering event, multiple importance sampling and
//! Russian roulette, in the conventions of pbrt-v4's `path` integrator: `max_depth` counts scattering events,
//! so that 0 shows emission only and 1 adds direct light.
//!
//! [`PathTracer`] serves both integrators of a scene: `Path` traces a path until it was scattered `max_depth`
//! times, `Direct` ends it at the hit after the first scattering event that is not perfectly specular.
//! It takes camera rays and the addresses of their sample values, and fills in a record for each path.
//!
//! Paths are traced as a wavefront (Laine, Karras and Aila 2013), in packets with one path a lane. Between
//! the stages, queues collect paths into full packets:
//!
//! ```text
//! ray queue ──► intersect ──► hit queue ──► shade ──► shadow-ray queue ──► test occlusion
//!     ▲                                       │
//!     └───────────── scattered rays ──────────┘
//! ```
//!
//! `reference` is the same path tracer for one path at a time: read it first.

mod emission;
mod features;
mod hit_queue;
mod light_sampling;
mod mis;
mod path_event;
mod path_packet;
mod path_tracer;
mod ray_queue;
mod reference;
mod scalar_interaction;
mod scatter;
mod shade;
mod shadow_ray_queue;
mod surface_interactions;
mod termination;
mod trace;
mod wavefront;

pub use path_event::PathEvent;
pub use path_tracer::PathTracer;
pub use reference::PathRadiance;
pub use wavefront::Wavefront;
