//! Accessors as plain arrays: every component type, normalised, strided, sparse, with every bound checked
//! before anything is allocated.

use std::fmt::Display;

use super::{
    context::{Context, check_index},
    error::{Problem, Step},
    json::{self, AccessorType, SparseIndices},
};

/// Number format of a component.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Component {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

impl Component {
    /// From glTF's number.
    pub(super) fn from_code(code: u32) -> Option<Self> {
        match code {
            5120 => Some(Self::I8),
            5121 => Some(Self::U8),
            5122 => Some(Self::I16),
            5123 => Some(Self::U16),
            5125 => Some(Self::U32),
            5126 => Some(Self::F32),
            _ => None,
        }
    }

    pub(super) fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::U32 | Self::F32 => 4,
        }
    }

    pub(super) fn is_unsigned(self) -> bool {
        matches!(self, Self::U8 | Self::U16 | Self::U32)
    }
}

impl AccessorType {
    /// Columns and rows of an element.
    fn shape(self) -> (usize, usize) {
        match self {
            Self::Scalar => (1, 1),
            Self::Vec2 => (1, 2),
            Self::Vec3 => (1, 3),
            Self::Vec4 => (1, 4),
            Self::Mat2 => (2, 2),
            Self::Mat3 => (3, 3),
            Self::Mat4 => (4, 4),
        }
    }

    /// Numbers in an element.
    pub(super) fn lanes(self) -> usize {
        let (columns, rows) = self.shape();
        columns * rows
    }
}

/// Where the numbers of an accessor lie.
#[derive(Clone, Copy, Debug)]
pub(super) struct Layout {
    pub(super) component: Component,
    pub(super) kind: AccessorType,
    pub(super) normalized: bool,
    pub(super) count: usize,
    /// Bytes from one element to the next.
    pub(super) stride: usize,
    /// Bytes of one element, columns of small matrices padded to 4.
    pub(super) element: usize,
}

impl Layout {
    fn new(accessor: &json::Accessor, stride: Option<usize>, place: &str) -> Step<Self> {
        let code = accessor.component_type.0;
        let component = Component::from_code(code).ok_or_else(|| {
            let known = "5120, 5121, 5122, 5123, 5125 and 5126 exist";
            Problem::at(format_args!("{place}.componentType"), format!("{code} is unknown; {known}"))
        })?;
        let (columns, rows) = accessor.kind.shape();
        let column = rows * component.size();
        let column = if columns > 1 { column.next_multiple_of(4) } else { column };
        let element = columns * column;
        let stride = stride.filter(|&s| s > 0).unwrap_or(element);
        if stride < element {
            let reason = format!("the view's byteStride {stride} is less than the {element} bytes of an element");
            return Err(Problem::at(place, reason));
        }
        let normalized = accessor.normalized && !matches!(component, Component::F32 | Component::U32);
        Ok(Self { component, kind: accessor.kind, normalized, count: accessor.count.get(), stride, element })
    }

    /// Byte offset of each number within an element.
    fn offsets(&self) -> impl Iterator<Item = usize> + Clone {
        let (columns, rows) = self.kind.shape();
        let (column, size) = (self.element / columns, self.component.size());
        (0..columns).flat_map(move |c| (0..rows).map(move |r| c * column + r * size))
    }

    /// Columns of an element: more than one for matrices.
    pub(super) fn columns(&self) -> usize {
        self.kind.shape().0
    }

    /// Bytes from the first element's start to the last one's end; `None` when that overflows.
    fn span(&self) -> Option<usize> {
        match self.count.checked_sub(1) {
            None => Some(0),
            Some(last) => last.checked_mul(self.stride)?.checked_add(self.element),
        }
    }
}

fn le<const N: usize>(bytes: &[u8], at: usize) -> [u8; N] {
    let mut out = [0; N];
    out.copy_from_slice(&bytes[at..at + N]);
    out
}

/// Calls `put(number index, value)` for every number of elements laid out in `bytes`.
fn each_number(layout: &Layout, bytes: &[u8], mut put: impl FnMut(usize, f32)) {
    let scale = |max: f32, v: f32| if layout.normalized { (v / max).max(-1.0) } else { v };
    let read = |at: usize| match layout.component {
        Component::I8 => scale(127.0, f32::from(i8::from_le_bytes(le(bytes, at)))),
        Component::U8 => scale(255.0, f32::from(bytes[at])),
        Component::I16 => scale(32767.0, f32::from(i16::from_le_bytes(le(bytes, at)))),
        Component::U16 => scale(65535.0, f32::from(u16::from_le_bytes(le(bytes, at)))),
        Component::U32 => u32::from_le_bytes(le(bytes, at)) as f32,
        Component::F32 => f32::from_le_bytes(le(bytes, at)),
    };
    let mut number = 0;
    for i in 0..layout.count {
        for offset in layout.offsets() {
            put(number, read(i * layout.stride + offset));
            number += 1;
        }
    }
}

impl Context<'_> {
    /// The accessor a reference names.
    pub(super) fn accessor(&self, index: usize, place: impl Display) -> Step<&json::Accessor> {
        check_index(index, self.doc.accessors.len(), place, "accessor")?;
        Ok(&self.doc.accessors[index])
    }

    /// Layout of an accessor, its format checked but not its extent.
    pub(super) fn layout(&self, index: usize) -> Step<Layout> {
        let place = format!("accessors[{index}]");
        let accessor = self.accessor(index, &place)?;
        let stride = match accessor.buffer_view {
            Some(view) => {
                let view_place = format!("{place}.bufferView");
                check_index(view.index(), self.doc.buffer_views.len(), view_place, "bufferView")?;
                let view = &self.doc.buffer_views[view.index()];
                match view.meshopt() {
                    Some(packed) => Some(packed.byte_stride.get()),
                    None => view.byte_stride.map(json::Size::get),
                }
            }
            None => None,
        };
        Layout::new(accessor, stride, &place)
    }

    /// The bytes behind an accessor without its sparse part; `None` means zeros.
    fn elements(&self, index: usize, layout: &Layout) -> Step<Option<&[u8]>> {
        let place = format!("accessors[{index}]");
        let accessor = &self.doc.accessors[index];
        let Some(view) = accessor.buffer_view else { return Ok(None) };
        let view_place = format!("{place}.bufferView");
        let bytes = self.buffers.view(self.doc, view.index(), self.budget, &view_place)?;
        let offset = accessor.byte_offset.map_or(0, json::Size::get);
        window(bytes, offset, layout, &place).map(Some)
    }

    /// Checks an accessor's format and extent without reading it.
    pub(super) fn check_accessor(&self, index: usize) -> Step<Layout> {
        let layout = self.layout(index)?;
        self.elements(index, &layout)?;
        self.sparse(index, &layout)?;
        Ok(layout)
    }

    /// All numbers of an accessor, element after element, dequantised, sparse values applied.
    pub(super) fn numbers(&self, index: usize) -> Step<Vec<f32>> {
        self.decode(index, self.layout(index)?)
    }

    /// As [`Self::numbers`], normalised integers as they are stored.
    pub(super) fn raw_numbers(&self, index: usize) -> Step<Vec<f32>> {
        self.decode(index, Layout { normalized: false, ..self.layout(index)? })
    }

    fn decode(&self, index: usize, layout: Layout) -> Step<Vec<f32>> {
        let place = format!("accessors[{index}]");
        let bytes = self.elements(index, &layout)?;
        let sparse = self.sparse(index, &layout)?;
        let lanes = layout.kind.lanes();
        self.budget.take(layout.count, lanes * 4, &place)?;
        let mut out = vec![0.0; layout.count * lanes];
        if let Some(bytes) = bytes {
            match layout.component {
                Component::F32 if layout.stride == layout.element => {
                    for (out, bytes) in out.iter_mut().zip(bytes.chunks_exact(4)) {
                        *out = f32::from_le_bytes(le(bytes, 0));
                    }
                }
                _ => each_number(&layout, bytes, |i, v| out[i] = v),
            }
        }
        if let Some(sparse) = sparse {
            let values = Layout { count: sparse.indices.len(), stride: layout.element, ..layout };
            each_number(&values, sparse.values, |i, v| {
                out[sparse.indices[i / lanes] as usize * lanes + i % lanes] = v;
            });
        }
        Ok(out)
    }

    /// Elements of exactly `N` numbers each.
    pub(super) fn vectors<const N: usize>(&self, index: usize, place: impl Display) -> Step<Vec<[f32; N]>> {
        let layout = self.layout(index)?;
        if layout.kind.lanes() != N {
            let reason = format!("accessors[{index}] has {} numbers an element, {N} are needed", layout.kind.lanes());
            return Err(Problem::at(place, reason));
        }
        let numbers = self.numbers(index)?;
        Ok(numbers.chunks_exact(N).map(|c| std::array::from_fn(|i| c[i])).collect())
    }

    /// Unsigned whole numbers: indices or joints.
    pub(super) fn unsigned(&self, index: usize, place: impl Display) -> Step<Vec<u32>> {
        let layout = self.layout(index)?;
        if !layout.component.is_unsigned() || layout.normalized {
            return Err(Problem::at(place, format!("accessors[{index}] is not of unsigned whole numbers")));
        }
        let own = format!("accessors[{index}]");
        let bytes = self.elements(index, &layout)?;
        let sparse = self.sparse(index, &layout)?;
        let lanes = layout.kind.lanes();
        self.budget.take(layout.count, lanes * 4, own)?;
        let mut out = vec![0; layout.count * lanes];
        if let Some(bytes) = bytes {
            each_unsigned(&layout, bytes, |i, v| out[i] = v);
        }
        if let Some(sparse) = sparse {
            let values = Layout { count: sparse.indices.len(), stride: layout.element, ..layout };
            each_unsigned(&values, sparse.values, |i, v| {
                out[sparse.indices[i / lanes] as usize * lanes + i % lanes] = v;
            });
        }
        Ok(out)
    }

    /// The sparse part of an accessor, indices in range and values in bounds.
    fn sparse(&self, index: usize, layout: &Layout) -> Step<Option<SparsePart<'_>>> {
        let Some(sparse) = &self.doc.accessors[index].sparse else { return Ok(None) };
        let place = format!("accessors[{index}].sparse");
        let count = sparse.count.get();
        if count > layout.count {
            let reason = format!("{count} values for an accessor of {} elements", layout.count);
            return Err(Problem::at(format_args!("{place}.count"), reason));
        }
        let indices = self.sparse_indices(&sparse.indices, count, layout.count, &place)?;
        let values_place = format!("{place}.values");
        let view = sparse.values.buffer_view.index();
        let bytes = self.buffers.view(self.doc, view, self.budget, &format!("{values_place}.bufferView"))?;
        let values = Layout { count, stride: layout.element, ..*layout };
        let values = window(bytes, sparse.values.byte_offset.get(), &values, &values_place)?;
        Ok(Some(SparsePart { indices, values }))
    }

    fn sparse_indices(&self, at: &SparseIndices, count: usize, elements: usize, place: &str) -> Step<Vec<u32>> {
        let place = format!("{place}.indices");
        let component = Component::from_code(at.component_type.0).filter(|c| c.is_unsigned());
        let component = component.ok_or_else(|| {
            let reason = format!("{} is not 5121, 5123 or 5125", at.component_type.0);
            Problem::at(format_args!("{place}.componentType"), reason)
        })?;
        let size = component.size();
        let layout =
            Layout { component, kind: AccessorType::Scalar, normalized: false, count, stride: size, element: size };
        let view = at.buffer_view.index();
        let bytes = self.buffers.view(self.doc, view, self.budget, &format!("{place}.bufferView"))?;
        let bytes = window(bytes, at.byte_offset.get(), &layout, &place)?;
        self.budget.take(count, 4, &place)?;
        let mut indices = vec![0; count];
        each_unsigned(&layout, bytes, |i, v| indices[i] = v);
        if let Some(bad) = indices.iter().find(|&&i| i as usize >= elements) {
            return Err(Problem::at(place, format!("index {bad}, but the accessor has {elements} elements")));
        }
        if !indices.is_sorted_by(|a, b| a < b) {
            self.warnings.add(place, "indices do not increase; where one is repeated the last value counts");
        }
        Ok(indices)
    }
}

/// The bytes of a view that a layout covers from `offset` on.
fn window<'b>(bytes: &'b [u8], offset: usize, layout: &Layout, place: &str) -> Step<&'b [u8]> {
    let covered = layout.span().and_then(|span| bytes.get(offset..)?.get(..span));
    covered.ok_or_else(|| {
        let (count, size) = (layout.count, bytes.len());
        let reason =
            format!("{count} elements from byte {offset} on go past the end of their bufferView ({size} bytes)");
        Problem::at(place, reason)
    })
}

struct SparsePart<'b> {
    indices: Vec<u32>,
    values: &'b [u8],
}

fn each_unsigned(layout: &Layout, bytes: &[u8], mut put: impl FnMut(usize, u32)) {
    let read = |at: usize| match layout.component {
        Component::U8 | Component::I8 => u32::from(bytes[at]),
        Component::U16 | Component::I16 => u32::from(u16::from_le_bytes(le(bytes, at))),
        Component::U32 | Component::F32 => u32::from_le_bytes(le(bytes, at)),
    };
    let mut number = 0;
    for i in 0..layout.count {
        for offset in layout.offsets() {
            put(number, read(i * layout.stride + offset));
            number += 1;
        }
    }
}
