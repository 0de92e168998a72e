//! Encoder threads: frames go in over a bounded channel, files come out, buffers are handed back.
//!
//! With N encoders N + 2 frames exist, whatever the length of the run: one being traced, N being encoded, one
//! waiting. A still is written by the thread that encoded it; the frames of a film are encoded in any order and
//! put in line by one more thread.

use std::{
    collections::BTreeMap,
    io::Write,
    path::PathBuf,
    sync::Arc,
    thread::{self, JoinHandle},
    time::{Duration, Instant},
};

use crossbeam::channel::{Receiver, Sender, bounded, unbounded};

use super::{
    AtomicFile, ExrColor, FilmFormat, FilmSettings, Fps, FrameSlot, OutputError, SettingsHash, Stamp, StillFormat,
    Target, Unfinished, atomic, exr_file, png_file,
};

/// A frame that is done.
#[derive(Clone, Debug)]
pub struct Written {
    /// Its number.
    pub frame: u64,
    /// The file it went to, for messages.
    pub file: String,
    /// Time to tone-map, encode and write it.
    pub encode: Duration,
}

/// How stills are made.
#[derive(Clone, Debug)]
pub struct StillSettings {
    /// The file of each frame.
    pub target: Target,
    /// Format of the files.
    pub format: StillFormat,
    /// Hash for the stamp.
    pub settings: SettingsHash,
    /// Numbers of the colour layer of `.exr`.
    pub exr_color: ExrColor,
    /// Rate named in the metadata of `.exr`.
    pub fps: Fps,
}

impl StillSettings {
    fn encode(&self, slot: &mut FrameSlot) -> Result<(), String> {
        let stamp = Stamp::of_frame(&self.settings, slot.frame);
        match self.format {
            StillFormat::Png => png_file::encode(slot, &stamp),
            StillFormat::Exr => exr_file::encode(slot, &stamp, self.exr_color, self.fps),
        }
    }

    fn write(&self, slot: &mut FrameSlot, unfinished: &Unfinished) -> Result<Written, OutputError> {
        let _span = tracing::info_span!("encode", frame = slot.frame).entered();
        let start = Instant::now();
        let path = self.target.file(slot.frame).unwrap_or_default();
        let file = path.display().to_string();
        self.encode(slot).map_err(|reason| OutputError::Encode { file: file.clone(), reason })?;
        atomic::write_file(&path, &slot.bytes, unfinished)?;
        Ok(Written { frame: slot.frame, file, encode: start.elapsed() })
    }
}

/// Where a film goes.
pub enum FilmSink {
    /// A file that appears when the film is complete.
    File(PathBuf),
    /// A stream, with its name for messages.
    Stream(Box<dyn Write + Send>, String),
}

impl std::fmt::Debug for FilmSink {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.name())
    }
}

impl FilmSink {
    fn name(&self) -> String {
        match self {
            Self::File(path) => path.display().to_string(),
            Self::Stream(_, name) => name.clone(),
        }
    }

    fn open(self, unfinished: &Unfinished) -> Result<OpenFilm, OutputError> {
        match self {
            Self::File(path) => AtomicFile::create(&path, unfinished).map(OpenFilm::File),
            Self::Stream(stream, name) => Ok(OpenFilm::Stream(stream, name)),
        }
    }
}

enum OpenFilm {
    File(AtomicFile),
    Stream(Box<dyn Write + Send>, String),
}

impl OpenFilm {
    fn write(&mut self, bytes: &[u8]) -> Result<(), OutputError> {
        match self {
            Self::File(file) => file.write(bytes),
            Self::Stream(stream, name) => stream
                .write_all(bytes)
                .and_then(|()| stream.flush())
                .map_err(|e| OutputError::Write { file: name.clone(), reason: e.to_string() }),
        }
    }

    fn finish(self) -> Result<(), OutputError> {
        match self {
            Self::File(file) => file.finish(),
            Self::Stream(..) => Ok(()),
        }
    }
}

type Done = Result<Written, OutputError>;

/// Encoder threads and the frames that travel to them and back.
#[derive(Debug)]
pub struct Writer {
    free: Receiver<FrameSlot>,
    jobs: Sender<FrameSlot>,
    done: Receiver<Done>,
    threads: Vec<JoinHandle<Result<(), OutputError>>>,
}

impl Writer {
    /// Starts `encoders` threads that write one file a frame of the given size.
    ///
    /// # Errors
    /// When the system gives no threads.
    pub fn stills(
        settings: StillSettings,
        size: (u32, u32),
        encoders: usize,
        unfinished: &Unfinished,
    ) -> Result<Self, OutputError> {
        let (mut writer, ends) = Self::channels(size, encoders);
        let settings = Arc::new(settings);
        for _ in 0..encoders.max(1) {
            let (ends, settings, unfinished) = (ends.clone(), Arc::clone(&settings), unfinished.clone());
            writer.spawn(move || {
                for mut slot in &ends.jobs {
                    ends.report(settings.write(&mut slot, &unfinished), slot);
                }
                Ok(())
            })?;
        }
        Ok(writer)
    }

    /// Starts `encoders` threads that encode frames of a film and one that writes them in order.
    ///
    /// # Errors
    /// When the film cannot be begun or the system gives no threads.
    pub fn film(
        sink: FilmSink,
        format: FilmFormat,
        settings: FilmSettings,
        encoders: usize,
        unfinished: &Unfinished,
    ) -> Result<Self, OutputError> {
        let (mut writer, ends) = Self::channels((settings.width, settings.height), encoders);
        let file = sink.name();
        let encode_error = |reason| OutputError::Encode { file: file.clone(), reason };
        let header = format.header(&settings).map_err(encode_error)?;
        let mut film = sink.open(unfinished)?;
        film.write(&header)?;

        let settings = Arc::new(settings);
        let (line_up, encoded) = unbounded();
        for _ in 0..encoders.max(1) {
            let (jobs, line_up, settings) = (ends.jobs.clone(), line_up.clone(), Arc::clone(&settings));
            writer.spawn(move || {
                for mut slot in &jobs {
                    let _span = tracing::info_span!("encode", frame = slot.frame).entered();
                    let start = Instant::now();
                    let result = format.frame(&settings, &mut slot).map(|()| start.elapsed());
                    if line_up.send((slot, result)).is_err() {
                        break;
                    }
                }
                Ok(())
            })?;
        }
        drop(line_up);
        let frames = settings.frames;
        writer.spawn(move || InOrder { film, file, ends, next: 0, failed: false }.run(&encoded, frames, format))?;
        Ok(writer)
    }

    fn channels((width, height): (u32, u32), encoders: usize) -> (Self, Ends) {
        let slots = encoders.max(1) + 2;
        let (give_back, free) = bounded(slots);
        for _ in 0..slots {
            give_back.try_send(FrameSlot::new(width, height)).expect("the channel has this much room");
        }
        let (jobs, jobs_end) = bounded(slots);
        let (report, done) = unbounded();
        (Self { free, jobs, done, threads: Vec::new() }, Ends { jobs: jobs_end, give_back, report })
    }

    fn spawn(&mut self, work: impl FnOnce() -> Result<(), OutputError> + Send + 'static) -> Result<(), OutputError> {
        let thread = thread::Builder::new().name("kinora-encode".to_owned()).spawn(work);
        self.threads.push(thread.map_err(|e| OutputError::Thread(e.to_string()))?);
        Ok(())
    }

    /// A frame to draw into, after waiting for one if all are in use.
    ///
    /// # Errors
    /// When the threads ended early.
    pub fn take(&self) -> Result<FrameSlot, OutputError> {
        self.free.recv().map_err(|_| OutputError::Thread("ended early".to_owned()))
    }

    /// Hands a drawn frame to the threads. The ordinals of a film are 0, 1, 2, ...
    ///
    /// # Errors
    /// When the threads ended early.
    pub fn submit(&self, slot: FrameSlot) -> Result<(), OutputError> {
        self.jobs.send(slot).map_err(|_| OutputError::Thread("ended early".to_owned()))
    }

    /// The frames that were finished since the last call.
    pub fn written(&self) -> impl Iterator<Item = Result<Written, OutputError>> + '_ {
        self.done.try_iter()
    }

    /// Waits for every frame submitted; the rest of what [`Writer::written`] gives. A film appears only when all
    /// of its frames were submitted and written.
    ///
    /// # Errors
    /// The first failure of a frame or thread.
    pub fn finish(self) -> Result<Vec<Written>, OutputError> {
        let Self { free, jobs, done, threads } = self;
        drop(jobs);
        let ends: Vec<_> = threads.into_iter().map(JoinHandle::join).collect();
        drop(free);
        let written = done.try_iter().collect::<Result<_, _>>()?;
        for end in ends {
            end.map_err(|_| OutputError::Thread("panicked".to_owned()))??;
        }
        Ok(written)
    }
}

/// The threads' ends of the channels.
#[derive(Clone)]
struct Ends {
    jobs: Receiver<FrameSlot>,
    give_back: Sender<FrameSlot>,
    report: Sender<Done>,
}

impl Ends {
    /// Reports a frame before its slot goes back, so that who waits for slots sees every report in time.
    fn report(&self, done: Done, slot: FrameSlot) {
        // Both may be gone when the run ends early.
        let _ = self.report.send(done);
        let _ = self.give_back.send(slot);
    }
}

/// Writes the frames of a film in order.
struct InOrder {
    film: OpenFilm,
    file: String,
    ends: Ends,
    next: u64,
    failed: bool,
}

type Encoded = (FrameSlot, Result<Duration, String>);

impl InOrder {
    fn run(mut self, encoded: &Receiver<Encoded>, frames: u64, format: FilmFormat) -> Result<(), OutputError> {
        let mut early = BTreeMap::new();
        for (slot, result) in encoded {
            early.insert(slot.ordinal, (slot, result));
            while let Some((slot, result)) = early.remove(&self.next) {
                self.next += 1;
                self.put(slot, result);
            }
        }
        if self.failed || self.next != frames {
            return Ok(());
        }
        self.film.write(&format.trailer())?;
        self.film.finish()
    }

    /// Writes one frame; after a failure the others are only handed back.
    fn put(&mut self, slot: FrameSlot, result: Result<Duration, String>) {
        if self.failed {
            let _ = self.ends.give_back.send(slot);
            return;
        }
        let start = Instant::now();
        let file = self.file.clone();
        let done = match result {
            Ok(encode) => self.film.write(&slot.bytes).map(|()| Written {
                frame: slot.frame,
                file,
                encode: encode + start.elapsed(),
            }),
            Err(reason) => Err(OutputError::Encode { file, reason }),
        };
        self.failed = done.is_err();
        self.ends.report(done, slot);
    }
}
