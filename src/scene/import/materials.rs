//! Materials.

use glam::{Vec2, Vec3, Vec4};

use super::{
    super::{AlphaMode, Material, TextureId, TextureRef},
    context::{Context, check_index, to_f32},
    error::Step,
    json::{self, TextureInfo},
};

/// All materials.
pub(super) fn import(cx: &Context<'_>) -> Step<Vec<Material>> {
    cx.budget.take(cx.doc.materials.len(), size_of::<Material>(), "materials")?;
    cx.doc.materials.iter().enumerate().map(|(i, source)| import_material(cx, i, source)).collect()
}

fn unit(value: Option<f64>, default: f32) -> f32 {
    value.map_or(default, to_f32).clamp(0.0, 1.0)
}

fn import_material(cx: &Context<'_>, index: usize, source: &json::Material) -> Step<Material> {
    let place = format!("materials[{index}]");
    let texture = |info: Option<&TextureInfo>, member: &str| texture_ref(cx, info, &format!("{place}.{member}"));
    let mut material = Material {
        name: source.name.as_deref().unwrap_or_default().to_owned(),
        normal_texture: texture(source.normal_texture.as_deref(), "normalTexture")?,
        occlusion_texture: texture(source.occlusion_texture.as_deref(), "occlusionTexture")?,
        emissive_texture: texture(source.emissive_texture.as_deref(), "emissiveTexture")?,
        alpha_mode: alpha_mode(cx, source, &place),
        double_sided: source.double_sided,
        unlit: source.is_unlit(),
        emissive: emissive(source),
        ..Material::default()
    };
    if let Some(info) = source.normal_texture.as_deref() {
        material.normal_scale = info.scale.map_or(1.0, to_f32);
    }
    if let Some(info) = source.occlusion_texture.as_deref() {
        material.occlusion_strength = unit(info.strength, 1.0);
    }
    if let Some(pbr) = source.pbr_metallic_roughness.as_deref() {
        material.base_color = color(pbr.base_color_factor);
        material.metallic = unit(pbr.metallic_factor, 1.0);
        material.roughness = unit(pbr.roughness_factor, 1.0);
        material.base_color_texture =
            texture(pbr.base_color_texture.as_ref(), "pbrMetallicRoughness.baseColorTexture")?;
        material.metallic_roughness_texture =
            texture(pbr.metallic_roughness_texture.as_ref(), "pbrMetallicRoughness.metallicRoughnessTexture")?;
    } else if let Some(old) = source.specular_glossiness() {
        // Not honoured, but its diffuse part gives a sensible picture.
        material.base_color = color(old.diffuse_factor);
        material.metallic = 0.0;
        material.roughness = 1.0 - unit(old.glossiness_factor, 1.0);
        let member = "extensions.KHR_materials_pbrSpecularGlossiness.diffuseTexture";
        material.base_color_texture = texture(old.diffuse_texture.as_ref(), member)?;
    }
    Ok(material)
}

fn color(factor: Option<[f64; 4]>) -> Vec4 {
    factor.map_or(Vec4::ONE, |f| Vec4::from_array(f.map(to_f32)).clamp(Vec4::ZERO, Vec4::ONE))
}

fn emissive(source: &json::Material) -> Vec3 {
    let factor = source.emissive_factor.as_deref().copied().unwrap_or_default();
    let strength = source.emissive_strength().max(0.0);
    Vec3::from_array(factor.map(|f| to_f32(f.clamp(0.0, 1.0) * strength)))
}

fn alpha_mode(cx: &Context<'_>, source: &json::Material, place: &str) -> AlphaMode {
    match source.alpha_mode.as_deref() {
        None | Some("OPAQUE") => AlphaMode::Opaque,
        Some("MASK") => AlphaMode::Mask { cutoff: source.alpha_cutoff.map_or(0.5, to_f32).max(0.0) },
        Some("BLEND") => AlphaMode::Blend,
        Some(other) => {
            let text = format!("`{}` is unknown; taken as OPAQUE", other.escape_debug());
            cx.warnings.add(format_args!("{place}.alphaMode"), text);
            AlphaMode::Opaque
        }
    }
}

fn texture_ref(cx: &Context<'_>, info: Option<&TextureInfo>, place: &str) -> Step<Option<TextureRef>> {
    let Some(info) = info else { return Ok(None) };
    check_index(info.index.index(), cx.doc.textures.len(), format_args!("{place}.index"), "texture")?;
    let transform = info.transform();
    let vec2 = |v: Option<[f64; 2]>, default| v.map_or(default, |v| Vec2::from_array(v.map(to_f32)));
    Ok(Some(TextureRef {
        texture: TextureId(info.index.0),
        tex_coord: info.set(),
        offset: vec2(transform.and_then(|t| t.offset), Vec2::ZERO),
        rotation: transform.and_then(|t| t.rotation).map_or(0.0, to_f32),
        scale: vec2(transform.and_then(|t| t.scale), Vec2::ONE),
    }))
}
