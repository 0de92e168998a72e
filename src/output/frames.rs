//! Frame rates and lists of frame numbers.

use std::{fmt, ops::Range, str::FromStr};

/// Most frames that one list may hold.
pub const MAX_FRAMES: usize = 10_000_000;

/// Largest frame number; times stay exact to well under a microsecond.
pub const MAX_FRAME: u64 = 1_000_000_000;

/// Frames a second as a fraction in lowest terms, so that times and stream headers are exact.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fps {
    num: u32,
    den: u32,
}

impl Fps {
    /// Film's usual 30.
    pub const DEFAULT: Self = Self { num: 30, den: 1 };

    /// `num / den` frames a second; `None` when either is 0.
    pub fn new(num: u32, den: u32) -> Option<Self> {
        if num == 0 || den == 0 {
            return None;
        }
        let g = gcd(num, den);
        Some(Self { num: num / g, den: den / g })
    }

    /// The numerator.
    pub fn num(self) -> u32 {
        self.num
    }

    /// The denominator.
    pub fn den(self) -> u32 {
        self.den
    }

    /// Frames a second, rounded.
    pub fn as_f64(self) -> f64 {
        f64::from(self.num) / f64::from(self.den)
    }

    /// Time of a frame in seconds: `frame / fps`, rounded once for every `frame` up to [`MAX_FRAME`].
    pub fn time_s(self, frame: u64) -> f64 {
        (u128::from(frame) * u128::from(self.den)) as f64 / f64::from(self.num)
    }

    /// The rate at which every `step`-th frame keeps its time; `None` when it is not representable.
    pub fn divided(self, step: u64) -> Option<Self> {
        Self::new(self.num, u32::try_from(step.checked_mul(u64::from(self.den))?).ok()?)
    }
}

impl fmt::Display for Fps {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.den == 1 { write!(f, "{}", self.num) } else { write!(f, "{}/{}", self.num, self.den) }
    }
}

impl FromStr for Fps {
    type Err = String;

    /// A whole number, a decimal of up to six places, or a fraction: `30`, `29.97`, `30000/1001`.
    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || format!("`{text}`: expected frames a second above 0, as 30, 29.97 or 30000/1001");
        let (num, den) = if let Some((num, den)) = text.split_once('/') {
            (num.to_owned(), den.parse().map_err(|_| wrong())?)
        } else {
            let (whole, places) = text.split_once('.').unwrap_or((text, ""));
            let power = u32::try_from(places.len()).ok().filter(|&n| n <= 6).ok_or_else(wrong)?;
            (format!("{whole}{places}"), 10u32.pow(power))
        };
        if !num.bytes().all(|b| b.is_ascii_digit()) {
            return Err(wrong());
        }
        num.parse().ok().and_then(|num| Self::new(num, den)).ok_or_else(wrong)
    }
}

fn gcd(a: u32, b: u32) -> u32 {
    if b == 0 { a } else { gcd(b, a % b) }
}

/// Frame numbers in the order they are rendered; never empty.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FrameList {
    frames: Vec<u64>,
}

impl FrameList {
    /// `0..=floor(duration * fps)`, or frame 0 alone when `duration_s` is not positive.
    ///
    /// Key times are `f32`: a duration that misses a frame by no more than their rounding reaches it.
    ///
    /// # Errors
    /// When that is more than [`MAX_FRAMES`].
    pub fn whole(duration_s: f64, fps: Fps) -> Result<Self, String> {
        let last = duration_s.max(0.0) * fps.as_f64();
        let last = (last + (last * f64::from(f32::EPSILON)).clamp(1e-9, 0.01)).floor();
        if last >= MAX_FRAMES as f64 {
            return Err(format!("{duration_s} s at {fps} frames a second are more than {MAX_FRAMES} frames"));
        }
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 <= last < MAX_FRAMES")]
        Ok(Self { frames: (0..=last as u64).collect() })
    }

    /// The frames in order.
    pub fn frames(&self) -> &[u64] {
        &self.frames
    }

    /// Each frame once, where it stands first.
    #[must_use]
    pub fn distinct(self) -> Self {
        let mut seen = std::collections::HashSet::with_capacity(self.frames.len());
        Self { frames: self.frames.into_iter().filter(|&f| seen.insert(f)).collect() }
    }

    /// The common difference of successive frames when it is positive and the same throughout.
    pub fn step(&self) -> Option<u64> {
        let step = self.frames.get(1)?.checked_sub(self.frames[0])?;
        let same = self.frames.windows(2).all(|w| w[1].checked_sub(w[0]) == Some(step));
        (same && step > 0).then_some(step)
    }
}

impl FromStr for FrameList {
    type Err = String;

    /// Commas of `A`, `A..=B`, `A-B` (both include B), `A..B` (excludes B), each range with an optional `xSTEP`.
    fn from_str(text: &str) -> Result<Self, String> {
        let mut frames = Vec::new();
        for item in text.split(',') {
            let wrong = |why: String| format!("`{}`: {why}", item.trim());
            let (Range { start, end }, step) = parse_item(item.trim()).map_err(wrong)?;
            if frames.len() as u64 + (end - start).div_ceil(step) > MAX_FRAMES as u64 {
                return Err(wrong(format!("more than {MAX_FRAMES} frames")));
            }
            let step = usize::try_from(step).unwrap_or(usize::MAX);
            frames.extend((start..end).step_by(step));
        }
        if frames.is_empty() {
            return Err(format!("`{text}`: no frames"));
        }
        Ok(Self { frames })
    }
}

/// The range of an item, which may be empty, and its step.
fn parse_item(item: &str) -> Result<(Range<u64>, u64), String> {
    let (range, step) = match item.split_once('x') {
        None => (item, None),
        Some((range, step)) => (range, Some(step)),
    };
    let ends = [("..=", true), ("..", false), ("-", true)]
        .into_iter()
        .find_map(|(mark, included)| range.split_once(mark).map(|(a, b)| (a, b, included)));
    let Some((first, last, included)) = ends else {
        let frame = number(range)?;
        return match step {
            None => Ok((frame..frame + 1, 1)),
            Some(_) => Err("a step needs a range, as 0-60x2".to_owned()),
        };
    };
    let (first, last) = (number(first)?, number(last)?);
    match step.map_or(Ok(1), number)? {
        0 => Err("the step must be at least 1".to_owned()),
        _ if last < first => Err("ends before it begins".to_owned()),
        step => Ok((first..last + u64::from(included), step)),
    }
}

fn number(text: &str) -> Result<u64, String> {
    if text.is_empty() || !text.bytes().all(|b| b.is_ascii_digit()) {
        return Err(format!("expected A, A-B, A..B, A..=B or A-BxSTEP, found `{text}`"));
    }
    text.parse().ok().filter(|&n| n <= MAX_FRAME).ok_or_else(|| format!("frame numbers end at {MAX_FRAME}"))
}

/// The I-th of N parts of a list: every N-th frame from the I-th.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    index: usize,
    count: usize,
}

impl Shard {
    /// Part `index` of `count`, counted from 1; `None` when there is no such part.
    pub fn new(index: usize, count: usize) -> Option<Self> {
        (1..=count).contains(&index).then_some(Self { index, count })
    }

    /// Which part, from 1.
    pub fn index(self) -> usize {
        self.index
    }

    /// How many parts.
    pub fn count(self) -> usize {
        self.count
    }

    /// This part of `frames`; empty when there are fewer frames than `index`.
    pub fn of(self, frames: &[u64]) -> Vec<u64> {
        frames.iter().copied().skip(self.index - 1).step_by(self.count).collect()
    }
}

impl FromStr for Shard {
    type Err = String;

    /// `I/N` with I in 1..=N.
    fn from_str(text: &str) -> Result<Self, String> {
        let parsed = text.split_once('/').and_then(|(i, n)| Some((i.parse().ok()?, n.parse().ok()?)));
        let (index, count) = parsed.ok_or_else(|| format!("`{text}`: expected I/N, as 1/8"))?;
        Self::new(index, count).ok_or_else(|| format!("`{text}`: I must be 1 to N"))
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn list(text: &str) -> Result<Vec<u64>, String> {
        text.parse::<FrameList>().map(|l| l.frames)
    }

    #[test]
    fn every_form_of_a_list_means_what_it_says() {
        assert_eq!(list("7"), Ok(vec![7]));
        assert_eq!(list("2..=4"), Ok(vec![2, 3, 4]));
        assert_eq!(list("2-4"), Ok(vec![2, 3, 4]));
        assert_eq!(list("2..4"), Ok(vec![2, 3]));
        assert_eq!(list("0-10x4"), Ok(vec![0, 4, 8]));
        assert_eq!(list("0..8x4"), Ok(vec![0, 4]));
        assert_eq!(list("0..=8x4"), Ok(vec![0, 4, 8]));
        assert_eq!(list("5, 1-2,9..9,3-3"), Ok(vec![5, 1, 2, 3]));
        assert_eq!(list("0..1"), Ok(vec![0]));
        assert_eq!(list("3-4x1000000000"), Ok(vec![3]));
    }

    #[test]
    fn wrong_lists_are_refused_with_the_item_named() {
        for (text, why) in [
            ("", "expected A"),
            ("a", "expected A"),
            ("1,,2", "expected A"),
            ("-3", "expected A"),
            ("+3", "expected A"),
            ("4-2", "ends before"),
            ("4..2", "ends before"),
            ("1-5x0", "at least 1"),
            ("3x2", "needs a range"),
            ("0..0", "no frames"),
            ("5..5", "no frames"),
            ("0-999999999", "more than"),
            ("1000000001", "end at"),
            ("99999999999999999999999", "end at"),
            ("1-2-3", "expected A"),
            ("1..=2..3", "expected A"),
        ] {
            let error = list(text).expect_err(text);
            assert!(error.contains(why), "{text}: {error}");
        }
    }

    #[test]
    fn default_list_reaches_the_last_frame_despite_f32_key_times() {
        let last = |d: f64, fps: &str| FrameList::whole(d, fps.parse().unwrap()).unwrap().frames.len() - 1;
        assert_eq!(last(2.0, "30"), 60);
        assert_eq!(last(f64::from(29.0f32 / 30.0), "30"), 29);
        assert_eq!(last(f64::from(100.1f32), "30"), 3003);
        assert_eq!(last(1.99, "30"), 59);
        assert_eq!(last(0.0, "30"), 0);
        assert_eq!(last(-1.0, "30"), 0);
        assert_eq!(last(f64::NAN, "30"), 0);
        assert!(FrameList::whole(f64::INFINITY, Fps::DEFAULT).is_err());
        assert!(FrameList::whole(1e9, Fps::DEFAULT).is_err());
    }

    #[test]
    fn every_multiple_of_a_frame_in_f32_seconds_reaches_its_frame() {
        for fps in [24u32, 25, 30, 60] {
            for k in (0..20_000u16).step_by(97) {
                let duration = f64::from(f32::from(k) / fps as f32);
                let list = FrameList::whole(duration, Fps::new(fps, 1).unwrap()).unwrap();
                assert_eq!(list.frames.len(), usize::from(k) + 1, "{k} at {fps}");
            }
        }
    }

    #[test]
    fn rates_are_exact_fractions() {
        let fps = |t: &str| t.parse::<Fps>().map(|f| (f.num, f.den));
        assert_eq!(fps("30"), Ok((30, 1)));
        assert_eq!(fps("29.97"), Ok((2997, 100)));
        assert_eq!(fps("12.50"), Ok((25, 2)));
        assert_eq!(fps("30000/1001"), Ok((30000, 1001)));
        assert_eq!(fps("0.5"), Ok((1, 2)));
        for wrong in ["0", "", ".", "-1", "+5", "1/0", "a", "1e3", "nan", "0.0000001", "99999999999", "1/2/3"] {
            assert!(fps(wrong).is_err(), "{wrong}");
        }
        assert!((Fps::DEFAULT.time_s(60) - 2.0).abs() < 1e-15);
        assert_eq!(Fps::DEFAULT.divided(2).map(|f| (f.num, f.den)), Some((15, 1)));
    }

    #[test]
    fn steps_are_found_only_when_constant_and_forward() {
        let step = |t: &str| t.parse::<FrameList>().unwrap().step();
        assert_eq!(step("0-10x5"), Some(5));
        assert_eq!(step("4,5,6"), Some(1));
        assert_eq!(step("4"), None);
        assert_eq!(step("1,2,4"), None);
        assert_eq!(step("3,2,1"), None);
        assert_eq!(step("3,3"), None);
    }

    proptest! {
        #[test]
        fn shards_partition_the_list(count in 1usize..20, frames in prop::collection::vec(0u64..1000, 0..100)) {
            let mut all: Vec<u64> =
                (1..=count).flat_map(|i| Shard::new(i, count).unwrap().of(&frames)).collect();
            let mut want = frames.clone();
            all.sort_unstable();
            want.sort_unstable();
            prop_assert_eq!(all, want);
        }

        #[test]
        fn parsing_never_panics(text in "[0-9.x,=\\- a]{0,24}") {
            let _ = text.parse::<FrameList>();
            let _ = text.parse::<Fps>();
            let _ = text.parse::<Shard>();
        }
    }

    #[test]
    fn shard_numbers_start_at_one() {
        assert_eq!("2/3".parse::<Shard>().map(|s| s.of(&[10, 11, 12, 13, 14])), Ok(vec![11, 14]));
        for wrong in ["0/3", "4/3", "1/0", "1", "a/b", "-1/2", "auto"] {
            assert!(wrong.parse::<Shard>().is_err(), "{wrong}");
        }
    }
}
