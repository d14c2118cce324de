//! All values of one pixel, in full precision, for the page's inspector.

use serde::Serialize;

use crate::filter::FilterResult;
use crate::image::Planes;
use crate::stats::{Block, Part, Store};

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
    /// Variance of the unfiltered mean, averaged over the channels, in squared radiance.
    variance: Option<f64>,
    /// Estimated squared error of the filtered pixel, likewise.
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
        variance: (samples > 1)
            .then(|| radiance.iter().map(|&m| m.variance()).sum::<f64>() / 3.0 / f64::from(samples)),
        error: shown.map(|f| at(&f.error, 0)),
        residual: shown.map(|f| at(&f.residual, 0)),
        failure: failure.map(|map| at(map, 0)),
    };
    serde_json::to_string(&values).unwrap_or_default()
}
