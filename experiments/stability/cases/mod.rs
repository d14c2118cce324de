//! Hard cases: numbers, scenes and circumstances at their worst, each with a measured figure and its bound.
//!
//! The tests (`tests/stability.rs`) require every case to hold; `prpf-experiments stability` reports the figures.
//! Cases use the library's public interface and the built program.

mod camera;
pub mod case;
mod chi_squared;
pub mod effort;
mod features;
mod files;
mod images;
mod leaks;
mod light;
pub mod program;
mod radiance;
mod render_loop;
mod renders;
mod scenes;
mod sphere_cells;
mod statistics;
mod stores;
mod surfaces;
mod unusual_stores;

use case::Case;
use effort::Effort;

/// Cases on one subject.
pub struct Section {
    pub name: &'static str,
    pub cases: fn(Effort) -> Vec<Case>,
}

/// All sections, in the order of the report.
pub const SECTIONS: [Section; 9] = [
    Section { name: "Statistics", cases: statistics::cases },
    Section { name: "Radiance", cases: radiance::cases },
    Section { name: "Features", cases: features::cases },
    Section { name: "Images", cases: images::cases },
    Section { name: "Unusual stores", cases: unusual_stores::cases },
    Section { name: "Scenes", cases: scenes::cases },
    Section { name: "Light and surfaces", cases: light_and_surfaces },
    Section { name: "The loop", cases: render_loop::cases },
    Section { name: "Files", cases: files::cases },
];

fn light_and_surfaces(effort: Effort) -> Vec<Case> {
    [surfaces::cases(effort), light::cases(effort), camera::cases(effort), leaks::cases(effort)].concat()
}
