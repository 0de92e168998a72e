//! The bar at the bottom: the clip's time, its key times, and where a click lands.

use crate::scene::{ClipId, Scene};

use super::canvas::{Canvas, Rect};

/// Height of the bar in font pixels; the pointer may miss it by as much again above.
const BAR_HEIGHT: i32 = 8;
/// Space beside and below the bar in font pixels.
const MARGIN: i32 = 8;
/// Key times are drawn when they are on average at least this many pixels apart.
const TICK_SPACE: usize = 4;

/// The bar of a window.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct ScrubBar {
    rect: Rect,
    scale: i32,
}

impl ScrubBar {
    /// The bar of a window of this size, its lengths `scale` times those of the font.
    pub(super) fn new(width: i32, height: i32, scale: i32) -> Self {
        let (margin, bar) = (MARGIN * scale, BAR_HEIGHT * scale);
        let rect = Rect { x: margin, y: height - margin - bar, width: (width - 2 * margin).max(1), height: bar };
        Self { rect, scale }
    }

    /// Top edge of everything the bar draws.
    pub(super) fn top(&self) -> i32 {
        self.rect.y
    }

    /// True when a press at this place takes hold of the bar.
    pub(super) fn is_hit(&self, x: f64, y: f64) -> bool {
        let reach = f64::from(MARGIN * self.scale);
        let Rect { x: left, y: top, width, height } = self.rect;
        (f64::from(left) - reach..f64::from(left + width) + reach).contains(&x)
            && (f64::from(top) - reach..f64::from(top + height) + reach).contains(&y)
    }

    /// The time at a horizontal place, clamped to the clip.
    pub(super) fn time_at(&self, x: f64, duration_s: f64) -> f64 {
        let part = (x - f64::from(self.rect.x)) / f64::from((self.rect.width - 1).max(1));
        duration_s * part.clamp(0.0, 1.0)
    }

    /// The horizontal place of a time, in pixels.
    pub(super) fn place_of(&self, time_s: f64, duration_s: f64) -> i32 {
        let part = if duration_s > 0.0 { (time_s / duration_s).clamp(0.0, 1.0) } else { 0.0 };
        #[expect(clippy::cast_possible_truncation, reason = "at most the bar's width")]
        let along = libm::round(part * f64::from((self.rect.width - 1).max(0))) as i32;
        self.rect.x + along
    }

    /// Draws the bar at a time; `ticks` as [`key_times`] gives them.
    pub(super) fn draw(&self, canvas: &mut Canvas<'_>, time_s: f64, duration_s: f64, ticks: &[f64]) {
        let rect = self.rect;
        canvas.rect(rect, 0x0010_1418, 170);
        let here = self.place_of(time_s, duration_s);
        canvas.rect(Rect { width: here - rect.x, ..rect }, 0x003c_7fc0, 200);
        let room = usize::try_from(rect.width).unwrap_or(0) / TICK_SPACE;
        if ticks.len() <= room {
            for &tick in ticks {
                let x = self.place_of(tick, duration_s);
                canvas.rect(Rect { x, width: 1, ..rect }, 0x00d8_d8d8, 110);
            }
        }
        let knob = Rect {
            x: here - self.scale,
            y: rect.y - self.scale,
            width: 2 * self.scale + 1,
            height: rect.height + 2 * self.scale,
        };
        canvas.rect(knob, 0x00ff_ffff, 256);
    }
}

/// The distinct key times of `clips` in seconds, ascending.
pub(super) fn key_times(scene: &Scene, clips: &[ClipId]) -> Vec<f64> {
    let samplers = clips.iter().flat_map(|c| &scene.clips[c.index()].samplers);
    let mut times: Vec<f64> = samplers.flat_map(|s| s.times.iter().map(|&t| f64::from(t))).collect();
    times.sort_unstable_by(f64::total_cmp);
    times.dedup();
    times
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::scene::{Clip, Interpolation, Sampler};

    proptest! {
        #[test]
        fn clicking_where_a_time_is_drawn_gives_that_time(part in 0.0..=1.0f64, width in 100..4000i32) {
            let bar = ScrubBar::new(width, 500, 1);
            let place = bar.place_of(part * 8.0, 8.0);
            let pixel_s = 8.0 / f64::from(width - 17);
            prop_assert!((bar.time_at(f64::from(place), 8.0) - part * 8.0).abs() <= 0.5001 * pixel_s);
        }
    }

    #[test]
    fn ends_of_the_bar_are_start_and_end_of_the_clip() {
        let bar = ScrubBar::new(640, 480, 2);
        assert_eq!(bar.time_at(-50.0, 3.0).to_bits(), 0.0f64.to_bits());
        assert_eq!(bar.time_at(700.0, 3.0).to_bits(), 3.0f64.to_bits());
        assert_eq!(bar.time_at(f64::from(bar.place_of(3.0, 3.0)), 3.0).to_bits(), 3.0f64.to_bits());
    }

    #[test]
    fn presses_near_the_bar_take_hold_and_others_do_not() {
        let bar = ScrubBar::new(640, 480, 1);
        assert!(bar.is_hit(320.0, 470.0) && bar.is_hit(320.0, 460.0));
        assert!(!bar.is_hit(320.0, 400.0));
    }

    #[test]
    fn drawing_in_a_tiny_window_or_without_a_clip_is_harmless() {
        for (width, height) in [(1, 1), (20, 3)] {
            let mut pixels = vec![0; width * height];
            let (w, h) = (i32::try_from(width).unwrap(), i32::try_from(height).unwrap());
            let mut canvas = Canvas::new(width, height, &mut pixels);
            ScrubBar::new(w, h, 1).draw(&mut canvas, 7.0, 0.0, &[0.0]);
        }
    }

    #[test]
    fn key_times_are_sorted_and_unique() {
        let sampler = |times: &[f32]| Sampler {
            interpolation: Interpolation::Linear,
            times: times.to_vec(),
            width: 3,
            values: vec![0.0; 3 * times.len()],
        };
        let clip = Clip { samplers: vec![sampler(&[0.5, 1.0]), sampler(&[0.0, 1.0])], ..Clip::default() };
        let scene = Scene { clips: vec![clip], ..Scene::default() };
        assert_eq!(key_times(&scene, &[ClipId(0)]), [0.0, 0.5, 1.0]);
        assert!(key_times(&scene, &[]).is_empty());
    }
}
