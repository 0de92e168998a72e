//! Pairs in ascending order.

/// Sorts pairs of numbers below `count`: by counting the first. Takes memory to work in.
pub(super) fn sort_pairs(pairs: &mut Vec<[u32; 2]>, count: usize, places: &mut Vec<u32>, sorted: &mut Vec<[u32; 2]>) {
    if pairs.len() < 64 || pairs.len() < count / 8 || u32::try_from(pairs.len()).is_err() {
        pairs.sort_unstable();
        return;
    }
    places.clear();
    places.resize(count + 1, 0);
    for pair in &*pairs {
        places[pair[0] as usize + 1] += 1;
    }
    for i in 0..count {
        places[i + 1] += places[i];
    }
    sorted.clear();
    sorted.resize(pairs.len(), [0; 2]);
    for pair in &*pairs {
        let place = &mut places[pair[0] as usize];
        sorted[*place as usize] = *pair;
        *place += 1;
    }
    // Each place is now where the next number's pairs begin.
    let mut from = 0;
    for &to in &places[..count] {
        sorted[from as usize..to as usize].sort_unstable();
        from = to;
    }
    std::mem::swap(pairs, sorted);
}

/// Merges a sorted list into another; they share nothing.
pub(super) fn merge(into: &mut Vec<[u32; 2]>, other: &[[u32; 2]]) {
    let (mut left, mut right) = (into.len(), other.len());
    into.resize(left + right, [0; 2]);
    // From the back, so that nothing is overwritten before it is read.
    while right > 0 {
        if left > 0 && into[left - 1] > other[right - 1] {
            into[left + right - 1] = into[left - 1];
            left -= 1;
        } else {
            into[left + right - 1] = other[right - 1];
            right -= 1;
        }
    }
}
