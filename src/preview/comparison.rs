//! Compares the filtered image with a reference: map of the error, ꟻLIP map, and their means.
//!
//! The ꟻLIP map takes a second at two million pixels, so it is made only while a viewer looks at it, on a thread of its own.

use std::sync::Arc;

use crossbeam::channel::{Receiver, TryRecvError, bounded};

use super::relative_error::relative_error;
use crate::filter::FilterResult;
use crate::image::Planes;
use crate::image::metrics::Pair;
use crate::image::perceptual::FlipMap;

/// The newest filtered image against a reference of its size.
pub struct Comparison {
    /// 3 planes.
    reference: Arc<Planes>,
    /// Squared difference by pixel, relative to the reference: 1 plane, with the image's relMSE.
    difference: Option<(Planes, f64)>,
    /// 1 plane, with its mean.
    flip: Option<(Planes, f64)>,
    pending_flip: Option<Receiver<FlipMap>>,
}

impl Comparison {
    /// Compares with a reference.
    pub fn new(reference: Arc<Planes>) -> Self {
        Self { reference, difference: None, flip: None, pending_flip: None }
    }

    /// Takes a newer image; `None` if there is none any more.
    pub fn update(&mut self, shown: Option<&FilterResult>) {
        (self.difference, self.flip, self.pending_flip) = (None, None, None);
        let Some(image) = shown.map(|shown| &shown.image) else { return };
        let Ok(pair) = Pair::new(image, &self.reference) else { return };
        let mut squares = image.clone();
        for (value, reference) in squares.data_mut().iter_mut().zip(self.reference.data()) {
            *value = (*value - reference).powi(2);
        }
        self.difference = Some((relative_error(&squares, &self.reference), pair.relmse()));
    }

    /// Makes the ꟻLIP map of the newest image, if a viewer wants it.
    pub fn make_flip(&mut self, shown: Option<&FilterResult>) {
        if let Some(pending) = &self.pending_flip {
            match pending.try_recv() {
                Ok(map) => self.flip = Some((map.values(), map.mean)),
                Err(TryRecvError::Empty) => return,
                Err(TryRecvError::Disconnected) => {}
            }
            self.pending_flip = None;
        }
        let Some(shown) = shown.filter(|_| self.flip.is_none()) else { return };
        let (done, pending) = bounded(1);
        let (image, reference) = (shown.image.clone(), self.reference.clone());
        let compare = move || {
            if let Ok(pair) = Pair::new(&image, &reference) {
                // A map that is no longer wanted is dropped.
                let _ = done.send(pair.flip());
            }
        };
        let thread = std::thread::Builder::new().name("flip".to_owned()).spawn(compare);
        self.pending_flip = thread.is_ok().then_some(pending);
    }

    pub fn reference(&self) -> &Planes {
        &self.reference
    }

    pub fn difference(&self) -> Option<&Planes> {
        self.difference.as_ref().map(|(map, _)| map)
    }

    pub fn flip(&self) -> Option<&Planes> {
        self.flip.as_ref().map(|(map, _)| map)
    }

    /// Returns the relMSE of the newest image.
    pub fn relmse(&self) -> Option<f64> {
        self.difference.as_ref().map(|(_, mean)| *mean)
    }

    /// Returns the mean of the ꟻLIP map.
    pub fn mean_flip(&self) -> Option<f64> {
        self.flip.as_ref().map(|(_, mean)| *mean)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stats::{Layout, Store};

    #[test]
    fn an_image_is_compared_with_its_reference() {
        let mut store = Store::new(8, 8, Layout::with_blocks(|_| false), 0, 0);
        let sample = vec![0.5; store.layout().len()];
        (0..64).for_each(|i| store.push(i % 8, i / 8, &sample));
        let shown = crate::filter::unfiltered(&store);
        let mut reference = Planes::new(8, 8, 3);
        reference.data_mut().fill(0.25);
        let mut comparison = Comparison::new(Arc::new(reference));
        comparison.update(Some(&shown));
        let expected = 0.0625 / 0.0725;
        assert!((comparison.relmse().unwrap() - expected).abs() < 1e-6);
        assert!((f64::from(comparison.difference().unwrap().at(0, 3, 3)) - expected).abs() < 1e-6);
        while comparison.flip().is_none() {
            comparison.make_flip(Some(&shown));
        }
        assert!(comparison.mean_flip().unwrap() > 0.05);
        comparison.update(None);
        assert!(comparison.relmse().is_none() && comparison.flip().is_none());
    }
}
