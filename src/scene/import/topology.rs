//! Index lists of every mode as triangle lists.

use super::super::Topology;

/// glTF's `mode`: what it means here, or `None` when unknown.
pub(super) fn of_mode(mode: u32) -> Option<Topology> {
    match mode {
        0 => Some(Topology::Points),
        1..=3 => Some(Topology::Lines),
        4..=6 => Some(Topology::Triangles),
        _ => None,
    }
}

/// Triangles of `corners` in file order, wound as the specification orders them. Corners left over are
/// dropped; modes without triangles give none.
pub(super) fn triangles(mode: u32, corners: &[u32]) -> Vec<[u32; 3]> {
    match mode {
        4 => corners.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect(),
        5 => {
            let strip = |(i, c): (usize, &[u32])| if i % 2 == 0 { [c[0], c[1], c[2]] } else { [c[0], c[2], c[1]] };
            corners.windows(3).enumerate().map(strip).collect()
        }
        6 => corners.get(1..).map_or_else(Vec::new, |rim| rim.windows(2).map(|c| [c[0], c[1], corners[0]]).collect()),
        _ => Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strips_and_fans_keep_the_specifications_winding() {
        assert_eq!(triangles(4, &[0, 1, 2, 3, 4]), [[0, 1, 2]]);
        assert_eq!(triangles(5, &[0, 1, 2, 3, 4]), [[0, 1, 2], [1, 3, 2], [2, 3, 4]]);
        assert_eq!(triangles(6, &[9, 1, 2, 3]), [[1, 2, 9], [2, 3, 9]]);
        assert!(
            triangles(6, &[]).is_empty() && triangles(5, &[0, 1]).is_empty() && triangles(1, &[0, 1, 2]).is_empty()
        );
    }
}
