//! Random scenes to train filters on, and to try the program with: rooms, open places and studios with objects,
//! materials, textures, lights and lenses drawn by chance.
//!
//! Takes a seed; gives the files of one scene: a few views, which include one world. Metres, y up, the
//! ground at y = 0. A scene depends on its seed alone.

mod camera;
mod environment;
mod lights;
mod materials;
mod objects;
mod patterns;
mod place;
mod world;

use std::fmt::Write;

use crate::Asset;
use crate::noise::Stream;
use camera::View;
use objects::scatter;
use place::Place;
use world::World;

/// Makes the files of the scene `number` of a collection, relative to the collection's folder.
pub fn scene(collection: u64, number: u64) -> Vec<Asset> {
    let mut stream = Stream::new(collection.wrapping_mul(1_000_003).wrapping_add(number));
    let mut world = World::new(format!("scene-{number:04}"));
    let place = Place::draw(&mut stream);
    place.build(&mut world, &mut stream);
    lights::light(&mut world, &place, &mut stream);
    let moves = stream.chance(0.35);
    scatter(&mut world, &place, moves, &mut stream);

    let views = stream.count(1, 3);
    for view in 0..views {
        let text = View::draw(&place, moves, &mut stream).text();
        let name = format!("view-{view}.pbrt");
        world.add_file(&name, format!("{text}WorldBegin\nInclude \"world.pbrt\"\n").into_bytes());
    }
    world.into_assets()
}

/// Formats numbers for a parameter: `[ 1 0.5 2 ]`.
fn numbers(values: &[f64]) -> String {
    let mut text = "[ ".to_owned();
    values.iter().for_each(|value| write!(text, "{value:.5} ").expect("strings grow"));
    text + "]"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scene_depends_on_its_seed_alone() {
        let [first, again, other] =
            [(7, 1), (7, 1), (7, 2)].map(|(collection, number)| scene(collection, number));
        let bytes = |assets: &[Asset]| assets.iter().map(|asset| asset.bytes.clone()).collect::<Vec<_>>();
        assert_eq!(bytes(&first), bytes(&again));
        assert_ne!(bytes(&first), bytes(&other));
    }

    #[test]
    fn every_file_that_a_world_names_is_one_of_its_own() {
        for number in 0..20 {
            let assets = scene(1, number);
            let paths: Vec<&str> = assets.iter().map(|asset| asset.path.as_str()).collect();
            for asset in assets.iter().filter(|asset| asset.path.ends_with("world.pbrt")) {
                let text = String::from_utf8_lossy(&asset.bytes);
                for name in
                    text.split("\"string filename\" \"").skip(1).filter_map(|rest| rest.split('"').next())
                {
                    let path = format!("scene-{number:04}/{name}");
                    assert!(paths.contains(&path.as_str()), "{path}");
                }
            }
        }
    }
}
