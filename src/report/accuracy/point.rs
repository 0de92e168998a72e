use crate::{
    accel::{AccelKind, AccelSpec},
    geom::{Forms, Precision},
};

/// A choice of structure and forms.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Point {
    pub(super) spec: AccelSpec,
    pub(super) forms: Forms,
}

impl Point {
    /// The forms that can make a difference to the rays of a structure, the exact one first.
    pub(super) fn all(spec: &AccelSpec) -> Vec<Self> {
        let exact = Forms::EXACT;
        let nodes = Forms { nodes: Precision::Fast, ..exact };
        let leaves = Forms { leaves: Precision::Fast, ..exact };
        let both = Forms { nodes: Precision::Fast, ..leaves };
        let forms = if has_fast_nodes(spec) { vec![exact, nodes, leaves, both] } else { vec![exact, leaves] };
        forms.into_iter().map(|forms| Self { spec: spec.clone(), forms }).collect()
    }
}

/// True where [`Forms::nodes`] has a fast form.
fn has_fast_nodes(spec: &AccelSpec) -> bool {
    let settings = spec.to_string();
    let has_planes = |count: &str| settings.split([':', ',']).any(|s| s == count);
    match spec.kind() {
        AccelKind::Bvh2 | AccelKind::Bvh8 => true,
        AccelKind::Ssh => has_planes("planes=3") || has_planes("planes=4"),
        _ => false,
    }
}

/// What is left out, in words: `exact`, or the names of the fast steps.
pub(super) fn label(forms: Forms) -> String {
    let steps =
        [("nodes", forms.nodes), ("triangles", forms.leaves), ("deform", forms.deform), ("offset", forms.offset)];
    let fast: Vec<&str> = steps.iter().filter(|s| s.1 == Precision::Fast).map(|s| s.0).collect();
    match fast.len() {
        0 => "exact".to_owned(),
        4 => "fast".to_owned(),
        _ => format!("fast {}", fast.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_is_measured_exactly_and_each_fast_step_by_itself() {
        for &kind in AccelKind::ALL {
            let points = Point::all(&AccelSpec::new(kind));
            assert_eq!(points[0].forms, Forms::EXACT);
            let labels: Vec<String> = points.iter().map(|p| label(p.forms)).collect();
            assert!(labels.contains(&"fast triangles".to_owned()), "{kind}: {labels:?}");
        }
        assert_eq!(label(Precision::Fast.into()), "fast");
    }

    #[test]
    fn fast_nodes_are_measured_where_answers_may_depend_on_them() {
        let has = |spec: &str| Point::all(&spec.parse().expect("a structure")).len() == 4;
        assert!(["bvh2", "bvh8", "ssh:planes=3", "ssh:planes=4"].into_iter().all(has));
        assert!(!["ssh", "ssh:leaf=1", "grid", "kdtree", "grug", "events", "list"].into_iter().any(has));
    }
}
