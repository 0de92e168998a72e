//! Places for names beside points, so that none covers another name, a mark, or the frame.

/// Width of a character and height of a line in pixels, for names of 12 points; a little more than most fonts take.
const CHAR: i32 = 6;
const LINE: i32 = 13;

/// Half the size of a mark.
const MARK: i32 = 6;

/// A rectangle in pixels: left, top, right, bottom.
pub(super) type Rect = [i32; 4];

fn overlap(a: &Rect, b: &Rect) -> bool {
    a[0] < b[2] && b[0] < a[2] && a[1] < b[3] && b[1] < a[3]
}

/// A name's place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Label {
    /// The left end of its line, at half its height.
    pub(super) at: (i32, i32),
    /// Where a line to its point begins, when it stands too far away to be told by eye.
    pub(super) from: Option<(i32, i32)>,
}

/// What is taken of an area.
#[derive(Clone, Debug)]
pub(super) struct Labels {
    area: Rect,
    taken: Vec<Rect>,
}

impl Labels {
    /// An area with marks at `points`.
    pub(super) fn new(area: Rect, points: impl Iterator<Item = (i32, i32)>) -> Self {
        let mark = |(x, y): (i32, i32)| [x - MARK, y - MARK, x + MARK, y + MARK];
        Self { area, taken: points.map(mark).collect() }
    }

    /// The nearest free place for `name` beside a point, and takes it: to the right if it can be, else to the left, further and further up and
    /// down. Where none is free, to the right, whatever it covers.
    pub(super) fn place(&mut self, name: &str, (x, y): (i32, i32)) -> Label {
        let width = i32::try_from(name.chars().count()).unwrap_or(i32::MAX / CHAR).saturating_mul(CHAR);
        let rect =
            |left: i32, middle: i32| [left, middle - LINE / 2, left.saturating_add(width), middle + LINE / 2 + 1];
        // Within a line of the point's height a name stands beside the mark, further up and down also above and below.
        let beside = |rows: i32| {
            let sides = [x + MARK + 2, x - MARK - 2 - width];
            let shifted = [x - width / 2, x + 30, x - width - 30, x + 60];
            sides.into_iter().chain(shifted.into_iter().filter(move |_| rows.abs() > 1))
        };
        let heights = (0..24).flat_map(|k| [-k, k]);
        let places = heights.flat_map(|rows| beside(rows).map(move |left| (left, y + rows * LINE)));
        let is_free = |&(left, middle): &(i32, i32)| {
            let r = rect(left, middle);
            let [x0, y0, x1, y1] = self.area;
            let is_inside = r[0] >= x0 && r[1] >= y0 && r[2] <= x1 && r[3] <= y1;
            is_inside && !self.taken.iter().any(|t| overlap(t, &r))
        };
        let (left, middle) = places.into_iter().find(is_free).unwrap_or((x + MARK + 2, y));
        self.taken.push(rect(left, middle));
        let is_near = (middle - y).abs() <= LINE && (left == x + MARK + 2 || left + width == x - MARK - 2);
        let end = if left > x { left - 1 } else { (left + width + 1).min(x.max(left)) };
        Label { at: (left, middle), from: (!is_near).then_some((end, middle)) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_cover_no_mark_no_other_name_and_stay_inside() {
        let area = [40, 0, 600, 400];
        let points: Vec<(i32, i32)> = (0..12).map(|i| (560 - i * 3, 20 + i * 5)).chain([(43, 3), (300, 396)]).collect();
        let mut labels = Labels::new(area, points.iter().copied());
        let name = "structure fast triangles, single";
        for &point in &points {
            labels.place(name, point);
        }
        let (marks, names) = labels.taken.split_at(points.len());
        for (i, r) in names.iter().enumerate() {
            assert!(r[0] >= area[0] && r[1] >= area[1] && r[2] <= area[2] && r[3] <= area[3], "{r:?}");
            assert!(!marks.iter().chain(&names[..i]).any(|t| overlap(t, r)), "{r:?}");
        }
    }

    #[test]
    fn a_lone_point_has_its_name_to_its_right_and_one_at_the_edge_to_its_left() {
        let mut labels = Labels::new([0, 0, 200, 100], [(20, 50), (190, 50)].into_iter());
        assert_eq!(labels.place("abc", (20, 50)), Label { at: (28, 50), from: None });
        assert_eq!(labels.place("abc", (190, 50)), Label { at: (164, 50), from: None });
    }
}
