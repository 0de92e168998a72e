use super::{
    flat::FlatLists,
    lists::{Event, ends},
    ranks::RankWord,
    tree::EventTree,
    walk::ListView,
};
use crate::geom::Aabb;

/// Checks the lists of some boxes; the first violation in words.
fn lists<W: RankWord>(view: &ListView<'_, W>, boxes: impl Fn(usize) -> Aabb) -> Result<(), String> {
    for axis in 0..3 {
        let events = view.list(axis);
        if let Some(at) = events.windows(2).position(|pair| pair[0].key() >= pair[1].key()) {
            return Err(format!("axis {axis}: events {at} and {} are out of order", at + 1));
        }
        for (child, ranks) in view.all_ranks().iter().enumerate() {
            let is_at = |rank: u32, is_max: bool, value: f32| {
                let due = |e: &Event| {
                    e.owner() as usize == child && e.is_max() == is_max && e.value().to_bits() == value.to_bits()
                };
                events.get(rank as usize).is_some_and(due)
            };
            let ([low, high], [min, max]) = (ranks.get(axis), ends(boxes(child), axis));
            if !is_at(low, false, min) || !is_at(high, true, max) {
                return Err(format!("axis {axis}: box {child} does not stand at ranks {low} and {high}"));
            }
        }
    }
    Ok(())
}

fn around(boxes: impl Iterator<Item = Aabb>) -> Aabb {
    boxes.filter(|aabb| !aabb.is_empty()).fold(Aabb::EMPTY, Aabb::union)
}

/// Checks the flat form.
pub(super) fn flat(flat: &FlatLists, boxes: impl Fn(u32) -> Aabb) -> Result<(), String> {
    let boxes = |number: usize| u32::try_from(number).map_or(Aabb::EMPTY, &boxes);
    lists(&flat.view(), boxes)?;
    if flat.bounds() == around((0..flat.len()).map(boxes)) { Ok(()) } else { Err("wrong bounds".into()) }
}

/// Checks the hierarchy over `count` objects.
pub(super) fn tree(tree: &EventTree, count: usize, boxes: impl Fn(u32) -> Aabb) -> Result<(), String> {
    if tree.events.iter().any(|list| list.len() != 2 * tree.links.len()) || tree.ranks.len() != tree.links.len() {
        return Err("lists of different lengths".into());
    }
    let mut seen = vec![false; count];
    let (mut next_child, mut next_volume) = (0, 1);
    // Volumes still to come, the next last: what is within a volume follows it before anything else does.
    let mut due = vec![0];
    for (number, volume) in tree.volumes.iter().enumerate() {
        if due.pop() != Some(number) || volume.first as usize != next_child {
            return Err(format!("volume {number} is out of place"));
        }
        next_child += volume.count as usize;
        let links = tree.links.get(volume.first as usize..next_child).ok_or("a volume holds more than there is")?;
        let mut inner = Vec::new();
        for link in links {
            match link.target() {
                Ok(object) => {
                    let seen = seen.get_mut(object as usize).ok_or("a link to an object that does not exist")?;
                    if std::mem::replace(seen, true) {
                        return Err(format!("object {object} is there twice"));
                    }
                }
                Err(volume) => inner.push(volume as usize),
            }
        }
        next_volume += inner.len();
        due.extend(inner.into_iter().rev());
        let aabb = |child: usize| match links[child].target() {
            Ok(object) => boxes(object),
            Err(volume) => tree.volumes[volume as usize].aabb,
        };
        if volume.aabb != around((0..links.len()).map(aabb)) {
            return Err(format!("volume {number}: wrong box"));
        }
        lists(&tree.view(volume), aabb).map_err(|what| format!("volume {number}, {what}"))?;
    }
    if next_volume != tree.volumes.len() || next_child != tree.links.len() {
        return Err("volumes or links are out of reach".into());
    }
    seen.iter().position(|&seen| !seen).map_or(Ok(()), |object| Err(format!("object {object} is in no volume")))
}
