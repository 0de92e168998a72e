//! Golden pictures: small scenes built in code, compared byte for byte with the files in `tests/golden/`.
//!
//! `KINORA_BLESS=1 cargo test --test golden` writes them anew; say why in the commit.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    clippy::case_sensitive_file_extension_comparisons,
    reason = "small numbers, files of our own"
)]

#[path = "common/stage.rs"]
mod stage;

use std::{
    collections::BTreeSet,
    path::{Path, PathBuf},
    sync::Arc,
};

use glam::{DVec3, Vec2, Vec3, Vec4};
use kinora::{
    render::{CameraView, RenderSettings, Shading},
    scene::{AlphaMode, Filter, LightKind, Material, TexSampler, Trs, Wrap},
    world::World,
};
use stage::{Stage, at, ball, floor, matte, shoot, square, turned, unlit};

const WIDTH: u32 = 96;
const HEIGHT: u32 = 64;

struct Case {
    name: &'static str,
    world: Arc<World>,
    shading: Shading,
    samples: u32,
}

/// Metals above, dielectrics below, rougher to the right.
fn spheres() -> Stage {
    let mut stage = Stage::default();
    for i in 0..8u32 {
        let (column, row) = (i % 4, i / 4);
        let material = Material {
            base_color: if row == 0 { Vec4::new(1.0, 0.76, 0.33, 1.0) } else { Vec4::new(0.7, 0.12, 0.1, 1.0) },
            metallic: if row == 0 { 1.0 } else { 0.0 },
            roughness: [0.05, 0.3, 0.6, 1.0][column as usize],
            ..Material::default()
        };
        let place = at(f64::from(column) * 1.1 - 1.65, 0.55 - f64::from(row) * 1.1, 0.0);
        stage.part(ball(0.5, 32, 16), material, place);
    }
    stage
}

/// The four corners of wrap and filter modes, a transform, and a floor that needs mip levels.
fn textures() -> Stage {
    let mut stage = Stage::default();
    let modes = [
        (Wrap::Repeat, Filter::Nearest),
        (Wrap::Mirror, Filter::Linear),
        (Wrap::Clamp, Filter::Nearest),
        (Wrap::Repeat, Filter::Linear),
    ];
    for (i, (wrap, mag)) in modes.into_iter().enumerate() {
        let sampler = TexSampler { mag, min: mag, mip: Some(Filter::Linear), wrap_u: wrap, wrap_v: wrap };
        let mut map =
            stage.texture(sampler, 8, |x, y| [(x * 36) as u8, (y * 36) as u8, if x > y { 200 } else { 40 }, 255]);
        (map.scale, map.offset) = (Vec2::splat(1.7), Vec2::new(-0.3, 0.2));
        map.rotation = if i == 3 { 0.6 } else { 0.0 };
        let material = Material { base_color_texture: Some(map), ..unlit(Vec4::ONE, AlphaMode::Opaque) };
        stage.part(square(0.5), material, at(i as f64 * 1.1 - 1.65, 0.6, 0.0));
    }
    let checks = stage.texture(TexSampler::default(), 32, |x, y| {
        if (x / 4 + y / 4) % 2 == 0 { [240, 240, 240, 255] } else { [20, 20, 30, 255] }
    });
    let mut part = floor(6.0);
    part.tex_coords[0].iter_mut().for_each(|uv| *uv *= 12.0);
    stage.part(part, Material { base_color_texture: Some(checks), ..matte(Vec3::ONE) }, at(0.0, -0.8, -3.0));
    stage
}

/// Holes, panes and their shadows.
fn alpha() -> Stage {
    let mut stage = Stage::default();
    stage.part(floor(4.0), matte(Vec3::splat(0.6)), at(0.0, -0.8, 0.0));
    let dots = stage.texture(TexSampler::default(), 32, |x, y| {
        let (dx, dy) = (x as i32 % 8 - 4, y as i32 % 8 - 4);
        [250, 180, 60, if dx * dx + dy * dy < 7 { 0 } else { 255 }]
    });
    let holes = Material {
        base_color_texture: Some(dots),
        alpha_mode: AlphaMode::Mask { cutoff: 0.5 },
        double_sided: true,
        ..matte(Vec3::ONE)
    };
    stage.part(ball(0.7, 24, 12), holes, at(-0.9, -0.1, 0.0));
    for (i, color) in
        [Vec3::new(0.9, 0.2, 0.2), Vec3::new(0.2, 0.9, 0.3), Vec3::new(0.2, 0.3, 0.9)].into_iter().enumerate()
    {
        let glass = Material {
            base_color: color.extend(0.45),
            alpha_mode: AlphaMode::Blend,
            double_sided: true,
            ..matte(color)
        };
        let glass = Material { base_color: color.extend(0.45), ..glass };
        stage.part(
            square(0.5),
            glass,
            turned(DVec3::Y, 25.0, at(0.5 + 0.35 * i as f64, 0.1 * i as f64, 0.7 - 0.4 * i as f64)),
        );
    }
    stage
}

/// Mirrored and plain balls with a normal map, lit by a lamp and a spot.
fn lamps() -> Stage {
    let mut stage = Stage::default();
    stage.part(floor(5.0), matte(Vec3::splat(0.5)), at(0.0, -0.9, 0.0));
    let bumps = stage.texture(TexSampler::default(), 16, |x, y| {
        let slope = |p: u32| if p % 8 < 4 { 168 } else { 88 };
        [slope(x), slope(y), 220, 255]
    });
    for (i, scale) in [1.0, -1.0].into_iter().enumerate() {
        let material = Material { normal_texture: Some(bumps), roughness: 0.4, ..matte(Vec3::new(0.7, 0.7, 0.75)) };
        let material = Material { roughness: 0.4, ..material };
        let place = Trs { scale: DVec3::new(scale, 1.0, 1.0), ..at(i as f64 * 1.8 - 0.9, 0.0, 0.0) };
        stage.part(ball(0.8, 32, 16), material, place);
    }
    stage.light(LightKind::Point, Vec3::new(1.0, 0.8, 0.6), 30.0, at(0.0, 1.6, 1.8));
    let cone = LightKind::Spot { inner: 0.15, outer: 0.35 };
    stage.light(cone, Vec3::new(0.5, 0.7, 1.0), 160.0, turned(DVec3::X, -50.0, at(0.0, 3.0, 2.5)));
    stage
}

/// Unlit, vertex-coloured and glowing squares.
fn colours() -> Stage {
    let mut stage = Stage::default();
    let mut part = square(0.5);
    part.colors =
        vec![Vec4::new(1.0, 0.0, 0.0, 1.0), Vec4::new(0.0, 1.0, 0.0, 1.0), Vec4::new(0.0, 0.0, 1.0, 1.0), Vec4::ONE];
    stage.part(part.clone(), unlit(Vec4::ONE, AlphaMode::Opaque), at(-1.2, 0.0, 0.0));
    stage.part(part, matte(Vec3::ONE), at(0.0, 0.0, 0.0));
    stage.part(
        square(0.5),
        Material { emissive: Vec3::new(4.0, 1.0, 0.2), ..matte(Vec3::splat(0.1)) },
        at(1.2, 0.0, 0.0),
    );
    let mut flat = ball(0.4, 10, 6);
    flat.normals.clear();
    stage.part(flat, matte(Vec3::new(0.3, 0.6, 0.9)), at(0.0, 0.9, 0.0));
    stage
}

fn cases() -> Vec<Case> {
    let mut all = Vec::new();
    let lit: [(&str, Stage); 5] = [
        ("spheres", spheres()),
        ("textures", textures()),
        ("alpha", alpha()),
        ("lamps", lamps()),
        ("colours", colours()),
    ];
    for (name, stage) in lit {
        all.push(Case { name, world: stage.world(), shading: Shading::Direct, samples: 4 });
    }
    let world = lamps().world();
    for (name, shading) in
        [("eyelight", Shading::Eyelight), ("normals", Shading::Normals), ("depth", Shading::Depth), ("ao", Shading::Ao)]
    {
        all.push(Case { name, world: world.clone(), shading, samples: 2 });
    }
    all
}

fn camera() -> CameraView {
    CameraView::look_at(Vec3::new(0.6, 0.5, 5.2), Vec3::new(0.0, 0.05, 0.0), Vec3::Y, 0.62)
}

fn render(case: &Case) -> Vec<u8> {
    let settings = RenderSettings { shading: case.shading, samples: case.samples, ..RenderSettings::default() };
    let mut bytes = Vec::new();
    shoot(&case.world, &camera(), &settings, WIDTH, HEIGHT).to_srgb8(&mut bytes);
    bytes.chunks(4).flat_map(|p| [p[0], p[1], p[2]]).collect()
}

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden")
}

fn save(path: &Path, bytes: &[u8]) {
    image::save_buffer(path, bytes, WIDTH, HEIGHT, image::ColorType::Rgb8).unwrap();
}

#[test]
fn pictures_equal_the_golden_ones_byte_for_byte() {
    let bless = std::env::var_os("KINORA_BLESS").is_some();
    let mut wrong = Vec::new();
    for case in cases() {
        let (path, got) = (folder().join(format!("{}.png", case.name)), render(&case));
        if bless {
            save(&path, &got);
            continue;
        }
        let want = image::open(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display())).to_rgb8();
        if (want.width(), want.height()) != (WIDTH, HEIGHT) || *want.as_raw() != got {
            let seen = std::env::temp_dir().join(format!("kinora-{}-{}.png", case.name, std::process::id()));
            save(&seen, &got);
            let off = want.as_raw().iter().zip(&got).filter(|(a, b)| a != b).count();
            let most = want.as_raw().iter().zip(&got).map(|(a, b)| a.abs_diff(*b)).max();
            wrong.push(format!("{}: {off} bytes differ, by up to {most:?}; see {}", case.name, seen.display()));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn every_golden_file_has_a_case() {
    let named: BTreeSet<String> = cases().iter().map(|c| format!("{}.png", c.name)).collect();
    let found: BTreeSet<String> = std::fs::read_dir(folder())
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .filter(|name| name.ends_with(".png"))
        .collect();
    assert_eq!(named, found);
}
