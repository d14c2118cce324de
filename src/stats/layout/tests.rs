//! Tests of layouts.

use super::*;
use crate::stats::MAX_DIMENSIONS;

#[test]
fn all_blocks_give_the_papers_27_dimensions() {
    let layout = Layout::with_blocks(|_| true);
    let vector = layout.dimensions().iter().filter(|d| d.group != Group::Auxiliary).count();
    assert_eq!(vector, 27);
    assert_eq!(layout.features().len(), 15);
    assert_eq!(layout.randoms().len(), 7);
}

#[test]
fn the_table_is_in_the_order_of_blocks() {
    assert!(BLOCKS.iter().enumerate().all(|(i, (block, _))| *block as usize == i));
}

#[test]
fn names_determine_the_layout() {
    for is_enabled in [|_| true, |b| b == Block::Lens, |b| b == Block::Hit || b == Block::Normal2] {
        let layout = Layout::with_blocks(is_enabled);
        let names: Vec<_> = layout.dimensions().iter().map(|d| d.name).collect();
        assert_eq!(Layout::from_names(&names, &[]), Some(layout));
        assert_eq!(Layout::from_names(&names[1..], &[]), None);
    }
    assert_eq!(Layout::from_names(&["film.x", "film.y", "R", "G", "B", "lens.u"], &[]), None);
}

#[test]
fn a_restricted_layout_knows_what_it_leaves_out() {
    let whole = Layout::with_blocks(|block| block != Block::Time);
    let kept: BlockSet = [Block::Normal1, Block::Time].into_iter().collect();
    let layout = whole.restricted_to(kept);
    layout.validate().unwrap();
    assert_eq!(layout.names().collect::<Vec<_>>(), ["R", "G", "B", "N1.x", "N1.y", "N1.z"]);
    assert!(layout.leaves_out(Block::Lens) && !layout.leaves_out(Block::Time) && layout.film().is_empty());
    let names: Vec<_> = layout.names().collect();
    assert_eq!(Layout::from_names(&names, &layout.names_left_out(|_| true)).as_ref(), Some(&layout));
    assert_eq!(Layout::from_names(&names, &names), None, "kept and left out at once");
    assert_eq!(whole.restricted_to(BlockSet::ALL), whole);
    assert_eq!(layout.enabled_names(), whole.names().collect::<Vec<_>>());
}

#[test]
fn writing_a_disabled_block_changes_nothing() {
    let layout = Layout::with_blocks(|_| false);
    let mut sample = vec![0.0; layout.len()];
    layout.write(&mut sample, Block::Lens, &[1.0, 1.0]);
    assert!(sample.iter().all(|&v| v == 0.0));
    layout.write(&mut sample, Block::Colour, &[1.0, 2.0, 3.0]);
    assert_eq!(sample[layout.colour()], [1.0, 2.0, 3.0]);
}

#[test]
fn blocks_follow_each_other_without_gaps() {
    let dropped = BLOCKS.map(|(block, _)| block).map(|block| move |b: Block| b != block);
    for is_enabled in dropped {
        let layout = Layout::with_blocks(is_enabled);
        layout.validate().unwrap();
        let mut end = 0;
        for (block, dims) in BLOCKS {
            let expected = matches!(block, Block::Film | Block::Colour) || is_enabled(block);
            assert_eq!(layout.block(block).is_some(), expected, "{block:?}");
            if let Some(range) = layout.block(block) {
                assert_eq!(range, end..end + dims.len());
                assert_eq!(layout.dimensions()[range.clone()], *dims);
                end = range.end;
            }
        }
        assert_eq!((layout.len(), layout.is_empty()), (end, false));
        assert_eq!((layout.film(), layout.colour()), (0..2, 2..5));
        assert_eq!(layout.radiance(), layout.block(Block::Radiance).unwrap_or(2..5));
    }
    assert_eq!(MAX_DIMENSIONS, 34);
}
