//! Maps the named columns of another program's samples to a layout.
//!
//! Takes the names of columns in any order; gives the layout that has these dimensions, and sample vectors in its order.

use super::block::block_names;
use super::layout::Layout;

/// The columns of a table of samples, one sample a row.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Columns {
    layout: Layout,
    count: usize,
    /// The column of each of the layout's dimensions; `None` for a film position that no column has.
    sources: Vec<Option<usize>>,
}

/// Names that make no layout.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ColumnError {
    #[error("dimensions: found `{found}`; accepted are {}", names())]
    Unknown { found: String },
    #[error("dimensions: found `{found}` twice; accepted is each name once")]
    Twice { found: String },
    #[error("dimensions: found no `{missing}`; accepted are {block} together")]
    Incomplete { missing: &'static str, block: String },
    #[error("dimensions: found no colour; accepted are names that include R, G and B")]
    NoColour,
}

fn names() -> String {
    block_names().flatten().collect::<Vec<_>>().join(", ")
}

impl Columns {
    /// Maps columns of these names. Colour must be among them; film position may be absent, and is then taken as the
    /// pixel's centre.
    ///
    /// # Errors
    /// A name that no dimension has, a name twice, a part of the dimensions that belong together, no colour.
    pub fn new<S: AsRef<str>>(found: &[S]) -> Result<Self, ColumnError> {
        let column = |name: &str| found.iter().position(|found| found.as_ref() == name);
        for (index, name) in found.iter().map(AsRef::as_ref).enumerate() {
            if !block_names().flatten().any(|known| known == name) {
                return Err(ColumnError::Unknown { found: name.to_owned() });
            }
            if column(name) != Some(index) {
                return Err(ColumnError::Twice { found: name.to_owned() });
            }
        }
        if ["R", "G", "B"].into_iter().all(|name| column(name).is_none()) {
            return Err(ColumnError::NoColour);
        }
        for block in block_names() {
            let missing = block.iter().find(|name| column(name).is_none());
            if let (Some(missing), true) = (missing, block.iter().any(|name| column(name).is_some())) {
                return Err(ColumnError::Incomplete { missing, block: block.join(", ") });
            }
        }
        let blocks: Vec<_> = block_names().collect();
        let layout = Layout::with_blocks(|block| column(blocks[block as usize][0]).is_some());
        let sources = layout.names().map(column).collect();
        Ok(Self { layout, count: found.len(), sources })
    }

    /// Maps the columns of a layout to itself.
    pub fn from_layout(layout: Layout) -> Self {
        Self { count: layout.len(), sources: (0..layout.len()).map(Some).collect(), layout }
    }

    /// Returns the layout with these dimensions.
    pub fn layout(&self) -> &Layout {
        &self.layout
    }

    /// Returns the number of columns.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Returns mean and variance of each of the layout's dimensions at pixel (`x`, `y`), from those of each column.
    pub fn arrange_moments(
        &self,
        x: usize,
        y: usize,
        mean: &[f32],
        variance: &[f32],
    ) -> impl Iterator<Item = (f32, f32)> {
        /// Variance of a film position that is uniform in its pixel.
        const FILM_VARIANCE: f32 = 1.0 / 12.0;
        let variances =
            self.sources.iter().map(|source| source.map_or(FILM_VARIANCE, |column| variance[column]));
        self.arrange(x, y, mean).zip(variances)
    }

    /// Returns the values of a sample of pixel (`x`, `y`) in the layout's order. `sample` has a value for each column.
    pub fn arrange(&self, x: usize, y: usize, sample: &[f32]) -> impl Iterator<Item = f32> {
        let centre = [x as f32 + 0.5, y as f32 + 0.5];
        self.sources.iter().enumerate().map(move |(dim, source)| match source {
            Some(column) => sample[*column],
            // Film position is the first block.
            None => centre[dim],
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_in_any_order_become_a_sample_vector() {
        let columns = Columns::new(&["B", "G", "R", "N1.y", "N1.x", "N1.z"]).unwrap();
        let names: Vec<_> = columns.layout().names().collect();
        assert_eq!(names, ["film.x", "film.y", "R", "G", "B", "N1.x", "N1.y", "N1.z"]);
        let sample: Vec<f32> = columns.arrange(3, 4, &[0.0, 1.0, 2.0, 3.0, 4.0, 5.0]).collect();
        assert_eq!(sample, [3.5, 4.5, 2.0, 1.0, 0.0, 4.0, 3.0, 5.0]);
    }

    #[test]
    fn the_columns_of_a_layout_are_its_own() {
        let layout = Layout::with_blocks(|_| true);
        let names: Vec<_> = layout.names().collect();
        assert_eq!(Columns::new(&names).unwrap(), Columns::from_layout(layout));
    }

    #[test]
    fn names_that_make_no_layout_are_errors_that_say_why() {
        for (names, part) in [
            (["R", "G", "depth"].as_slice(), "found `depth`; accepted are film.x, film.y, R"),
            (&["R", "G", "B", "G"], "found `G` twice"),
            (&["R", "G"], "found no `B`; accepted are R, G, B together"),
            (&["R", "G", "B", "film.y"], "found no `film.x`"),
            (&["N1.x", "N1.y", "N1.z"], "found no colour"),
            (&[], "found no colour"),
        ] {
            let message = Columns::new(names).unwrap_err().to_string();
            assert!(message.contains(part), "{message}");
        }
    }
}
