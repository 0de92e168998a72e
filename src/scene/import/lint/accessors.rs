//! Accessors: extents of unused ones, alignment, bounds, numbers that are not finite.

use super::super::{
    accessor::{Component, Layout},
    context::Context,
    json,
};

/// At most this many numbers are compared with their bounds.
const MAX_NUMBERS: usize = 8 << 20;

pub(super) fn check(cx: &Context<'_>) {
    let mut left = MAX_NUMBERS;
    for (i, accessor) in cx.doc.accessors.iter().enumerate() {
        let layout = cx.layout(i).inspect(|layout| check_format(cx, i, accessor, layout));
        let layout = match layout.and_then(|_| cx.check_accessor(i)) {
            Ok(layout) => layout,
            Err(problem) => {
                cx.warnings.add_problem(&problem, &format!("nothing drawn reads accessors[{i}]"));
                continue;
            }
        };
        let numbers = layout.count.saturating_mul(layout.kind.lanes());
        let is_float = layout.component == Component::F32;
        let has_data = accessor.buffer_view.is_some() || accessor.sparse.is_some();
        if numbers <= left && has_data && (is_float || accessor.min.is_some() || accessor.max.is_some()) {
            left -= numbers;
            check_numbers(cx, i, accessor, &layout);
        }
    }
}

fn check_format(cx: &Context<'_>, index: usize, accessor: &json::Accessor, layout: &Layout) {
    let place = format!("accessors[{index}]");
    let offset = accessor.byte_offset.map_or(0, |o| o.0);
    if accessor.normalized && matches!(layout.component, Component::F32 | Component::U32) {
        cx.warnings.add(format_args!("{place}.normalized"), "means nothing for 32-bit components; ignored");
    }
    let Some(view) = accessor.buffer_view else {
        if accessor.byte_offset.is_some() {
            cx.warnings.add(format_args!("{place}.byteOffset"), "is given without a bufferView; ignored");
        }
        return;
    };
    let view = &cx.doc.buffer_views[view.index()];
    let align = if layout.columns() > 1 { 4 } else { layout.component.size() as u64 };
    if !offset.is_multiple_of(align) {
        cx.warnings.add(format_args!("{place}.byteOffset"), format_args!("{offset} is not a multiple of {align}"));
    } else if !offset.wrapping_add(view.byte_offset.0).is_multiple_of(align) {
        let text = format!("with the bufferView's offset it is not a multiple of {align}");
        cx.warnings.add(format_args!("{place}.byteOffset"), text);
    }
}

fn check_numbers(cx: &Context<'_>, index: usize, accessor: &json::Accessor, layout: &Layout) {
    let place = format!("accessors[{index}]");
    // Without budget left there is nothing to warn about: everything drawn was read before.
    let Ok(numbers) = cx.raw_numbers(index) else { return };
    let lanes = layout.kind.lanes();
    if let Some(i) = numbers.iter().position(|v| !v.is_finite()) {
        cx.warnings.add(&place, format_args!("element {} is not finite", i / lanes));
        return;
    }
    for (name, bounds, sign) in [("min", &accessor.min, -1.0), ("max", &accessor.max, 1.0)] {
        let Some(bounds) = bounds.as_deref() else { continue };
        if bounds.len() != lanes {
            let text = format!("has {} numbers for elements of {lanes}", bounds.len());
            cx.warnings.add(format_args!("{place}.{name}"), text);
            continue;
        }
        // Exporters round; only what is plainly outside is worth a word.
        let outside = |(i, v): (usize, &f32)| {
            let (bound, v) = (bounds[i % lanes], f64::from(*v));
            (v - bound) * sign > 1e-4 * bound.abs().max(v.abs()).max(1e-3)
        };
        if let Some(i) = numbers.iter().enumerate().position(outside) {
            let text = format!("element {} lies outside: {} against {}", i / lanes, numbers[i], bounds[i % lanes]);
            cx.warnings.add(format_args!("{place}.{name}"), text);
        }
    }
}
