use serde::Deserialize;

use super::Idx;

/// `materials[]`.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(in super::super) struct Material {
    pub(in super::super) name: Option<Box<str>>,
    pub(in super::super) pbr_metallic_roughness: Option<Box<Pbr>>,
    pub(in super::super) normal_texture: Option<Box<TextureInfo>>,
    pub(in super::super) occlusion_texture: Option<Box<TextureInfo>>,
    pub(in super::super) emissive_texture: Option<Box<TextureInfo>>,
    pub(in super::super) emissive_factor: Option<Box<[f64; 3]>>,
    pub(in super::super) alpha_mode: Option<Box<str>>,
    pub(in super::super) alpha_cutoff: Option<f64>,
    #[serde(default)]
    pub(in super::super) double_sided: bool,
    extensions: Option<Box<MaterialExtensions>>,
}

/// `materials[].pbrMetallicRoughness`.
#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(in super::super) struct Pbr {
    pub(in super::super) base_color_factor: Option<[f64; 4]>,
    pub(in super::super) base_color_texture: Option<TextureInfo>,
    pub(in super::super) metallic_factor: Option<f64>,
    pub(in super::super) roughness_factor: Option<f64>,
    pub(in super::super) metallic_roughness_texture: Option<TextureInfo>,
}

/// A texture reference with its coordinates; `scale` belongs to normal, `strength` to occlusion textures.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(in super::super) struct TextureInfo {
    pub(in super::super) index: Idx,
    pub(in super::super) tex_coord: Option<Idx>,
    pub(in super::super) scale: Option<f64>,
    pub(in super::super) strength: Option<f64>,
    extensions: Option<Box<TextureInfoExtensions>>,
}

#[derive(Debug, Deserialize)]
struct TextureInfoExtensions {
    #[serde(rename = "KHR_texture_transform")]
    transform: Option<TextureTransform>,
}

/// `KHR_texture_transform`.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(in super::super) struct TextureTransform {
    pub(in super::super) offset: Option<[f64; 2]>,
    pub(in super::super) rotation: Option<f64>,
    pub(in super::super) scale: Option<[f64; 2]>,
    pub(in super::super) tex_coord: Option<Idx>,
}

impl TextureInfo {
    /// The texture coordinate set, that of `KHR_texture_transform` first.
    pub(in super::super) fn set(&self) -> u32 {
        self.transform().and_then(|t| t.tex_coord).or(self.tex_coord).map_or(0, |set| set.0)
    }

    pub(in super::super) fn transform(&self) -> Option<&TextureTransform> {
        self.extensions.as_ref().and_then(|e| e.transform.as_ref())
    }
}

#[derive(Debug, Deserialize)]
struct MaterialExtensions {
    #[serde(rename = "KHR_materials_unlit")]
    unlit: Option<serde::de::IgnoredAny>,
    #[serde(rename = "KHR_materials_emissive_strength")]
    emissive_strength: Option<EmissiveStrength>,
    #[serde(rename = "KHR_materials_pbrSpecularGlossiness")]
    specular_glossiness: Option<Box<SpecularGlossiness>>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
struct EmissiveStrength {
    emissive_strength: Option<f64>,
}

/// `KHR_materials_pbrSpecularGlossiness`: read only where a material has nothing else.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(in super::super) struct SpecularGlossiness {
    pub(in super::super) diffuse_factor: Option<[f64; 4]>,
    pub(in super::super) diffuse_texture: Option<TextureInfo>,
    pub(in super::super) glossiness_factor: Option<f64>,
}

impl Material {
    /// Texture coordinate sets that the material reads.
    pub(in super::super) fn tex_coords(&self) -> impl Iterator<Item = u32> {
        let pbr = self.pbr_metallic_roughness.as_deref();
        let own = [
            self.normal_texture.as_deref(),
            self.occlusion_texture.as_deref(),
            self.emissive_texture.as_deref(),
            pbr.and_then(|p| p.base_color_texture.as_ref()),
            pbr.and_then(|p| p.metallic_roughness_texture.as_ref()),
        ];
        own.into_iter().flatten().map(TextureInfo::set)
    }

    pub(in super::super) fn is_unlit(&self) -> bool {
        self.extensions.as_ref().is_some_and(|e| e.unlit.is_some())
    }

    pub(in super::super) fn emissive_strength(&self) -> f64 {
        let strength = self.extensions.as_ref().and_then(|e| e.emissive_strength.as_ref());
        strength.and_then(|s| s.emissive_strength).unwrap_or(1.0)
    }

    pub(in super::super) fn specular_glossiness(&self) -> Option<&SpecularGlossiness> {
        self.extensions.as_ref().and_then(|e| e.specular_glossiness.as_deref())
    }
}

/// `textures[]`.
#[derive(Debug, Deserialize)]
pub(in super::super) struct Texture {
    pub(in super::super) sampler: Option<Idx>,
    pub(in super::super) source: Option<Idx>,
    extensions: Option<Box<TextureExtensions>>,
}

#[derive(Debug, Deserialize)]
struct TextureExtensions {
    #[serde(rename = "EXT_texture_webp")]
    webp: Option<TextureSource>,
}

#[derive(Debug, Deserialize)]
struct TextureSource {
    source: Option<Idx>,
}

impl Texture {
    /// The image to use: the WebP one where the file offers it.
    pub(in super::super) fn image(&self) -> Option<Idx> {
        let webp = self.extensions.as_ref().and_then(|e| e.webp.as_ref()).and_then(|w| w.source);
        webp.or(self.source)
    }
}

/// `samplers[]` of textures.
#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(in super::super) struct TextureSampler {
    pub(in super::super) mag_filter: Option<Idx>,
    pub(in super::super) min_filter: Option<Idx>,
    pub(in super::super) wrap_s: Option<Idx>,
    pub(in super::super) wrap_t: Option<Idx>,
}

/// `images[]`.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(in super::super) struct Image {
    pub(in super::super) name: Option<Box<str>>,
    pub(in super::super) uri: Option<Box<str>>,
    pub(in super::super) mime_type: Option<Box<str>>,
    pub(in super::super) buffer_view: Option<Idx>,
}
