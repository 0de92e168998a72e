//! From cells to groups.

/// Order of the cells in the table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CellOrder {
    /// The most significant bits of x, y and z after one another.
    Concatenated,
    /// The bits of x, y and z in turn (Morton order).
    Interleaved,
}

/// The hash of a cell: its place in the table.
///
/// A coordinate as a 32-bit integer is `floor((x - low) / (high - low) * 2^32)`, and its most significant `bits` bits are the cell's number
/// on the axis: scaling by powers of two is exact, so [`crate::accel::grid::lattice::Lattice::cell`] gives the same. Two points collide
/// exactly when they share a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Hash {
    pub(super) bits: u32,
    pub(super) order: CellOrder,
}

impl Hash {
    /// Number of places.
    pub(super) fn len(self) -> usize {
        1 << (3 * self.bits)
    }

    #[inline(always)]
    pub(super) fn of(self, cell: [u32; 3]) -> usize {
        let [x, y, z] = cell;
        let place = match self.order {
            CellOrder::Concatenated => ((x << self.bits | y) << self.bits) | z,
            CellOrder::Interleaved => spread(x) << 2 | spread(y) << 1 | spread(z),
        };
        place as usize
    }
}

/// Up to ten bits, two zeros after each.
#[inline(always)]
fn spread(x: u32) -> u32 {
    let x = (x | x << 16) & 0x0300_00ff;
    let x = (x | x << 8) & 0x0300_f00f;
    let x = (x | x << 4) & 0x030c_30c3;
    (x | x << 2) & 0x0924_9249
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::accel::grid::lattice::Lattice;

    #[test]
    fn every_cell_has_its_own_place_in_both_orders() {
        for order in [CellOrder::Concatenated, CellOrder::Interleaved] {
            let hash = Hash { bits: 3, order };
            let cells = (0..512_u32).map(|i| [i & 7, i >> 3 & 7, i >> 6]);
            let mut places: Vec<_> = cells.map(|cell| hash.of(cell)).collect();
            places.sort_unstable();
            assert_eq!(places, (0..hash.len()).collect::<Vec<_>>());
        }
        assert_eq!(Hash { bits: 9, order: CellOrder::Interleaved }.of([511; 3]), (1 << 27) - 1);
        assert_eq!(Hash { bits: 9, order: CellOrder::Concatenated }.of([1, 2, 3]), 1 << 18 | 2 << 9 | 3);
    }

    proptest! {
        #[test]
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "the product is neither negative nor above 2^32"
        )]
        fn a_cell_is_the_most_significant_bits_of_the_integer_coordinate(
            low in -1e3_f64..1e3, size in 1e-3_f64..1e3, at in 0.0..1.0_f64, bits in 6_u32..10,
        ) {
            let high = low + size;
            let lattice = Lattice::new([low; 3], [high; 3], [1 << bits; 3]);
            let x = low + at * (high - low);
            let scale = 4_294_967_296.0 / (high - low);
            let integer = (((x - low) * scale) as u64).min(u64::from(u32::MAX));
            // Dividing by the width of a cell rounds once more than scaling does: only at a plane itself may that show.
            let near = (integer + 2) >> (32 - bits) != integer.saturating_sub(2) >> (32 - bits);
            prop_assert!(near || u64::from(lattice.cell(0, x)) == integer >> (32 - bits));
        }
    }
}
