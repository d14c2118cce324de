//! Converts header attributes between this crate's types and those of the `exr` crate.

use exr::meta::attribute::{AttributeValue, Text};
use exr::meta::header::LayerAttributes;

/// An attribute of a supported type. Reading ignores attributes of other types.
#[derive(Clone, Debug, PartialEq)]
pub enum Attribute {
    /// UTF-8; EXR type `string`.
    Text(String),
    Int(i32),
    Float(f32),
    /// EXR has no list of integers; the EXR type is `stringvector` with one decimal number per string.
    Ints(Vec<i64>),
}

impl Attribute {
    fn to_exr(&self) -> AttributeValue {
        match self {
            Self::Text(value) => AttributeValue::Text(text(value)),
            Self::Int(value) => AttributeValue::I32(*value),
            Self::Float(value) => AttributeValue::F32(*value),
            // EXR allows no empty vector, so one empty string represents it.
            Self::Ints(values) if values.is_empty() => AttributeValue::TextVector(vec![text("")]),
            Self::Ints(values) => {
                AttributeValue::TextVector(values.iter().map(|value| text(&value.to_string())).collect())
            }
        }
    }

    fn from_exr(value: &AttributeValue) -> Option<Self> {
        match value {
            AttributeValue::Text(value) => Some(Self::Text(string(value))),
            AttributeValue::I32(value) => Some(Self::Int(*value)),
            AttributeValue::F32(value) => Some(Self::Float(*value)),
            AttributeValue::TextVector(values) => {
                let texts = values.iter().map(string).filter(|text| !text.is_empty());
                let numbers = texts.map(|text| text.parse().ok());
                numbers.collect::<Option<_>>().map(Self::Ints)
            }
            _ => None,
        }
    }
}

/// Encodes a string as UTF-8 bytes, as is usual with EXR.
pub(super) fn text(value: &str) -> Text {
    Text::from_slice_unchecked(value.as_bytes())
}

/// Decodes EXR text as UTF-8, replacing invalid bytes.
pub(super) fn string(value: &Text) -> String {
    String::from_utf8_lossy(value.as_slice()).into_owned()
}

/// The field of a standard text attribute, which the `exr` crate refuses among other attributes.
fn standard_text<'a>(header: &'a mut LayerAttributes, name: &str) -> Option<&'a mut Option<Text>> {
    match name {
        "comments" => Some(&mut header.comments),
        "owner" => Some(&mut header.owner),
        "software" => Some(&mut header.software_name),
        "capDate" => Some(&mut header.capture_date),
        _ => None,
    }
}

/// The names that [`standard_text`] knows.
const STANDARD_TEXTS: [&str; 4] = ["comments", "owner", "software", "capDate"];

/// Adds attributes to a header. Of attributes with equal names the last one counts.
pub(super) fn insert(header: &mut LayerAttributes, attributes: &[(String, Attribute)]) {
    for (name, attribute) in attributes {
        match (standard_text(header, name), attribute) {
            (Some(field), Attribute::Text(value)) => *field = Some(text(value)),
            _ => {
                header.other.insert(text(name), attribute.to_exr());
            }
        }
    }
}

/// All attributes of supported types, sorted by name.
pub(super) fn extract(mut header: LayerAttributes) -> Vec<(String, Attribute)> {
    let mut attributes: Vec<_> = header
        .other
        .iter()
        .filter_map(|(name, value)| Some((string(name), Attribute::from_exr(value)?)))
        .collect();
    for name in STANDARD_TEXTS {
        if let Some(Some(value)) = standard_text(&mut header, name) {
            attributes.push((name.to_string(), Attribute::Text(string(value))));
        }
    }
    attributes.sort_by(|a, b| a.0.cmp(&b.0));
    attributes
}
