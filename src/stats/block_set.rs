//! A set of blocks of a sample's dimensions.

use std::ops::BitOr;

use super::block::Block;

/// A set of [`Block`]s.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct BlockSet(u16);

impl BlockSet {
    pub const NONE: Self = Self(0);
    pub const ALL: Self = Self(u16::MAX);

    /// Tests whether a block is in the set.
    pub fn contains(self, block: Block) -> bool {
        self.0 >> block as u16 & 1 == 1
    }
}

impl FromIterator<Block> for BlockSet {
    fn from_iter<I: IntoIterator<Item = Block>>(blocks: I) -> Self {
        Self(blocks.into_iter().fold(0, |bits, block| bits | 1 << block as u16))
    }
}

impl BitOr for BlockSet {
    type Output = Self;

    fn bitor(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_set_holds_what_was_put_in() {
        let set: BlockSet = [Block::Film, Block::Hit].into_iter().collect();
        assert!(set.contains(Block::Film) && set.contains(Block::Hit) && !set.contains(Block::Lens));
        let more = set | [Block::Lens].into_iter().collect();
        assert!(more.contains(Block::Hit) && more.contains(Block::Lens) && !more.contains(Block::Time));
        assert!(BlockSet::ALL.contains(Block::Hit) && !BlockSet::NONE.contains(Block::Film));
    }
}
