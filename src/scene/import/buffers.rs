//! Buffers and buffer views as checked byte slices.

use std::{cell::OnceCell, collections::HashMap, sync::Arc};

use super::{
    context::{Budget, Warnings, check_index},
    error::{Problem, Step},
    json::{BufferView, Document},
    meshopt,
    uri::{self, Target},
};

/// Gives the bytes behind a relative URI.
pub(super) type Resolver<'r> = &'r mut dyn FnMut(&str) -> Result<Vec<u8>, String>;

/// Bytes of a buffer, borrowed from the file or owned.
#[derive(Clone, Debug)]
pub(super) enum Bytes<'a> {
    Borrowed(&'a [u8]),
    Shared(Arc<Vec<u8>>),
    /// A buffer without data: legal as a stand-in for compressed views.
    Absent,
}

/// Files that the scene names, each read once.
pub(super) struct Files<'r> {
    resolve: Resolver<'r>,
    read: HashMap<String, Result<Arc<Vec<u8>>, String>>,
}

impl<'r> Files<'r> {
    pub(super) fn new(resolve: Resolver<'r>) -> Self {
        Self { resolve, read: HashMap::new() }
    }

    /// The bytes behind any URI.
    pub(super) fn load(&mut self, uri: &str, budget: &Budget) -> Result<Arc<Vec<u8>>, String> {
        match uri::parse(uri)? {
            Target::Data(data) => {
                let bound = usize::try_from(data.len_bound()).unwrap_or(usize::MAX);
                budget.take(bound, 1, "data URI").map_err(|p| p.reason())?;
                data.decode().map(Arc::new)
            }
            Target::File(path) => {
                if let Some(known) = self.read.get(&path) {
                    return known.clone();
                }
                let bytes = (self.resolve)(&path).map(Arc::new);
                let bytes = bytes.map_err(|why| format!("{} cannot be read: {why}", uri::shorten(&path)));
                if let Ok(bytes) = &bytes {
                    budget.grow(bytes.len());
                }
                self.read.insert(path, bytes.clone());
                bytes
            }
        }
    }
}

/// All buffers of a file, and compressed views decoded when first asked for.
#[derive(Debug)]
pub(super) struct Buffers<'a> {
    data: Vec<Bytes<'a>>,
    decoded: Vec<OnceCell<Step<Vec<u8>>>>,
}

impl<'a> Buffers<'a> {
    /// Reads every buffer.
    pub(super) fn load(
        doc: &Document<'_>,
        bin: Option<&'a [u8]>,
        files: &mut Files<'_>,
        budget: &Budget,
        warnings: &Warnings,
    ) -> Step<Self> {
        let mut data = Vec::with_capacity(doc.buffers.len());
        for (i, buffer) in doc.buffers.iter().enumerate() {
            let place = format!("buffers[{i}]");
            let bytes = match (&buffer.uri, bin) {
                (Some(uri), _) => {
                    let uri_place = format!("{place}.uri");
                    check_media_type(uri, &uri_place, warnings);
                    let bytes = files.load(uri, budget).map_err(|why| Problem::at(&uri_place, why))?;
                    Bytes::Shared(bytes)
                }
                (None, Some(bin)) if i == 0 => Bytes::Borrowed(bin),
                (None, _) => Bytes::Absent,
            };
            let length = buffer.byte_length.get();
            let bytes = trim(bytes, length);
            match &bytes {
                Bytes::Absent => {}
                bytes if bytes.len() < length => {
                    let reason = format!("{length}, but the data has {} bytes; it may be cut short", bytes.len());
                    warnings.add(format_args!("{place}.byteLength"), reason);
                }
                _ => {}
            }
            data.push(bytes);
        }
        let decoded = (0..doc.buffer_views.len()).map(|_| OnceCell::new()).collect();
        Ok(Self { data, decoded })
    }

    /// Bytes `offset..offset + length` of a buffer.
    fn slice(&self, buffer: usize, offset: usize, length: usize, place: &str) -> Step<&[u8]> {
        check_index(buffer, self.data.len(), format_args!("{place}.buffer"), "buffer")?;
        let bytes = match &self.data[buffer] {
            Bytes::Borrowed(bytes) => bytes,
            Bytes::Shared(bytes) => bytes.as_slice(),
            Bytes::Absent => return Err(Problem::at(format_args!("buffers[{buffer}]"), "has no data and no uri")),
        };
        bytes.get(offset..).and_then(|rest| rest.get(..length)).ok_or_else(|| {
            let reason = format!(
                "{length} bytes from byte {offset} on go past the end of buffers[{buffer}] ({} bytes)",
                bytes.len()
            );
            Problem::at(place, reason)
        })
    }

    /// The bytes of a view, decompressed if need be.
    pub(super) fn view(&self, doc: &Document<'_>, index: usize, budget: &Budget, place: &str) -> Step<&[u8]> {
        check_index(index, doc.buffer_views.len(), place, "bufferView")?;
        let view = &doc.buffer_views[index];
        let place = format!("bufferViews[{index}]");
        if view.meshopt().is_some() {
            let bytes = self.decoded[index].get_or_init(|| self.decompress(view, &place, budget));
            return bytes.as_deref().map_err(Clone::clone);
        }
        self.slice(view.buffer.index(), view.byte_offset.get(), view.byte_length.get(), &place)
    }

    fn decompress(&self, view: &BufferView, place: &str, budget: &Budget) -> Step<Vec<u8>> {
        let Some(packed) = view.meshopt() else { return Ok(Vec::new()) };
        let place = format!("{place}.extensions.EXT_meshopt_compression");
        let source = self.slice(packed.buffer.index(), packed.byte_offset.get(), packed.byte_length.get(), &place)?;
        let (count, stride) = (packed.count.get(), packed.byte_stride.get());
        budget.take(count, stride, &place)?;
        let bytes = meshopt::decode(source, count, stride, &packed.mode, packed.filter.as_deref())
            .map_err(|why| Problem::at(&place, why))?;
        if bytes.len() < view.byte_length.get() {
            let reason = format!("holds {} bytes of the view's {}", bytes.len(), view.byte_length.get());
            return Err(Problem::at(place, reason));
        }
        Ok(bytes)
    }
}

impl Bytes<'_> {
    fn len(&self) -> usize {
        match self {
            Self::Borrowed(bytes) => bytes.len(),
            Self::Shared(bytes) => bytes.len(),
            Self::Absent => 0,
        }
    }
}

/// Leaves padding of the binary chunk out.
fn trim(bytes: Bytes<'_>, length: usize) -> Bytes<'_> {
    match bytes {
        Bytes::Borrowed(bytes) => Bytes::Borrowed(bytes.get(..length).unwrap_or(bytes)),
        other => other,
    }
}

fn check_media_type(uri: &str, place: &str, warnings: &Warnings) {
    if let Ok(Target::Data(data)) = uri::parse(uri)
        && !["application/octet-stream", "application/gltf-buffer"].contains(&data.media_type)
    {
        warnings.add(place, format_args!("media type {} is not one for buffers", uri::shorten(data.media_type)));
    }
}
