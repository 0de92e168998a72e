//! World-space vertices of a model, evaluated as plainly as the specification reads: by recursion, with 4 x 4
//! arrays and the system's functions. Shares no code with the library.

use super::model::{Channel, Interpolation, Model, Path, Placement};

type Matrix = [f64; 16];

const IDENTITY: Matrix = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0];

fn times(a: &Matrix, b: &Matrix) -> Matrix {
    std::array::from_fn(|i| (0..4).map(|k| a[4 * k + i % 4] * b[i / 4 * 4 + k]).sum())
}

fn trs(t: [f64; 3], r: [f64; 4], s: [f64; 3]) -> Matrix {
    let length = r.iter().map(|v| v * v).sum::<f64>().sqrt();
    let [x, y, z, w] = if length > 0.0 { r.map(|v| v / length) } else { [0.0, 0.0, 0.0, 1.0] };
    [
        (1.0 - 2.0 * (y * y + z * z)) * s[0],
        2.0 * (x * y + w * z) * s[0],
        2.0 * (x * z - w * y) * s[0],
        0.0,
        2.0 * (x * y - w * z) * s[1],
        (1.0 - 2.0 * (x * x + z * z)) * s[1],
        2.0 * (y * z + w * x) * s[1],
        0.0,
        2.0 * (x * z + w * y) * s[2],
        2.0 * (y * z - w * x) * s[2],
        (1.0 - 2.0 * (x * x + y * y)) * s[2],
        0.0,
        t[0],
        t[1],
        t[2],
        1.0,
    ]
}

fn slerp(a: &[f64], b: &[f64], u: f64) -> Vec<f64> {
    let unit = |q: &[f64]| {
        let length = q.iter().map(|v| v * v).sum::<f64>().sqrt();
        q.iter().map(|v| v / length).collect::<Vec<_>>()
    };
    let (a, mut b) = (unit(a), unit(b));
    let mut dot: f64 = a.iter().zip(&b).map(|(x, y)| x * y).sum();
    if dot < 0.0 {
        b = b.iter().map(|v| -v).collect();
        dot = -dot;
    }
    if dot > 1.0 - 1e-12 {
        return a.iter().zip(&b).map(|(x, y)| x * (1.0 - u) + y * u).collect();
    }
    let angle = dot.acos();
    let (p, q) = (((1.0 - u) * angle).sin() / angle.sin(), (u * angle).sin() / angle.sin());
    a.iter().zip(&b).map(|(x, y)| x * p + y * q).collect()
}

/// A channel's value at a time.
fn sampled(channel: &Channel, time: f64) -> Vec<f64> {
    let width = channel.width();
    let cubic = channel.interpolation == Interpolation::Cubic;
    let slot =
        |s: usize| -> Vec<f64> { (0..width).map(|c| channel.storage.decoded(channel.values[s * width + c])).collect() };
    let value = |key: usize| slot(if cubic { 3 * key + 1 } else { key });
    let keys: Vec<f64> = channel.times.iter().map(|&t| f64::from(t)).collect();
    let last = keys.len() - 1;
    if time <= keys[0] {
        return value(0);
    }
    if time >= keys[last] {
        return value(last);
    }
    let mut key = 0;
    while keys[key + 1] <= time {
        key += 1;
    }
    let span = keys[key + 1] - keys[key];
    let u = (time - keys[key]) / span;
    let (from, to) = (value(key), value(key + 1));
    match channel.interpolation {
        Interpolation::Step => from,
        Interpolation::Linear if channel.path == Path::Rotation => slerp(&from, &to, u),
        Interpolation::Linear => from.iter().zip(&to).map(|(a, b)| a * (1.0 - u) + b * u).collect(),
        Interpolation::Cubic => {
            let (leave, arrive) = (slot(3 * key + 2), slot(3 * key + 3));
            let (u2, u3) = (u * u, u * u * u);
            (0..width)
                .map(|c| {
                    (2.0 * u3 - 3.0 * u2 + 1.0) * from[c]
                        + span * (u3 - 2.0 * u2 + u) * leave[c]
                        + (-2.0 * u3 + 3.0 * u2) * to[c]
                        + span * (u3 - u2) * arrive[c]
                })
                .collect()
        }
    }
}

/// A model at a moment.
pub(crate) struct Moment<'a> {
    model: &'a Model,
    /// Animations that play, each at its time.
    playing: &'a [(usize, f64)],
}

impl<'a> Moment<'a> {
    pub(crate) fn new(model: &'a Model, playing: &'a [(usize, f64)]) -> Self {
        Self { model, playing }
    }

    fn driven(&self, target: usize, path: Path) -> Option<Vec<f64>> {
        let mut channels = self.playing.iter().flat_map(|&(a, t)| self.model.animations[a].iter().map(move |c| (c, t)));
        channels.rfind(|(c, _)| c.target == target && c.path == path).map(|(c, t)| sampled(c, t))
    }

    fn local(&self, node: usize) -> Matrix {
        let (t, r, s) = match self.model.nodes[node].placement {
            Placement::Matrix(m) => return m.map(f64::from),
            Placement::Trs(t, r, s) => (t.map(f64::from), r.map(f64::from), s.map(f64::from)),
        };
        let pick = |path| self.driven(node, path);
        trs(
            pick(Path::Translation).map_or(t, |v| v.try_into().unwrap()),
            pick(Path::Rotation).map_or(r, |v| v.try_into().unwrap()),
            pick(Path::Scale).map_or(s, |v| v.try_into().unwrap()),
        )
    }

    pub(crate) fn global(&self, node: usize) -> Matrix {
        let parent = self.model.nodes.iter().position(|n| n.children.contains(&node));
        let above = parent.map_or(IDENTITY, |p| self.global(p));
        times(&above, &self.local(node))
    }

    fn morph_weights(&self, node: usize, mesh: usize) -> Vec<f64> {
        let wide = |w: &Vec<f32>| w.iter().map(|&v| f64::from(v)).collect();
        self.driven(node, Path::Weights)
            .or_else(|| self.model.nodes[node].weights.as_ref().map(wide))
            .or_else(|| self.driven(mesh, Path::MeshWeights))
            .unwrap_or_else(|| wide(&self.model.meshes[mesh].weights))
    }

    /// Vertices of every part in the order of `.pos` files.
    pub(crate) fn parts(&self) -> Vec<Vec<[f64; 3]>> {
        let mut parts = Vec::new();
        for &root in &self.model.roots {
            self.visit(root, &mut parts);
        }
        parts
    }

    fn visit(&self, node: usize, parts: &mut Vec<Vec<[f64; 3]>>) {
        let here = &self.model.nodes[node];
        if let Some(mesh) = here.mesh {
            if here.copies.is_empty() {
                parts.push(self.part(node, mesh, &IDENTITY));
            }
            for (t, r, s) in &here.copies {
                let copy = trs(t.map(f64::from), r.map(f64::from), s.map(f64::from));
                parts.push(self.part(node, mesh, &copy));
            }
        }
        for &child in &here.children {
            self.visit(child, parts);
        }
    }

    fn part(&self, node: usize, mesh: usize, copy: &Matrix) -> Vec<[f64; 3]> {
        let weights = self.morph_weights(node, mesh);
        let mesh = &self.model.meshes[mesh];
        let whole = times(&self.global(node), copy);
        let joints: Option<Vec<Matrix>> = self.model.nodes[node].skin.map(|skin| {
            let skin = &self.model.skins[skin];
            let pairs = skin.joints.iter().zip(&skin.inverse_bind);
            pairs.map(|(&j, bind)| times(&self.global(j), &bind.map(f64::from))).collect()
        });
        (0..mesh.positions.len())
            .map(|v| {
                let mut p = mesh.positions[v].map(f64::from);
                for (target, w) in mesh.targets.iter().zip(&weights) {
                    (0..3).for_each(|i| p[i] += w * f64::from(target[v][i]));
                }
                apply(&joints.as_ref().map_or(whole, |joints| blend(mesh, v, joints)), p)
            })
            .collect()
    }
}

/// Weighted by the weights over their sum; the first joint when the sum is zero.
fn blend(mesh: &super::model::Mesh, v: usize, joints: &[Matrix]) -> Matrix {
    let influences: Vec<(usize, f64)> = mesh
        .joint_sets
        .iter()
        .flat_map(|set| set[v].0.iter().zip(set[v].1).map(|(&j, w)| (usize::from(j), f64::from(w))))
        .collect();
    let sum: f64 = influences.iter().map(|(_, w)| w).sum();
    if sum == 0.0 {
        return joints[influences[0].0];
    }
    std::array::from_fn(|i| influences.iter().map(|&(j, w)| joints[j][i] * w / sum).sum())
}

fn apply(m: &Matrix, p: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| m[i] * p[0] + m[4 + i] * p[1] + m[8 + i] * p[2] + m[12 + i])
}
