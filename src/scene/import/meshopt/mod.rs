//! Decoder of the buffer compression of `EXT_meshopt_compression` and `KHR_meshopt_compression`.
//!
//! Written from the extensions' normative appendices on bitstream and filters. Every read is checked; a
//! stream that ends early, has bytes left, or refers to what was not yet written is an error.

mod attributes;
mod filters;
mod indices;

use filters::Filter;

/// Reads bytes from the front of a stream.
#[derive(Clone, Copy, Debug)]
struct Reader<'a> {
    bytes: &'a [u8],
}

const CUT_SHORT: &str = "the compressed stream ends too early";

impl<'a> Reader<'a> {
    fn byte(&mut self) -> Result<u8, &'static str> {
        let (&byte, rest) = self.bytes.split_first().ok_or(CUT_SHORT)?;
        self.bytes = rest;
        Ok(byte)
    }

    fn take(&mut self, count: usize) -> Result<&'a [u8], &'static str> {
        let (taken, rest) = self.bytes.split_at_checked(count).ok_or(CUT_SHORT)?;
        self.bytes = rest;
        Ok(taken)
    }

    /// Unsigned LEB128 of at most five bytes.
    fn varint(&mut self) -> Result<u32, &'static str> {
        let mut value = 0;
        for shift in [0, 7, 14, 21, 28] {
            let byte = self.byte()?;
            value |= u32::from(byte & 0x7f) << shift;
            if byte < 0x80 {
                return Ok(value);
            }
        }
        Err("a number in the compressed stream is longer than five bytes")
    }
}

/// Decodes `count` elements of `stride` bytes.
///
/// Allocates `count * stride` bytes, which the caller has found acceptable.
///
/// # Errors
/// In words, when a parameter or the stream is not valid.
pub(super) fn decode(
    data: &[u8],
    count: usize,
    stride: usize,
    mode: &str,
    filter: Option<&str>,
) -> Result<Vec<u8>, String> {
    let filter = Filter::named(filter.unwrap_or("NONE"), stride)?;
    let mut out = match mode {
        "ATTRIBUTES" => {
            if stride == 0 || stride > 256 || !stride.is_multiple_of(4) {
                return Err(format!("byteStride {stride} is not a multiple of 4 up to 256"));
            }
            attributes::decode(data, count, stride)?
        }
        "TRIANGLES" | "INDICES" => {
            if stride != 2 && stride != 4 {
                return Err(format!("byteStride {stride} of indices is neither 2 nor 4"));
            }
            if filter != Filter::None {
                return Err("indices have a filter".to_owned());
            }
            let indices =
                if mode == "TRIANGLES" { indices::triangles(data, count)? } else { indices::sequence(data, count)? };
            indices::pack(&indices, stride)?
        }
        other => return Err(format!("mode `{}` is unknown", other.escape_debug())),
    };
    filter.apply(&mut out, stride);
    Ok(out)
}
