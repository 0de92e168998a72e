//! Decoder of the buffer compression of EXT_meshopt_compression and KHR_meshopt_compression.

/// Decodes `count` elements of `stride` bytes.
pub(super) fn decode(
    _data: &[u8],
    _count: usize,
    _stride: usize,
    mode: &str,
    _filter: Option<&str>,
) -> Result<Vec<u8>, String> {
    Err(format!("mode {mode} is not decoded"))
}
