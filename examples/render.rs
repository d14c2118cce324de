//! Renders a scene to a file: `cargo run --release --example render -- scenes/pool/pool.pbrt pool.exr`

use std::error::Error;
use std::path::PathBuf;

use prpf::{RenderBuilder, scene::pbrt};

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args_os().skip(1).map(PathBuf::from);
    let (Some(scene), Some(image)) = (arguments.next(), arguments.next()) else {
        return Err("usage: render SCENE IMAGE".into());
    };
    let scene = pbrt::read(&scene)?;
    let rendered = RenderBuilder::new(&scene).spp(16).run()?;
    rendered.write(&image)?;
    println!("{} by {}", image.display(), rendered.outcome.result.made_by);
    Ok(())
}
