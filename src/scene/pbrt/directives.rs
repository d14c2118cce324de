//! Tokens → statements: the table of directives, and the loop that carries them out.

use std::borrow::Cow;
use std::rc::Rc;

use sha2::Digest;

use super::color_space::ColorSpace;
use super::lexer::{Lexer, TokenKind};
use super::params::Params;
use super::state::{Block, Reader};
use super::{Fault, Place, Result, files};

/// Includes inside includes; real scenes have two or three.
const MAX_INCLUDE_DEPTH: usize = 32;
/// Times that a file may be included. Without a limit, thirty files each of which includes the next one
/// twice would be a scene of 2³⁰.
const MAX_INCLUSIONS: usize = 1024;

/// Options that change how pbrt works, and not what its image converges to here. Samples are
/// filtered by their number, textures not at all, and the seed is the command line's.
const WITHOUT_BEARING: [&str; 12] = [
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

/// A directive with its arguments.
#[derive(Clone, Debug)]
pub struct Statement {
    pub name: &'static str,
    pub place: Place,
    pub strings: Vec<String>,
    pub numbers: Vec<f64>,
    pub params: Params,
}

/// Where a directive may stand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    Anywhere,
    /// Before `WorldBegin`.
    Header,
    /// After it.
    World,
}

/// What stands between a directive and the next one.
#[derive(Clone, Copy, Debug)]
enum Arguments {
    Nothing,
    /// So many, in brackets or not.
    Numbers(usize),
    /// An unquoted word.
    Word,
    /// So many strings in quotes.
    Strings(usize),
    /// One or two strings in quotes.
    OneOrTwoStrings,
    /// So many strings in quotes, then parameters.
    Params(usize),
}

struct Directive {
    name: &'static str,
    arguments: Arguments,
    phase: Phase,
    run: fn(&mut Reader, &Statement) -> Result<()>,
}

const fn directive(
    name: &'static str,
    arguments: Arguments,
    phase: Phase,
    run: fn(&mut Reader, &Statement) -> Result<()>,
) -> Directive {
    Directive { name, arguments, phase, run }
}

/// All directives, of all dialects.
const TABLE: &[Directive] = {
    use Arguments::*;
    use Phase::*;
    &[
        directive("Accelerator", Params(1), Header, Reader::ignore),
        directive("ActiveTransform", Word, Anywhere, Reader::active_transform),
        directive("AreaLightSource", Params(1), World, Reader::area_light_source),
        directive("Attribute", Params(1), Anywhere, Reader::attribute),
        directive("AttributeBegin", Nothing, World, |r, s| r.push(Block::Attribute, s.place)),
        directive("AttributeEnd", Nothing, World, |r, s| r.pop(Block::Attribute, s.place)),
        directive("Camera", Params(1), Header, Reader::keep),
        directive("ColorSpace", Strings(1), Anywhere, Reader::color_space),
        directive("ConcatTransform", Numbers(16), Anywhere, Reader::concat_transform),
        directive("CoordSysTransform", Strings(1), Anywhere, Reader::coord_sys_transform),
        directive("CoordinateSystem", Strings(1), Anywhere, Reader::coordinate_system),
        directive("Film", Params(1), Header, Reader::keep),
        directive("Identity", Nothing, Anywhere, Reader::identity),
        directive("Import", Strings(1), World, Reader::import),
        directive("Include", Strings(1), Anywhere, Reader::include),
        directive("Integrator", Params(1), Header, Reader::keep),
        directive("LightSource", Params(1), World, Reader::light_source),
        directive("LookAt", Numbers(9), Anywhere, Reader::look_at),
        directive("MakeNamedMaterial", Params(1), World, Reader::make_named_material),
        directive("MakeNamedMedium", Params(1), Anywhere, Reader::medium),
        directive("Material", Params(1), World, Reader::material),
        directive("MediumInterface", OneOrTwoStrings, Anywhere, Reader::medium),
        directive("NamedMaterial", Strings(1), World, Reader::named_material),
        directive("ObjectBegin", Strings(1), World, Reader::object_begin),
        directive("ObjectEnd", Nothing, World, Reader::object_end),
        directive("ObjectInstance", Strings(1), World, Reader::object_instance),
        directive("Option", Params(0), Header, Reader::option),
        directive("PixelFilter", Params(1), Header, Reader::keep),
        directive("Renderer", Params(1), Header, Reader::ignore),
        directive("ReverseOrientation", Nothing, World, |r, _| {
            r.state.reverse_orientation = !r.state.reverse_orientation;
            Ok(())
        }),
        directive("Rotate", Numbers(4), Anywhere, Reader::rotate),
        directive("Sampler", Params(1), Header, Reader::keep),
        directive("Scale", Numbers(3), Anywhere, Reader::scale),
        directive("Shape", Params(1), World, Reader::shape),
        directive("SurfaceIntegrator", Params(1), Header, Reader::keep),
        directive("Texture", Params(3), World, Reader::texture),
        directive("Transform", Numbers(16), Anywhere, Reader::transform),
        directive("TransformBegin", Nothing, Anywhere, |r, s| r.push(Block::Transform, s.place)),
        directive("TransformEnd", Nothing, Anywhere, |r, s| r.pop(Block::Transform, s.place)),
        directive("TransformTimes", Numbers(2), Header, Reader::set_transform_times),
        directive("Translate", Numbers(3), Anywhere, Reader::translate),
        directive("Volume", Params(1), World, Reader::medium),
        directive("VolumeIntegrator", Params(1), Header, Reader::ignore),
        directive("WorldBegin", Nothing, Header, Reader::world_begin),
        directive("WorldEnd", Nothing, World, |_, _| Ok(())),
    ]
};

impl Reader {
    /// Carries out the directives of a file.
    pub fn read_text(&mut self, text: &[u8], file: u32) -> Result<()> {
        // With its length, so that what stands in one file differs from the same in two.
        self.digest.update((text.len() as u64).to_le_bytes());
        self.digest.update(text);
        let mut lexer = Lexer::new(text, file);
        while let Some(token) = lexer.next()? {
            let found = match &token.kind {
                TokenKind::Word(word) => TABLE.iter().find(|directive| directive.name == word),
                _ => None,
            };
            let Some(directive) = found else {
                let found = token.kind.describe();
                let message =
                    format!("{found}; a directive such as Shape or AttributeBegin would be accepted");
                return Err(Fault::new(token.place, message));
            };
            self.check_phase(directive, token.place)?;
            let statement = parse_statement(&mut lexer, directive, token.place)?;
            (directive.run)(self, &statement)?;
            // Directives of the header are looked at when the world begins.
            if directive.phase != Phase::Header {
                self.report_unused(&statement);
            }
        }
        Ok(())
    }

    fn check_phase(&self, directive: &Directive, place: Place) -> Result<()> {
        let accepted = match (directive.phase, self.view.is_some()) {
            (Phase::Header, true) => "before",
            (Phase::World, false) => "after",
            _ => return Ok(()),
        };
        let name = directive.name;
        Err(Fault::new(place, format!("{name} here; it would be accepted {accepted} WorldBegin")))
    }

    fn include(&mut self, statement: &Statement) -> Result<()> {
        let name = &statement.strings[0];
        let path = self.resolve(name);
        let fault = |message: String| Fault::new(statement.place, message);
        let text = files::read(&path).map_err(|e| {
            fault(format!("\"{}\" cannot be read: {e}; a scene file would be accepted", path.display()))
        })?;
        let canonical = path.canonicalize().unwrap_or_else(|_| path.clone());
        if self.open.contains(&canonical) {
            return Err(fault(format!(
                "\"{name}\", which is being read already; another file would be accepted"
            )));
        }
        if self.open.len() >= MAX_INCLUDE_DEPTH {
            return Err(fault(format!(
                "includes more than {MAX_INCLUDE_DEPTH} deep; fewer would be accepted"
            )));
        }
        let inclusions = self.inclusions.entry(canonical.clone()).or_default();
        *inclusions += 1;
        if *inclusions > MAX_INCLUSIONS {
            return Err(fault(format!(
                "\"{name}\" for more than {MAX_INCLUSIONS} times; fewer would be accepted"
            )));
        }
        self.open.push(canonical);
        self.files.push(path.display().to_string());
        self.read_text(&text, (self.files.len() - 1) as u32)?;
        self.open.pop();
        Ok(())
    }

    /// As `include`, but the graphics state is as before afterwards.
    fn import(&mut self, statement: &Statement) -> Result<()> {
        let saved = self.state.clone();
        self.include(statement)?;
        self.state = saved;
        Ok(())
    }

    /// For what has no bearing on the image here.
    fn ignore(&mut self, _: &Statement) -> Result<()> {
        Ok(())
    }

    fn medium(&mut self, statement: &Statement) -> Result<()> {
        self.warnings.add(statement.place, "participating media are not simulated");
        statement.params.mark_all_used();
        Ok(())
    }

    fn color_space(&mut self, statement: &Statement) -> Result<()> {
        let name = &statement.strings[0];
        let Some(space) = ColorSpace::named(name) else {
            let names = ColorSpace::names();
            return Err(Fault::new(statement.place, format!("color space \"{name}\"; {names} are accepted")));
        };
        self.state.color_space = space;
        Ok(())
    }

    /// Options of pbrt's machinery have no bearing here; those of the image are reported.
    fn option(&mut self, statement: &Statement) -> Result<()> {
        for name in WITHOUT_BEARING {
            statement.params.get(name);
        }
        self.report_unused(statement);
        Ok(())
    }

    fn attribute(&mut self, statement: &Statement) -> Result<()> {
        const TARGETS: [&str; 5] = ["shape", "light", "material", "medium", "texture"];
        let target = &statement.strings[0];
        if !TARGETS.contains(&target.as_str()) {
            let message = format!("\"{target}\"; {} are accepted", TARGETS.join(", "));
            return Err(Fault::new(statement.place, message));
        }
        statement.params.mark_all_used();
        let defaults = Rc::make_mut(&mut self.state.defaults).entry(target.clone()).or_default();
        Rc::make_mut(defaults).set(statement.params.clone());
        Ok(())
    }

    /// The parameters of a statement, with what `Attribute` set for its kind.
    pub fn params_for<'s>(&self, target: &str, statement: &'s Statement) -> Cow<'s, Params> {
        match self.state.defaults.get(target) {
            Some(defaults) => Cow::Owned(statement.params.clone().with_defaults(defaults)),
            None => Cow::Borrowed(&statement.params),
        }
    }
}

fn parse_statement(lexer: &mut Lexer, directive: &'static Directive, place: Place) -> Result<Statement> {
    let name = directive.name;
    let mut statement =
        Statement { name, place, strings: Vec::new(), numbers: Vec::new(), params: Params::none(place) };
    match directive.arguments {
        Arguments::Nothing => {}
        Arguments::Numbers(count) => statement.numbers = parse_numbers(lexer, name, count, place)?,
        Arguments::Word => {
            let word = lexer.next_if(|kind| match kind {
                TokenKind::Word(word) => Some(word.to_string()),
                _ => None,
            })?;
            statement.strings.push(word.ok_or_else(|| missing(lexer, name, "a word", place))?);
        }
        Arguments::Strings(count) => statement.strings = parse_strings(lexer, name, count, place)?,
        Arguments::OneOrTwoStrings => {
            statement.strings = parse_strings(lexer, name, 1, place)?;
            statement.strings.extend(quoted(lexer)?);
        }
        Arguments::Params(count) => {
            statement.strings = parse_strings(lexer, name, count, place)?;
            statement.params = Params::parse(lexer, place)?;
        }
    }
    Ok(statement)
}

/// An argument that is not there: at the token that stands in its stead.
fn missing(lexer: &mut Lexer, name: &str, accepted: &str, place: Place) -> Fault {
    match lexer.peek() {
        Err(fault) => fault,
        Ok(None) => Fault::new(place, format!("the file ends after {name}; {accepted} would be accepted")),
        Ok(Some(token)) => {
            let found = token.kind.describe();
            Fault::new(token.place, format!("{found} after {name}; {accepted} would be accepted"))
        }
    }
}

fn quoted(lexer: &mut Lexer) -> Result<Option<String>> {
    lexer.next_if(|kind| match kind {
        TokenKind::Quoted(text) => Some(text.to_string()),
        _ => None,
    })
}

fn parse_strings(lexer: &mut Lexer, name: &str, count: usize, place: Place) -> Result<Vec<String>> {
    (0..count)
        .map(|_| match quoted(lexer)? {
            Some(text) => Ok(text),
            None => Err(missing(lexer, name, "a string in quotes", place)),
        })
        .collect()
}

fn parse_numbers(lexer: &mut Lexer, name: &str, count: usize, place: Place) -> Result<Vec<f64>> {
    let is = |wanted: TokenKind<'static>| move |kind: &TokenKind| (*kind == wanted).then_some(());
    let bracketed = lexer.next_if(is(TokenKind::Open))?.is_some();
    let mut numbers = Vec::with_capacity(count);
    for _ in 0..count {
        let number = lexer.next_if(|kind| match kind {
            TokenKind::Number(number) => Some(*number),
            _ => None,
        })?;
        let accepted = || format!("{count} numbers");
        numbers.push(number.ok_or_else(|| missing(lexer, name, &accepted(), place))?);
    }
    if bracketed && lexer.next_if(is(TokenKind::Close))?.is_none() {
        return Err(missing(lexer, name, &format!("`]` after {count} numbers"), place));
    }
    Ok(numbers)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use crate::scene::pbrt::{read, read_str};

    #[test]
    fn includes_that_double_at_every_level_end_early() {
        let folder = tempfile::tempdir().unwrap();
        for level in 0..30 {
            let next = format!("Include \"{}\"\n", level + 1);
            std::fs::write(folder.path().join(level.to_string()), next.repeat(2)).unwrap();
        }
        std::fs::write(folder.path().join("30"), "Identity").unwrap();
        let error = read(&folder.path().join("0")).unwrap_err();
        assert!(error.message.contains("for more than 1024 times"), "{error}");
    }

    #[test]
    fn blocks_are_not_nested_without_end() {
        let nested = |depth: usize| {
            let text =
                format!("WorldBegin {} {}", "AttributeBegin ".repeat(depth), "AttributeEnd ".repeat(depth));
            read_str(&text, Path::new(""))
        };
        assert!(nested(1024).is_ok());
        assert!(nested(1025).unwrap_err().message.contains("blocks more than 1024 deep"));
    }
}
