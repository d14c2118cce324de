//! Directives without effect on the image.

use crate::scene::pbrt::builder::SceneBuilder;
use crate::scene::pbrt::parser::{Result, Statement};

/// Options that do not change the converged image. Sampling is unaffected by them, textures are not
/// filtered, and the seed comes from the command line.
const IGNORED_OPTIONS: [&str; 12] = [
    "disablepixeljitter",
    "disabletexturefiltering",
    "disablewavelengthjitter",
    "displacementedgescale",
    "interactive",
    "msereferenceimage",
    "msereferenceout",
    "pixelstats",
    "quiet",
    "rendercoordsys",
    "seed",
    "wavefront",
];

impl SceneBuilder {
    /// Ignores a directive, such as `Accelerator`.
    pub fn ignore(&mut self, _: &Statement) -> Result<()> {
        Ok(())
    }

    /// Warns that participating media are not simulated.
    pub fn medium(&mut self, statement: &Statement) -> Result<()> {
        self.warnings.add(statement.loc, "participating media are not simulated");
        statement.params.mark_all_used();
        Ok(())
    }

    /// `Option`: ignores options that do not change the image and warns about the others.
    pub fn option(&mut self, statement: &Statement) -> Result<()> {
        for name in IGNORED_OPTIONS {
            statement.params.get(name);
        }
        self.report_unused(statement);
        if let Some(name) = statement.strings.first() {
            // As in pbrt-v4, case and separators do not count
            let plain = name.replace(['_', '-'], "").to_lowercase();
            if !IGNORED_OPTIONS.contains(&plain.as_str()) {
                self.warnings.add(statement.loc, format!("Option \"{name}\" is not used"));
            }
        }
        Ok(())
    }
}
