//! One-line messages about a wrong command line: what was found, and what is accepted.

use clap::error::{ContextKind, ContextValue, Error, ErrorKind};

use super::terminal::escaped;

/// Returns clap's message in one line.
pub(super) fn one_line(error: &Error) -> String {
    // Describe what was found
    let text = |kind| match error.get(kind) {
        Some(ContextValue::String(text)) => Some(text.clone()),
        Some(ContextValue::Strings(list)) if !list.is_empty() => Some(list.join(", ")),
        Some(ContextValue::Number(number)) => Some(number.to_string()),
        _ => None,
    };
    let argument = text(ContextKind::InvalidArg).unwrap_or_default();
    let value = text(ContextKind::InvalidValue).filter(|value| !value.is_empty());
    let found = match (error.kind(), value) {
        (ErrorKind::UnknownArgument, _) => format!("found `{argument}`, which is no option"),
        (ErrorKind::InvalidSubcommand, _) => {
            format!(
                "found `{}`, which is no command",
                text(ContextKind::InvalidSubcommand).unwrap_or_default()
            )
        }
        (ErrorKind::MissingRequiredArgument, _) => format!("found no {argument}"),
        (ErrorKind::ArgumentConflict, _) => {
            format!("found `{argument}` twice, or with an option that it conflicts with")
        }
        (ErrorKind::TooFewValues, _) => {
            let number = |kind| text(kind).unwrap_or_default();
            let (found, least) = (number(ContextKind::ActualNumValues), number(ContextKind::MinValues));
            format!("{argument}: found {found}, and at least {least} are needed")
        }
        (_, Some(value)) => format!("{argument}: found `{value}`"),
        (ErrorKind::InvalidValue | ErrorKind::ValueValidation, None) => format!("{argument}: found no value"),
        _ => error.kind().to_string(),
    };

    // Describe what is accepted
    let suggested =
        [ContextKind::SuggestedArg, ContextKind::SuggestedSubcommand, ContextKind::SuggestedValue]
            .into_iter()
            .find_map(text);
    let valid = text(ContextKind::ValidValue).or_else(|| text(ContextKind::ValidSubcommand));
    let reason = std::error::Error::source(error).map(ToString::to_string);
    let accepted = match (reason, valid, suggested) {
        // The message of one of our own parsers is complete.
        (Some(reason), ..) if reason.contains("accepted") => {
            return escaped(&format!("{argument}: {reason}"));
        }
        (Some(reason), ..) => format!("{reason}; accepted are whole numbers in the option's range"),
        (None, Some(valid), _) => format!("accepted are {valid}"),
        (None, None, Some(suggested)) => format!("accepted is `{suggested}`, and what --help lists"),
        (None, None, None) => "accepted is what --help lists".to_owned(),
    };
    escaped(&format!("{found}; {accepted}"))
}
