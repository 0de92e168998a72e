//! A PNG writer of our own, so that the bytes of the scenes do not follow the version of an encoder.
//!
//! Eight bits a channel, RGB; each row takes the filter with the least sum of absolute differences; deflate
//! with greedy matches of a hash chain and the fixed Huffman code (RFC 1951, 1950, 2083).

/// A picture of eight-bit RGB texels, rows top down.
#[derive(Clone)]
pub struct Picture {
    /// Width in texels.
    pub width: usize,
    /// Height in texels.
    pub height: usize,
    /// `width * height` colours.
    pub texels: Vec<[u8; 3]>,
}

impl Picture {
    /// A picture filled by `texel(x, y)`.
    pub fn from_fn(width: usize, height: usize, texel: impl Fn(usize, usize) -> [u8; 3]) -> Self {
        let texels = (0..width * height).map(|i| texel(i % width, i / width)).collect();
        Self { width, height, texels }
    }

    /// The picture as a PNG file.
    pub fn encode(&self) -> Vec<u8> {
        let mut out = b"\x89PNG\r\n\x1a\n".to_vec();
        let mut header = Vec::new();
        header.extend((self.width as u32).to_be_bytes());
        header.extend((self.height as u32).to_be_bytes());
        header.extend([8, 2, 0, 0, 0]);
        chunk(&mut out, *b"IHDR", &header);
        chunk(&mut out, *b"IDAT", &zlib(&self.filtered_rows()));
        chunk(&mut out, *b"IEND", &[]);
        out
    }

    fn filtered_rows(&self) -> Vec<u8> {
        let stride = 3 * self.width;
        let mut out = Vec::with_capacity((stride + 1) * self.height);
        let mut above = vec![0u8; stride];
        for row in self.texels.chunks(self.width) {
            let row: Vec<u8> = row.iter().flatten().copied().collect();
            let best = (0..5u8)
                .map(|kind| filtered(kind, &row, &above))
                .min_by_key(|r| r.iter().skip(1).map(|&b| u64::from(b.cast_signed().unsigned_abs())).sum::<u64>());
            out.extend(best.into_iter().flatten());
            above = row;
        }
        out
    }
}

/// One row under PNG filter `kind`, the filter's number first.
fn filtered(kind: u8, row: &[u8], above: &[u8]) -> Vec<u8> {
    let mut out = vec![kind];
    for (i, &value) in row.iter().enumerate() {
        let (left, corner) = if i >= 3 { (row[i - 3], above[i - 3]) } else { (0, 0) };
        let up = above[i];
        let guess = match kind {
            0 => 0,
            1 => left,
            2 => up,
            3 => u16::midpoint(u16::from(left), u16::from(up)) as u8,
            _ => paeth(left, up, corner),
        };
        out.push(value.wrapping_sub(guess));
    }
    out
}

fn paeth(left: u8, up: u8, corner: u8) -> u8 {
    let guess = i16::from(left) + i16::from(up) - i16::from(corner);
    let off = |v: u8| (guess - i16::from(v)).abs();
    if off(left) <= off(up) && off(left) <= off(corner) {
        left
    } else if off(up) <= off(corner) {
        up
    } else {
        corner
    }
}

fn chunk(out: &mut Vec<u8>, kind: [u8; 4], data: &[u8]) {
    out.extend((data.len() as u32).to_be_bytes());
    let start = out.len();
    out.extend(kind);
    out.extend(data);
    let crc = crc32(&out[start..]);
    out.extend(crc.to_be_bytes());
}

fn crc32(data: &[u8]) -> u32 {
    let step = |crc: u32, &byte: &u8| {
        (0..8).fold(crc ^ u32::from(byte), |c, _| if c & 1 == 1 { 0xedb8_8320 ^ (c >> 1) } else { c >> 1 })
    };
    !data.iter().fold(!0, step)
}

fn adler32(data: &[u8]) -> u32 {
    let (a, b) = data.iter().fold((1u32, 0u32), |(a, b), &byte| {
        let a = (a + u32::from(byte)) % 65521;
        (a, (b + a) % 65521)
    });
    b << 16 | a
}

/// Bits, least significant first.
#[derive(Default)]
struct Bits {
    out: Vec<u8>,
    held: u64,
    count: u32,
}

impl Bits {
    fn put(&mut self, value: u32, count: u32) {
        self.held |= u64::from(value) << self.count;
        self.count += count;
        while self.count >= 8 {
            self.out.push(self.held as u8);
            self.held >>= 8;
            self.count -= 8;
        }
    }

    /// A code of the fixed literal and length tree.
    fn symbol(&mut self, symbol: u32) {
        let (code, count) = match symbol {
            0..144 => (0x30 + symbol, 8),
            144..256 => (0x190 + symbol - 144, 9),
            256..280 => (symbol - 256, 7),
            _ => (0xc0 + symbol - 280, 8),
        };
        self.put(code.reverse_bits() >> (32 - count), count);
    }

    /// A match of `length` bytes `distance` back.
    fn copy(&mut self, length: usize, distance: usize) {
        let (symbol, extra, bits) = bucket(length - 3, 3);
        if length == 258 {
            self.symbol(285);
        } else {
            self.symbol(257 + symbol);
            self.put(extra, bits);
        }
        let (symbol, extra, bits) = bucket(distance - 1, 2);
        self.put(symbol.reverse_bits() >> 27, 5);
        self.put(extra, bits);
    }
}

/// Deflate's bucket of a length or distance less its minimum: symbol, extra bits and their count, where each
/// doubling has `1 << (shift - 1)` buckets (lengths: shift 3, distances: shift 2).
fn bucket(value: usize, shift: u32) -> (u32, u32, u32) {
    let value = value as u32;
    let per = 1u32 << (shift - 1);
    if value < 2 * per {
        return (value, 0, 0);
    }
    let bits = value.ilog2() - (shift - 1);
    let symbol = (bits + 1) * per + ((value >> bits) - per);
    (symbol, value & ((1 << bits) - 1), bits)
}

const HASH_BITS: u32 = 15;
const MAX_CHAIN: usize = 48;
const WINDOW: usize = 32768;

fn zlib(data: &[u8]) -> Vec<u8> {
    let mut bits = Bits { out: vec![0x78, 0x01], ..Bits::default() };
    bits.put(0b011, 3);
    let mut head = vec![usize::MAX; 1 << HASH_BITS];
    let mut previous = vec![usize::MAX; data.len()];
    let mut at = 0;
    while at < data.len() {
        let (length, distance) = longest_match(data, at, &head, &previous);
        let step = if length >= 3 {
            bits.copy(length, distance);
            length
        } else {
            bits.symbol(u32::from(data[at]));
            1
        };
        for _ in 0..step {
            if let Some(slot) = hash3(data, at) {
                previous[at] = head[slot];
                head[slot] = at;
            }
            at += 1;
        }
    }
    bits.symbol(256);
    bits.put(0, 7);
    bits.out.extend(adler32(data).to_be_bytes());
    bits.out
}

fn hash3(data: &[u8], at: usize) -> Option<usize> {
    let b = data.get(at..at + 3)?;
    let key = u32::from(b[0]) | u32::from(b[1]) << 8 | u32::from(b[2]) << 16;
    Some((key.wrapping_mul(0x9e37_79b1) >> (32 - HASH_BITS)) as usize)
}

fn longest_match(data: &[u8], at: usize, head: &[usize], previous: &[usize]) -> (usize, usize) {
    let limit = (data.len() - at).min(258);
    let (mut best, mut distance) = (0, 0);
    let mut candidate = hash3(data, at).map_or(usize::MAX, |slot| head[slot]);
    for _ in 0..MAX_CHAIN {
        if candidate == usize::MAX || at - candidate > WINDOW || best == limit {
            break;
        }
        let length = (0..limit).take_while(|&i| data[candidate + i] == data[at + i]).count();
        if length > best {
            (best, distance) = (length, at - candidate);
        }
        candidate = previous[candidate];
    }
    (best, distance)
}
