//! A directive with its arguments.

use super::{FileLoc, Lexer, ParameterDictionary, ParseError, Result, TokenKind};

/// A directive with its arguments, not yet carried out.
#[derive(Clone, Debug)]
pub struct Statement {
    pub name: &'static str,
    pub loc: FileLoc,
    pub strings: Vec<String>,
    pub numbers: Vec<f64>,
    pub params: ParameterDictionary,
}

/// Arguments that a directive takes.
#[derive(Clone, Copy, Debug)]
pub enum Arguments {
    Nothing,
    /// This many numbers, with or without brackets.
    Numbers(usize),
    /// One unquoted word.
    Word,
    /// This many quoted strings.
    Strings(usize),
    /// One or two quoted strings.
    OneOrTwoStrings,
    /// This many quoted strings, then parameters.
    Parameters(usize),
    /// A quoted name and one value of any type, as pbrt-v4 reads an `Option`, or parameters. The name becomes the only
    /// string.
    NameAndValue,
}

impl Statement {
    /// Parses the arguments of the directive `name` at `loc`.
    pub fn parse(lexer: &mut Lexer, name: &'static str, arguments: Arguments, loc: FileLoc) -> Result<Self> {
        let mut statement = Self {
            name,
            loc,
            strings: Vec::new(),
            numbers: Vec::new(),
            params: ParameterDictionary::empty(loc),
        };
        match arguments {
            Arguments::Nothing => {}
            Arguments::Numbers(count) => statement.numbers = parse_numbers(lexer, name, count, loc)?,
            Arguments::Word => {
                let word = lexer.next_if(|kind| match kind {
                    TokenKind::Word(word) => Some(word.to_string()),
                    _ => None,
                })?;
                statement.strings.push(word.ok_or_else(|| missing(lexer, name, "a word", loc))?);
            }
            Arguments::Strings(count) => statement.strings = parse_strings(lexer, name, count, loc)?,
            Arguments::OneOrTwoStrings => {
                statement.strings = parse_strings(lexer, name, 1, loc)?;
                statement.strings.extend(quoted(lexer)?);
            }
            Arguments::Parameters(count) => {
                statement.strings = parse_strings(lexer, name, count, loc)?;
                statement.params = ParameterDictionary::parse(lexer, loc)?;
            }
            Arguments::NameAndValue => {
                let name_only = lexer.next_if(|kind| match kind {
                    TokenKind::Quoted(text) if !text.contains(char::is_whitespace) => Some(text.to_string()),
                    _ => None,
                })?;
                match name_only {
                    Some(option) => {
                        statement.strings.push(option);
                        let value = lexer.next_if(|kind| {
                            (!matches!(kind, TokenKind::Open | TokenKind::Close)).then_some(())
                        })?;
                        value.ok_or_else(|| missing(lexer, name, "a value", loc))?;
                    }
                    None => statement.params = ParameterDictionary::parse(lexer, loc)?,
                }
            }
        }
        Ok(statement)
    }
}

/// The error for a missing argument, located at the token in its place.
fn missing(lexer: &mut Lexer, name: &str, expected: &str, loc: FileLoc) -> ParseError {
    match lexer.peek() {
        Err(error) => error,
        Ok(None) => ParseError::new(loc, format!("the file ends after {name}; expected {expected}")),
        Ok(Some(token)) => {
            let found = token.kind.describe();
            ParseError::new(token.loc, format!("unexpected {found} after {name}; expected {expected}"))
        }
    }
}

/// The next token if it is a quoted string.
fn quoted(lexer: &mut Lexer) -> Result<Option<String>> {
    lexer.next_if(|kind| match kind {
        TokenKind::Quoted(text) => Some(text.to_string()),
        _ => None,
    })
}

fn parse_strings(lexer: &mut Lexer, name: &str, count: usize, loc: FileLoc) -> Result<Vec<String>> {
    (0..count)
        .map(|_| match quoted(lexer)? {
            Some(text) => Ok(text),
            None => Err(missing(lexer, name, "a quoted string", loc)),
        })
        .collect()
}

fn parse_numbers(lexer: &mut Lexer, name: &str, count: usize, loc: FileLoc) -> Result<Vec<f64>> {
    let is = |wanted: TokenKind<'static>| move |kind: &TokenKind| (*kind == wanted).then_some(());
    let bracketed = lexer.next_if(is(TokenKind::Open))?.is_some();
    let mut numbers = Vec::with_capacity(count);
    for _ in 0..count {
        let number = lexer.next_if(|kind| match kind {
            TokenKind::Number(number) => Some(*number),
            _ => None,
        })?;
        let expected = || format!("{count} numbers");
        numbers.push(number.ok_or_else(|| missing(lexer, name, &expected(), loc))?);
    }
    if bracketed && lexer.next_if(is(TokenKind::Close))?.is_none() {
        return Err(missing(lexer, name, &format!("`]` after {count} numbers"), loc));
    }
    Ok(numbers)
}
