use serde::Deserialize;

use super::Idx;

/// `scenes[]`.
#[derive(Debug, Deserialize)]
pub(in super::super) struct Scene {
    /// Read only so that a name that is no text is found.
    #[serde(rename = "name")]
    _name: Option<Box<str>>,
    pub(in super::super) nodes: Option<Box<[Idx]>>,
}

/// `nodes[]`.
#[derive(Debug, Deserialize)]
pub(in super::super) struct Node {
    pub(in super::super) name: Option<Box<str>>,
    pub(in super::super) children: Option<Box<[Idx]>>,
    pub(in super::super) matrix: Option<Box<[f64; 16]>>,
    pub(in super::super) translation: Option<Box<[f64; 3]>>,
    pub(in super::super) rotation: Option<Box<[f64; 4]>>,
    pub(in super::super) scale: Option<Box<[f64; 3]>>,
    pub(in super::super) mesh: Option<Idx>,
    pub(in super::super) skin: Option<Idx>,
    pub(in super::super) camera: Option<Idx>,
    pub(in super::super) weights: Option<Box<[f64]>>,
    extensions: Option<Box<NodeExtensions>>,
}

#[derive(Debug, Deserialize)]
struct NodeExtensions {
    #[serde(rename = "EXT_mesh_gpu_instancing")]
    instancing: Option<Instancing>,
    #[serde(rename = "KHR_lights_punctual")]
    light: Option<NodeLight>,
}

#[derive(Debug, Deserialize)]
struct NodeLight {
    light: Idx,
}

/// `EXT_mesh_gpu_instancing` on a node.
#[derive(Debug, Deserialize)]
pub(in super::super) struct Instancing {
    #[serde(default)]
    pub(in super::super) attributes: InstancingAttributes,
}

/// Accessors of the copies' transforms.
#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "UPPERCASE")]
pub(in super::super) struct InstancingAttributes {
    pub(in super::super) translation: Option<Idx>,
    pub(in super::super) rotation: Option<Idx>,
    pub(in super::super) scale: Option<Idx>,
}

impl Node {
    pub(in super::super) fn instancing(&self) -> Option<&Instancing> {
        self.extensions.as_ref().and_then(|e| e.instancing.as_ref())
    }

    pub(in super::super) fn light(&self) -> Option<Idx> {
        self.extensions.as_ref().and_then(|e| e.light.as_ref()).map(|l| l.light)
    }
}

/// `skins[]`.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(in super::super) struct Skin {
    pub(in super::super) name: Option<Box<str>>,
    pub(in super::super) joints: Box<[Idx]>,
    pub(in super::super) inverse_bind_matrices: Option<Idx>,
    pub(in super::super) skeleton: Option<Idx>,
}

/// `cameras[]`.
#[derive(Debug, Deserialize)]
pub(in super::super) struct Camera {
    pub(in super::super) name: Option<Box<str>>,
    #[serde(rename = "type")]
    pub(in super::super) kind: Option<Box<str>>,
    pub(in super::super) perspective: Option<Box<Perspective>>,
    pub(in super::super) orthographic: Option<Box<Orthographic>>,
}

/// `cameras[].perspective`.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(in super::super) struct Perspective {
    pub(in super::super) yfov: Option<f64>,
    pub(in super::super) aspect_ratio: Option<f64>,
    pub(in super::super) znear: Option<f64>,
    pub(in super::super) zfar: Option<f64>,
}

/// `cameras[].orthographic`.
#[derive(Debug, Deserialize)]
pub(in super::super) struct Orthographic {
    pub(in super::super) xmag: Option<f64>,
    pub(in super::super) ymag: Option<f64>,
    pub(in super::super) znear: Option<f64>,
    pub(in super::super) zfar: Option<f64>,
}

/// `extensions.KHR_lights_punctual.lights[]`.
#[derive(Debug, Deserialize)]
pub(in super::super) struct Light {
    pub(in super::super) name: Option<Box<str>>,
    #[serde(rename = "type")]
    pub(in super::super) kind: Box<str>,
    pub(in super::super) color: Option<[f64; 3]>,
    pub(in super::super) intensity: Option<f64>,
    pub(in super::super) range: Option<f64>,
    pub(in super::super) spot: Option<Box<Spot>>,
}

/// `extensions.KHR_lights_punctual.lights[].spot`.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(in super::super) struct Spot {
    pub(in super::super) inner_cone_angle: Option<f64>,
    pub(in super::super) outer_cone_angle: Option<f64>,
}
