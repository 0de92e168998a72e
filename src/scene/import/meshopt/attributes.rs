//! Mode 0: deltas between consecutive elements, byte position by byte position, in groups of 16.

use super::Reader;

const GROUP: usize = 16;

/// Bits a delta takes for each of a group's four header values; 0 is a group of zeros, 8 plain bytes.
const BITS_V0: [u32; 4] = [0, 2, 4, 8];
const BITS_V1: [[u32; 4]; 2] = [[0, 1, 2, 4], [1, 2, 4, 8]];

/// Deltas of one byte position of a block.
type Lane = [u8; 256];

/// Decodes `count` elements of `stride` bytes; `stride` is a multiple of 4 up to 256.
pub(super) fn decode(data: &[u8], count: usize, stride: usize) -> Result<Vec<u8>, &'static str> {
    let mut reader = Reader { bytes: data };
    let version = match reader.byte()? {
        0xa0 => 0,
        0xa1 => 1,
        _ => return Err("the compressed stream is not one of attributes"),
    };
    let (tail, padded) = if version == 0 { (stride, 32) } else { (stride + stride / 4, 24) };
    let body = reader.bytes.len().checked_sub(tail.max(padded)).ok_or(super::CUT_SHORT)?;
    let tail = &reader.bytes[reader.bytes.len() - tail..];
    reader.bytes = &reader.bytes[..body];
    let (baseline, channels) = tail.split_at(stride);
    let modes = channel_modes(channels, stride)?;

    let block_elements = ((8192 / stride) & !(GROUP - 1)).min(256);
    let mut out = vec![0; count * stride];
    let mut last = baseline.to_vec();
    let mut lanes: Vec<Lane> = vec![[0; 256]; stride];
    for block in out.chunks_mut(block_elements * stride) {
        let elements = block.len() / stride;
        let control = if version == 0 { &[][..] } else { reader.take(stride / 4)? };
        for (position, lane) in lanes.iter_mut().enumerate() {
            let bits = control.get(position / 4).map(|c| usize::from(c >> (position % 4 * 2) & 3));
            read_lane(&mut reader, &mut lane[..elements.next_multiple_of(GROUP)], bits)?;
        }
        for (channel, mode) in modes.iter().enumerate() {
            let lanes = &lanes[channel * 4..channel * 4 + 4];
            let last = &mut last[channel * 4..channel * 4 + 4];
            for (i, element) in block.chunks_exact_mut(stride).enumerate() {
                let deltas = [lanes[0][i], lanes[1][i], lanes[2][i], lanes[3][i]];
                let old = [last[0], last[1], last[2], last[3]];
                let new = mode.undo(old, deltas);
                element[channel * 4..channel * 4 + 4].copy_from_slice(&new);
                last.copy_from_slice(&new);
            }
        }
    }
    if reader.bytes.is_empty() { Ok(out) } else { Err("the compressed stream has bytes left") }
}

/// How four neighbouring bytes follow from those of the element before.
#[derive(Clone, Copy)]
enum Delta {
    Bytes,
    Words,
    Xor { rotation: u32 },
}

fn channel_modes(bytes: &[u8], stride: usize) -> Result<Vec<Delta>, &'static str> {
    if bytes.is_empty() {
        return Ok(vec![Delta::Bytes; stride / 4]);
    }
    let mode = |&byte: &u8| match (byte & 15, byte >> 4) {
        (0, 0) => Ok(Delta::Bytes),
        (1, 0) => Ok(Delta::Words),
        (2, rotation) => Ok(Delta::Xor { rotation: rotation.into() }),
        _ => Err("a channel mode of the compressed stream is unknown"),
    };
    bytes.iter().map(mode).collect()
}

impl Delta {
    fn undo(self, old: [u8; 4], delta: [u8; 4]) -> [u8; 4] {
        match self {
            Self::Bytes => std::array::from_fn(|i| old[i].wrapping_add(unzigzag8(delta[i]))),
            Self::Words => {
                let word = |b: [u8; 4], i: usize| u16::from_le_bytes([b[i], b[i + 1]]);
                let sum = |i| word(old, i).wrapping_add(unzigzag16(word(delta, i))).to_le_bytes();
                let (low, high) = (sum(0), sum(2));
                [low[0], low[1], high[0], high[1]]
            }
            Self::Xor { rotation } => {
                let delta = u32::from_le_bytes(delta).rotate_left(rotation);
                (u32::from_le_bytes(old) ^ delta).to_le_bytes()
            }
        }
    }
}

fn unzigzag8(v: u8) -> u8 {
    if v & 1 != 0 { !(v >> 1) } else { v >> 1 }
}

fn unzigzag16(v: u16) -> u16 {
    if v & 1 != 0 { !(v >> 1) } else { v >> 1 }
}

/// Reads the deltas of one byte position; `control` is absent in version 0.
fn read_lane(reader: &mut Reader<'_>, lane: &mut [u8], control: Option<usize>) -> Result<(), &'static str> {
    let bits = match control {
        None => BITS_V0,
        Some(mode @ (0 | 1)) => BITS_V1[mode],
        Some(2) => {
            lane.fill(0);
            return Ok(());
        }
        Some(_) => {
            let bytes = reader.take(lane.len())?;
            lane.copy_from_slice(bytes);
            return Ok(());
        }
    };
    let groups = lane.len() / GROUP;
    let header = reader.take(groups.div_ceil(4))?;
    for (g, group) in lane.chunks_exact_mut(GROUP).enumerate() {
        let bits = bits[usize::from(header[g / 4] >> (g % 4 * 2) & 3)];
        read_group(reader, group, bits)?;
    }
    Ok(())
}

fn read_group(reader: &mut Reader<'_>, group: &mut [u8], bits: u32) -> Result<(), &'static str> {
    match bits {
        0 => group.fill(0),
        8 => group.copy_from_slice(reader.take(GROUP)?),
        bits => {
            let packed = reader.take(GROUP * bits as usize / 8)?;
            let per_byte = 8 / bits as usize;
            let sentinel = (1 << bits) - 1;
            for (i, value) in group.iter_mut().enumerate() {
                // Single bits lie from the least significant up, wider values from the most significant down.
                let place = if bits == 1 { i % 8 } else { (per_byte - 1 - i % per_byte) * bits as usize };
                let small = packed[i / per_byte] >> place & sentinel;
                *value = if small == sentinel { reader.byte()? } else { small };
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_specifications_example_group_decodes() {
        let bytes = [0x17, 0x5f, 0xf0, 0xbc, 0x77, 0xa9, 0x21, 0x00, 0x34, 0xb5];
        let mut reader = Reader { bytes: &bytes };
        let mut group = [0; GROUP];
        read_group(&mut reader, &mut group, 4).expect("valid");
        let deltas = group.map(|v| unzigzag8(v).cast_signed());
        assert_eq!(deltas, [-1, -4, -3, 26, -91, 0, -6, 6, -4, -4, 5, -5, 1, -1, 0, 0]);
        assert!(reader.bytes.is_empty());
    }

    /// Two elements of 4 bytes in version 1 with every byte stored as it is.
    fn literal(mode: u8, baseline: [u8; 4], second: [u8; 4]) -> Vec<u8> {
        let mut stream = vec![0xa1, 0xff];
        for byte in second {
            stream.push(0);
            stream.push(byte);
            stream.extend([0; 14]);
        }
        stream.extend([0; 24 - 5]);
        stream.extend(baseline);
        stream.push(mode);
        stream
    }

    #[test]
    fn every_channel_mode_undoes_its_delta() {
        let at_second = |mode, delta| {
            decode(&literal(mode, [10, 0, 0, 0x80], delta), 2, 4).map(|out| [out[4], out[5], out[6], out[7]])
        };
        assert_eq!(at_second(0, [1, 2, 0, 4]), Ok([9, 1, 0, 0x82]));
        assert_eq!(at_second(1, [0, 2, 1, 0]), Ok([10, 1, 0xff, 0x7f]));
        assert_eq!(at_second(0x42, [1, 0, 0, 0]), Ok([26, 0, 0, 0x80]));
        assert!(at_second(0x10, [0; 4]).is_err() && at_second(3, [0; 4]).is_err());
    }

    #[test]
    fn streams_cut_anywhere_or_with_bytes_left_are_refused() {
        let whole = literal(0, [1, 2, 3, 4], [0; 4]);
        assert!(decode(&whole, 2, 4).is_ok());
        for length in 0..whole.len() {
            assert!(decode(&whole[..length], 2, 4).is_err(), "{length}");
        }
        let mut longer = whole.clone();
        longer.insert(2, 0);
        assert!(decode(&longer, 2, 4).is_err());
    }
}
