//! The parameters of a directive, looked up by name and type.
//!
//! Lookups mark parameters as used, so that the reader can report those that no directive reads
//! (pbrt-v4's `ParameterDictionary`).

use std::rc::Rc;

use glam::{DVec2, DVec3};

use super::{
    AttributeDefaults, FileLoc, Lexer, Parameter, ParameterType, ParseError, Result, TokenKind, Values,
};

/// The parameters of a directive.
#[derive(Clone, Debug)]
pub struct ParameterDictionary {
    /// Location of the directive.
    pub loc: FileLoc,
    list: Vec<Parameter>,
    /// Values from `Attribute` directives for parameters that are not in `list`.
    defaults: Option<Rc<AttributeDefaults>>,
}

impl ParameterDictionary {
    /// Parses all parameters that follow a directive at `loc`.
    pub fn parse(lexer: &mut Lexer, loc: FileLoc) -> Result<Self> {
        let mut list = Vec::new();
        while let Some(token) = lexer.peek()? {
            let start = token.loc;
            let declared = lexer.next_if(|kind| match kind {
                TokenKind::Quoted(text) => Some(text.to_string()),
                _ => None,
            })?;
            let Some(declared) = declared else { break };
            list.push(Parameter::parse(lexer, &declared, start)?);
        }
        Ok(Self { loc, list, defaults: None })
    }

    /// A dictionary without parameters.
    pub fn empty(loc: FileLoc) -> Self {
        Self { loc, list: Vec::new(), defaults: None }
    }

    /// Adds defaults for parameters that are not given.
    pub fn with_defaults(self, defaults: &Rc<AttributeDefaults>) -> Self {
        Self { defaults: Some(defaults.clone()), ..self }
    }

    /// The parameters that are given, without defaults.
    pub fn into_parameters(self) -> Vec<Parameter> {
        self.list
    }

    /// The parameters that were never looked up.
    pub fn unused(&self) -> impl Iterator<Item = &Parameter> {
        self.list.iter().filter(|param| !param.used.get())
    }

    /// Marks every parameter as used.
    pub fn mark_all_used(&self) {
        self.list.iter().for_each(|param| param.used.set(true));
    }

    /// Marks the parameters that are used in `copy`, a clone of this dictionary.
    pub fn mark_used_from(&self, copy: &ParameterDictionary) {
        for (param, copied) in self.list.iter().zip(&copy.list) {
            param.used.set(param.used.get() || copied.used.get());
        }
    }

    /// Drops unused parameters, of which there may be any amount.
    pub fn retain_used(mut self) -> Self {
        self.list.retain(|param| param.used.get());
        self
    }

    /// Appends the unused parameters of `others`, which take precedence.
    pub fn extended_with_unused(&self, others: &ParameterDictionary) -> ParameterDictionary {
        let list = self.list.iter().chain(others.unused()).cloned().collect();
        Self { list, ..self.clone() }
    }

    /// Marks the parameters that were used in `extended`, the result of
    /// [`Self::extended_with_unused`] with `self` as `others`. Returns whether there are any.
    pub fn mark_used_from_extension(&self, extended: &ParameterDictionary) -> bool {
        let unused: Vec<&Parameter> = self.unused().collect();
        let copies = &extended.list[extended.list.len() - unused.len()..];
        unused.iter().zip(copies).for_each(|(param, copy)| param.used.set(copy.used.get()));
        copies.iter().any(|copy| copy.used.get())
    }

    /// The parameter called `name`, of any type. Of several the last one counts, as in pbrt; all
    /// are marked as used.
    pub fn get(&self, name: &str) -> Option<&Parameter> {
        let named = |param: &&Parameter| param.name == name;
        self.list.iter().filter(named).for_each(|param| param.used.set(true));
        let default = || self.defaults.as_ref()?.get(name);
        self.list.iter().rfind(named).or_else(default)
    }

    /// The parameter called `name`, which must have one of `types`.
    fn typed(&self, name: &str, types: &[ParameterType], expected: &str) -> Result<Option<&Parameter>> {
        match self.get(name) {
            Some(param) if !types.contains(&param.kind) => {
                Err(param.error(format_args!("of type {}", param.type_name), expected))
            }
            found => Ok(found),
        }
    }

    /// A list of numbers.
    pub fn floats(&self, name: &str) -> Result<Option<&[f64]>> {
        let param = self.typed(name, &[ParameterType::Float, ParameterType::Integer], "float")?;
        Ok(param.map(Parameter::numbers))
    }

    /// One number.
    pub fn float(&self, name: &str) -> Result<Option<f64>> {
        let param = self.typed(name, &[ParameterType::Float, ParameterType::Integer], "float")?;
        param.map(|param| param.single(param.numbers()).copied()).transpose()
    }

    /// One number, or `default`.
    pub fn float_or(&self, name: &str, default: f64) -> Result<f64> {
        Ok(self.float(name)?.unwrap_or(default))
    }

    /// One number above 0. Other values mean "not given", as pbrt-v4's default of -1 does.
    pub fn positive(&self, name: &str) -> Result<Option<f64>> {
        Ok(self.float(name)?.filter(|&number| number > 0.0))
    }

    /// One number, or `default`; an error unless it is above 0.
    pub fn positive_or(&self, name: &str, default: f64) -> Result<f64> {
        match self.float_or(name, default)? {
            // Compare as `f32`, the precision of the scene
            number if number as f32 > 0.0 => Ok(number),
            number => Err(self.get(name).map_or_else(
                || ParseError::new(self.loc, format!("\"{name}\" is {number}; expected a number above 0")),
                |param| param.error(number, "a number above 0"),
            )),
        }
    }

    /// A list of whole numbers.
    pub fn integers(&self, name: &str) -> Result<Option<&[f64]>> {
        let param = self.typed(name, &[ParameterType::Integer, ParameterType::Float], "integer")?;
        match param {
            Some(param) => match param.numbers().iter().find(|number| number.fract() != 0.0) {
                Some(number) => Err(param.error(number, "a whole number")),
                None => Ok(Some(param.numbers())),
            },
            None => Ok(None),
        }
    }

    /// One whole number, or `default`; an error unless it is in `range`.
    pub fn integer_in(&self, name: &str, default: u32, range: std::ops::RangeInclusive<u32>) -> Result<u32> {
        let Some(numbers) = self.integers(name)? else { return Ok(default) };
        let param = self.get(name).expect("its numbers were just found");
        let number = *param.single(numbers)?;
        if number < f64::from(*range.start()) || number > f64::from(*range.end()) {
            let expected = format!("{} to {}", range.start(), range.end());
            return Err(param.error(number, &expected));
        }
        Ok(number as u32)
    }

    /// One truth value, or `default`.
    pub fn bool_or(&self, name: &str, default: bool) -> Result<bool> {
        let Some(param) = self.typed(name, &[ParameterType::Bool], "bool")? else { return Ok(default) };
        match &param.values {
            Values::Bools(bools) => param.single(bools).copied(),
            _ => Err(param.error("not a truth value", "true or false")),
        }
    }

    /// One string.
    pub fn string(&self, name: &str) -> Result<Option<&str>> {
        let param = self.typed(name, &[ParameterType::String], "string")?;
        param.map(|param| param.single(param.strings()).map(String::as_str)).transpose()
    }

    /// A list of strings.
    pub fn strings(&self, name: &str) -> Result<Option<&[String]>> {
        Ok(self.typed(name, &[ParameterType::String], "string")?.map(Parameter::strings))
    }

    /// Points or vectors in the plane.
    pub fn pairs(&self, name: &str) -> Result<Option<Vec<DVec2>>> {
        let types = [ParameterType::Point2, ParameterType::Vector2, ParameterType::Float];
        let Some(param) = self.typed(name, &types, "point2")? else { return Ok(None) };
        Ok(Some(param.groups::<2>()?.map(|&[x, y]| DVec2::new(x, y)).collect()))
    }

    /// Points, vectors or normals in space.
    pub fn triples(&self, name: &str) -> Result<Option<Vec<DVec3>>> {
        let types = [ParameterType::Point3, ParameterType::Vector3, ParameterType::Normal3];
        let Some(param) = self.typed(name, &types, "point3, vector3 or normal")? else { return Ok(None) };
        Ok(Some(param.groups::<3>()?.map(|&[x, y, z]| DVec3::new(x, y, z)).collect()))
    }

    /// One point, vector or normal in space, or `default`.
    pub fn triple_or(&self, name: &str, default: DVec3) -> Result<DVec3> {
        match self.triples(name)?.as_deref() {
            None => Ok(default),
            Some([point]) => Ok(*point),
            Some(points) => Err(self
                .get(name)
                .expect("its numbers were just found")
                .error(format_args!("a list of {} numbers", 3 * points.len()), "three numbers")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn params(text: &str) -> Result<ParameterDictionary> {
        ParameterDictionary::parse(&mut Lexer::new(text.as_bytes(), 0), FileLoc::default())
    }

    #[test]
    fn equal_defaults_are_shared() {
        let mut defaults = AttributeDefaults::default();
        defaults.extend(params(r#""float a" 2"#).unwrap().into_parameters());
        let defaults = Rc::new(defaults);
        let shapes: Vec<ParameterDictionary> =
            (0..9).map(|_| ParameterDictionary::empty(FileLoc::default()).with_defaults(&defaults)).collect();
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
    fn parameters_that_are_not_looked_up_are_unused() {
        let params = params(r#""float a" 2 "float b" 3"#).unwrap();
        params.float("a").unwrap();
        assert_eq!(params.unused().map(|p| p.name.as_str()).collect::<Vec<_>>(), ["b"]);
    }

    #[test]
    fn wrong_types_counts_and_ranges_are_errors_at_the_parameter() {
        let params = params("\n \"rgb a\" [1 1 1] \"point3 b\" [1 2] \"integer c\" 1.5").unwrap();
        let error = params.float("a").unwrap_err();
        assert_eq!((error.loc.line, error.loc.column), (2, 2));
        assert_eq!(error.message, "parameter \"a\" is of type rgb; expected float");
        assert!(params.triples("b").is_err());
        assert!(params.integer_in("c", 0, 0..=9).is_err());
    }

    #[test]
    fn values_of_the_wrong_type_are_errors() {
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
