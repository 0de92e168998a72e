//! Work that a scene does not ask for and that is therefore neither done nor stored.

use serde::Serialize;

use super::MotionClass;
use crate::scene::{AlphaMode, Material, MaterialId, NodeId, Scene, Topology};

/// A feature that is left out, and why.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct LeftOut {
    /// What is neither done nor stored.
    pub feature: &'static str,
    /// What the scene lacks that would need it.
    pub why: String,
}

/// Everything left out for this scene, stages before shading; `classes` are those of its instances.
pub fn left_out(scene: &Scene, classes: &[MotionClass]) -> Vec<LeftOut> {
    let mut found = Vec::new();
    let mut note = |is_left_out: bool, feature: &'static str, why: String| {
        if is_left_out {
            found.push(LeftOut { feature, why });
        }
    };
    motion(scene, classes, &mut note);
    geometry(scene, &mut note);
    shading(scene, &mut note);
    found
}

type Note<'n> = dyn FnMut(bool, &'static str, String) + 'n;

fn motion(scene: &Scene, classes: &[MotionClass], note: &mut Note<'_>) {
    let drawn = || scene.instances.iter().map(|i| (&scene.nodes[i.node.index()], scene.part(*i)));
    let is_skinned = drawn().any(|(node, part)| node.skin.is_some() && part.influences.is_some());
    let morphs = drawn().any(|(_, part)| part.targets.iter().any(|t| !t.positions.is_empty()));
    note(!is_skinned, "skinning", "no drawn part has a skin".to_owned());
    note(!morphs, "morphing", "no drawn part has morph targets".to_owned());
    let still = classes.iter().filter(|&&c| c == MotionClass::Static).count();
    let moving = classes.len() - still;
    note(moving == 0, "deform, refit and rebuild", "no part moves in any animation".to_owned());
    let why = format!("{still} of {} parts never move: built once", classes.len());
    note(moving > 0 && still > 0, "refit of static parts", why);
}

fn geometry(scene: &Scene, note: &mut Note<'_>) {
    let untraced = scene.instances.iter().filter(|&&i| scene.part(i).topology != Topology::Triangles).count();
    note(untraced > 0, "points and lines", format!("{untraced} parts have no surface: posed, not traced"));
    let mut is_drawn = vec![false; scene.nodes.len()];
    scene.draw_order.iter().for_each(|n: &NodeId| is_drawn[n.index()] = true);
    let hidden = scene.nodes.iter().zip(&is_drawn).filter(|(n, drawn)| n.mesh.is_some() && !**drawn).count();
    note(hidden > 0, "nodes of other scenes", format!("{hidden} nodes with a mesh are not in the default scene"));
}

fn shading(scene: &Scene, note: &mut Note<'_>) {
    let used = drawn_materials(scene);
    let any = |test: fn(&Material) -> bool| used.iter().any(|m| test(m));
    let none = |what: &str| format!("no drawn material has {what}");
    note(!any(|m| matches!(m.alpha_mode, AlphaMode::Mask { .. })), "alpha test", none("alpha mode MASK"));
    note(!any(|m| m.alpha_mode == AlphaMode::Blend), "blending", none("alpha mode BLEND"));
    note(!any(|m| m.normal_texture.is_some()), "normal maps and tangents", none("a normal texture"));
    note(!any(|m| m.occlusion_texture.is_some()), "occlusion maps", none("an occlusion texture"));
    note(!any(|m| m.emissive != glam::Vec3::ZERO), "emission", none("an emissive factor"));
    note(!any(has_texture), "texture lookup and mipmaps", none("a texture"));
    let colors = scene.instances.iter().any(|&i| !scene.part(i).colors.is_empty());
    note(!colors, "vertex colours", "no drawn part has COLOR_0".to_owned());
    let lit = scene.draw_order.iter().any(|n| scene.nodes[n.index()].light.is_some());
    note(!lit, "the file's lights", "it has none in the default scene: a key light and a soft sky are used".to_owned());
}

fn has_texture(m: &Material) -> bool {
    let all =
        [m.base_color_texture, m.metallic_roughness_texture, m.normal_texture, m.occlusion_texture, m.emissive_texture];
    all.iter().any(Option::is_some)
}

/// Materials of drawn parts, each once.
fn drawn_materials(scene: &Scene) -> Vec<&Material> {
    let mut ids: Vec<MaterialId> = scene.instances.iter().filter_map(|&i| scene.part(i).material).collect();
    ids.sort_unstable();
    ids.dedup();
    ids.into_iter().map(|id| &scene.materials[id.index()]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::builtin;

    #[test]
    fn an_empty_scene_leaves_everything_out() {
        let features: Vec<_> = left_out(&Scene::default(), &[]).into_iter().map(|l| l.feature).collect();
        for feature in ["skinning", "deform, refit and rebuild", "alpha test", "texture lookup and mipmaps"] {
            assert!(features.contains(&feature), "{features:?}");
        }
    }

    #[test]
    fn the_walking_figure_needs_skinning() {
        let scene = builtin::load("walk").expect("built in");
        let found = left_out(&scene, &[MotionClass::Static, MotionClass::Deforming]);
        assert!(found.iter().all(|l| l.feature != "skinning" && !l.why.is_empty()));
        assert!(found.iter().any(|l| l.feature == "refit of static parts"));
    }
}
