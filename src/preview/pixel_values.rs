//! All values of one pixel, in full precision, for the page's inspector.

use serde::Serialize;

use super::relative_error::relative;
use crate::filter::FilterResult;
use crate::image::Planes;
use crate::stats::{Block, Moments, Part, Store};

#[derive(Serialize)]
struct PixelValues {
    /// Tells the message from others.
    r#type: &'static str,
    x: u32,
    y: u32,
    samples: u32,
    /// Linear radiance: the mean of the samples, if there are any, and the filtered pixel.
    raw: Option<[f64; 3]>,
    filtered: Option<[f32; 3]>,
    albedo: Option<[f64; 3]>,
    normal: Option<[f64; 3]>,
    /// Relative variance of the unfiltered mean, averaged over the channels, as in its map.
    variance: Option<f32>,
    /// Estimated relative squared error of the filtered pixel, likewise.
    error: Option<f32>,
    residual: Option<f32>,
    failure: Option<f32>,
}

/// Returns a JSON message with all values at a pixel, without any if it is outside the image.
pub fn describe_pixel([x, y]: [u32; 2], store: &Store, shown: Option<&FilterResult>) -> String {
    let (column, line) = (x as usize, y as usize);
    let Some(row) = store.rows().get(line).filter(|_| column < store.width()) else {
        return r#"{"type":"values"}"#.to_owned();
    };
    let samples = row.count(column, Part::Whole);
    let three = |first: usize| [0, 1, 2].map(|k| row.moments(column, first + k, Part::Whole));
    let means = |block: Block| {
        let dimensions = store.layout().block(block).filter(|_| samples > 0)?;
        Some(three(dimensions.start).map(|m| m.mean))
    };
    let radiance = three(store.layout().radiance().start);
    let at = |planes: &Planes, plane| planes.at(plane, column, line);
    let failure = shown.and_then(|shown| shown.interpolation.as_ref()).map(|found| &found.failure);
    let values = PixelValues {
        r#type: "values",
        x,
        y,
        samples,
        raw: (samples > 0).then(|| radiance.map(|m| m.mean)),
        filtered: shown.map(|f| [0, 1, 2].map(|k| at(&f.image, k))),
        albedo: means(Block::Albedo),
        normal: means(Block::Normal1),
        // One sample says nothing of the variance.
        variance: (samples > 1).then(|| {
            let of_mean = |m: Moments| (m.variance() / f64::from(samples)) as f32;
            radiance.iter().map(|&m| relative(of_mean(m), m.mean as f32)).sum::<f32>() / 3.0
        }),
        error: shown.map(|f| (0..3).map(|k| relative(at(&f.error, 0), at(&f.image, k))).sum::<f32>() / 3.0),
        residual: shown.map(|f| at(&f.residual, 0)),
        failure: failure.map(|map| at(map, 0)),
    };
    serde_json::to_string(&values).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::preview::view::{View, ViewSource};
    use crate::stats::Layout;

    #[test]
    fn errors_are_those_of_the_maps() {
        let mut store = Store::new(2, 1, Layout::with_blocks(|_| false), 0, 0);
        let length = store.layout().len();
        for value in [0.5, 1.5, 2.0, 3.0] {
            (0..2).for_each(|x| store.push(x, 0, &vec![value; length]));
        }
        let shown = crate::filter::unfiltered(&store);
        let text = describe_pixel([1, 0], &store, Some(&shown));
        let values: serde_json::Value = serde_json::from_str(&text).unwrap();
        let source = ViewSource { store: &store, shown: Some(&shown), comparison: None };
        for (name, view) in [("error", View::Error), ("variance", View::Variance)] {
            let in_map = f64::from(view.planes(&source).unwrap().at(0, 1, 0));
            let value = values[name].as_f64().unwrap();
            assert!((value / in_map - 1.0).abs() < 1e-5, "{name}: {value} for {in_map}");
        }
    }
}
