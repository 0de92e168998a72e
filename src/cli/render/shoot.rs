//! The loop over frames: pose, deform, refit, trace; encoding goes on beside it.

use std::{io, sync::Arc, time::Instant};

use kinora::{
    dynamics::FrameLoop,
    glam::DAffine3,
    output::{FilmFormat, FilmSink, FrameSlot, StillSettings, Target, Unfinished, Writer},
    render::{RenderSettings, Renderer},
};

use super::{
    plan::Plan,
    summary::{Stages, Summary},
};
use crate::cli::{error::CliError, progress::Progress, scene, settings::Settings, signals::Signals};

/// Most threads that encode beside the tracing ones.
const MAX_ENCODERS: usize = 4;

/// Renders `frames`.
///
/// # Errors
/// What went wrong first, or the signal that came. Frames handed to the encoders before that are finished.
pub(super) fn shoot(
    plan: &Plan,
    frames: &[u64],
    settings: &Settings,
    signals: &Signals,
    unfinished: &Unfinished,
) -> Result<Summary, CliError> {
    let mut summary = Summary::new(plan, frames.len(), settings);
    if frames.is_empty() {
        return Ok(summary);
    }
    let writer = writer(plan, settings, unfinished)?;
    let mut shots = Shots::new(plan, settings)?;
    let mut progress = Progress::new(frames.len(), settings.verbosity);
    let mut stages = Stages::default();
    let mut shoot_all = || -> Result<(), CliError> {
        for (ordinal, &frame) in (0..).zip(frames) {
            signals.check()?;
            let mut slot = writer.take()?;
            (slot.frame, slot.ordinal) = (frame, ordinal);
            shots.shoot(&mut slot, &mut stages)?;
            writer.submit(slot)?;
            for written in writer.written() {
                let written = written?;
                progress.frame(&written);
                stages.encode(written.encode);
            }
        }
        Ok(())
    };
    let ended = shoot_all();
    let finished = writer.finish();
    if let Ok(rest) = &finished {
        for written in rest {
            progress.frame(written);
            stages.encode(written.encode);
        }
    }
    progress.end();
    ended?;
    finished?;
    summary.add(stages, shots.frames.counts());
    Ok(summary)
}

fn writer(plan: &Plan, settings: &Settings, unfinished: &Unfinished) -> Result<Writer, CliError> {
    let encoders = settings.threads().min(MAX_ENCODERS);
    let film = |sink, format| Writer::film(sink, format, plan.film.clone(), encoders, unfinished);
    let writer = match &plan.target {
        Target::Sequence(_, format) | Target::Still(_, format) => {
            let stills = StillSettings {
                target: plan.target.clone(),
                format: *format,
                settings: plan.settings.clone(),
                exr_color: plan.exr_color,
                fps: plan.fps,
            };
            Writer::stills(stills, plan.size, encoders, unfinished)
        }
        Target::Film(path, format) => film(FilmSink::File(path.clone()), *format),
        Target::Stdout => film(FilmSink::Stream(Box::new(io::stdout()), "stdout".to_owned()), FilmFormat::Y4m),
    };
    Ok(writer?)
}

/// Makes pictures of moments.
struct Shots<'a> {
    plan: &'a Plan,
    settings: &'a Settings,
    frames: FrameLoop,
    renderer: Renderer,
}

impl<'a> Shots<'a> {
    fn new(plan: &'a Plan, settings: &'a Settings) -> Result<Self, CliError> {
        let mut frames = FrameLoop::new(settings.frame_config(plan.policy))?;
        let actor = frames.add(Arc::clone(&plan.scene), DAffine3::IDENTITY);
        if let [only] = plan.clips[..] {
            frames.learn(actor, &[only])?;
        }
        let renderer = settings.pool.install(|| Renderer::new(std::slice::from_ref(&plan.scene)));
        Ok(Self { plan, settings, frames, renderer })
    }

    /// Draws the slot's frame into its film.
    fn shoot(&mut self, slot: &mut FrameSlot, stages: &mut Stages) -> Result<(), CliError> {
        let start = Instant::now();
        let clips = scene::at_time(&self.plan.clips, self.plan.fps.time_s(slot.frame));
        let (world, times) = self.frames.advance(&[&clips])?;
        let traced = Instant::now();
        let view =
            self.plan.viewpoint.view(&world).ok_or_else(|| {
                CliError::failed(format!("frame {}: the camera's placement has no inverse", slot.frame))
            })?;
        let how = RenderSettings {
            shading: self.plan.shading,
            samples: self.plan.samples,
            first_sample: 0,
            seed: self.plan.seed,
            frame: slot.frame,
            simd: self.settings.simd,
        };
        let _span = tracing::info_span!("render", frame = slot.frame).entered();
        let Self { renderer, settings, .. } = self;
        let rays = settings.pool.install(|| renderer.render(&world, &view, &how, &mut slot.film))?;
        stages.frame(times, traced.elapsed(), start.elapsed(), rays);
        Ok(())
    }
}
