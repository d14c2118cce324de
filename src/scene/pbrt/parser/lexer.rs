//! Splits scene text into tokens. All dialects share the token syntax.

use std::borrow::Cow;

use super::{FileLoc, ParseError, Result};

/// A token's kind and value. Text is borrowed from the file unless it has escapes.
#[derive(Clone, Debug, PartialEq)]
pub enum TokenKind<'a> {
    /// A directive, or an unquoted value such as `true`.
    Word(Cow<'a, str>),
    /// A quoted string, without its quotes.
    Quoted(Cow<'a, str>),
    Number(f64),
    Open,
    Close,
}

impl TokenKind<'_> {
    /// Describes the token for messages.
    pub fn describe(&self) -> String {
        match self {
            TokenKind::Word(word) => format!("`{}`", excerpt(word)),
            TokenKind::Quoted(text) => format!("\"{}\"", excerpt(text)),
            TokenKind::Number(number) => format!("number {number}"),
            TokenKind::Open => "`[`".into(),
            TokenKind::Close => "`]`".into(),
        }
    }
}

/// The start of a token with control characters escaped, because the file may be binary.
fn excerpt(text: &str) -> String {
    const LONGEST: usize = 40;
    let printable = |c: char| if c.is_control() { c.escape_default().to_string() } else { c.to_string() };
    let start: String = text.chars().take(LONGEST).map(printable).collect();
    if text.chars().nth(LONGEST).is_some() { start + "..." } else { start }
}

/// A token and its location.
#[derive(Clone, Debug, PartialEq)]
pub struct Token<'a> {
    pub loc: FileLoc,
    pub kind: TokenKind<'a>,
}

/// Splits a file into tokens, with one token of look-ahead.
pub struct Lexer<'a> {
    text: &'a [u8],
    at: usize,
    /// The file, the line and the offset of the line's start at `at`.
    file: u32,
    line: u32,
    line_start: usize,
    peeked: Option<Token<'a>>,
}

impl<'a> Lexer<'a> {
    /// A lexer over `text`; `file` is the file's index, for locations.
    pub fn new(text: &'a [u8], file: u32) -> Self {
        // Skip a byte order mark
        let at = if text.starts_with(b"\xef\xbb\xbf") { 3 } else { 0 };
        Self { text, at, file, line: 1, line_start: at, peeked: None }
    }

    /// The location of the next byte.
    fn loc(&self) -> FileLoc {
        FileLoc { file: self.file, line: self.line, column: (self.at - self.line_start + 1) as u32 }
    }

    /// Returns the next token without consuming it; `None` at the end of the file.
    pub fn peek(&mut self) -> Result<Option<&Token<'a>>> {
        if self.peeked.is_none() {
            self.peeked = self.lex()?;
        }
        Ok(self.peeked.as_ref())
    }

    /// Consumes the next token; `None` at the end of the file.
    pub fn next(&mut self) -> Result<Option<Token<'a>>> {
        match self.peeked.take() {
            Some(token) => Ok(Some(token)),
            None => self.lex(),
        }
    }

    /// Consumes the next token if `accept` returns a value for it.
    pub fn next_if<T>(&mut self, accept: impl FnOnce(&TokenKind<'a>) -> Option<T>) -> Result<Option<T>> {
        let accepted = self.peek()?.and_then(|token| accept(&token.kind));
        if accepted.is_some() {
            self.peeked = None;
        }
        Ok(accepted)
    }

    fn lex(&mut self) -> Result<Option<Token<'a>>> {
        self.skip_blanks();
        let loc = self.loc();
        let Some(&first) = self.text.get(self.at) else { return Ok(None) };
        let kind = match first {
            b'[' => {
                self.at += 1;
                TokenKind::Open
            }
            b']' => {
                self.at += 1;
                TokenKind::Close
            }
            b'"' => TokenKind::Quoted(self.quoted(loc)?),
            _ => self.word(loc)?,
        };
        Ok(Some(Token { loc, kind }))
    }

    fn skip_blanks(&mut self) {
        while let Some(&byte) = self.text.get(self.at) {
            match byte {
                b'\n' => {
                    self.at += 1;
                    self.line += 1;
                    self.line_start = self.at;
                }
                b'#' => {
                    let rest = &self.text[self.at..];
                    self.at += rest.iter().position(|b| b"\n\r".contains(b)).unwrap_or(rest.len());
                }
                _ if byte.is_ascii_whitespace() => self.at += 1,
                _ => break,
            }
        }
    }

    /// Lexes a word or number, which ends at a blank, a bracket, a quote or a comment.
    fn word(&mut self, loc: FileLoc) -> Result<TokenKind<'a>> {
        let rest = &self.text[self.at..];
        let ends = |b: &u8| b.is_ascii_whitespace() || matches!(b, b'[' | b']' | b'"' | b'#');
        let word = &rest[..rest.iter().position(ends).unwrap_or(rest.len())];
        self.at += word.len();
        let text = String::from_utf8_lossy(word);
        if !matches!(word[0], b'0'..=b'9' | b'+' | b'-' | b'.') {
            return Ok(TokenKind::Word(text));
        }
        match text.parse::<f64>() {
            // Most values are stored as `f32`, which must hold them
            Ok(number) if (number as f32).is_finite() => Ok(TokenKind::Number(number)),
            _ => Err(ParseError::new(
                loc,
                format!("`{text}` is not a number; expected a number up to {:e}", f32::MAX),
            )),
        }
    }

    /// Lexes a quoted string.
    fn quoted(&mut self, loc: FileLoc) -> Result<Cow<'a, str>> {
        let start = self.at + 1;
        let mut end = start;
        let mut escaped = false;
        loop {
            match self.text.get(end) {
                Some(b'"') => break,
                Some(b'\\') if self.text.get(end + 1) != Some(&b'\n') => {
                    escaped = true;
                    end += 2;
                }
                Some(b'\n') | None => {
                    return Err(ParseError::new(
                        loc,
                        "string without an end; expected `\"` on the same line",
                    ));
                }
                Some(_) => end += 1,
            }
        }
        self.at = end + 1;
        let raw = &self.text[start..end];
        Ok(if escaped { Cow::Owned(unescaped(raw)) } else { String::from_utf8_lossy(raw) })
    }
}

/// Resolves backslash escapes.
fn unescaped(raw: &[u8]) -> String {
    let mut bytes = Vec::with_capacity(raw.len());
    let mut rest = raw.iter();
    while let Some(&byte) = rest.next() {
        bytes.push(match (byte, byte == b'\\') {
            (_, true) => match rest.next() {
                Some(b'n') => b'\n',
                Some(b't') => b'\t',
                Some(b'r') => b'\r',
                Some(&other) => other,
                None => b'\\',
            },
            (byte, false) => byte,
        });
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tokens(text: &str) -> Vec<Token<'_>> {
        let mut lexer = Lexer::new(text.as_bytes(), 0);
        std::iter::from_fn(|| lexer.next().unwrap()).collect()
    }

    fn kinds(text: &str) -> Vec<TokenKind<'_>> {
        tokens(text).into_iter().map(|token| token.kind).collect()
    }

    #[test]
    fn tokens_of_every_kind_are_recognised() {
        use TokenKind::*;
        let expected = [
            Word("Shape".into()),
            Quoted("float radius".into()),
            Open,
            Number(-0.5),
            Number(1e3),
            Number(2.0),
            Close,
            Word("true".into()),
        ];
        assert_eq!(kinds("Shape \"float radius\"[-.5 1e3 +2.]true# \" [ comment"), expected);
    }

    #[test]
    fn escapes_in_strings_are_resolved() {
        assert_eq!(kinds(r#""a\"b\\c""#), [TokenKind::Quoted(r#"a"b\c"#.into())]);
    }

    #[test]
    fn lines_and_columns_are_counted_from_one() {
        let locs: Vec<_> = tokens("# c\n  A\n\tB C").iter().map(|t| (t.loc.line, t.loc.column)).collect();
        assert_eq!(locs, [(2, 3), (3, 2), (3, 4)]);
    }

    #[test]
    fn invalid_numbers_and_unterminated_strings_are_errors() {
        for text in ["1.2.3", "1e39", "1e999", "-", "\"abc\ndef\"", "\"abc\\\ndef\"", "\"abc\\"] {
            assert!(Lexer::new(text.as_bytes(), 0).next().is_err(), "{text}");
        }
    }
}
