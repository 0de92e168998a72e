use super::Counter;

/// Bytes of a cache line.
const LINE: usize = 64;

/// Counts everything that a traversal does, and the structure's memory reads in four ways.
///
/// The steps of the papers' comparisons differ in what one read is, so all four are kept: transactions, 4-byte words, bytes, and
/// distinct 64-byte lines a ray. Addresses are places within the structure, so the counts are the same on every machine.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ReadCounter {
    /// Nodes visited.
    pub nodes: u64,
    /// Primitives tested by themselves.
    pub prims: u64,
    /// Blocks of primitives tested.
    pub blocks: u64,
    /// Grid cells entered.
    pub steps: u64,
    /// Events handled.
    pub events: u64,
    /// Events passed over.
    pub skips: u64,
    /// Reads, whatever their size.
    pub transactions: u64,
    /// 4-byte words read.
    pub words: u64,
    /// Bytes read.
    pub bytes: u64,
    /// Different 64-byte lines read, summed over the rays that [`ReadCounter::next_ray`] ended.
    pub lines: u64,
    /// Lines read by the current ray, some several times.
    seen: Vec<usize>,
}

impl ReadCounter {
    /// Ends a ray: its different lines are added up.
    pub fn next_ray(&mut self) {
        self.seen.sort_unstable();
        self.seen.dedup();
        self.lines += self.seen.len() as u64;
        self.seen.clear();
    }
}

impl Counter for ReadCounter {
    fn node(&mut self) {
        self.nodes += 1;
    }

    fn prim(&mut self) {
        self.prims += 1;
    }

    fn block(&mut self) {
        self.blocks += 1;
    }

    fn step(&mut self) {
        self.steps += 1;
    }

    fn event(&mut self) {
        self.events += 1;
    }

    fn skip(&mut self) {
        self.skips += 1;
    }

    fn read(&mut self, address: usize, bytes: usize) {
        self.transactions += 1;
        self.words += bytes.div_ceil(4) as u64;
        self.bytes += bytes as u64;
        self.seen.extend(address / LINE..=(address + bytes.max(1) - 1) / LINE);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reads_count_in_four_ways() {
        let mut count = ReadCounter::default();
        count.read(60, 8);
        count.read(0, 24);
        count.next_ray();
        count.read(0, 4);
        count.next_ray();
        assert_eq!((count.transactions, count.words, count.bytes, count.lines), (3, 9, 36, 3));
    }
}
