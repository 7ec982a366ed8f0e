//! Where things lie in the scene's buffers: slots of equal size, and ranges of any size.

use std::collections::BTreeMap;
use std::ops::Range;

/// Hands out the lowest free slot, so that the same history gives the same slots.
#[derive(Debug, Default)]
pub(super) struct SlotAllocator {
    free: std::collections::BTreeSet<u32>,
    end: u32,
}

impl SlotAllocator {
    /// The lowest free slot below `limit`.
    pub fn allocate(&mut self, limit: u32) -> Option<u32> {
        if let Some(slot) = self.free.pop_first() {
            return Some(slot);
        }
        (self.end < limit).then(|| {
            self.end += 1;
            self.end - 1
        })
    }

    /// Gives a slot back.
    pub fn free(&mut self, slot: u32) {
        self.free.insert(slot);
    }
}

/// First-fit allocation of ranges; freed neighbours merge.
#[derive(Debug, Default)]
pub(super) struct RangeAllocator {
    /// Free ranges: start to length, never adjacent.
    free: BTreeMap<u32, u32>,
    capacity: u32,
    used: u32,
}

impl RangeAllocator {
    /// Room in all.
    pub fn capacity(&self) -> u32 {
        self.capacity
    }

    /// Sum of the lengths that are handed out.
    pub fn used(&self) -> u32 {
        self.used
    }

    /// Adds room at the end.
    pub fn grow(&mut self, capacity: u32) {
        if capacity > self.capacity {
            let added = self.capacity..capacity;
            self.capacity = capacity;
            self.insert(added);
        }
    }

    /// Start of `length` free places, the lowest that fit. Nothing takes no room, and starts at 0.
    pub fn allocate(&mut self, length: u32) -> Option<u32> {
        if length == 0 {
            return Some(0);
        }
        let (&start, &room) = self.free.iter().find(|&(_, &room)| room >= length)?;
        self.free.remove(&start);
        if room > length {
            self.free.insert(start + length, room - length);
        }
        self.used += length;
        Some(start)
    }

    /// Gives a range back.
    pub fn free(&mut self, range: Range<u32>) {
        if !range.is_empty() {
            self.used -= range.end - range.start;
            self.insert(range);
        }
    }

    fn insert(&mut self, mut range: Range<u32>) {
        if let Some((&start, &length)) = self.free.range(..range.start).next_back()
            && start + length == range.start
        {
            self.free.remove(&start);
            range.start = start;
        }
        if let Some(length) = self.free.remove(&range.end) {
            range.end += length;
        }
        self.free.insert(range.start, range.end - range.start);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slots_are_reused_lowest_first() {
        let mut slots = SlotAllocator::default();
        assert_eq!((0..4).map(|_| slots.allocate(4)).collect::<Vec<_>>(), [Some(0), Some(1), Some(2), Some(3)]);
        assert_eq!(slots.allocate(4), None);
        slots.free(2);
        slots.free(1);
        assert_eq!(slots.allocate(4), Some(1));
        assert_eq!(slots.allocate(4), Some(2));
        assert_eq!(slots.allocate(5), Some(4));
    }

    #[test]
    fn ranges_merge_with_both_neighbours() {
        let mut ranges = RangeAllocator::default();
        assert_eq!(ranges.allocate(1), None);
        ranges.grow(10);
        assert_eq!(ranges.allocate(4), Some(0));
        assert_eq!(ranges.allocate(3), Some(4));
        assert_eq!(ranges.allocate(3), Some(7));
        assert_eq!(ranges.allocate(1), None);
        ranges.free(0..4);
        ranges.free(7..10);
        assert_eq!(ranges.allocate(5), None);
        ranges.free(4..7);
        assert_eq!(ranges.free, BTreeMap::from([(0, 10)]));
        assert_eq!(ranges.used(), 0);
        assert_eq!(ranges.allocate(10), Some(0));
    }

    #[test]
    fn growth_joins_a_free_tail() {
        let mut ranges = RangeAllocator::default();
        ranges.grow(8);
        assert_eq!(ranges.allocate(5), Some(0));
        ranges.grow(12);
        assert_eq!(ranges.allocate(7), Some(5));
        assert_eq!((ranges.capacity(), ranges.used()), (12, 12));
    }

    #[test]
    fn nothing_takes_no_room() {
        let mut ranges = RangeAllocator::default();
        assert_eq!(ranges.allocate(0), Some(0));
        ranges.free(0..0);
        assert!(ranges.free.is_empty());
    }
}
