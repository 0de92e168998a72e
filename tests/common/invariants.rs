//! What every imported scene promises its readers; also asserted by the fuzz target `import`.

use kinora::scene::{Interpolation, LocalTransform, MeshPart, Scene, SceneNode};

/// Asserts the promises.
///
/// # Panics
/// When one is broken.
pub(crate) fn check(scene: &Scene) {
    let nodes = scene.nodes.len();
    assert_eq!(scene.eval_order.len(), nodes);
    let mut seen = vec![false; nodes];
    for id in &scene.eval_order {
        assert!(!std::mem::replace(&mut seen[id.index()], true));
        let node = &scene.nodes[id.index()];
        assert!(node.parent.is_none_or(|p| seen[p.index()]));
        check_node(scene, node);
    }
    for instance in &scene.instances {
        let _ = scene.part(*instance);
    }
    scene.meshes.iter().flat_map(|m| &m.parts).for_each(|p| check_part(scene, p));
    for clip in &scene.clips {
        assert!(clip.disabled.is_none() || clip.channels.is_empty());
        for channel in &clip.channels {
            let sampler = &clip.samplers[channel.sampler as usize];
            let per_key = if sampler.interpolation == Interpolation::CubicSpline { 3 } else { 1 };
            assert!(!sampler.times.is_empty() && sampler.times.is_sorted_by(|a, b| a < b));
            assert_eq!(sampler.values.len(), sampler.times.len() * sampler.width * per_key);
            assert!(sampler.values.iter().all(|v| v.is_finite()));
        }
    }
    for image in &scene.images {
        assert_eq!(image.rgba.len(), 4 * image.width as usize * image.height as usize);
        assert!(!image.rgba.is_empty());
    }
    for texture in &scene.textures {
        assert!(texture.image.is_none_or(|i| i.index() < scene.images.len()));
    }
}

fn check_node(scene: &Scene, node: &SceneNode) {
    if let LocalTransform::Matrix(matrix) = &node.local {
        assert!(matrix.is_finite());
    }
    if let (Some(mesh), Some(skin)) = (node.mesh, node.skin) {
        let joints = scene.skins[skin.index()].joints.len();
        for part in &scene.meshes[mesh.index()].parts {
            let used = part.influences.iter().flat_map(|i| &i.joints);
            assert!(used.max().is_none_or(|&j| usize::from(j) < joints));
        }
    }
    if let (Some(mesh), Some(weights)) = (node.mesh, &node.weights) {
        assert_eq!(weights.len(), scene.meshes[mesh.index()].weights.len());
    }
}

fn check_part(scene: &Scene, part: &MeshPart) {
    let count = part.positions.len();
    let fits = |length: usize| length == 0 || length == count;
    assert!(part.positions.iter().all(|p| p.is_finite()));
    assert!(part.triangles.iter().flatten().all(|&i| (i as usize) < count));
    assert!(fits(part.normals.len()) && fits(part.tangents.len()) && fits(part.colors.len()));
    assert!(part.tex_coords.iter().all(|set| set.len() == count));
    assert!(part.material.is_none_or(|m| m.index() < scene.materials.len()));
    if let Some(all) = &part.influences {
        assert_eq!(all.joints.len(), count * all.per_vertex);
        assert_eq!(all.weights.len(), count * all.per_vertex);
    }
    for target in &part.targets {
        assert!(fits(target.positions.len()) && fits(target.normals.len()) && fits(target.tangents.len()));
    }
}
