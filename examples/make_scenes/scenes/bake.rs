//! Fills a texture with a function of the surface that its texels lie on.

use glam::{DVec2, DVec3};

use super::png::Picture;

/// A place on the surface that a texel covers.
#[derive(Clone, Copy)]
pub struct Place {
    /// Rest position.
    pub position: DVec3,
    /// Interpolated unit normal.
    pub normal: DVec3,
    /// Interpolated unit tangent, at right angles to the normal.
    pub tangent: DVec3,
}

/// Vertices to bake over, one entry each, and triangles.
pub struct Source<'a> {
    /// Places of the vertices.
    pub places: &'a [Place],
    /// Texture coordinates.
    pub tex_coords: &'a [DVec2],
    /// Triangles.
    pub triangles: &'a [[u32; 3]],
}

/// A square picture of `size` texels; texels near a chart repeat its edge, others are `empty`.
pub fn bake(source: &Source<'_>, size: usize, empty: [u8; 3], texel: impl Fn(&Place) -> [u8; 3]) -> Picture {
    let mut filled: Vec<Option<[u8; 3]>> = vec![None; size * size];
    for corners in source.triangles {
        let uv = corners.map(|i| source.tex_coords[i as usize] * size as f64);
        let places = corners.map(|i| source.places[i as usize]);
        each_texel(uv, size, |index, weights| {
            if filled[index].is_none() {
                filled[index] = Some(texel(&blend(&places, weights)));
            }
        });
    }
    for _ in 0..4 {
        filled = dilated(&filled, size);
    }
    Picture { width: size, height: size, texels: filled.into_iter().map(|t| t.unwrap_or(empty)).collect() }
}

fn blend(places: &[Place; 3], w: [f64; 3]) -> Place {
    let sum = |f: fn(&Place) -> DVec3| f(&places[0]) * w[0] + f(&places[1]) * w[1] + f(&places[2]) * w[2];
    let normal = sum(|p| p.normal).normalize_or(DVec3::Y);
    let tangent = sum(|p| p.tangent);
    let tangent = (tangent - normal * normal.dot(tangent)).normalize_or(DVec3::X);
    Place { position: sum(|p| p.position), normal, tangent }
}

/// Calls `visit` with each texel whose centre lies in the triangle, and its barycentric weights.
fn each_texel(uv: [DVec2; 3], size: usize, mut visit: impl FnMut(usize, [f64; 3])) {
    let area = (uv[1] - uv[0]).perp_dot(uv[2] - uv[0]);
    if area == 0.0 {
        return;
    }
    let low = uv[0].min(uv[1]).min(uv[2]).floor().max(DVec2::ZERO);
    let high = uv[0].max(uv[1]).max(uv[2]).ceil().min(DVec2::splat(size as f64));
    for y in low.y as usize..high.y as usize {
        for x in low.x as usize..high.x as usize {
            let p = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
            let w1 = (p - uv[0]).perp_dot(uv[2] - uv[0]) / area;
            let w2 = (uv[1] - uv[0]).perp_dot(p - uv[0]) / area;
            let w0 = 1.0 - w1 - w2;
            if w0 >= 0.0 && w1 >= 0.0 && w2 >= 0.0 {
                visit(y * size + x, [w0, w1, w2]);
            }
        }
    }
}

/// Empty texels next to filled ones take the value of the first filled neighbour.
fn dilated(filled: &[Option<[u8; 3]>], size: usize) -> Vec<Option<[u8; 3]>> {
    let near = |i: usize| {
        let (x, y) = (i % size, i / size);
        let sides = [
            (x > 0).then(|| i - 1),
            (x + 1 < size).then(|| i + 1),
            (y > 0).then(|| i - size),
            (y + 1 < size).then(|| i + size),
        ];
        sides.into_iter().flatten().find_map(|j| filled[j])
    };
    (0..filled.len()).map(|i| filled[i].or_else(|| near(i))).collect()
}

/// A colour in [0, 1] as eight-bit numbers.
pub fn bytes(color: DVec3) -> [u8; 3] {
    color.to_array().map(|c| (c.clamp(0.0, 1.0) * 255.0).round() as u8)
}

/// A unit normal as a texel of a normal map, against the frame of `place`.
pub fn normal_texel(place: &Place, normal: DVec3) -> [u8; 3] {
    let bitangent = place.normal.cross(place.tangent);
    let local = DVec3::new(normal.dot(place.tangent), normal.dot(bitangent), normal.dot(place.normal).max(0.05));
    local.normalize().to_array().map(|c| (127.5 + 127.5 * c).round().clamp(0.0, 255.0) as u8)
}
