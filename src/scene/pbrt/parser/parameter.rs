//! A single parameter: a type, a name and values.

use std::cell::Cell;

use super::{FileLoc, Lexer, ParameterType, ParseError, Result, TokenKind};

/// Values of a parameter.
#[derive(Clone, Debug)]
pub enum Values {
    Numbers(Vec<f64>),
    Strings(Vec<String>),
    Bools(Vec<bool>),
}

/// A parameter as declared: `"type name" [ values ]`.
#[derive(Clone, Debug)]
pub struct Parameter {
    pub kind: ParameterType,
    /// The type as the file spells it, for messages.
    pub type_name: String,
    pub name: String,
    pub values: Values,
    pub loc: FileLoc,
    /// Set when the parameter is looked up, so that unused parameters can be reported.
    pub used: Cell<bool>,
}

impl Parameter {
    /// Parses the values that follow `declared`, the quoted type and name at `loc`.
    pub fn parse(lexer: &mut Lexer, declared: &str, loc: FileLoc) -> Result<Self> {
        // Split the declaration into type and name
        let mut words = declared.split_whitespace();
        let (Some(type_name), Some(name), None) = (words.next(), words.next(), words.next()) else {
            let message = format!("\"{declared}\" is not a parameter declaration; expected \"type name\"");
            return Err(ParseError::new(loc, message));
        };
        let Some(kind) = ParameterType::from_name(type_name) else {
            let message = format!(
                "unknown parameter type \"{type_name}\"; expected float, integer, bool, string, texture, rgb, \
                 spectrum, blackbody, point2, point3, vector2, vector3 or normal"
            );
            return Err(ParseError::new(loc, message));
        };

        // Parse the values and check them against the declared type
        let values = parse_values(lexer, kind, loc)?;
        let fits = match kind {
            _ if matches!(&values, Values::Numbers(numbers) if numbers.is_empty()) => true,
            ParameterType::Bool => matches!(values, Values::Bools(_)),
            ParameterType::String | ParameterType::Texture => matches!(values, Values::Strings(_)),
            ParameterType::Spectrum => matches!(values, Values::Strings(_) | Values::Numbers(_)),
            _ => matches!(values, Values::Numbers(_)),
        };

        // Report values of the wrong type at the parameter
        let param = Self {
            kind,
            type_name: type_name.into(),
            name: name.into(),
            values,
            loc,
            used: Cell::new(false),
        };
        if !fits {
            let (found, expected) = match (&param.values, kind) {
                (Values::Numbers(_), ParameterType::Bool) => ("a list of numbers", "true or false"),
                (Values::Numbers(_), _) => ("a list of numbers", "quoted strings"),
                (Values::Strings(_), ParameterType::Bool) => ("a list of strings", "true or false"),
                (Values::Strings(_), _) => ("a list of strings", "numbers"),
                (Values::Bools(_), ParameterType::String | ParameterType::Texture) => {
                    ("a list of truth values", "quoted strings")
                }
                (Values::Bools(_), _) => ("a list of truth values", "numbers"),
            };
            return Err(param.error(found, expected));
        }
        Ok(param)
    }

    /// The numeric values; empty if the values are not numeric.
    pub fn numbers(&self) -> &[f64] {
        if let Values::Numbers(numbers) = &self.values { numbers } else { &[] }
    }

    /// The string values; empty if the values are not strings.
    pub fn strings(&self) -> &[String] {
        if let Values::Strings(strings) = &self.values { strings } else { &[] }
    }

    /// An error at this parameter that states what was found and what was expected.
    pub fn error(&self, found: impl std::fmt::Display, expected: &str) -> ParseError {
        let message = format!("parameter \"{}\" is {found}; expected {expected}", self.name);
        ParseError::new(self.loc, message)
    }

    /// The numeric values in groups of `N`.
    pub fn groups<const N: usize>(&self) -> Result<impl ExactSizeIterator<Item = &[f64; N]>> {
        let (groups, rest) = self.numbers().as_chunks::<N>();
        match rest {
            [] => Ok(groups.iter()),
            _ => Err(self.error(
                format_args!("a list of {} numbers", self.numbers().len()),
                &format!("a multiple of {N}"),
            )),
        }
    }

    /// The single element of `values`, which are this parameter's values.
    pub fn single<'v, T>(&self, values: &'v [T]) -> Result<&'v T> {
        match values {
            [value] => Ok(value),
            _ => Err(self.error(format_args!("a list of {} values", values.len()), "one value")),
        }
    }
}

/// Parses one value, or several in brackets.
fn parse_values(lexer: &mut Lexer, kind: ParameterType, loc: FileLoc) -> Result<Values> {
    let bracketed = lexer.next_if(|kind| (*kind == TokenKind::Open).then_some(()))?.is_some();
    let mut values: Option<Values> = None;
    // Older files quote truth values
    let truth = |token: &TokenKind| match token {
        TokenKind::Word(text) => text.parse().ok(),
        TokenKind::Quoted(text) if kind == ParameterType::Bool => text.parse().ok(),
        _ => None,
    };

    // Parse values until the closing bracket, all of the type of the first
    loop {
        let Some(token) = lexer.next()? else {
            return Err(ParseError::new(loc, "the file ends inside this parameter; expected values and `]`"));
        };
        if bracketed && token.kind == TokenKind::Close {
            return Ok(values.unwrap_or(Values::Numbers(Vec::new())));
        }
        let unexpected = |expected: &str| {
            ParseError::new(token.loc, format!("unexpected {}; expected {expected}", token.kind.describe()))
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
            (Some(Values::Strings(_)), _) => return Err(unexpected("a quoted string or `]`")),
            (None, _) => return Err(unexpected("a number, a quoted string, true or false")),
        }
        if !bracketed {
            return Ok(values.expect("a value was just read"));
        }
    }
}
