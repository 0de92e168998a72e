//! Modes 1 and 2: triangle lists by shared edges and recent vertices, index sequences by two baselines.

use super::Reader;

/// The last 16 things pushed; reading what was never pushed is an error.
struct Fifo<T> {
    items: [Option<T>; 16],
    next: usize,
}

impl<T: Copy> Fifo<T> {
    fn new() -> Self {
        Self { items: [None; 16], next: 0 }
    }

    fn push(&mut self, item: T) {
        self.items[self.next] = Some(item);
        self.next = (self.next + 1) % 16;
    }

    /// The item pushed `back` pushes before the last.
    fn get(&self, back: u8) -> Result<T, &'static str> {
        let item = self.items[(self.next + 15 - usize::from(back)) % 16];
        item.ok_or("the compressed triangles refer to an edge or vertex before the first")
    }
}

struct Decoder<'a> {
    data: Reader<'a>,
    edges: Fifo<(u32, u32)>,
    vertices: Fifo<u32>,
    next: u32,
    last: u32,
}

fn unzigzag(v: u32) -> u32 {
    if v & 1 != 0 { !(v >> 1) } else { v >> 1 }
}

impl Decoder<'_> {
    fn new_vertex(&mut self) -> u32 {
        let vertex = self.next;
        self.next = vertex.wrapping_add(1);
        vertex
    }

    fn explicit(&mut self) -> Result<u32, &'static str> {
        self.last = self.last.wrapping_add(unzigzag(self.data.varint()?));
        Ok(self.last)
    }

    /// A vertex by four bits, and whether it enters the list of recent vertices.
    fn vertex(&mut self, code: u8) -> Result<(u32, bool), &'static str> {
        match code {
            0 => Ok((self.new_vertex(), true)),
            15 => Ok((self.explicit()?, true)),
            recent => Ok((self.vertices.get(recent - 1)?, false)),
        }
    }

    /// A triangle over a recent edge.
    fn on_edge(&mut self, edge: u8, corner: u8) -> Result<[u32; 3], &'static str> {
        let (a, b) = self.edges.get(edge)?;
        let (c, is_new) = match corner {
            0 => (self.new_vertex(), true),
            13 | 14 => {
                self.last = if corner == 13 { self.last.wrapping_sub(1) } else { self.last.wrapping_add(1) };
                (self.last, true)
            }
            15 => (self.explicit()?, true),
            recent => (self.vertices.get(recent)?, false),
        };
        self.edges.push((c, b));
        self.edges.push((a, c));
        if is_new {
            self.vertices.push(c);
        }
        Ok([a, b, c])
    }

    /// A triangle that shares no edge.
    fn apart(&mut self, code: u8, table: &[u8]) -> Result<[u32; 3], &'static str> {
        let pair = match code {
            14 | 15 => {
                let pair = self.data.byte()?;
                if pair == 0 {
                    self.next = 0;
                }
                pair
            }
            code => table[usize::from(code)],
        };
        let a = if code == 15 { self.explicit()? } else { self.new_vertex() };
        let (b, b_is_new) = self.vertex(pair >> 4)?;
        let (c, c_is_new) = self.vertex(pair & 15)?;
        for edge in [(b, a), (c, b), (a, c)] {
            self.edges.push(edge);
        }
        self.vertices.push(a);
        if b_is_new {
            self.vertices.push(b);
        }
        if c_is_new {
            self.vertices.push(c);
        }
        Ok([a, b, c])
    }
}

/// Mode 1: `count` indices of a triangle list.
pub(super) fn triangles(data: &[u8], count: usize) -> Result<Vec<u32>, &'static str> {
    if !count.is_multiple_of(3) {
        return Err("the count of triangle indices is not a multiple of 3");
    }
    let mut reader = Reader { bytes: data };
    if reader.byte()? != 0xe1 {
        return Err("the compressed stream is not one of triangles");
    }
    let body = reader.bytes.len().checked_sub(16).ok_or(super::CUT_SHORT)?;
    let (body, table) = reader.bytes.split_at(body);
    if table[14..] != [0, 0] || table.iter().any(|b| b & 15 == 15 || b >> 4 == 15) {
        return Err("the table of the compressed triangles is not valid");
    }
    let mut reader = Reader { bytes: body };
    let codes = reader.take(count / 3)?;
    let mut decoder = Decoder { data: reader, edges: Fifo::new(), vertices: Fifo::new(), next: 0, last: 0 };
    let mut out = Vec::with_capacity(count);
    for code in codes {
        let (high, low) = (code >> 4, code & 15);
        let corners = if high < 15 { decoder.on_edge(high, low)? } else { decoder.apart(low, table)? };
        out.extend(corners);
    }
    if decoder.data.bytes.is_empty() { Ok(out) } else { Err("the compressed triangles have bytes left") }
}

/// Mode 2: `count` indices of any kind.
pub(super) fn sequence(data: &[u8], count: usize) -> Result<Vec<u32>, &'static str> {
    let mut reader = Reader { bytes: data };
    if reader.byte()? != 0xd1 {
        return Err("the compressed stream is not one of indices");
    }
    let body = reader.bytes.len().checked_sub(4).ok_or(super::CUT_SHORT)?;
    if body < count {
        return Err(super::CUT_SHORT);
    }
    reader.bytes = &reader.bytes[..body];
    let mut last = [0_u32; 2];
    let mut out = Vec::with_capacity(count);
    for _ in 0..count {
        let code = reader.varint()?;
        let baseline = &mut last[(code & 1) as usize];
        *baseline = baseline.wrapping_add(unzigzag(code >> 1));
        out.push(*baseline);
    }
    if reader.bytes.is_empty() { Ok(out) } else { Err("the compressed indices have bytes left") }
}

/// Indices as little-endian numbers of 2 or 4 bytes.
pub(super) fn pack(indices: &[u32], stride: usize) -> Result<Vec<u8>, &'static str> {
    let mut out = Vec::with_capacity(indices.len() * stride);
    for &index in indices {
        if stride == 2 {
            let index = u16::try_from(index).map_err(|_| "an index does not fit its two bytes")?;
            out.extend(index.to_le_bytes());
        } else {
            out.extend(index.to_le_bytes());
        }
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A lookup table whose entry 0 takes three new vertices.
    const TABLE: [u8; 16] = [0; 16];

    fn stream(codes: &[u8], data: &[u8]) -> Vec<u8> {
        [&[0xe1], codes, data, &TABLE].concat()
    }

    #[test]
    fn triangles_follow_edges_and_vertices() {
        // Three new vertices; the newest edge with a new vertex; an edge with an explicit vertex (last + 5).
        let out = triangles(&stream(&[0xf0, 0x00, 0x0f], &[10]), 9).expect("valid");
        assert_eq!(out, [0, 1, 2, 0, 2, 3, 0, 3, 5]);
        // Explicit triangle 7, then relative to `last`.
        let out = triangles(&stream(&[0xff, 0x0e], &[0xff, 14, 2, 2]), 6).expect("valid");
        assert_eq!(out, [7, 8, 9, 7, 9, 10]);
    }

    #[test]
    fn references_before_the_first_are_refused() {
        assert!(triangles(&stream(&[0x00], &[]), 3).is_err());
        assert!(triangles(&stream(&[0xfe], &[0x11]), 3).is_err());
        assert!(triangles(&stream(&[0xf0], &[1]), 3).is_err());
        assert!(triangles(&stream(&[0xf0], &[]), 6).is_err());
    }

    #[test]
    fn sequences_keep_two_baselines() {
        // +5 on baseline 0, +100 on baseline 1, -1 on baseline 0.
        let data = [0xd1, 5 << 2, 0x91, 0x03, 0b10, 0, 0, 0, 0];
        assert_eq!(sequence(&data, 3), Ok(vec![5, 100, 4]));
        assert!(sequence(&data[..8], 3).is_err());
        assert!(sequence(&data, 2).is_err());
    }
}
