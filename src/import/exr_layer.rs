//! The layers of an EXR: channels of one part whose names differ in their last component only.
//!
//! `ViewLayer.Denoising Albedo.R` belongs to the layer `ViewLayer.Denoising Albedo`, `R` to the layer without a name. Of a
//! file with several parts the part's name precedes those of channels that do not begin with it.

use crate::image::exr_file::ExrPart;

/// A layer.
#[derive(Clone, Debug, PartialEq)]
pub struct ExrLayer {
    /// Empty for the layer without a name.
    pub name: String,
    /// The part that holds it.
    pub part: usize,
    /// Last component and full name of each channel.
    channels: Vec<(String, String)>,
}

impl ExrLayer {
    /// Returns the full names of three channels, R G B, in full as Nuke writes them, or X Y Z, in either case; `None` if the
    /// layer lacks them.
    pub fn triple(&self) -> Option<[&str; 3]> {
        let triples = [["R", "G", "B"], ["red", "green", "blue"], ["X", "Y", "Z"]];
        let found = triples.map(|suffixes| suffixes.map(|suffix| find(&self.channels, suffix)));
        found.into_iter().find_map(|[a, b, c]| Some([a?, b?, c?]))
    }

    /// Returns the full name of the channel Z, or of the only channel of a layer that has a name: without one it may be an alpha.
    pub fn single(&self) -> Option<&str> {
        match self.channels.as_slice() {
            [(_, only)] if !self.name.is_empty() => Some(only),
            several => find(several, "Z"),
        }
    }

    /// Returns the full name of the alpha channel.
    pub fn alpha(&self) -> Option<&str> {
        find(&self.channels, "A").or_else(|| find(&self.channels, "alpha"))
    }

    /// Returns the name without its last component: what Blender calls a view layer.
    pub fn group(&self) -> &str {
        self.name.rsplit_once('.').map_or("", |(group, _)| group)
    }

    /// Returns the last components of the channels' names, for a message.
    pub fn suffixes(&self) -> String {
        self.channels.iter().map(|(suffix, _)| suffix.as_str()).collect::<Vec<_>>().join(" ")
    }

    /// Returns the last component of the name that says what the layer holds, in lower case without spaces, underscores and
    /// the endings by which renderers mark inputs of denoisers.
    pub fn key(&self) -> String {
        let is_axis = |component: &&str| ["x", "y", "z"].contains(&component.to_lowercase().as_str());
        let components: Vec<&str> = self.name.split('.').collect();
        // Mitsuba's documentation names a depth `dd.y`.
        let last = components.iter().rev().find(|component| components.len() == 1 || !is_axis(component));
        let key = last.map_or(String::new(), |last| last.to_lowercase());
        let key =
            ["_noice", "_denoise"].into_iter().fold(key.as_str(), |key, ending| key.trim_end_matches(ending));
        key.replace([' ', '_'], "")
    }
}

/// Returns the full name of the channel of a last component, in either case.
fn find<'a>(channels: &'a [(String, String)], suffix: &str) -> Option<&'a str> {
    let found = channels.iter().find(|(found, _)| found.eq_ignore_ascii_case(suffix));
    found.map(|(_, channel)| channel.as_str())
}

/// Returns the layers of a file's parts, in the order of the parts, sorted by name in each.
pub fn layers(parts: &[ExrPart]) -> Vec<ExrLayer> {
    let mut layers: Vec<ExrLayer> = Vec::new();
    for (index, part) in parts.iter().enumerate() {
        let part_name = part.name.as_deref().filter(|_| parts.len() > 1).unwrap_or_default();
        for channel in &part.info.channels {
            let (name, suffix) = split(channel, &part.info.channels);
            let is_complete = name.starts_with(part_name) || part_name.is_empty();
            let name = match (is_complete, name) {
                (true, name) => name.to_owned(),
                (false, "") => part_name.to_owned(),
                (false, name) => format!("{part_name}.{name}"),
            };
            let entry = (suffix.to_owned(), channel.clone());
            match layers.iter_mut().find(|layer| layer.part == index && layer.name == name) {
                Some(layer) => layer.channels.push(entry),
                None => layers.push(ExrLayer { name, part: index, channels: vec![entry] }),
            }
        }
    }
    layers
}

/// Splits a channel's name into those of layer and component: at the last dot, or, as earlier versions of pbrt write
/// `Nsx`, before a final x, y or z that occurs with the two others. A longer name without a dot is that of a layer of one channel, as
/// RenderMan writes its depth.
fn split<'a>(channel: &'a str, all: &[String]) -> (&'a str, &'a str) {
    if let Some(parts) = channel.rsplit_once('.') {
        return parts;
    }
    let base = channel.strip_suffix(['x', 'y', 'z']).filter(|base| !base.is_empty());
    let is_triple = |base: &&str| {
        ["x", "y", "z"].iter().all(|axis| all.iter().any(|name| *name == format!("{base}{axis}")))
    };
    match base.filter(is_triple) {
        Some(base) => (base, &channel[base.len()..]),
        None if channel.len() > 1 => (channel, channel),
        None => ("", channel),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::exr_file::{ExrInfo, Windows};

    fn part(name: Option<&str>, channels: &[&str]) -> ExrPart {
        let channels = channels.iter().map(|&channel| channel.to_owned()).collect();
        let windows = Windows::whole(1, 1);
        let info =
            ExrInfo { width: 1, height: 1, windows, channels, attributes: Vec::new(), primaries: None };
        ExrPart { name: name.map(str::to_owned), info }
    }

    fn names(parts: &[ExrPart]) -> Vec<String> {
        layers(parts).into_iter().map(|layer| layer.name).collect()
    }

    #[test]
    fn channels_are_grouped_by_layer() {
        let single =
            part(Some("any"), &["A", "B", "G", "Nsx", "Nsy", "Nsz", "P.X", "P.Y", "P.Z", "R", "dzdx"]);
        let found = layers(&[single]);
        assert_eq!(
            found.iter().map(|layer| layer.name.as_str()).collect::<Vec<_>>(),
            ["", "Ns", "P", "dzdx"]
        );
        assert_eq!(found[0].triple(), Some(["R", "G", "B"]));
        assert_eq!(found[1].triple(), Some(["Nsx", "Nsy", "Nsz"]));
        assert_eq!(found[2].triple(), Some(["P.X", "P.Y", "P.Z"]));
        assert_eq!((found[3].single(), found[0].alpha()), (Some("dzdx"), Some("A")));
        let alpha = layers(&[part(None, &["Ci.r", "Ci.g", "Ci.b", "a"])]);
        assert_eq!((alpha[1].name.as_str(), alpha[1].single()), ("", None));
    }

    #[test]
    fn parts_name_their_layers() {
        let cycles = part(Some("View.Combined"), &["View.Combined.R", "View.Combined.G", "View.Combined.B"]);
        let depth = part(Some("View.Depth"), &["View.Depth.Z"]);
        let bare = part(Some("albedo"), &["R", "G", "B", "x.R"]);
        let parts = [cycles, depth, bare];
        assert_eq!(names(&parts), ["View.Combined", "View.Depth", "albedo", "albedo.x"]);
        assert_eq!(layers(&parts)[1].single(), Some("View.Depth.Z"));
        assert_eq!(layers(&parts)[2].part, 2);
    }

    #[test]
    fn keys_leave_out_what_differs_between_files() {
        let key = |name: &str| ExrLayer { name: name.to_owned(), part: 0, channels: Vec::new() }.key();
        assert_eq!(key("ViewLayer.Denoising Albedo"), "denoisingalbedo");
        assert_eq!(key("diffuse_albedo_noice"), "diffusealbedo");
        assert_eq!((key("dd.y"), key("z"), key("")), ("dd".into(), "z".into(), String::new()));
    }
}
