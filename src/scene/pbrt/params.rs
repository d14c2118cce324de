//! Parameter lists: `"type name" [ values ]`, read without knowing what they are for, and asked
//! for by name and type afterwards. What nobody asked for is reported.

use std::cell::Cell;
use std::collections::HashMap;
use std::rc::Rc;

use glam::{DVec2, DVec3};

use super::dialect::parameter_type;
use super::lexer::{Lexer, TokenKind};
use super::{Fault, Place, Result};

/// What kind of values a parameter has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ParamType {
    Float,
    Integer,
    Bool,
    String,
    Texture,
    Rgb,
    Xyz,
    Spectrum,
    Blackbody,
    Point2,
    Point3,
    Vector2,
    Vector3,
    Normal3,
}

#[derive(Clone, Debug)]
pub enum Values {
    Numbers(Vec<f64>),
    Strings(Vec<String>),
    Bools(Vec<bool>),
}

#[derive(Clone, Debug)]
pub struct Param {
    pub kind: ParamType,
    /// The type as the file spells it, for messages.
    type_name: String,
    pub name: String,
    pub values: Values,
    pub place: Place,
    used: Cell<bool>,
}

impl Param {
    /// The numbers; empty if the values are something else.
    pub fn numbers(&self) -> &[f64] {
        if let Values::Numbers(numbers) = &self.values { numbers } else { &[] }
    }

    /// The strings; empty if the values are something else.
    pub fn strings(&self) -> &[String] {
        if let Values::Strings(strings) = &self.values { strings } else { &[] }
    }

    pub fn fault(&self, found: impl std::fmt::Display, accepted: &str) -> Fault {
        let message = format!("parameter \"{}\" is {found}; {accepted} would be accepted", self.name);
        Fault::new(self.place, message)
    }

    /// The numbers in groups of `N`.
    fn groups<const N: usize>(&self) -> Result<impl ExactSizeIterator<Item = &[f64; N]>> {
        let (groups, rest) = self.numbers().as_chunks::<N>();
        match rest {
            [] => Ok(groups.iter()),
            _ => {
                Err(self
                    .fault(format_args!("{} numbers", self.numbers().len()), &format!("a multiple of {N}")))
            }
        }
    }
}

/// What `Attribute` directives set for one kind of directive, by name. The parameters are shared, because every
/// block that sets another one keeps a copy of the table.
#[derive(Clone, Debug, Default)]
pub struct Defaults(HashMap<String, Rc<Param>>);

impl Defaults {
    /// Sets these, each in place of the one that had its name before.
    pub fn set(&mut self, params: Params) {
        self.0.extend(params.list.into_iter().map(|param| (param.name.clone(), Rc::new(param))));
    }
}

/// The parameters of a directive.
#[derive(Clone, Debug)]
pub struct Params {
    /// Of the directive.
    pub place: Place,
    list: Vec<Param>,
    /// What `Attribute` directives set beforehand, in case the list does not say.
    defaults: Option<Rc<Defaults>>,
}

impl Params {
    /// Reads all parameters that follow.
    pub fn parse(lexer: &mut Lexer, place: Place) -> Result<Self> {
        let mut list = Vec::new();
        while let Some(token) = lexer.peek()? {
            let start = token.place;
            let declared = lexer.next_if(|kind| match kind {
                TokenKind::Quoted(text) => Some(text.to_string()),
                _ => None,
            })?;
            let Some(declared) = declared else { break };
            list.push(parse_param(lexer, &declared, start)?);
        }
        Ok(Self { place, list, defaults: None })
    }

    /// An empty list.
    pub fn none(place: Place) -> Self {
        Self { place, list: Vec::new(), defaults: None }
    }

    /// The same list, with values for what it does not say.
    pub fn with_defaults(self, defaults: &Rc<Defaults>) -> Self {
        Self { defaults: Some(defaults.clone()), ..self }
    }

    /// The parameters that were not asked for.
    pub fn unused(&self) -> impl Iterator<Item = &Param> {
        self.list.iter().filter(|param| !param.used.get())
    }

    /// Takes all parameters as asked for.
    pub fn mark_all_used(&self) {
        self.list.iter().for_each(|param| param.used.set(true));
    }

    /// Takes what was asked for in `copy` as asked for here.
    pub fn mark_used_in(&self, copy: &Params) {
        for (param, copied) in self.list.iter().zip(&copy.list) {
            param.used.set(param.used.get() || copied.used.get());
        }
    }

    /// Those that were asked for: there may be any amount of others.
    pub fn without_unused(mut self) -> Self {
        self.list.retain(|param| param.used.get());
        self
    }

    /// These, and after them, where they count more, what was not asked for of others.
    pub fn followed_by_unused(&self, others: &Params) -> Params {
        let list = self.list.iter().chain(others.unused()).cloned().collect();
        Self { list, ..self.clone() }
    }

    /// Takes what was asked for at the end of `all`, which [`Self::followed_by_unused`] made, as asked for here;
    /// whether anything was.
    pub fn mark_used_at_end_of(&self, all: &Params) -> bool {
        let unused: Vec<&Param> = self.unused().collect();
        let copies = &all.list[all.list.len() - unused.len()..];
        unused.iter().zip(copies).for_each(|(param, copy)| param.used.set(copy.used.get()));
        copies.iter().any(|copy| copy.used.get())
    }

    /// The parameter of a name, whatever its type. Of several the last one counts, as in pbrt; the others are taken
    /// as asked for.
    pub fn get(&self, name: &str) -> Option<&Param> {
        let named = |param: &&Param| param.name == name;
        self.list.iter().filter(named).for_each(|param| param.used.set(true));
        let default = || self.defaults.as_ref()?.0.get(name).map(Rc::as_ref);
        self.list.iter().rfind(named).or_else(default)
    }

    fn typed(&self, name: &str, types: &[ParamType], accepted: &str) -> Result<Option<&Param>> {
        match self.get(name) {
            Some(param) if !types.contains(&param.kind) => {
                Err(param.fault(format_args!("of type {}", param.type_name), accepted))
            }
            found => Ok(found),
        }
    }

    pub fn floats(&self, name: &str) -> Result<Option<&[f64]>> {
        let param = self.typed(name, &[ParamType::Float, ParamType::Integer], "float")?;
        Ok(param.map(Param::numbers))
    }

    pub fn float(&self, name: &str) -> Result<Option<f64>> {
        let param = self.typed(name, &[ParamType::Float, ParamType::Integer], "float")?;
        param.map(|param| one(param, param.numbers()).copied()).transpose()
    }

    pub fn float_or(&self, name: &str, default: f64) -> Result<f64> {
        Ok(self.float(name)?.unwrap_or(default))
    }

    /// A number above 0; any other says that there is none, as the -1 that pbrt-v4 has for that.
    pub fn positive(&self, name: &str) -> Result<Option<f64>> {
        Ok(self.float(name)?.filter(|&number| number > 0.0))
    }

    /// A number above 0.
    pub fn positive_or(&self, name: &str, default: f64) -> Result<f64> {
        match self.float_or(name, default)? {
            // As `f32`, which it will become.
            number if number as f32 > 0.0 => Ok(number),
            number => Err(self.get(name).map_or_else(
                || {
                    Fault::new(
                        self.place,
                        format!("\"{name}\" is {number}; a number above 0 would be accepted"),
                    )
                },
                |param| param.fault(number, "a number above 0"),
            )),
        }
    }

    pub fn integers(&self, name: &str) -> Result<Option<&[f64]>> {
        let param = self.typed(name, &[ParamType::Integer, ParamType::Float], "integer")?;
        match param {
            Some(param) => match param.numbers().iter().find(|number| number.fract() != 0.0) {
                Some(number) => Err(param.fault(number, "a whole number")),
                None => Ok(Some(param.numbers())),
            },
            None => Ok(None),
        }
    }

    /// A whole number in `range`.
    pub fn integer_in(&self, name: &str, default: u32, range: std::ops::RangeInclusive<u32>) -> Result<u32> {
        let Some(numbers) = self.integers(name)? else { return Ok(default) };
        let param = self.get(name).expect("its numbers were just found");
        let number = *one(param, numbers)?;
        if number < f64::from(*range.start()) || number > f64::from(*range.end()) {
            let accepted = format!("{} to {}", range.start(), range.end());
            return Err(param.fault(number, &accepted));
        }
        Ok(number as u32)
    }

    pub fn bool_or(&self, name: &str, default: bool) -> Result<bool> {
        let Some(param) = self.typed(name, &[ParamType::Bool], "bool")? else { return Ok(default) };
        match &param.values {
            Values::Bools(bools) => one(param, bools).copied(),
            _ => Err(param.fault("no truth value", "true or false")),
        }
    }

    pub fn string(&self, name: &str) -> Result<Option<&str>> {
        let param = self.typed(name, &[ParamType::String], "string")?;
        param.map(|param| one(param, param.strings()).map(String::as_str)).transpose()
    }

    pub fn strings(&self, name: &str) -> Result<Option<&[String]>> {
        Ok(self.typed(name, &[ParamType::String], "string")?.map(Param::strings))
    }

    /// Points or vectors in the plane.
    pub fn pairs(&self, name: &str) -> Result<Option<Vec<DVec2>>> {
        let types = [ParamType::Point2, ParamType::Vector2, ParamType::Float];
        let Some(param) = self.typed(name, &types, "point2")? else { return Ok(None) };
        Ok(Some(param.groups::<2>()?.map(|&[x, y]| DVec2::new(x, y)).collect()))
    }

    /// Points, vectors or normals in space.
    pub fn triples(&self, name: &str) -> Result<Option<Vec<DVec3>>> {
        let types = [ParamType::Point3, ParamType::Vector3, ParamType::Normal3];
        let Some(param) = self.typed(name, &types, "point3, vector3 or normal")? else { return Ok(None) };
        Ok(Some(param.groups::<3>()?.map(|&[x, y, z]| DVec3::new(x, y, z)).collect()))
    }

    /// One point or vector in space.
    pub fn triple_or(&self, name: &str, default: DVec3) -> Result<DVec3> {
        match self.triples(name)?.as_deref() {
            None => Ok(default),
            Some([point]) => Ok(*point),
            Some(points) => Err(self
                .get(name)
                .expect("its numbers were just found")
                .fault(format_args!("{} numbers", 3 * points.len()), "three numbers")),
        }
    }
}

/// The one value of a parameter.
fn one<'v, T>(param: &Param, values: &'v [T]) -> Result<&'v T> {
    match values {
        [value] => Ok(value),
        _ => Err(param.fault(format_args!("{} values", values.len()), "one value")),
    }
}

fn parse_param(lexer: &mut Lexer, declared: &str, place: Place) -> Result<Param> {
    let mut words = declared.split_whitespace();
    let (Some(type_name), Some(name), None) = (words.next(), words.next(), words.next()) else {
        let message = format!("\"{declared}\"; a parameter, \"type name\", would be accepted");
        return Err(Fault::new(place, message));
    };
    let Some(kind) = parameter_type(type_name) else {
        let message = format!(
            "parameter type \"{type_name}\"; float, integer, bool, string, texture, rgb, spectrum, blackbody, \
             point2, point3, vector2, vector3 and normal are accepted"
        );
        return Err(Fault::new(place, message));
    };
    let values = parse_values(lexer, kind, place)?;
    let fits = match kind {
        _ if matches!(&values, Values::Numbers(numbers) if numbers.is_empty()) => true,
        ParamType::Bool => matches!(values, Values::Bools(_)),
        ParamType::String | ParamType::Texture => matches!(values, Values::Strings(_)),
        ParamType::Spectrum => matches!(values, Values::Strings(_) | Values::Numbers(_)),
        _ => matches!(values, Values::Numbers(_)),
    };
    let param =
        Param { kind, type_name: type_name.into(), name: name.into(), values, place, used: Cell::new(false) };
    if !fits {
        let (found, accepted) = match (&param.values, kind) {
            (Values::Numbers(_), ParamType::Bool) => ("numbers", "true or false"),
            (Values::Numbers(_), _) => ("numbers", "strings in quotes"),
            (Values::Strings(_), ParamType::Bool) => ("strings", "true or false"),
            (Values::Strings(_), _) => ("strings", "numbers"),
            (Values::Bools(_), ParamType::String | ParamType::Texture) => {
                ("truth values", "strings in quotes")
            }
            (Values::Bools(_), _) => ("truth values", "numbers"),
        };
        return Err(param.fault(found, accepted));
    }
    Ok(param)
}

/// One value, or several in brackets.
fn parse_values(lexer: &mut Lexer, kind: ParamType, place: Place) -> Result<Values> {
    let bracketed = lexer.next_if(|kind| (*kind == TokenKind::Open).then_some(()))?.is_some();
    let mut values: Option<Values> = None;
    // Older files put truth values in quotes.
    let truth = |token: &TokenKind| match token {
        TokenKind::Word(text) => text.parse().ok(),
        TokenKind::Quoted(text) if kind == ParamType::Bool => text.parse().ok(),
        _ => None,
    };
    loop {
        let Some(token) = lexer.next()? else {
            return Err(Fault::new(
                place,
                "the file ends inside this parameter; values and `]` would be accepted",
            ));
        };
        if bracketed && token.kind == TokenKind::Close {
            return Ok(values.unwrap_or(Values::Numbers(Vec::new())));
        }
        let unexpected = |accepted: &str| {
            Fault::new(token.place, format!("{}; {accepted} would be accepted", token.kind.describe()))
        };
        match (&mut values, &token.kind) {
            (Some(Values::Numbers(list)), TokenKind::Number(number)) => list.push(*number),
            (None, TokenKind::Number(number)) => values = Some(Values::Numbers(vec![*number])),
            (Some(Values::Numbers(_)), _) => return Err(unexpected("a number or `]`")),
            (Some(Values::Bools(list)), kind) => {
                list.push(truth(kind).ok_or_else(|| unexpected("true, false or `]`"))?);
            }
            (None, kind) if truth(kind).is_some() => {
                values = truth(kind).map(|truth| Values::Bools(vec![truth]))
            }
            (Some(Values::Strings(list)), TokenKind::Quoted(text)) => list.push(text.to_string()),
            (None, TokenKind::Quoted(text)) => values = Some(Values::Strings(vec![text.to_string()])),
            (Some(Values::Strings(_)), _) => return Err(unexpected("a string in quotes or `]`")),
            (None, _) => return Err(unexpected("a number, a string in quotes, true or false")),
        }
        if !bracketed {
            return Ok(values.expect("a value was just read"));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn params(text: &str) -> Result<Params> {
        Params::parse(&mut Lexer::new(text.as_bytes(), 0), Place::default())
    }

    #[test]
    fn all_that_have_the_same_defaults_share_them() {
        let mut defaults = Defaults::default();
        defaults.set(params(r#""float a" 2"#).unwrap());
        let defaults = Rc::new(defaults);
        let shapes: Vec<Params> =
            (0..9).map(|_| Params::none(Place::default()).with_defaults(&defaults)).collect();
        assert!(shapes.iter().all(|shape| shape.float("a").unwrap() == Some(2.0)));
        assert_eq!(Rc::strong_count(&defaults), 10, "no copies");
    }

    #[test]
    fn values_are_found_by_name_with_and_without_brackets() {
        let params =
            params(r#""float a" 2 "integer b" [3] "bool c" true "string d" "x" "point3 e" [1 2 3 4 5 6]"#)
                .unwrap();
        assert_eq!(params.float("a").unwrap(), Some(2.0));
        assert_eq!(params.integer_in("b", 0, 0..=9).unwrap(), 3);
        assert!(params.bool_or("c", false).unwrap());
        assert_eq!(params.string("d").unwrap(), Some("x"));
        assert_eq!(params.triples("e").unwrap().unwrap()[1], DVec3::new(4.0, 5.0, 6.0));
        assert_eq!(params.unused().count(), 0);
        assert_eq!(params.float("missing").unwrap(), None);
    }

    #[test]
    fn what_nobody_asked_for_is_unused() {
        let params = params(r#""float a" 2 "float b" 3"#).unwrap();
        params.float("a").unwrap();
        assert_eq!(params.unused().map(|p| p.name.as_str()).collect::<Vec<_>>(), ["b"]);
    }

    #[test]
    fn wrong_types_counts_and_ranges_are_errors_at_the_parameter() {
        let params = params("\n \"rgb a\" [1 1 1] \"point3 b\" [1 2] \"integer c\" 1.5").unwrap();
        let fault = params.float("a").unwrap_err();
        assert_eq!((fault.place.line, fault.place.column), (2, 2));
        assert_eq!(fault.message, "parameter \"a\" is of type rgb; float would be accepted");
        assert!(params.triples("b").is_err());
        assert!(params.integer_in("c", 0, 0..=9).is_err());
    }

    #[test]
    fn values_that_do_not_fit_their_type_are_errors() {
        for text in [
            r#""float a" "x""#,
            r#""string a" 1"#,
            r#""bool a" 1"#,
            r#""float a" [1 "x"]"#,
            r#""float a" [1 2"#,
            r#""float" 1"#,
            r#""quaternion a" 1"#,
        ] {
            assert!(params(text).is_err(), "{text}");
        }
    }
}
