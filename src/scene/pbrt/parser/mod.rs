//! Parses scene files: text → tokens → statements with typed parameters.
//!
//! Nothing here knows what a directive does.

mod attribute_defaults;
mod file_loc;
mod lexer;
mod parameter;
mod parameter_dictionary;
mod parameter_type;
mod parse_error;
mod statement;
mod warnings;

pub use self::attribute_defaults::AttributeDefaults;
pub use self::file_loc::{FileLoc, format_position};
pub use self::lexer::{Lexer, TokenKind};
pub use self::parameter::{Parameter, Values};
pub use self::parameter_dictionary::ParameterDictionary;
pub use self::parameter_type::ParameterType;
pub use self::parse_error::{ParseError, Result};
pub use self::statement::{Arguments, Statement};
pub use self::warnings::Warnings;
