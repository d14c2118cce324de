//! Finds the layers that a denoiser reads by the names that renderers give them.
//!
//! Sources: pbrt-v4's gbuffer film (`film.cpp`), Blender's passes of Cycles, Mitsuba 3's `aov` integrator, Arnold's AOVs
//! (also with the endings `_noice` and `_denoise`), RenderMan's display channels for its denoiser.

use std::str::FromStr;

use super::exr_layer::ExrLayer;

/// A quantity that a denoiser needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    Colour,
    Albedo,
    Normal,
    Position,
    Depth,
    /// Variance of the pixel's mean.
    Variance,
    /// Variance of the samples.
    SampleVariance,
}

/// All roles with their names in `--map`, and the keys of layers that have them, the best first.
const TABLE: [(Role, &str, &[&str]); 7] = [
    (
        Role::Colour,
        "colour",
        &["noisy", "noisyimage", "combined", "", "rgba", "beauty", "rgb", "ci", "color", "colour", "image"],
    ),
    (
        Role::Albedo,
        "albedo",
        &[
            "denoisingalbedo",
            "denoisealbedo",
            "albedo",
            "alb",
            "diffusealbedo",
            "basecolor",
            "diffusecolor",
            "diffcol",
        ],
    ),
    (
        Role::Normal,
        "normal",
        &[
            "denoisingnormal",
            "ns",
            "nn",
            "shnormal",
            "shadingnormal",
            "normal",
            "normals",
            "n",
            "nrm",
            "geonormal",
        ],
    ),
    (Role::Position, "position", &["position", "p", "pp", "pos", "worldposition", "pworld"]),
    (Role::Depth, "depth", &["denoisingdepth", "depth", "z", "zdepth", "zfiltered", "dd", ""]),
    (Role::Variance, "variance", &["mse", "variance"]),
    (Role::SampleVariance, "sample-variance", &[]),
];

impl Role {
    /// Returns all roles.
    pub fn all() -> [Self; TABLE.len()] {
        TABLE.map(|(role, ..)| role)
    }

    /// Returns the name in `--map`.
    pub fn name(self) -> &'static str {
        self.row().1
    }

    fn row(self) -> (Self, &'static str, &'static [&'static str]) {
        TABLE[self as usize]
    }

    /// Returns the channels of a layer that has this role, three or one; `None` if it has others.
    pub fn channels(self, layer: &ExrLayer) -> Option<Vec<String>> {
        if self == Self::Depth {
            return layer.single().map(|channel| vec![channel.to_owned()]);
        }
        layer.triple().map(|channels| channels.map(str::to_owned).to_vec())
    }
}

/// The layers that a person names: for each role a layer, or `none`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LayerMap(Vec<(Role, String)>);

impl FromStr for LayerMap {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let names = TABLE.map(|(_, name, _)| name).join(", ");
        let item = |item: &str| {
            let error = || {
                format!(
                    "found `{item}`; accepted are ROLE=LAYER with the roles {names}, each once, and the layer none"
                )
            };
            let (role, layer) = item.split_once('=').ok_or_else(error)?;
            let role = TABLE.iter().find(|(_, name, _)| *name == role).ok_or_else(error)?.0;
            Ok((role, layer.to_owned()))
        };
        let items = text.split(',').map(item).collect::<Result<Vec<_>, String>>()?;
        match items
            .iter()
            .enumerate()
            .find(|(i, (role, _))| items[..*i].iter().any(|(other, _)| other == role))
        {
            Some((_, (role, _))) => Err(format!("found `{}` twice; accepted is each role once", role.name())),
            None => Ok(Self(items)),
        }
    }
}

impl LayerMap {
    /// Returns the layer of each role that a file has, in the order of [`Role::all`].
    ///
    /// # Errors
    /// A named layer that the file does not have, or that has other channels.
    pub fn find<'a>(&self, layers: &'a [ExrLayer]) -> Result<Vec<(Role, &'a ExrLayer)>, String> {
        let name_of =
            |role: Role| self.0.iter().find(|(named, _)| *named == role).map(|(_, name)| name.as_str());
        let is_of_samples = has_pbrts_variance(layers);
        let mut found: Vec<(Role, &ExrLayer)> = Vec::new();
        for role in Role::all() {
            let named = name_of(role);
            let colour = found.first().map(|(_, colour)| *colour);
            let layer = match named {
                Some("none") => None,
                Some(name) => Some(by_name(layers, name, colour, |layer| role.channels(layer).is_some())?),
                None => by_convention(layers, role, colour),
            };
            if !(role == Role::Variance && named.is_none() && is_of_samples) {
                found.extend(layer.map(|layer| (role, layer)));
            } else if name_of(Role::SampleVariance).is_none() {
                found.extend(layer.map(|layer| (Role::SampleVariance, layer)));
            }
        }
        Ok(found)
    }
}

/// Returns the layer of this name, or the one whose last component it is; of several such layers, that of the colour's group, if
/// the colour is known.
///
/// # Errors
/// There is none with the right channels, or several and none of the colour's group; the message lists what there is.
pub fn by_name<'a>(
    layers: &'a [ExrLayer],
    name: &str,
    colour: Option<&ExrLayer>,
    is_suitable: impl Fn(&ExrLayer) -> bool,
) -> Result<&'a ExrLayer, String> {
    let last = |layer: &ExrLayer| layer.name.rsplit('.').next() == Some(name);
    let names = |layers: &[&ExrLayer]| {
        let names: Vec<String> = layers.iter().map(|layer| format!("`{}`", layer.name)).collect();
        if names.is_empty() { "none".into() } else { names.join(", ") }
    };
    let suitable: Vec<&'a ExrLayer> = layers.iter().filter(|layer| is_suitable(layer)).collect();
    if let Some(layer) = suitable.iter().find(|layer| layer.name == name) {
        return Ok(layer);
    }
    let of_last: Vec<&'a ExrLayer> = suitable.iter().copied().filter(|layer| last(layer)).collect();
    let of_group = of_last.iter().find(|layer| colour.is_some_and(|colour| colour.group() == layer.group()));
    match (of_last.as_slice(), of_group) {
        (_, Some(layer)) | ([layer], None) => Ok(layer),
        ([], None) => {
            let found = match layers.iter().find(|layer| layer.name == name || last(layer)) {
                Some(layer) => format!("the layer `{}` with the channels {}", layer.name, layer.suffixes()),
                None => format!("no layer `{name}`"),
            };
            Err(format!("found {found}; accepted are {}", names(&suitable)))
        }
        (several, None) => Err(format!("found `{name}`; accepted is one of {}", names(several))),
    }
}

/// Returns whether the layer `Variance` is that of pbrt-v4, which has a relative one beside it: of the samples, by the responses of its
/// sensor.
pub fn has_pbrts_variance(layers: &[ExrLayer]) -> bool {
    layers.iter().any(|layer| layer.key() == "relativevariance")
}

/// Finds the layer of a role, among those that belong to the colour's. Blender's compositor makes an image of its own, which is the
/// colour only if there is no other.
fn by_convention<'a>(layers: &'a [ExrLayer], role: Role, colour: Option<&ExrLayer>) -> Option<&'a ExrLayer> {
    let is_composite = |layer: &ExrLayer| layer.group().ends_with("Composite");
    let has_combined = |layer: &&ExrLayer| layer.key() == "combined" && !is_composite(layer);
    let view_layers: Vec<&str> = layers.iter().filter(has_combined).map(ExrLayer::group).collect();
    // Features of another view layer are those of other things
    let is_of_others = |layer: &ExrLayer| {
        let own = colour.map(ExrLayer::group);
        view_layers.len() > 1
            && own.is_some_and(|own| own != layer.group())
            && view_layers.contains(&layer.group())
    };
    let find = |key: &str| {
        let has_role =
            |layer: &&ExrLayer| layer.key() == key && role.channels(layer).is_some() && !is_of_others(layer);
        layers.iter().filter(has_role).min_by_key(|layer| is_composite(layer))
    };
    role.row().2.iter().find_map(|key| find(key))
}

#[cfg(test)]
mod tests {
    use super::super::exr_layer::layers;
    use super::*;
    use crate::image::exr_file::{ExrInfo, ExrPart, Windows};

    /// Channels of layers: `name:RGB` stands for `name.R`, `name.G` and `name.B`.
    fn file(names: &[&str]) -> Vec<ExrLayer> {
        let expand = |name: &&str| -> Vec<String> {
            let Some((layer, suffixes)) = name.split_once(':') else { return vec![name.to_string()] };
            let full = |s: char| if layer.is_empty() { s.to_string() } else { format!("{layer}.{s}") };
            suffixes.chars().map(full).collect()
        };
        let channels = names.iter().flat_map(expand).collect();
        let windows = Windows::whole(1, 1);
        let info =
            ExrInfo { width: 1, height: 1, windows, channels, attributes: Vec::new(), primaries: None };
        layers(&[ExrPart { name: None, info }])
    }

    fn roles(map: &str, names: &[&str]) -> Result<Vec<String>, String> {
        let map = if map.is_empty() { LayerMap::default() } else { map.parse()? };
        let layers = file(names);
        let found = map.find(&layers)?;
        Ok(found.into_iter().map(|(role, layer)| format!("{}={}", role.name(), layer.name)).collect())
    }

    #[test]
    fn the_conventions_of_renderers_are_known() {
        let all = |names: &[&str]| roles("", names).unwrap().join(" ");
        assert_eq!(
            all(&[":RGB", "Albedo:RGB", "P:XYZ", "N:XYZ", "Ns:XYZ", "Variance:RGB", "RelativeVariance:RGB"]),
            "colour= albedo=Albedo normal=Ns position=P sample-variance=Variance"
        );
        assert_eq!(
            all(&[
                "V.Combined:RGBA",
                "V.Depth:Z",
                "V.Normal:XYZ",
                "V.Diffuse Color:RGB",
                "V.Denoising Normal:XYZ",
                "V.Denoising Albedo:RGB"
            ]),
            "colour=V.Combined albedo=V.Denoising Albedo normal=V.Denoising Normal depth=V.Depth"
        );
        assert_eq!(
            all(&[":RGB", "alb:RGB", "dd.y:T", "img:RGBA", "nn:XYZ", "pp:XYZ"]),
            "colour= albedo=alb normal=nn position=pp depth=dd.y"
        );
        assert_eq!(
            all(&[":RGBAZ", "diffuse_albedo_noice:RGB", "N_noice:XYZ", "variance:RGB"]),
            "colour= albedo=diffuse_albedo_noice normal=N_noice depth= variance=variance"
        );
        assert_eq!(
            all(&["Ci:rgb", ":a", "albedo:rgb", "normal:rgb", "mse:rgb", "zfiltered"]),
            "colour=Ci albedo=albedo normal=normal depth=zfiltered variance=mse"
        );
        assert_eq!(
            all(&["Composite.Combined:RGBA", "V.Combined:RGBA", "V.Denoising Albedo:RGB",]),
            "colour=V.Combined albedo=V.Denoising Albedo",
            "the compositor's image is not what was rendered"
        );
        assert_eq!(
            all(&[
                "BG.Combined:RGBA",
                "BG.Denoising Albedo:RGB",
                "BG.Denoising Normal:XYZ",
                "FG.Combined:RGBA",
                "FG.Noisy Image:RGB",
                "FG.Denoising Albedo:RGB",
            ]),
            "colour=FG.Noisy Image albedo=FG.Denoising Albedo",
            "features of another view layer are not used"
        );
        assert_eq!(
            all(&[":RGB", "Noisy:RGB", "Variance:RGB"]),
            "colour=Noisy variance=Variance",
            "the filtered image of this program is not what is denoised"
        );
    }

    #[test]
    fn a_map_comes_before_the_conventions() {
        let names = [":RGB", "a.b:RGB", "Albedo:RGB", "d:T"];
        let found = roles("colour=b,albedo=none,depth=d", &names).unwrap();
        assert_eq!(found, ["colour=a.b", "depth=d"]);
        let pbrts = [":RGB", "Variance:RGB", "RelativeVariance:RGB"];
        for map in ["sample-variance=none", "variance=none"] {
            assert_eq!(roles(map, &pbrts).unwrap(), ["colour="]);
        }
        let two = ["BG.Albedo:RGB", "FG.Combined:RGB", "FG.Noisy:RGB", "FG.Albedo:RGB"];
        assert_eq!(roles("albedo=Albedo", &two).unwrap(), ["colour=FG.Noisy", "albedo=FG.Albedo"]);
        let error = roles("colour=Albedo", &two).unwrap_err();
        assert_eq!(error, "found `Albedo`; accepted is one of `BG.Albedo`, `FG.Albedo`");
        let error = roles("normal=nn", &names).unwrap_err();
        assert_eq!(error, "found no layer `nn`; accepted are ``, `a.b`, `Albedo`");
        let error = roles("normal=d", &names).unwrap_err();
        assert_eq!(error, "found the layer `d` with the channels T; accepted are ``, `a.b`, `Albedo`");
        assert!(roles("shape=x", &names).unwrap_err().contains("the roles colour, albedo"));
        assert!(roles("albedo=a,albedo=b", &names).unwrap_err().contains("twice"));
    }
}
