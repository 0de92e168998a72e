//! The binary container: a header, a JSON chunk, at most one binary chunk.

use super::{
    context::Warnings,
    error::{Problem, Step},
};

const MAGIC: &[u8] = b"glTF";
const JSON: u32 = 0x4E4F_534A;
const BIN: u32 = 0x004E_4942;

/// JSON text and binary chunk of a file.
#[derive(Clone, Copy, Debug)]
pub(super) struct Container<'a> {
    pub(super) json: &'a [u8],
    pub(super) bin: Option<&'a [u8]>,
}

/// Splits a file: `.glb` by its magic, anything else is JSON text.
pub(super) fn split<'a>(bytes: &'a [u8], warnings: &Warnings) -> Step<Container<'a>> {
    if bytes.starts_with(MAGIC) { split_glb(bytes, warnings) } else { Ok(Container { json: bytes, bin: None }) }
}

fn u32_at(bytes: &[u8], at: usize) -> Option<u32> {
    bytes.get(at..at + 4)?.first_chunk().map(|b| u32::from_le_bytes(*b))
}

fn split_glb<'a>(bytes: &'a [u8], warnings: &Warnings) -> Step<Container<'a>> {
    let (Some(version), Some(length)) = (u32_at(bytes, 4), u32_at(bytes, 8)) else {
        return Err(Problem::at("GLB header", format!("has {} bytes of 12; the file is cut short", bytes.len())));
    };
    if version != 2 {
        return Err(Problem::at("GLB header", format!("version {version}; only version 2 can be read")));
    }
    let length = length as usize;
    if length > bytes.len() {
        let reason = format!("length {length}, but the file has {} bytes; it is cut short", bytes.len());
        return Err(Problem::at("GLB header", reason));
    }
    if length < bytes.len() {
        warnings.add("GLB header", format!("{} bytes after the end are ignored", bytes.len() - length));
    }
    chunks(&bytes[..length], warnings)
}

fn chunks<'a>(bytes: &'a [u8], warnings: &Warnings) -> Step<Container<'a>> {
    let (mut json, mut bin) = (None, None);
    let mut at = 12;
    let mut number = 0;
    while at < bytes.len() {
        let place = format!("GLB chunk {number}");
        let (Some(length), Some(kind)) = (u32_at(bytes, at), u32_at(bytes, at + 4)) else {
            return Err(Problem::at(place, format!("{} bytes of an 8-byte chunk header", bytes.len() - at)));
        };
        let start = at + 8;
        let Some(data) = bytes.get(start..).and_then(|rest| rest.get(..length as usize)) else {
            let reason = format!("length {length}, but {} bytes follow", bytes.len() - start);
            return Err(Problem::at(place, reason));
        };
        if length % 4 != 0 {
            warnings.add(&place, format!("length {length} is not a multiple of 4"));
        }
        match (kind, number) {
            (JSON, 0) => json = Some(data),
            (_, 0) => return Err(Problem::at(place, format!("type {kind:#010x}; the first must be JSON"))),
            (BIN, 1) => bin = Some(data),
            (JSON | BIN, _) => {
                return Err(Problem::at(place, "a second JSON chunk or a misplaced binary chunk"));
            }
            _ => warnings.add(&place, format!("unknown type {kind:#010x} is ignored")),
        }
        at = start + length as usize;
        number += 1;
    }
    match json {
        Some([]) => Err(Problem::at("GLB chunk 0", "the JSON chunk is empty")),
        Some(json) => Ok(Container { json, bin }),
        None => Err(Problem::at("GLB header", "no JSON chunk follows")),
    }
}
