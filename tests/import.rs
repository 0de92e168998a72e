//! What the importer makes of files built here: one feature or fault each.

use std::fmt::Write as _;

use kinora::{
    glam::{DQuat, DVec3, Vec2, Vec3, Vec4},
    scene::{
        AlphaMode, ChannelTarget, Interpolation, LightKind, LocalTransform, MeshId, NodeId, Projection, Scene,
        Topology,
        import::{ImportError, from_bytes},
    },
};

/// A file built from JSON text and one buffer whose views are added piece by piece.
#[derive(Default)]
struct Builder {
    data: Vec<u8>,
    views: Vec<String>,
    accessors: Vec<String>,
}

impl Builder {
    /// A view over `bytes`, aligned to 4; its number.
    fn view(&mut self, bytes: &[u8], extra: &str) -> usize {
        self.data.resize(self.data.len().next_multiple_of(4), 0);
        let (offset, length) = (self.data.len(), bytes.len());
        self.data.extend(bytes);
        self.views.push(format!(r#"{{"buffer":0,"byteOffset":{offset},"byteLength":{length}{extra}}}"#));
        self.views.len() - 1
    }

    /// An accessor given as JSON members; its number.
    fn accessor(&mut self, members: &str) -> usize {
        self.accessors.push(format!("{{{members}}}"));
        self.accessors.len() - 1
    }

    fn typed(&mut self, kind: &str, component: u32, count: usize, bytes: &[u8], extra: &str) -> usize {
        let view = self.view(bytes, "");
        self.accessor(&format!(
            r#""bufferView":{view},"componentType":{component},"count":{count},"type":"{kind}"{extra}"#
        ))
    }

    fn floats(&mut self, kind: &str, lanes: usize, values: &[f32]) -> usize {
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        self.typed(kind, 5126, values.len() / lanes, &bytes, "")
    }

    fn vec3(&mut self, values: &[[f32; 3]]) -> usize {
        self.floats("VEC3", 3, values.as_flattened())
    }

    fn shorts(&mut self, kind: &str, lanes: usize, values: &[u16], extra: &str) -> usize {
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        self.typed(kind, 5123, values.len() / lanes, &bytes, extra)
    }

    /// The whole document with `members` at its root.
    fn json(&self, members: &str) -> String {
        let mut text = format!(r#"{{"asset":{{"version":"2.0"}},{members}"#);
        if !self.accessors.is_empty() {
            write!(text, r#","accessors":[{}]"#, self.accessors.join(",")).expect("a string");
        }
        if !self.views.is_empty() {
            let (views, length) = (self.views.join(","), self.data.len());
            write!(text, r#","bufferViews":[{views}],"buffers":[{{"byteLength":{length}}}]"#).expect("a string");
        }
        text + "}"
    }

    fn glb(&self, members: &str) -> Vec<u8> {
        glb(&self.json(members), &self.data)
    }

    fn import(&self, members: &str) -> Result<Scene, ImportError> {
        import(&self.glb(members))
    }
}

fn glb(json: &str, data: &[u8]) -> Vec<u8> {
    let pad = |bytes: &[u8], with: u8| {
        let mut bytes = bytes.to_vec();
        bytes.resize(bytes.len().next_multiple_of(4), with);
        bytes
    };
    let (json, data) = (pad(json.as_bytes(), b' '), pad(data, 0));
    let chunk = |kind: &[u8; 4], bytes: &[u8]| {
        let length = u32::try_from(bytes.len()).expect("small");
        [&length.to_le_bytes(), &kind[..], bytes].concat()
    };
    let chunks = [chunk(b"JSON", &json), chunk(b"BIN\0", &data)].concat();
    let length = u32::try_from(12 + chunks.len()).expect("small");
    [b"glTF".as_slice(), &2_u32.to_le_bytes(), &length.to_le_bytes(), &chunks].concat()
}

fn import(bytes: &[u8]) -> Result<Scene, ImportError> {
    from_bytes("test.glb", bytes, &mut |uri| Err(format!("no file {uri}")))
}

/// Imports plain JSON members without any buffer.
fn members(members: &str) -> Result<Scene, ImportError> {
    Builder::default().import(members)
}

#[track_caller]
fn assert_fails(result: Result<Scene, ImportError>, place: &str, reason: &str) {
    let error = result.map(|s| s.warnings).expect_err("must not load").to_string();
    assert!(error.contains(place), "`{error}` does not name `{place}`");
    assert!(error.contains(reason), "`{error}` does not say `{reason}`");
}

#[track_caller]
fn assert_warns(scene: &Scene, text: &str) {
    assert!(scene.warnings.iter().any(|w| w.contains(text)), "no `{text}` in {:#?}", scene.warnings);
}

const TRIANGLE: [[f32; 3]; 3] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

/// A mesh of one primitive with these attributes and members, drawn by one node.
fn mesh(attributes: &str, members: &str) -> String {
    format!(r#""nodes":[{{"mesh":0}}],"meshes":[{{"primitives":[{{"attributes":{{{attributes}}}{members}}}]}}]"#)
}

// Accessors

#[test]
fn every_component_type_is_read_normalised_or_not() {
    let read = |component: u32, bytes: &[u8], normalized: bool| {
        let mut b = Builder::default();
        let extra = if normalized { r#","normalized":true"# } else { "" };
        let a = b.typed("VEC3", component, 1, bytes, extra);
        let scene = b.import(&mesh(&format!(r#""POSITION":{a}"#), "")).expect("valid");
        scene.meshes[0].parts[0].positions[0]
    };
    assert_eq!(read(5120, &[0x80, 127, 1], false), Vec3::new(-128.0, 127.0, 1.0));
    assert_eq!(read(5120, &[0x80, 127, 0], true), Vec3::new(-1.0, 1.0, 0.0));
    assert_eq!(read(5121, &[255, 51, 0], true), Vec3::new(1.0, 0.2, 0.0));
    assert_eq!(read(5122, &[0, 0x80, 0xff, 0x7f, 0, 0], true), Vec3::new(-1.0, 1.0, 0.0));
    assert_eq!(read(5123, &[0xff, 0xff, 1, 0, 0, 1], false), Vec3::new(65535.0, 1.0, 256.0));
}

#[test]
fn interleaved_views_and_offsets_are_followed() {
    let mut b = Builder::default();
    let interleaved: Vec<f32> = vec![0., 0., 0., 0., 0., 1., 1., 0., 0., 0., 1., 0., 0., 1., 0., 1., 0., 0.];
    let bytes: Vec<u8> = interleaved.iter().flat_map(|v| v.to_le_bytes()).collect();
    let view = b.view(&bytes, r#","byteStride":24"#);
    let at = |offset: u32| {
        format!(r#""bufferView":{view},"byteOffset":{offset},"componentType":5126,"count":3,"type":"VEC3""#)
    };
    let (p, n) = (b.accessor(&at(0)), b.accessor(&at(12)));
    let scene = b.import(&mesh(&format!(r#""POSITION":{p},"NORMAL":{n}"#), "")).expect("valid");
    let part = &scene.meshes[0].parts[0];
    assert_eq!(part.positions, TRIANGLE.map(Vec3::from_array));
    assert_eq!(part.normals, [Vec3::Z, Vec3::Y, Vec3::X]);
}

#[test]
fn sparse_accessors_overlay_zeros_or_a_view() {
    for with_view in [false, true] {
        let mut b = Builder::default();
        let base = b.vec3(&TRIANGLE);
        let indices = b.view(&[2, 0], "");
        let values: Vec<u8> = [7.0_f32, 8.0, 9.0].iter().flat_map(|v| v.to_le_bytes()).collect();
        let values = b.view(&values, "");
        let view = if with_view { format!(r#""bufferView":{base},"#) } else { String::new() };
        let a = b.accessor(&format!(
            r#"{view}"componentType":5126,"count":3,"type":"VEC3","sparse":{{"count":1,
            "indices":{{"bufferView":{indices},"componentType":5121}},"values":{{"bufferView":{values}}}}}"#
        ));
        let scene = b.import(&mesh(&format!(r#""POSITION":{a}"#), "")).expect("valid");
        let x = if with_view { Vec3::X } else { Vec3::ZERO };
        assert_eq!(scene.meshes[0].parts[0].positions, [Vec3::ZERO, x, Vec3::new(7.0, 8.0, 9.0)]);
    }
}

#[test]
fn accessors_that_reach_outside_are_refused_without_allocating() {
    let cases = [
        (r#""bufferView":0,"componentType":5126,"count":4,"type":"VEC3""#, "accessors[0]"),
        (r#""bufferView":0,"componentType":5126,"count":9007199254740991,"type":"VEC3""#, "accessors[0]"),
        (
            r#""bufferView":0,"byteOffset":9007199254740991,"componentType":5126,"count":1,"type":"VEC3""#,
            "accessors[0]",
        ),
        (r#""bufferView":9,"componentType":5126,"count":1,"type":"VEC3""#, "accessors[0].bufferView"),
        (r#""componentType":5126,"count":4000000000,"type":"VEC3""#, "accessors[0]"),
        (r#""componentType":5124,"count":1,"type":"VEC3""#, "accessors[0].componentType"),
        (
            r#""componentType":5126,"count":3,"type":"VEC3","sparse":{"count":4000000000,
            "indices":{"bufferView":0,"componentType":5125},"values":{"bufferView":0}}"#,
            "accessors[0].sparse.count",
        ),
    ];
    for (accessor, place) in cases {
        let mut b = Builder::default();
        b.view(&[0; 36], "");
        b.accessor(accessor);
        assert_fails(b.import(&mesh(r#""POSITION":0"#, "")), place, "");
    }
}

#[test]
fn positions_that_are_not_finite_are_refused() {
    for bad in [f32::NAN, f32::INFINITY] {
        let mut b = Builder::default();
        let p = b.vec3(&[[0.0; 3], [0.0, bad, 0.0], [0.0; 3]]);
        let result = b.import(&mesh(&format!(r#""POSITION":{p}"#), ""));
        assert_fails(result, "meshes[0].primitives[0].attributes.POSITION", "element 1");
    }
}

// Meshes

#[test]
fn indices_out_of_range_are_refused_and_restarts_too() {
    for index in [3_u16, 0xffff] {
        let mut b = Builder::default();
        let p = b.vec3(&TRIANGLE);
        let i = b.shorts("SCALAR", 1, &[0, 1, index], "");
        let result = b.import(&mesh(&format!(r#""POSITION":{p}"#), &format!(r#","indices":{i}"#)));
        assert_fails(result, "meshes[0].primitives[0].indices", &format!("vertex {index}"));
    }
}

#[test]
fn points_and_lines_are_kept_without_triangles_and_warned_about_once() {
    let mut b = Builder::default();
    let p = b.vec3(&TRIANGLE);
    let parts: Vec<String> =
        (0..7).map(|mode| format!(r#"{{"attributes":{{"POSITION":{p}}},"mode":{mode}}}"#)).collect();
    let text = format!(r#""nodes":[{{"mesh":0}}],"meshes":[{{"primitives":[{}]}}]"#, parts.join(","));
    let scene = b.import(&text).expect("valid");
    let kinds: Vec<_> = scene.meshes[0].parts.iter().map(|p| (p.topology, p.triangles.len())).collect();
    assert_eq!(kinds[0], (Topology::Points, 0));
    assert!(kinds[1..4].iter().all(|k| *k == (Topology::Lines, 0)));
    assert!(kinds[4..].iter().all(|k| *k == (Topology::Triangles, 1)));
    assert_eq!(scene.instances.len(), 7);
    assert_eq!(scene.warnings.iter().filter(|w| w.contains("points or lines")).count(), 1);
}

#[test]
fn eight_influences_come_together_and_weightless_joints_are_harmless() {
    let mut b = Builder::default();
    let p = b.vec3(&TRIANGLE);
    let first = b.shorts("VEC4", 4, &[1, 0, 900, 0].repeat(3), "");
    let second = b.typed("VEC4", 5121, 3, &[1, 1, 0, 0].repeat(3), "");
    let w0 = b.floats("VEC4", 4, &[0.5, 0.0, 0.0, 0.0].repeat(3));
    let w1 = b.shorts("VEC4", 4, &[0, 32768, 0, 0].repeat(3), r#","normalized":true"#);
    let attributes =
        format!(r#""POSITION":{p},"JOINTS_0":{first},"WEIGHTS_0":{w0},"JOINTS_1":{second},"WEIGHTS_1":{w1}"#);
    let text = format!(
        r#""nodes":[{{"mesh":0,"skin":0}},{{}},{{}}],"skins":[{{"joints":[1,2]}}],
        "meshes":[{{"primitives":[{{"attributes":{{{attributes}}}}}]}}]"#
    );
    let scene = b.import(&text).expect("valid");
    let all = scene.meshes[0].parts[0].influences.as_ref().expect("joints");
    assert_eq!(all.per_vertex, 8);
    assert_eq!(all.joints[..8], [1, 0, 0, 0, 0, 1, 0, 0]);
    assert_eq!(all.weights[..8], [0.5, 0.0, 0.0, 0.0, 0.0, 32768.0 / 65535.0, 0.0, 0.0]);
    let fewer = text.replace("[1,2]", "[1]");
    assert_fails(b.import(&fewer), "nodes[0].skin", "joint 1");
}

#[test]
fn morph_targets_and_default_weights_follow_the_mesh_and_the_node() {
    let mut b = Builder::default();
    let p = b.vec3(&TRIANGLE);
    let t = b.vec3(&[[0.0, 0.0, 1.0]; 3]);
    let short = b.vec3(&[[0.0; 3]; 2]);
    let text = |target: usize| {
        format!(
            r#""nodes":[{{"mesh":0,"weights":[0.25,0.75]}},{{"mesh":0}}],"meshes":[{{"weights":[1],"primitives":[
            {{"attributes":{{"POSITION":{p}}},"targets":[{{"POSITION":{target}}},{{"NORMAL":{t}}}]}}]}}]"#
        )
    };
    let scene = b.import(&text(t)).expect("valid");
    let part = &scene.meshes[0].parts[0];
    assert_eq!(part.targets[0].positions, [Vec3::Z; 3]);
    assert!(part.targets[1].positions.is_empty() && part.targets[1].normals.is_empty());
    assert_eq!(scene.meshes[0].weights, [1.0, 0.0]);
    assert_eq!(scene.nodes[0].weights.as_deref(), Some(&[0.25, 0.75][..]));
    assert!(scene.nodes[1].weights.is_none());
    assert_warns(&scene, "targets[1].NORMAL");
    assert_fails(b.import(&text(short)), "targets[0].POSITION", "2 elements for 3 vertices");
}

#[test]
fn attributes_a_picture_can_do_without_are_dropped_when_broken() {
    let mut b = Builder::default();
    let p = b.vec3(&TRIANGLE);
    let n = b.vec3(&[[0.0, 0.0, f32::NAN]; 3]);
    let uv = b.vec3(&[[0.0; 3]; 3]);
    let scene = b.import(&mesh(&format!(r#""POSITION":{p},"NORMAL":{n},"TEXCOORD_0":{uv}"#), "")).expect("valid");
    let part = &scene.meshes[0].parts[0];
    assert!(part.normals.is_empty());
    assert_eq!(part.tex_coords, [vec![Vec2::ZERO; 3]]);
    assert_warns(&scene, "attributes.NORMAL: element 0");
    assert_warns(&scene, "attributes.TEXCOORD_0");
}

#[test]
fn vertex_colours_of_three_bytes_become_opaque() {
    let mut b = Builder::default();
    let p = b.vec3(&TRIANGLE);
    let c = b.typed("VEC3", 5121, 3, &[255, 0, 51].repeat(3), r#","normalized":true"#);
    let scene = b.import(&mesh(&format!(r#""POSITION":{p},"COLOR_0":{c}"#), "")).expect("valid");
    assert_eq!(scene.meshes[0].parts[0].colors, [Vec4::new(1.0, 0.0, 0.2, 1.0); 3]);
}

#[test]
fn draco_with_plain_accessors_beside_it_is_drawn_from_those() {
    let mut b = Builder::default();
    let p = b.vec3(&TRIANGLE);
    let draco = r#","extensions":{"KHR_draco_mesh_compression":{"bufferView":0,"attributes":{"POSITION":0}}}"#;
    let used = r#","extensionsUsed":["KHR_draco_mesh_compression"]"#;
    let scene = b.import(&(mesh(&format!(r#""POSITION":{p}"#), draco) + used)).expect("has a fallback");
    assert_eq!(scene.triangles_drawn(), 1);
    assert_eq!(scene.extensions_ignored, ["KHR_draco_mesh_compression"]);
    let empty = b.accessor(r#""componentType":5126,"count":3,"type":"VEC3""#);
    let result = b.import(&(mesh(&format!(r#""POSITION":{empty}"#), draco) + used));
    assert_fails(result, "meshes[0].primitives[0].attributes.POSITION", "KHR_draco_mesh_compression");
}

// Nodes and scenes

#[test]
fn draw_order_is_depth_first_and_lists_copies_before_parts() {
    let mut b = Builder::default();
    let p = b.vec3(&TRIANGLE);
    let t = b.vec3(&[[1.0, 0.0, 0.0], [2.0, 0.0, 0.0]]);
    let r = b.typed("VEC4", 5122, 2, &[0, 0, 0, 0, 0, 0, 0xff, 0x7f].repeat(2), r#","normalized":true"#);
    let primitive = format!(r#"{{"attributes":{{"POSITION":{p}}}}}"#);
    let text = format!(
        r#""scene":1,"scenes":[{{"nodes":[3]}},{{"nodes":[2,0]}}],
        "nodes":[{{"mesh":0}},{{"mesh":0}},{{"children":[1],"mesh":0,"extensions":{{"EXT_mesh_gpu_instancing":
        {{"attributes":{{"TRANSLATION":{t},"ROTATION":{r}}}}}}}}},{{"mesh":0}}],
        "meshes":[{{"primitives":[{primitive},{primitive}]}}],"extensionsUsed":["EXT_mesh_gpu_instancing"]"#
    );
    let scene = b.import(&text).expect("valid");
    assert_eq!(scene.scene_count, 2);
    assert_eq!(scene.draw_order, [NodeId(2), NodeId(1), NodeId(0)]);
    let order: Vec<_> = scene.instances.iter().map(|i| (i.node.0, i.copy, i.part)).collect();
    let two = |node, copy| [(node, copy, 0), (node, copy, 1)];
    assert_eq!(order, [two(2, Some(0)), two(2, Some(1)), two(1, None), two(0, None)].concat());
    let copy = scene.nodes[2].copies.as_ref().expect("copies")[1];
    assert_eq!((copy.translation, copy.rotation, copy.scale), (DVec3::X * 2.0, DQuat::IDENTITY, DVec3::ONE));
}

#[test]
fn without_scenes_every_root_is_drawn_by_index() {
    let scene = members(r#""nodes":[{},{"children":[0]},{}]"#).expect("valid");
    assert_eq!(scene.draw_order, [NodeId(1), NodeId(0), NodeId(2)]);
}

#[test]
fn bad_graphs_are_refused_by_node() {
    let cases = [
        (r#""nodes":[{"children":[1]},{"children":[0]}]"#, "nodes[", "cycle"),
        (r#""nodes":[{"children":[0]}]"#, "nodes[0].children[0]", "its own child"),
        (r#""nodes":[{"children":[2]},{"children":[2]},{}]"#, "nodes[1].children[0]", "two parents"),
        (r#""nodes":[{"children":[1]}]"#, "nodes[0].children[0]", "node 1"),
        (r#""nodes":[{}],"scenes":[{"nodes":[1]}]"#, "scenes[0].nodes[0]", "node 1"),
        (r#""nodes":[{}],"scene":3"#, "scene:", "scene 3"),
        (r#""nodes":[{"mesh":0}]"#, "nodes[0].mesh", "none"),
        (r#""nodes":[{"children":[-1]}]"#, "nodes[0].children[0]", "-1"),
    ];
    for (text, place, reason) in cases {
        assert_fails(members(text), place, reason);
    }
}

#[test]
fn a_chain_of_a_hundred_thousand_nodes_loads() {
    const COUNT: usize = 100_000;
    let nodes: Vec<String> = (1..COUNT).map(|i| format!(r#"{{"children":[{i}]}}"#)).collect();
    let scene = members(&format!(r#""nodes":[{},{{}}]"#, nodes.join(","))).expect("valid");
    assert_eq!(scene.draw_order.len(), COUNT);
    assert_eq!(scene.eval_order[COUNT - 1], NodeId(99_999));
    let cycle = format!(r#""nodes":[{},{{"children":[0]}}]"#, nodes.join(","));
    assert_fails(members(&cycle), "nodes[", "cycle");
}

#[test]
fn transforms_keep_double_precision_and_matrices() {
    let scene = members(
        r#""nodes":[{"translation":[0.1,1e-9,3],"rotation":[0,0,2,0],"scale":[-1,1,1]},
        {"matrix":[1,0,0,0, 0.5,1,0,0, 0,0,1,0, 4,5,6,1]}]"#,
    )
    .expect("valid");
    let LocalTransform::Trs(trs) = scene.nodes[0].local else { panic!("TRS") };
    assert_eq!((trs.translation, trs.scale.x), (DVec3::new(0.1, 1e-9, 3.0), -1.0));
    assert_eq!(trs.rotation, DQuat::from_xyzw(0.0, 0.0, 2.0, 0.0));
    let LocalTransform::Matrix(matrix) = scene.nodes[1].local else { panic!("matrix") };
    assert_eq!(matrix.w_axis.truncate(), DVec3::new(4.0, 5.0, 6.0));
    assert_warns(&scene, "nodes[0].rotation");
}

// Animations

/// One node, and animations over key times and rotations.
fn animated(b: &mut Builder, animations: &str) -> Scene {
    b.import(&format!(r#""nodes":[{{}},{{}}],"animations":[{animations}]"#)).expect("valid")
}

#[test]
fn a_broken_animation_disables_itself_and_the_others_play() {
    let mut b = Builder::default();
    let good = b.floats("SCALAR", 1, &[0.0, 1.0]);
    let values = b.vec3(&[[0.0; 3], [1.0; 3]]);
    let mut bad_times = Vec::new();
    for times in [&[1.0, 1.0][..], &[0.0, f32::NAN], &[]] {
        bad_times.push(b.floats("SCALAR", 1, times));
    }
    let animation = |input: usize, output: usize, node: u32| {
        format!(
            r#"{{"channels":[{{"sampler":0,"target":{{"node":{node},"path":"translation"}}}}],
            "samplers":[{{"input":{input},"output":{output}}}]}}"#
        )
    };
    let mut all = vec![animation(good, values, 0), animation(good, good, 0), animation(good, values, 9)];
    all.extend(bad_times.iter().map(|&times| animation(times, values, 0)));
    all.push(animation(99, values, 0));
    all.push(r#"{"channels":[{"sampler":-1,"target":{"path":"scale"}}],"samplers":[]}"#.to_owned());
    all.push(animation(good, values, 0).replace(r#""output""#, r#""interpolation":"CUBIC","output""#));
    let scene = animated(&mut b, &all.join(","));
    assert!(scene.clips[0].disabled.is_none() && scene.clips[0].channels.len() == 1);
    let reasons = ["output", "target.node", "do not increase", "not finite", "no key", "accessor 99", "-1", "CUBIC"];
    for (clip, reason) in scene.clips[1..].iter().zip(reasons) {
        let disabled = clip.disabled.as_deref().expect("disabled");
        assert!(disabled.contains(reason) && clip.channels.is_empty(), "`{disabled}` does not say `{reason}`");
        assert_warns(&scene, reason);
    }
    assert_eq!(scene.clips.len(), reasons.len() + 1);
}

#[test]
fn channels_without_a_node_are_skipped_quietly_and_the_last_of_two_counts() {
    let mut b = Builder::default();
    let times = b.floats("SCALAR", 1, &[0.5, 2.5]);
    let (first, last) = (b.vec3(&[[1.0; 3]; 2]), b.vec3(&[[2.0; 3]; 2]));
    let scene = animated(
        &mut b,
        &format!(
            r#"{{"name":"walk","samplers":[{{"input":{times},"output":{first}}},
            {{"input":{times},"output":{last},"interpolation":"STEP"}}],
            "channels":[{{"sampler":0,"target":{{"path":"translation"}}}},
            {{"sampler":0,"target":{{"node":1,"path":"scale"}}}},
            {{"sampler":1,"target":{{"node":1,"path":"scale"}}}}]}}"#
        ),
    );
    let clip = &scene.clips[0];
    assert_eq!((clip.name.as_str(), clip.channel_count, clip.duration_s), ("walk", 3, 2.5));
    let [channel] = clip.channels[..] else { panic!("{:?}", clip.channels) };
    assert_eq!(channel.target, ChannelTarget::Scale(NodeId(1)));
    let sampler = &clip.samplers[channel.sampler as usize];
    assert_eq!((sampler.interpolation, sampler.values[0]), (Interpolation::Step, 2.0));
    assert_eq!(
        scene.warnings.len(),
        scene.warnings.iter().filter(|w| w.contains("earlier") || w.contains("min and max")).count()
    );
}

#[test]
fn pointers_drive_nodes_and_mesh_weights_and_others_warn_once() {
    let mut b = Builder::default();
    let times = b.floats("SCALAR", 1, &[0.0, 1.0]);
    let (vec3, one) = (b.vec3(&[[0.0; 3]; 2]), b.floats("SCALAR", 1, &[0.0, 1.0]));
    let (p, t) = (b.vec3(&TRIANGLE), b.vec3(&TRIANGLE));
    let channel = |sampler: u32, pointer: &str| {
        format!(
            r#"{{"sampler":{sampler},"target":{{"path":"pointer","extensions":{{"KHR_animation_pointer":
            {{"pointer":"{pointer}"}}}}}}}}"#
        )
    };
    let pointers = ["/nodes/0/translation", "/meshes/0/weights", "/materials/0/alphaCutoff", "/cameras/0/x"];
    let channels: Vec<_> = [0, 1, 1, 1].iter().zip(pointers).map(|(&s, p)| channel(s, p)).collect();
    let text = format!(
        r#"{},"extensionsUsed":["KHR_animation_pointer"],"animations":[{{"channels":[{}],
        "samplers":[{{"input":{times},"output":{vec3}}},{{"input":{times},"output":{one}}}]}}]"#,
        mesh(&format!(r#""POSITION":{p}"#), &format!(r#","targets":[{{"POSITION":{t}}}]"#)),
        channels.join(",")
    );
    let scene = b.import(&text).expect("valid");
    let targets: Vec<_> = scene.clips[0].channels.iter().map(|c| c.target).collect();
    assert_eq!(targets, [ChannelTarget::Translation(NodeId(0)), ChannelTarget::MeshWeights(MeshId(0))]);
    assert_eq!(scene.warnings.iter().filter(|w| w.contains("alphaCutoff")).count(), 1);
}

// Materials, textures, lights, cameras, extensions

#[test]
fn materials_textures_lights_and_cameras_are_read() {
    let scene = members(
        r#""materials":[{"name":"m","alphaMode":"MASK","doubleSided":true,"emissiveFactor":[1,0.5,0],
        "normalTexture":{"index":0,"scale":2},"pbrMetallicRoughness":{"metallicFactor":0,"baseColorTexture":{"index":0,
        "texCoord":0,"extensions":{"KHR_texture_transform":{"texCoord":1,"offset":[0.5,0],"rotation":1}}}},
        "extensions":{"KHR_materials_emissive_strength":{"emissiveStrength":4},"KHR_materials_unlit":{}}}],
        "textures":[{"sampler":0,"source":0,"extensions":{"EXT_texture_webp":{"source":1}}}],
        "samplers":[{"wrapS":33071,"magFilter":9728,"minFilter":9985}],
        "images":[{"uri":"a.png"},{"uri":"data:image/png;base64,AAAA"}],
        "cameras":[{"type":"perspective","perspective":{"yfov":0.5,"znear":0.1}}],
        "nodes":[{"camera":0,"extensions":{"KHR_lights_punctual":{"light":0}}}],
        "extensions":{"KHR_lights_punctual":{"lights":[{"type":"spot","intensity":5,"spot":{"outerConeAngle":0.5}}]}},
        "extensionsUsed":["KHR_lights_punctual","KHR_materials_unlit","KHR_texture_transform","EXT_texture_webp",
        "KHR_materials_emissive_strength"]"#,
    )
    .expect("valid");
    let material = &scene.materials[0];
    assert_eq!(material.alpha_mode, AlphaMode::Mask { cutoff: 0.5 });
    assert_eq!(material.emissive, Vec3::new(4.0, 2.0, 0.0));
    assert!(material.unlit && material.double_sided);
    assert_eq!((material.metallic, material.normal_scale), (0.0, 2.0));
    let base = material.base_color_texture.expect("a texture");
    assert_eq!((base.tex_coord, base.offset, base.scale), (1, Vec2::new(0.5, 0.0), Vec2::ONE));
    assert_eq!(scene.lights[0].kind, LightKind::Spot { inner: 0.0, outer: 0.5 });
    let perspective = Projection::Perspective { y_fov: 0.5, aspect: None, z_near: 0.1, z_far: None };
    assert_eq!(scene.cameras[0].projection, perspective);
    // Neither image can be read: white, with a reason each.
    assert_eq!(scene.textures[0].image, None);
    assert_warns(&scene, "images[0]: `a.png` cannot be read: no file a.png");
    assert_warns(&scene, "images[1]: is no PNG, JPEG or WebP");
    assert!(scene.extensions_ignored.is_empty(), "{:?}", scene.extensions_ignored);
}

#[test]
fn unknown_extensions_are_named_when_required_and_listed_when_used() {
    let scene = members(r#""extensionsUsed":["XYZ_new"]"#).expect("optional");
    assert_eq!((scene.extensions_used, scene.extensions_ignored), (vec!["XYZ_new".into()], vec!["XYZ_new".into()]));
    let result = members(r#""extensionsUsed":["XYZ_new"],"extensionsRequired":["XYZ_new"]"#);
    assert_fails(result, "XYZ_new", "export");
}

// Files and limits

#[test]
fn relative_buffers_come_from_the_resolver_once_and_others_are_refused_by_name() {
    let text = |uri: &str| {
        format!(
            r#"{{"asset":{{"version":"2.0"}},"buffers":[{{"uri":"{uri}","byteLength":4}},{{"uri":"{uri}","byteLength":4}}]}}"#
        )
    };
    let mut asked = Vec::new();
    let mut resolve = |uri: &str| {
        asked.push(uri.to_owned());
        Ok(vec![0; 4])
    };
    from_bytes("a.gltf", text("sub/a%20b.bin").as_bytes(), &mut resolve).expect("valid");
    for uri in ["../a.bin", "/etc/passwd", "https://host/a.bin", "C:/a.bin", "%2e%2e%2fa.bin"] {
        let error = from_bytes("a.gltf", text(uri).as_bytes(), &mut resolve).expect_err(uri).to_string();
        assert!(error.contains("buffers[0].uri") && error.contains(uri), "{error}");
    }
    assert_eq!(asked, ["sub/a b.bin"]);
}

#[test]
fn small_files_cannot_ask_for_much_memory() {
    let mut b = Builder::default();
    let huge = b.accessor(r#""componentType":5126,"count":50000000,"type":"VEC3""#);
    let result = b.import(&mesh(&format!(r#""POSITION":{huge}"#), ""));
    assert!(matches!(result, Err(ImportError::TooLarge { .. })), "{result:?}");
    // Many primitives over one accessor are many copies.
    let mut b = Builder::default();
    let big = b.accessor(r#""componentType":5126,"count":1000000,"type":"VEC3""#);
    let parts = vec![format!(r#"{{"attributes":{{"POSITION":{big}}}}}"#); 1000].join(",");
    let result = b.import(&format!(r#""meshes":[{{"primitives":[{parts}]}}]"#));
    assert!(matches!(result, Err(ImportError::TooLarge { .. })), "{:?}", result.map(|s| s.meshes.len()));
    // Empty nodes take a hundred times their text.
    let nodes = vec!["{}"; 800_000].join(",");
    let result = members(&format!(r#""nodes":[{nodes}]"#));
    assert!(matches!(result, Err(ImportError::TooLarge { .. })), "{:?}", result.map(|s| s.nodes.len()));
}

#[test]
fn an_image_of_absurd_size_is_white_and_not_decoded() {
    let header = |width: u32| {
        let mut ihdr = b"IHDR".to_vec();
        ihdr.extend(width.to_be_bytes());
        ihdr.extend(width.to_be_bytes());
        ihdr.extend([8, 6, 0, 0, 0]);
        let crc = crc32(&ihdr);
        [b"\x89PNG\r\n\x1a\n\0\0\0\x0d".as_slice(), &ihdr, &crc.to_be_bytes()].concat()
    };
    for width in [40_000, 20_000] {
        let mut b = Builder::default();
        let view = b.view(&header(width), "");
        let scene = b.import(&format!(r#""images":[{{"bufferView":{view},"mimeType":"image/png"}}]"#)).expect("valid");
        assert_eq!((scene.images[0].width, scene.images[0].rgba.len()), (1, 4));
        assert_warns(&scene, "images[0]");
    }
}

fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0_u32, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |c, _| if c & 1 == 1 { c >> 1 ^ 0xedb8_8320 } else { c >> 1 })
    })
}

#[test]
fn text_that_is_no_gltf_is_told_so() {
    for (bytes, reason) in [
        (&b""[..], "empty"),
        (b"solid cube", "neither"),
        (b"{", "EOF"),
        (b"{\"asset\":{\"version\":\"2.0\"}} trailing", "trailing"),
        (b"\xff\xfe", "UTF-8"),
        (b"glTF\x02\0\0\0", "cut short"),
        (b"{\"asset\":{\"version\":2}}", "asset.version"),
        (b"{\"asset\":[\"2.0\"]}", "asset"),
        (b"{\"nodes\":[]}", "asset"),
    ] {
        assert_fails(import(bytes), "test.glb: ", reason);
    }
}

#[test]
fn whole_numbers_may_be_written_as_decimals() {
    let scene = members(r#""nodes":[{"children":[1.0]},{}],"scene":0e0,"scenes":[{"nodes":[0]}]"#).expect("valid");
    assert_eq!(scene.draw_order, [NodeId(0), NodeId(1)]);
    assert_fails(members(r#""nodes":[{"children":[0.5]}]"#), "nodes[0].children[0]", "0.5");
}
