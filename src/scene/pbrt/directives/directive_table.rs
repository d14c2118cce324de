//! The table of directives, and the loop that carries them out.

use sha2::Digest;

use crate::scene::pbrt::builder::{SceneBuilder, ScopeKind};
use crate::scene::pbrt::parser::{Arguments, FileLoc, Lexer, ParseError, Result, Statement, TokenKind};

/// Part of a scene file that a directive is accepted in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    Anywhere,
    /// Before `WorldBegin`.
    Options,
    /// After `WorldBegin`.
    World,
}

/// A row of the table.
struct Directive {
    name: &'static str,
    arguments: Arguments,
    phase: Phase,
    run: fn(&mut SceneBuilder, &Statement) -> Result<()>,
}

const fn directive(
    name: &'static str,
    arguments: Arguments,
    phase: Phase,
    run: fn(&mut SceneBuilder, &Statement) -> Result<()>,
) -> Directive {
    Directive { name, arguments, phase, run }
}

/// The directives of all dialects.
const TABLE: &[Directive] = {
    use Arguments::*;
    use Phase::*;
    &[
        directive("Accelerator", Parameters(1), Options, SceneBuilder::ignore),
        directive("ActiveTransform", Word, Anywhere, SceneBuilder::active_transform),
        directive("AreaLightSource", Parameters(1), World, SceneBuilder::area_light_source),
        directive("Attribute", Parameters(1), Anywhere, SceneBuilder::attribute),
        directive("AttributeBegin", Nothing, World, |builder, s| {
            builder.push_scope(ScopeKind::Attribute, s.loc)
        }),
        directive("AttributeEnd", Nothing, World, |builder, s| {
            builder.pop_scope(ScopeKind::Attribute, s.loc)
        }),
        directive("Camera", Parameters(1), Options, SceneBuilder::keep_option),
        directive("ColorSpace", Strings(1), Anywhere, SceneBuilder::color_space),
        directive("ConcatTransform", Numbers(16), Anywhere, SceneBuilder::concat_transform),
        directive("CoordSysTransform", Strings(1), Anywhere, SceneBuilder::coord_sys_transform),
        directive("CoordinateSystem", Strings(1), Anywhere, SceneBuilder::coordinate_system),
        directive("Film", Parameters(1), Options, SceneBuilder::keep_option),
        directive("Identity", Nothing, Anywhere, SceneBuilder::identity),
        directive("Import", Strings(1), World, SceneBuilder::import),
        directive("Include", Strings(1), Anywhere, SceneBuilder::include),
        directive("Integrator", Parameters(1), Options, SceneBuilder::keep_option),
        directive("LightSource", Parameters(1), World, SceneBuilder::light_source),
        directive("LookAt", Numbers(9), Anywhere, SceneBuilder::look_at),
        directive("MakeNamedMaterial", Parameters(1), World, SceneBuilder::make_named_material),
        directive("MakeNamedMedium", Parameters(1), Anywhere, SceneBuilder::medium),
        directive("Material", Parameters(1), World, SceneBuilder::material),
        directive("MediumInterface", OneOrTwoStrings, Anywhere, SceneBuilder::medium),
        directive("NamedMaterial", Strings(1), World, SceneBuilder::named_material),
        directive("ObjectBegin", Strings(1), World, SceneBuilder::object_begin),
        directive("ObjectEnd", Nothing, World, SceneBuilder::object_end),
        directive("ObjectInstance", Strings(1), World, SceneBuilder::object_instance),
        directive("Option", NameAndValue, Options, SceneBuilder::option),
        directive("PixelFilter", Parameters(1), Options, SceneBuilder::keep_option),
        directive("Renderer", Parameters(1), Options, SceneBuilder::ignore),
        directive("ReverseOrientation", Nothing, World, SceneBuilder::reverse_orientation),
        directive("Rotate", Numbers(4), Anywhere, SceneBuilder::rotate),
        directive("Sampler", Parameters(1), Options, SceneBuilder::keep_option),
        directive("Scale", Numbers(3), Anywhere, SceneBuilder::scale),
        directive("Shape", Parameters(1), World, SceneBuilder::shape),
        directive("SurfaceIntegrator", Parameters(1), Options, SceneBuilder::keep_option),
        directive("Texture", Parameters(3), World, SceneBuilder::texture),
        directive("Transform", Numbers(16), Anywhere, SceneBuilder::transform),
        directive("TransformBegin", Nothing, Anywhere, |builder, s| {
            builder.push_scope(ScopeKind::Transform, s.loc)
        }),
        directive("TransformEnd", Nothing, Anywhere, |builder, s| {
            builder.pop_scope(ScopeKind::Transform, s.loc)
        }),
        directive("TransformTimes", Numbers(2), Options, SceneBuilder::set_transform_times),
        directive("Translate", Numbers(3), Anywhere, SceneBuilder::translate),
        directive("Volume", Parameters(1), World, SceneBuilder::medium),
        directive("VolumeIntegrator", Parameters(1), Options, SceneBuilder::ignore),
        directive("WorldBegin", Nothing, Options, SceneBuilder::world_begin),
        directive("WorldEnd", Nothing, World, |builder, _| {
            builder.world_has_ended = true;
            Ok(())
        }),
    ]
};

impl SceneBuilder {
    /// Carries out the directives of a scene file up to `WorldEnd`; `file` is its index.
    pub fn read_text(&mut self, text: &[u8], file: u32) -> Result<()> {
        // The length separates the files in the digest
        self.digest.update((text.len() as u64).to_le_bytes());
        self.digest.update(text);
        let mut lexer = Lexer::new(text, file);
        while let Some(token) = lexer.next()? {
            // A scene has one world
            if self.world_has_ended {
                self.warnings.add(token.loc, "everything after WorldEnd is ignored");
                break;
            }

            // Look up the directive
            let found = match &token.kind {
                TokenKind::Word(word) => TABLE.iter().find(|directive| directive.name == word),
                _ => None,
            };
            let Some(directive) = found else {
                let found = token.kind.describe();
                let message =
                    format!("unexpected {found}; expected a directive such as Shape or AttributeBegin");
                return Err(ParseError::new(token.loc, message));
            };

            // Parse its arguments and carry it out
            let is_misplaced = self.is_misplaced(directive, token.loc)?;
            let statement = Statement::parse(&mut lexer, directive.name, directive.arguments, token.loc)?;
            if is_misplaced {
                continue;
            }
            if let Err(error) = (directive.run)(self, &statement) {
                // A material, a texture or a light with a wrong parameter
                let has_parameters = matches!(directive.arguments, Arguments::Parameters(_));
                if !(has_parameters && directive.phase == Phase::World) {
                    return Err(error);
                }
                self.warn_or_fail(error, &format!("the {} is ignored", directive.name))?;
                statement.params.mark_all_used();
            }

            // Parameters of options are looked up at WorldBegin
            if directive.phase != Phase::Options {
                self.report_unused(&statement);
            }
        }
        Ok(())
    }

    /// Whether a directive is on the wrong side of `WorldBegin`: an error in v4, and ignored in the older dialects.
    fn is_misplaced(&mut self, directive: &Directive, loc: FileLoc) -> Result<bool> {
        let expected = match (directive.phase, self.options.is_some()) {
            (Phase::Options, true) => "before",
            (Phase::World, false) => "after",
            _ => return Ok(false),
        };
        let message = format!("misplaced {}; expected it {expected} WorldBegin", directive.name);
        self.warn_or_fail(ParseError::new(loc, message), "it is ignored")?;
        Ok(true)
    }

    /// Warns about parameters that were never looked up.
    pub fn report_unused(&mut self, statement: &Statement) {
        let what = match statement.strings.last() {
            Some(kind) if statement.name != "MakeNamedMaterial" => format!("{} \"{kind}\"", statement.name),
            _ => statement.name.to_string(),
        };
        for param in statement.params.unused() {
            self.warnings.add(param.loc, format!("parameter \"{}\" of {what} is not used", param.name));
        }
    }
}
