//! What pictures promise: the same bytes everywhere, light where light belongs, layers in order.

#![allow(clippy::float_cmp, reason = "the same bytes are what is claimed")]

#[path = "common/stage.rs"]
mod stage;

use std::sync::Arc;

use glam::{DVec3, Vec2, Vec3, Vec4};
use kinora::{
    render::{CameraView, Film, RenderSettings, Renderer, Shading},
    scene::{AlphaMode, Filter, LightKind, Material, TexSampler, Trs},
    simd::SimdLevel,
    world::World,
};
use stage::{Stage, at, ball, floor, front, matte, shoot, square, turned, unlit};

fn pixel(film: &Film, x: u32, y: u32) -> [f32; 4] {
    film.color[(y * film.width + x) as usize]
}

fn close(a: [f32; 4], b: [f32; 4], bound: f32) -> bool {
    a.iter().zip(b).all(|(a, b)| (a - b).abs() <= bound)
}

/// Balls of several materials on a floor, with a mask, a blended pane and two lights.
fn fair(accel: &str) -> Arc<World> {
    let mut stage = Stage::default();
    let checks = stage.texture(TexSampler::default(), 16, |x, y| {
        if (x / 2 + y / 2) % 2 == 0 { [230, 120, 40, 255] } else { [30, 60, 160, 90] }
    });
    stage.part(
        floor(4.0),
        Material { base_color_texture: Some(checks), metallic: 0.0, ..Material::default() },
        at(0.0, -1.0, 0.0),
    );
    stage.part(ball(0.7, 16, 8), Material { roughness: 0.3, ..Material::default() }, at(-1.0, -0.3, 0.0));
    let mask = AlphaMode::Mask { cutoff: 0.5 };
    let holes = Material { base_color_texture: Some(checks), alpha_mode: mask, double_sided: true, ..matte(Vec3::ONE) };
    stage.part(ball(0.6, 12, 6), holes, at(0.8, -0.2, 0.3));
    let pane = Material {
        base_color: Vec4::new(0.2, 0.9, 0.4, 0.4),
        alpha_mode: AlphaMode::Blend,
        double_sided: true,
        ..Material::default()
    };
    stage.part(square(0.8), pane, turned(DVec3::Y, 20.0, at(0.1, 0.0, 1.2)));
    stage.light(LightKind::Point, Vec3::new(1.0, 0.9, 0.8), 40.0, at(2.0, 3.0, 2.0));
    stage.light(LightKind::Directional, Vec3::new(0.5, 0.7, 1.0), 2.0, turned(DVec3::X, -50.0, Trs::IDENTITY));
    stage.world_with(accel)
}

fn view() -> CameraView {
    CameraView::look_at(Vec3::new(1.0, 1.2, 5.0), Vec3::new(0.0, -0.3, 0.0), Vec3::Y, 0.6)
}

#[test]
fn threads_levels_and_structures_change_no_bit() {
    for shading in Shading::ALL {
        let settings = RenderSettings { shading, samples: 2, simd: SimdLevel::Scalar, ..RenderSettings::default() };
        let mut reference = Film::new(31, 23);
        let world = fair("list");
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        pool.install(|| Renderer::default().render(&world, &view(), &settings, &mut reference)).unwrap();
        for accel in ["list", "bvh2"] {
            let world = fair(accel);
            for simd in SimdLevel::available() {
                let film = shoot(&world, &view(), &RenderSettings { simd, ..settings }, 31, 23);
                assert!(film.color == reference.color, "{shading:?} {accel} {simd}");
                assert!(film.depth == reference.depth && film.instance == reference.instance);
            }
        }
    }
}

#[test]
fn a_renderer_used_before_gives_the_same_picture() {
    let (world, other) = (fair("bvh2"), Stage::default().world());
    let settings = RenderSettings::default();
    let fresh = shoot(&world, &view(), &settings, 40, 30);
    let mut renderer = Renderer::default();
    let mut film = Film::new(90, 10);
    for (w, size) in [(&world, [90, 10]), (&other, [40, 30]), (&world, [40, 30])] {
        film.resize(size[0], size[1]);
        renderer.render(w, &view(), &settings, &mut film).unwrap();
    }
    assert_eq!(film.color, fresh.color);
    assert_eq!(film.depth, fresh.depth);
}

#[test]
fn two_renders_of_two_samples_make_one_of_four() {
    let world = fair("bvh2");
    let part = |first_sample, samples| {
        shoot(&world, &view(), &RenderSettings { first_sample, samples, ..RenderSettings::default() }, 40, 30)
    };
    let (all, early, late) = (part(0, 4), part(0, 2), part(2, 2));
    for ((all, early), late) in all.color.iter().zip(&early.color).zip(&late.color) {
        let mean = std::array::from_fn(|i| (early[i] + late[i]) * 0.5);
        assert!(close(*all, mean, 1e-4 * (1.0 + all[0].abs().max(all[1]).max(all[2]))), "{all:?} {mean:?}");
    }
}

#[test]
fn an_empty_world_is_background() {
    let world = Stage::default().world();
    let mut film = Film::new(9, 5);
    let rays = Renderer::default().render(&world, &front(3.0), &RenderSettings::default(), &mut film).unwrap();
    assert_eq!(rays, 0);
    assert!(film.color.iter().all(|c| c[3] == 0.0 && c[0] > 0.0));
    assert!(film.depth.iter().all(|d| d.is_infinite()) && film.instance.iter().all(|&i| i == 0));
    Renderer::default().render(&world, &front(3.0), &RenderSettings::default(), &mut Film::new(0, 0)).unwrap();
}

#[test]
fn unlit_colours_reach_the_file_as_they_are() {
    let mut stage = Stage::default();
    stage.part(square(9.0), unlit(Vec4::new(0.5, 0.1, 0.02, 1.0), AlphaMode::Opaque), at(0.0, 0.0, 0.0));
    let film = shoot(&stage.world(), &front(3.0), &RenderSettings::default(), 8, 8);
    let mut bytes = Vec::new();
    film.to_srgb8(&mut bytes);
    // sRGB codes of 0.5, 0.1 and 0.02.
    for (got, want) in bytes[..3].iter().zip([188u8, 89, 39]) {
        assert!(got.abs_diff(want) <= 1, "{:?}", &bytes[..4]);
    }
}

#[test]
fn a_back_face_shows_only_when_double_sided_and_mirroring_turns_no_face() {
    let away = turned(DVec3::Y, 180.0, Trs::IDENTITY);
    let mirrored = Trs { scale: DVec3::new(-1.0, 1.0, 1.0), ..Trs::IDENTITY };
    let both = Trs { scale: DVec3::new(-1.0, 1.0, 1.0), ..away };
    for (place, double_sided, seen) in [
        (Trs::IDENTITY, false, true),
        (away, false, false),
        (away, true, true),
        (mirrored, false, true),
        (both, false, false),
    ] {
        let mut stage = Stage::default();
        stage.part(square(1.0), Material { double_sided, ..matte(Vec3::ONE) }, place);
        let film = shoot(&stage.world(), &front(3.0), &RenderSettings::default(), 8, 8);
        assert_eq!(pixel(&film, 4, 4)[3] == 1.0, seen, "{place:?} {double_sided}");
        assert_eq!(film.instance[36] == 1, seen);
    }
}

#[test]
fn mirrored_balls_are_lit_like_plain_ones() {
    let picture = |scale: f64| {
        let mut stage = Stage::default();
        let place = Trs { scale: DVec3::new(scale, 1.0, 1.0), ..Trs::IDENTITY };
        stage.part(ball(1.0, 48, 24), matte(Vec3::splat(0.7)), place);
        shoot(&stage.world(), &front(5.0), &RenderSettings::default(), 32, 32)
    };
    let (plain, mirrored) = (picture(1.0), picture(-1.0));
    let different = plain.color.iter().zip(&mirrored.color).filter(|(a, b)| !close(**a, **b, 0.05)).count();
    assert!(different < 20, "{different} of 1024");
}

#[test]
fn layers_blend_in_order_of_distance_whatever_their_numbers() {
    let colors = [Vec4::new(0.8, 0.1, 0.1, 0.5), Vec4::new(0.1, 0.8, 0.1, 0.25), Vec4::new(0.1, 0.1, 0.8, 0.75)];
    let picture = |order: [usize; 3]| {
        let mut stage = Stage::default();
        for i in order {
            stage.part(square(2.0), unlit(colors[i], AlphaMode::Blend), at(0.0, 0.0, i as f64 * 0.1));
        }
        shoot(&stage.world(), &front(3.0), &RenderSettings::default(), 8, 8)
    };
    let film = picture([0, 1, 2]);
    let alone = |color: Vec4| {
        let mut stage = Stage::default();
        stage.part(square(2.0), unlit(color.truncate().extend(1.0), AlphaMode::Opaque), at(0.0, 0.0, 0.0));
        Vec4::from(pixel(&shoot(&stage.world(), &front(3.0), &RenderSettings::default(), 8, 8), 4, 4)).truncate()
    };
    let behind =
        Vec4::from(pixel(&shoot(&Stage::default().world(), &front(3.0), &RenderSettings::default(), 8, 8), 4, 4));
    let mut want = behind.truncate();
    for color in colors {
        want = alone(color) * color.w + want * (1.0 - color.w);
    }
    let got = pixel(&film, 4, 4);
    assert!(close(got, want.extend(1.0 - 0.5 * 0.75 * 0.25).to_array(), 1e-4), "{got:?} {want}");
    assert_eq!(film.instance[36], 3);
    for order in [[2, 1, 0], [1, 2, 0], [0, 2, 1]] {
        assert_eq!(picture(order).color, film.color);
    }
}

#[test]
fn coincident_layers_are_each_counted_once() {
    let mut stage = Stage::default();
    for _ in 0..3 {
        stage.part(square(2.0), unlit(Vec4::new(0.5, 0.5, 0.5, 0.5), AlphaMode::Blend), at(0.0, 0.0, 0.0));
    }
    let film = shoot(&stage.world(), &front(3.0), &RenderSettings::default(), 8, 8);
    assert!((pixel(&film, 3, 5)[3] - 0.875).abs() < 1e-5);
}

/// A floor under a pane between it and an overhead light; the floor's brightness below the pane's middle and beside it.
fn shade_below(pane: impl FnOnce(&mut Stage) -> Material) -> [f32; 2] {
    let mut stage = Stage::default();
    let material = pane(&mut stage);
    stage.part(floor(5.0), matte(Vec3::splat(0.5)), at(0.0, 0.0, 0.0));
    let flat = turned(DVec3::X, -90.0, at(0.0, 1.0, 0.0));
    stage.part(square(1.0), material, flat);
    stage.light(LightKind::Directional, Vec3::ONE, 3.0, turned(DVec3::X, -90.0, Trs::IDENTITY));
    let camera = CameraView::look_at(Vec3::new(0.0, 0.5, 4.0), Vec3::ZERO, Vec3::Y, 0.5);
    let film = shoot(&stage.world(), &camera, &RenderSettings::default(), 64, 32);
    let dark = CameraView::look_at(Vec3::new(3.0, 0.5, 4.0), Vec3::new(3.0, 0.0, 0.0), Vec3::Y, 0.5);
    [pixel(&film, 32, 16)[1], {
        let mut stage = Stage::default();
        stage.part(floor(5.0), matte(Vec3::splat(0.5)), at(0.0, 0.0, 0.0));
        stage.part(square(1.0), matte(Vec3::ONE), at(0.0, -50.0, 0.0));
        stage.light(LightKind::Directional, Vec3::ONE, 3.0, turned(DVec3::X, -90.0, Trs::IDENTITY));
        pixel(&shoot(&stage.world(), &dark, &RenderSettings::default(), 64, 32), 32, 16)[1]
    }]
}

#[test]
fn shadows_are_cast_holed_and_dimmed_as_the_material_says() {
    let [shadow, _] = shade_below(|_| matte(Vec3::ONE));
    let [hole, _] = shade_below(|_| Material {
        base_color: Vec4::new(1.0, 1.0, 1.0, 0.2),
        alpha_mode: AlphaMode::Mask { cutoff: 0.5 },
        ..matte(Vec3::ONE)
    });
    let glass = |alpha: f32| Material {
        base_color: Vec4::new(1.0, 1.0, 1.0, alpha),
        alpha_mode: AlphaMode::Blend,
        ..matte(Vec3::ONE)
    };
    let [half, _] = shade_below(|_| glass(0.5));
    let [clear, _] = shade_below(|_| glass(0.0));
    assert!((hole - clear).abs() < 1e-5 && hole > 2.0 * shadow, "{hole} {clear} {shadow}");
    assert!((half - 0.5 * (shadow + hole)).abs() < 1e-3, "{half} between {shadow} and {hole}");
}

#[test]
fn a_masked_texture_has_holes_where_alpha_is_low() {
    let mut stage = Stage::default();
    let sampler = TexSampler { mag: Filter::Nearest, min: Filter::Nearest, mip: None, ..TexSampler::default() };
    let half = stage.texture(sampler, 2, |x, _| [255, 255, 255, if x == 0 { 0 } else { 255 }]);
    let mask = Material {
        base_color_texture: Some(half),
        alpha_mode: AlphaMode::Mask { cutoff: 0.5 },
        ..unlit(Vec4::ONE, AlphaMode::Opaque)
    };
    stage.part(square(1.0), Material { alpha_mode: AlphaMode::Mask { cutoff: 0.5 }, ..mask }, at(0.0, 0.0, 0.0));
    let film = shoot(&stage.world(), &front(4.0), &RenderSettings::default(), 32, 32);
    assert_eq!(pixel(&film, 12, 16)[3], 0.0);
    assert_eq!(pixel(&film, 20, 16)[3], 1.0);
}

#[test]
fn a_floor_shadows_itself_at_no_scale() {
    for scale in [1e-3f32, 1.0, 1e5] {
        for offset in [0.0f32, 37.0] {
            let mut stage = Stage::default();
            let s = f64::from(scale);
            let move_by = f64::from(offset) * s;
            stage.part(ball(scale, 64, 32), matte(Vec3::ONE), at(move_by, 0.0, 0.0));
            stage.light(LightKind::Directional, Vec3::ONE, 3.0, turned(DVec3::X, -60.0, Trs::IDENTITY));
            let target = Vec3::new(offset * scale, 0.0, 0.0);
            let camera = CameraView::look_at(target + Vec3::new(0.0, 2.0, 3.5) * scale, target, Vec3::Y, 0.5);
            let film = shoot(&stage.world(), &camera, &RenderSettings::default(), 64, 64);
            // Every point of the ball that this light can reach at a good angle is bright: no speck is dark.
            let light = Vec3::new(0.0, libm::sinf(60f32.to_radians()), libm::cosf(60f32.to_radians()));
            let mut seen = 0;
            for y in 0..64 {
                for x in 0..64 {
                    let at = (y * 64 + x) as usize;
                    if film.depth[at].is_finite() {
                        let half = libm::tanf(0.25);
                        let back = Vec3::new(0.0, 2.0, 3.5).normalize();
                        let (right, up) = (Vec3::X, back.cross(Vec3::X));
                        let slope = |p: u32| ((p as f32 + 0.5) / 32.0 - 1.0) * half;
                        let dir = right * slope(x) - up * slope(y) - back;
                        let n = (Vec3::new(0.0, 2.0, 3.5) + dir * (film.depth[at] / scale)).normalize();
                        if n.dot(light) > 0.3 {
                            seen += 1;
                            assert!(
                                film.color[at][1] > 0.25,
                                "dark speck at {x}, {y}, scale {scale}: {:?}",
                                film.color[at]
                            );
                        }
                    }
                }
            }
            assert!(seen > 500, "{seen}");
        }
    }
}

#[test]
fn no_light_leaks_into_a_closed_box() {
    let inside = |intensity: f32| {
        let mut stage = Stage::default();
        for (axis, degrees) in [
            (DVec3::Y, 0.0),
            (DVec3::Y, 90.0),
            (DVec3::Y, 180.0),
            (DVec3::Y, 270.0),
            (DVec3::X, 90.0),
            (DVec3::X, -90.0),
        ] {
            let turn = turned(axis, degrees, Trs::IDENTITY);
            let place = Trs { translation: turn.rotation * DVec3::new(0.0, 0.0, -1.0), ..turn };
            stage.part(square(1.0), matte(Vec3::splat(0.8)), place);
        }
        // Something outside, so that the light has a level to be exposed for.
        stage.part(floor(9.0), matte(Vec3::ONE), at(0.0, -3.0, 0.0));
        stage.light(LightKind::Point, Vec3::ONE, intensity, at(3.0, 4.0, 5.0));
        stage.light(LightKind::Point, Vec3::ONE, 0.001, at(-1e4, 1e4, 0.0));
        let camera = CameraView::look_at(Vec3::new(0.1, 0.2, 0.3), Vec3::new(1.0, -0.8, -1.0), Vec3::Y, 2.2);
        shoot(&stage.world(), &camera, &RenderSettings::default(), 64, 64)
    };
    let (lit, dark) = (inside(100.0), inside(0.0));
    assert_eq!(lit.color, dark.color);
}

#[test]
fn the_units_of_lights_do_not_decide_the_brightness() {
    let picture = |intensity: f32| {
        let mut stage = Stage::default();
        stage.part(ball(1.0, 24, 12), matte(Vec3::splat(0.6)), at(0.0, 0.0, 0.0));
        stage.light(LightKind::Point, Vec3::ONE, intensity, at(2.0, 2.0, 3.0));
        shoot(&stage.world(), &front(5.0), &RenderSettings::default(), 24, 24)
    };
    let (candle, lighthouse) = (picture(1.0), picture(1e5));
    for (a, b) in candle.color.iter().zip(&lighthouse.color) {
        assert!(close(*a, *b, 1e-3), "{a:?} {b:?}");
    }
}

#[test]
fn a_spot_lights_its_cone_only() {
    let mut stage = Stage::default();
    stage.part(floor(4.0), matte(Vec3::splat(0.8)), at(0.0, 0.0, 0.0));
    let cone = LightKind::Spot { inner: 0.2, outer: 0.3 };
    stage.light(cone, Vec3::ONE, 50.0, turned(DVec3::X, -90.0, at(0.0, 3.0, 0.0)));
    let camera = CameraView::look_at(Vec3::new(0.0, 9.0, 0.01), Vec3::ZERO, Vec3::Y, 0.8);
    let film = shoot(&stage.world(), &camera, &RenderSettings::default(), 64, 64);
    let (centre, edge) = (pixel(&film, 32, 32)[1], pixel(&film, 6, 32)[1]);
    assert!(centre > 3.0 * edge, "{centre} {edge}");
    // Radius 0.93 at the floor; the picture's half height is 3.8.
    assert!((pixel(&film, 32 + 10, 32)[1] - edge).abs() < 0.01 * edge);
    assert!(pixel(&film, 32 + 4, 32)[1] > 2.0 * edge);
}

#[test]
fn emission_adds_and_normals_show_as_codes() {
    let mut stage = Stage::default();
    let glow = Material { emissive: Vec3::new(0.0, 2.0, 0.0), ..matte(Vec3::ZERO) };
    stage.part(square(9.0), glow, at(0.0, 0.0, 0.0));
    let world = stage.world();
    let lit = pixel(&shoot(&world, &front(3.0), &RenderSettings::default(), 4, 4), 2, 2);
    assert!(lit[1] > lit[0] + 1.9 && lit[1] < lit[0] + 2.1, "{lit:?}");
    let normals =
        shoot(&world, &front(3.0), &RenderSettings { shading: Shading::Normals, ..RenderSettings::default() }, 4, 4);
    let mut bytes = Vec::new();
    normals.to_srgb8(&mut bytes);
    assert_eq!(bytes[..4], [128, 128, 255, 255]);
}

#[test]
fn an_open_plane_is_unoccluded_and_a_corner_is_not() {
    let mut stage = Stage::default();
    stage.part(floor(4.0), matte(Vec3::ONE), at(0.0, 0.0, 0.0));
    stage.part(square(4.0), matte(Vec3::ONE), at(0.0, 4.0, -2.0));
    let camera = CameraView::look_at(Vec3::new(0.0, 4.0, 8.0), Vec3::new(0.0, 0.0, 0.0), Vec3::Y, 0.9);
    let settings = RenderSettings { shading: Shading::Ao, samples: 16, ..RenderSettings::default() };
    let film = shoot(&stage.world(), &camera, &settings, 48, 48);
    let open = pixel(&film, 24, 34)[0];
    let corner = (0..48).map(|y| pixel(&film, 24, y)[0]).fold(1.0, f32::min);
    assert_eq!(open, 1.0);
    assert!(corner < 0.75, "{corner}");
}

#[test]
fn distant_checks_become_their_mean() {
    let mut stage = Stage::default();
    let checks =
        stage.texture(TexSampler::default(), 64, |x, y| if (x + y) % 2 == 0 { [255; 4] } else { [0, 0, 0, 255] });
    let mut part = floor(400.0);
    for uv in &mut part.tex_coords[0] {
        *uv *= Vec2::splat(200.0);
    }
    stage.part(
        part,
        Material { base_color_texture: Some(checks), ..unlit(Vec4::ONE, AlphaMode::Opaque) },
        at(0.0, 0.0, 0.0),
    );
    let world = stage.world();
    let row = |shift: f32| {
        let camera = CameraView::look_at(Vec3::new(shift, 2.0, 0.0), Vec3::new(shift, 0.0, -20.0), Vec3::Y, 0.7);
        let film = shoot(&world, &camera, &RenderSettings::default(), 64, 64);
        let mut bytes = Vec::new();
        film.to_srgb8(&mut bytes);
        bytes[4 * 64 * 29..4 * 64 * 30].to_vec()
    };
    // Far rows are an even grey (the code of linear 0.5), and stay so while the camera moves.
    for shift in [0.0, 0.013, 0.029] {
        assert!(row(shift).chunks(4).all(|p| p[0].abs_diff(188) <= 6), "{:?}", row(shift));
    }
}

#[test]
fn depth_is_distance_along_the_view_axis() {
    let mut stage = Stage::default();
    stage.part(square(9.0), matte(Vec3::ONE), at(0.0, 0.0, 0.0));
    let film = shoot(&stage.world(), &front(3.0), &RenderSettings::default(), 16, 16);
    assert!(film.depth.iter().all(|d| (d - 3.0).abs() < 1e-5));
}
