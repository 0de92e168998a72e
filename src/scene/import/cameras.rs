//! Cameras and punctual lights.

use glam::Vec3;

use super::{
    super::{Camera, Light, LightKind, Projection},
    context::{Context, to_f32},
    error::{Problem, Step},
    json,
};

/// Field of view where the file has none that can be used: 45 degrees.
const DEFAULT_Y_FOV: f32 = std::f32::consts::FRAC_PI_4;

/// All cameras; what is missing or out of range is replaced with a warning.
pub(super) fn import_cameras(cx: &Context<'_>) -> Step<Vec<Camera>> {
    cx.budget.take(cx.doc.cameras.len(), size_of::<Camera>(), "cameras")?;
    let camera = |(i, source): (usize, &json::Camera)| Camera {
        name: source.name.as_deref().unwrap_or_default().to_owned(),
        projection: projection(cx, source, &format!("cameras[{i}]")),
    };
    Ok(cx.doc.cameras.iter().enumerate().map(camera).collect())
}

/// A number that must be positive; anything else becomes `default` with a warning.
fn positive(cx: &Context<'_>, value: Option<f64>, default: f32, place: &str, member: &str) -> f32 {
    match value.map(to_f32) {
        Some(value) if value > 0.0 => value,
        given => {
            let given = given.map_or_else(|| "is missing".to_owned(), |v| format!("{v} is not positive"));
            cx.warnings.add(format_args!("{place}.{member}"), format_args!("{given}; {default} is used"));
            default
        }
    }
}

fn projection(cx: &Context<'_>, source: &json::Camera, place: &str) -> Projection {
    let kind = source.kind.as_deref().unwrap_or_default();
    match (&source.perspective, &source.orthographic) {
        (_, Some(ortho)) if kind == "orthographic" => orthographic(cx, ortho, &format!("{place}.orthographic")),
        (Some(perspective), _) if kind == "perspective" => {
            self::perspective(cx, perspective, &format!("{place}.perspective"))
        }
        _ => {
            let text =
                format!("type `{}` without what belongs to it; a default perspective is used", kind.escape_debug());
            cx.warnings.add(place, text);
            Projection::Perspective { y_fov: DEFAULT_Y_FOV, aspect: None, z_near: 0.01, z_far: None }
        }
    }
}

fn perspective(cx: &Context<'_>, source: &json::Perspective, place: &str) -> Projection {
    let mut y_fov = positive(cx, source.yfov, DEFAULT_Y_FOV, place, "yfov");
    if y_fov >= std::f32::consts::PI {
        cx.warnings.add(format_args!("{place}.yfov"), format_args!("{y_fov} is not below pi; {DEFAULT_Y_FOV} is used"));
        y_fov = DEFAULT_Y_FOV;
    }
    let z_near = positive(cx, source.znear, 0.01, place, "znear");
    let z_far = source.zfar.map(to_f32).filter(|&far| {
        let fits = far > z_near;
        if !fits {
            cx.warnings.add(format_args!("{place}.zfar"), format_args!("{far} is not beyond znear; ignored"));
        }
        fits
    });
    let aspect = source.aspect_ratio.map(|a| positive(cx, Some(a), 1.0, place, "aspectRatio"));
    Projection::Perspective { y_fov, aspect, z_near, z_far }
}

fn orthographic(cx: &Context<'_>, source: &json::Orthographic, place: &str) -> Projection {
    let magnitude = |value: Option<f64>, member: &str| {
        let negative = value.is_some_and(|v| v < 0.0);
        if negative {
            cx.warnings.add(format_args!("{place}.{member}"), "is negative; its magnitude is used");
        }
        positive(cx, value.map(f64::abs), 1.0, place, member)
    };
    let z_near = source.znear.map_or(0.0, to_f32);
    let z_far = source.zfar.map(to_f32).filter(|&far| far > z_near).unwrap_or_else(|| {
        cx.warnings.add(format_args!("{place}.zfar"), "is missing or not beyond znear; ignored");
        f32::MAX
    });
    Projection::Orthographic {
        x_mag: magnitude(source.xmag, "xmag"),
        y_mag: magnitude(source.ymag, "ymag"),
        z_near,
        z_far,
    }
}

/// All lights of `KHR_lights_punctual`.
pub(super) fn import_lights(cx: &Context<'_>) -> Step<Vec<Light>> {
    cx.budget.take(cx.doc.lights().len(), size_of::<Light>(), "extensions.KHR_lights_punctual.lights")?;
    cx.doc.lights().iter().enumerate().map(|(i, source)| light(cx, i, source)).collect()
}

fn light(cx: &Context<'_>, index: usize, source: &json::Light) -> Step<Light> {
    let place = format!("extensions.KHR_lights_punctual.lights[{index}]");
    let kind = match &*source.kind {
        "directional" => LightKind::Directional,
        "point" => LightKind::Point,
        "spot" => spot(cx, source.spot.as_deref(), &format!("{place}.spot")),
        other => {
            let reason = format!("`{}` is not directional, point or spot", other.escape_debug());
            return Err(Problem::at(format_args!("{place}.type"), reason));
        }
    };
    let range = source.range.map(to_f32).filter(|&range| {
        if range <= 0.0 {
            cx.warnings.add(format_args!("{place}.range"), format_args!("{range} is not positive; ignored"));
        }
        range > 0.0
    });
    Ok(Light {
        name: source.name.as_deref().unwrap_or_default().to_owned(),
        color: source.color.map_or(Vec3::ONE, |c| Vec3::from_array(c.map(|c| to_f32(c.max(0.0))))),
        intensity: source.intensity.map_or(1.0, to_f32).max(0.0),
        range,
        kind,
    })
}

fn spot(cx: &Context<'_>, source: Option<&json::Spot>, place: &str) -> LightKind {
    let outer = source.and_then(|s| s.outer_cone_angle).map_or(std::f32::consts::FRAC_PI_4, to_f32);
    let inner = source.and_then(|s| s.inner_cone_angle).map_or(0.0, to_f32);
    let fixed_outer = outer.clamp(1e-3, std::f32::consts::FRAC_PI_2);
    let fixed_inner = inner.clamp(0.0, fixed_outer);
    if (inner, outer) != (fixed_inner, fixed_outer) {
        cx.warnings.add(place, format_args!("cone angles {inner} and {outer} are out of range; clamped"));
    }
    LightKind::Spot { inner: fixed_inner, outer: fixed_outer }
}
