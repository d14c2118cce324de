//! The stack of a traversal: nodes that are still to be visited, nearest on top.

/// Entries of the stack before it spills to the heap; only degenerate scenes need more.
const STACK_SIZE: usize = 64;

/// A node to visit, ordered by distance: the upper half is the distance at which the ray enters its
/// box, the lower half the child reference. Non-negative floats are ordered as their bits are.
#[derive(Clone, Copy, PartialEq, PartialOrd)]
pub struct StackEntry(u64);

impl StackEntry {
    pub const ZERO: Self = Self(0);

    #[inline(always)]
    pub fn new(t_near: f32, child: u32) -> Self {
        Self((t_near.to_bits() as u64) << 32 | child as u64)
    }

    #[inline(always)]
    fn t_near(self) -> f32 {
        f32::from_bits((self.0 >> 32) as u32)
    }

    #[inline(always)]
    pub fn child(self) -> u32 {
        self.0 as u32
    }
}

/// Nodes to visit. A traversal of an instance keeps its entries above those of the top level. One
/// stack serves many rays.
pub struct Stack {
    entries: [StackEntry; STACK_SIZE],
    len: usize,
    spilled: Vec<StackEntry>,
}

impl Stack {
    #[inline]
    pub fn new() -> Self {
        Self { entries: [StackEntry::ZERO; STACK_SIZE], len: 0, spilled: Vec::new() }
    }

    #[inline(always)]
    pub fn height(&self) -> usize {
        self.len + self.spilled.len()
    }

    #[inline(always)]
    pub fn push(&mut self, entry: StackEntry) {
        if self.len < STACK_SIZE {
            self.entries[self.len] = entry;
            self.len += 1;
        } else {
            self.spilled.push(entry);
        }
    }

    #[inline(always)]
    fn pop(&mut self) -> StackEntry {
        self.spilled.pop().unwrap_or_else(|| {
            self.len -= 1;
            self.entries[self.len % STACK_SIZE]
        })
    }

    /// Pops entries above `bottom` until one is entered before `t_max`, and returns its child.
    #[inline(always)]
    pub fn pop_before(&mut self, t_max: f32, bottom: usize) -> Option<u32> {
        while self.height() > bottom {
            let entry = self.pop();
            if entry.t_near() <= t_max {
                return Some(entry.child());
            }
        }
        None
    }

    /// Pops all entries above `bottom`.
    pub fn drop_above(&mut self, bottom: usize) {
        while self.height() > bottom {
            self.pop();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn entries_beyond_the_array_come_back_from_the_heap() {
        let mut stack = Stack::new();
        stack.push(StackEntry::new(0.0, 7));
        let bottom = stack.height();
        let count = 3 * STACK_SIZE as u32;
        for child in 0..count {
            stack.push(StackEntry::new(child as f32, child));
        }
        // Entries beyond `t_max` are skipped, and the outer traversal's entry stays.
        let popped: Vec<_> = std::iter::from_fn(|| stack.pop_before((count / 2) as f32, bottom)).collect();
        assert_eq!(popped, (0..=count / 2).rev().collect::<Vec<_>>());
        assert_eq!(stack.pop().child(), 7);
    }
}
