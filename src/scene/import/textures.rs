//! Textures: which image, and how it is sampled.

use super::{
    super::{Filter, Image, ImageId, TexSampler, Texture, Wrap},
    context::{Context, check_index},
    error::Step,
    json::{self, Idx},
};

/// All textures. `decoded` says which images could be read.
pub(super) fn import(cx: &Context<'_>, decoded: &[bool]) -> Step<Vec<Texture>> {
    cx.budget.take(cx.doc.textures.len(), size_of::<Texture>(), "textures")?;
    let texture = |(i, source): (usize, &json::Texture)| import_texture(cx, i, source, decoded);
    cx.doc.textures.iter().enumerate().map(texture).collect()
}

fn import_texture(cx: &Context<'_>, index: usize, source: &json::Texture, decoded: &[bool]) -> Step<Texture> {
    let place = format!("textures[{index}]");
    let image = if let Some(image) = source.image() {
        check_index(image.index(), cx.doc.images.len(), format_args!("{place}.source"), "image")?;
        decoded[image.index()].then_some(ImageId(image.0))
    } else {
        cx.warnings.add(&place, "names no image in a format that can be read; drawn white");
        None
    };
    let sampler = match source.sampler {
        Some(sampler) => {
            check_index(sampler.index(), cx.doc.samplers.len(), format_args!("{place}.sampler"), "sampler")?;
            tex_sampler(cx, sampler.index())
        }
        None => TexSampler::default(),
    };
    Ok(Texture { image, sampler })
}

fn tex_sampler(cx: &Context<'_>, index: usize) -> TexSampler {
    let source = &cx.doc.samplers[index];
    let default = TexSampler::default();
    let unknown = |member: &str, code: Idx| {
        cx.warnings.add(format_args!("samplers[{index}].{member}"), format_args!("{} is unknown; ignored", code.0));
    };
    let wrap = |member: &str, code: Option<Idx>| match code.map(|c| c.0) {
        None | Some(10497) => Wrap::Repeat,
        Some(33648) => Wrap::Mirror,
        Some(33071) => Wrap::Clamp,
        Some(other) => {
            unknown(member, Idx(other));
            Wrap::Repeat
        }
    };
    let mag = match source.mag_filter.map(|c| c.0) {
        None | Some(9729) => Filter::Linear,
        Some(9728) => Filter::Nearest,
        Some(other) => {
            unknown("magFilter", Idx(other));
            default.mag
        }
    };
    let (min, mip) = match source.min_filter.map(|c| c.0) {
        None | Some(9987) => (Filter::Linear, Some(Filter::Linear)),
        Some(9728) => (Filter::Nearest, None),
        Some(9729) => (Filter::Linear, None),
        Some(9984) => (Filter::Nearest, Some(Filter::Nearest)),
        Some(9985) => (Filter::Linear, Some(Filter::Nearest)),
        Some(9986) => (Filter::Nearest, Some(Filter::Linear)),
        Some(other) => {
            unknown("minFilter", Idx(other));
            (default.min, default.mip)
        }
    };
    TexSampler { mag, min, mip, wrap_u: wrap("wrapS", source.wrap_s), wrap_v: wrap("wrapT", source.wrap_t) }
}

/// Stands in for an image that could not be read, so that image numbers stay the file's.
pub(super) fn blank(name: String) -> Image {
    Image { name, width: 1, height: 1, rgba: [255; 4].into() }
}
