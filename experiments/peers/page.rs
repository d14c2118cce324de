//! The page of a comparison: a document with its style, its program and all images in it.

use super::Scene;

const DOCUMENT: &str = include_str!("page.html");
/// Stands in the document for the data.
const PLACE: &str = "/*SCENES*/";

/// Returns the document with the scenes' data.
///
/// # Errors
/// Those of encoding the data.
pub fn html(scenes: &[Scene]) -> anyhow::Result<String> {
    // A name must not end the script.
    let data = serde_json::to_string(scenes)?.replace('<', "\\u003c");
    Ok(DOCUMENT.replacen(PLACE, &data, 1))
}
