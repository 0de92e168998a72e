//! Every writer's files decode again to what was drawn, and resume can tell good files from bad.

use std::{
    fs,
    io::{BufReader, Cursor},
    path::Path,
};

use kinora::{
    output::{
        Chroma, Expected, ExrColor, FilmFormat, FilmSettings, FilmSink, Fps, FrameList, OutputError, SettingsHash,
        SettingsHasher, Stamp, StillFormat, StillSettings, Target, Unfinished, Unfit, Writer, Written, check_film,
        check_still,
    },
    render::Film,
};

const SIZE: (u32, u32) = (37, 21);

fn hash(text: &str) -> SettingsHash {
    let mut hasher = SettingsHasher::default();
    hasher.add("test", text.as_bytes());
    hasher.finish()
}

/// A picture that differs from frame to frame and in every layer.
fn draw(film: &mut Film, frame: u64) {
    let f = frame as f32;
    for y in 0..film.height {
        for x in 0..film.width {
            let at = (y * film.width + x) as usize;
            let (u, v) = (x as f32 / film.width as f32, y as f32 / film.height as f32);
            film.color[at] = [u, v, (u * v + f / 16.0).fract(), 1.0];
            film.depth[at] = if x > y { f32::INFINITY } else { 1.0 + u + f };
            film.instance[at] = if x > y { 0 } else { 1 + y };
        }
    }
}

fn drawn(frame: u64) -> Film {
    let mut film = Film::new(SIZE.0, SIZE.1);
    draw(&mut film, frame);
    film
}

fn srgb8(frame: u64) -> Vec<u8> {
    let mut rgba = Vec::new();
    drawn(frame).to_srgb8(&mut rgba);
    rgba
}

fn rgb8(frame: u64) -> Vec<u8> {
    srgb8(frame).chunks_exact(4).flat_map(|p| p[..3].to_vec()).collect()
}

fn run(writer: Writer, frames: &[u64]) -> Result<Vec<Written>, OutputError> {
    let mut written = Vec::new();
    for (ordinal, &frame) in (0..).zip(frames) {
        let mut slot = writer.take()?;
        draw(&mut slot.film, frame);
        (slot.frame, slot.ordinal) = (frame, ordinal);
        writer.submit(slot)?;
        written.extend(writer.written().collect::<Result<Vec<_>, _>>()?);
    }
    written.extend(writer.finish()?);
    Ok(written)
}

fn stills(folder: &Path, name: &str, frames: &[u64], color: ExrColor) -> Vec<Written> {
    let target = Target::parse(&folder.join(name)).unwrap();
    let format = if name.ends_with("exr") { StillFormat::Exr } else { StillFormat::Png };
    let settings = StillSettings { target, format, settings: hash("a"), exr_color: color, fps: Fps::DEFAULT };
    let mut written = run(Writer::stills(settings, SIZE, 2, &Unfinished::default()).unwrap(), frames).unwrap();
    written.sort_by_key(|w| w.frame);
    written
}

fn film_settings(frames: &[u64], chroma: Chroma) -> FilmSettings {
    let frames = frames.len() as u64;
    let stamp = Stamp::of_film(&hash("a"), frames);
    FilmSettings { width: SIZE.0, height: SIZE.1, fps: Fps::DEFAULT, frames, chroma, stamp }
}

fn film(path: &Path, format: FilmFormat, frames: &[u64], chroma: Chroma) -> Result<Vec<Written>, OutputError> {
    let sink = FilmSink::File(path.to_owned());
    let settings = film_settings(frames, chroma);
    run(Writer::film(sink, format, settings, 3, &Unfinished::default())?, frames)
}

fn expected(stamp: &Stamp, frames: u64) -> Expected<'_> {
    Expected { stamp, width: SIZE.0, height: SIZE.1, frames }
}

#[test]
fn png_stills_hold_the_tone_mapped_picture() {
    let folder = tempfile::tempdir().unwrap();
    let written = stills(folder.path(), "f_###.png", &[0, 5, 12], ExrColor::Half);
    assert_eq!(written.iter().map(|w| w.frame).collect::<Vec<_>>(), [0, 5, 12]);
    for w in written {
        assert!(w.file.ends_with(&format!("f_{:03}.png", w.frame)), "{}", w.file);
        let image = image::open(&w.file).unwrap();
        assert_eq!((image.width(), image.height()), SIZE);
        assert_eq!(image.into_rgb8().into_raw(), rgb8(w.frame));
    }
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 3);
}

#[test]
fn exr_stills_hold_colour_depth_and_instances() {
    let folder = tempfile::tempdir().unwrap();
    for (name, color, tolerance) in [("h.exr", ExrColor::Half, 1e-3), ("f.exr", ExrColor::Float, 0.0)] {
        stills(folder.path(), name, &[3], color);
        let image = exr::prelude::read_all_flat_layers_from_file(folder.path().join(name)).unwrap();
        let want = drawn(3);
        let names: Vec<String> =
            image.layer_data.iter().map(|l| l.attributes.layer_name.clone().unwrap().to_string()).collect();
        assert_eq!(names, ["color", "depth", "instance"]);
        let channel = |layer: usize, channel: &str| {
            let list = &image.layer_data[layer].channel_data.list;
            list.iter().find(|c| c.name.eq(channel)).unwrap().sample_data.clone()
        };
        for (c, name) in ["R", "G", "B", "A"].into_iter().enumerate() {
            let got: Vec<f32> = channel(0, name).values_as_f32().collect();
            for (got, want) in got.iter().zip(want.color.iter().map(|p| p[c])) {
                assert!((got - want).abs() <= tolerance, "{name}: {got} for {want}");
            }
        }
        assert_eq!(channel(1, "Z"), exr::prelude::FlatSamples::F32(want.depth.clone()));
        assert_eq!(channel(2, "ID"), exr::prelude::FlatSamples::U32(want.instance.clone()));
    }
}

#[test]
fn equal_frames_give_equal_bytes_in_every_still_format() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["a_#.png", "a_#.exr"] {
        let (one, two) = (folder.path().join("one"), folder.path().join("two"));
        for to in [&one, &two] {
            fs::create_dir_all(to).unwrap();
            stills(to, name, &[4], ExrColor::Half);
        }
        let file = name.replace('#', "4");
        assert_eq!(fs::read(one.join(&file)).unwrap(), fs::read(two.join(&file)).unwrap(), "{name}");
    }
}

#[test]
fn apng_holds_every_frame_in_order_and_is_a_png_for_others() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.apng");
    let frames: Vec<u64> = (0..9).collect();
    film(&path, FilmFormat::Apng, &frames, Chroma::C420).unwrap();
    let file = BufReader::new(fs::File::open(&path).unwrap());
    let mut reader = png::Decoder::new(file).read_info().unwrap();
    assert_eq!(reader.info().animation_control.unwrap().num_frames, 9);
    assert_eq!(reader.info().animation_control.unwrap().num_plays, 0);
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    for frame in frames {
        reader.next_frame(&mut pixels).unwrap();
        let control = reader.info().frame_control.unwrap();
        assert_eq!((control.delay_num, control.delay_den), (1, 30));
        assert_eq!(pixels, rgb8(frame), "frame {frame}");
    }
    reader.finish().unwrap();
    let first = image::load(Cursor::new(fs::read(&path).unwrap()), image::ImageFormat::Png).unwrap();
    assert_eq!(first.into_rgb8().into_raw(), rgb8(0));
}

#[test]
fn gif_holds_every_frame_in_order() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.gif");
    let frames: Vec<u64> = (0..7).collect();
    film(&path, FilmFormat::Gif, &frames, Chroma::C420).unwrap();
    let mut options = gif::DecodeOptions::new();
    options.set_color_output(gif::ColorOutput::RGBA);
    let mut decoder = options.read_info(fs::File::open(&path).unwrap()).unwrap();
    assert_eq!(decoder.repeat(), gif::Repeat::Infinite);
    let mut delays = 0;
    for &frame in &frames {
        let got = decoder.read_next_frame().unwrap().unwrap();
        delays += u32::from(got.delay);
        let want = srgb8(frame);
        let error: u32 = got.buffer.iter().zip(&want).map(|(a, b)| u32::from(a.abs_diff(*b))).sum();
        assert!(f64::from(error) / want.len() as f64 <= 8.0, "frame {frame}: {error}");
    }
    assert_eq!(delays, 23, "7 frames of 1/30 s in hundredths");
    assert!(decoder.read_next_frame().unwrap().is_none());
}

#[test]
fn y4m_has_its_header_and_whole_frames() {
    let folder = tempfile::tempdir().unwrap();
    for (chroma, word, size) in [(Chroma::C420, "C420jpeg", 37 * 21 + 2 * 19 * 11), (Chroma::C444, "C444", 3 * 37 * 21)]
    {
        let path = folder.path().join(format!("{word}.y4m"));
        film(&path, FilmFormat::Y4m, &[0, 1, 2], chroma).unwrap();
        let bytes = fs::read(&path).unwrap();
        let end = bytes.iter().position(|&b| b == b'\n').unwrap();
        let header = std::str::from_utf8(&bytes[..end]).unwrap();
        assert!(header.starts_with("YUV4MPEG2 W37 H21 F30:1 Ip A1:1 "), "{header}");
        assert!(header.contains(word) && header.contains("XCOLORRANGE=LIMITED"), "{header}");
        assert!(end <= 95, "longer than FFmpeg reads: {header}");
        let frames = &bytes[end + 1..];
        assert_eq!(frames.len(), 3 * (6 + size));
        assert!(frames.chunks(6 + size).all(|f| f.starts_with(b"FRAME\n")));
        assert!(frames.chunks(6 + size).all(|f| f[6..6 + 37 * 21].iter().all(|y| (16..=235).contains(y))));
    }
}

#[test]
fn films_come_out_the_same_for_any_number_of_encoders() {
    let frames: Vec<u64> = (0..12).collect();
    let folder = tempfile::tempdir().unwrap();
    for format in [FilmFormat::Apng, FilmFormat::Gif, FilmFormat::Y4m] {
        let bytes: Vec<_> = [1, 4]
            .into_iter()
            .map(|encoders| {
                let path = folder.path().join(format!("{encoders}"));
                let (sink, settings) = (FilmSink::File(path.clone()), film_settings(&frames, Chroma::C444));
                let writer = Writer::film(sink, format, settings, encoders, &Unfinished::default()).unwrap();
                assert_eq!(run(writer, &frames).unwrap().len(), 12);
                fs::read(path).unwrap()
            })
            .collect();
        assert!(bytes[0] == bytes[1], "{format:?}");
    }
}

#[test]
fn a_film_that_is_cut_short_never_appears() {
    let folder = tempfile::tempdir().unwrap();
    for format in [FilmFormat::Apng, FilmFormat::Gif, FilmFormat::Y4m] {
        let path = folder.path().join("cut");
        let settings = film_settings(&[0, 1, 2], Chroma::C420);
        let writer = Writer::film(FilmSink::File(path), format, settings, 2, &Unfinished::default()).unwrap();
        run(writer, &[0, 1]).unwrap();
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}

#[test]
fn a_closed_stream_is_an_error_that_names_it() {
    struct Closed(usize);
    impl std::io::Write for Closed {
        fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
            self.0 = self.0.checked_sub(1).ok_or(std::io::ErrorKind::BrokenPipe)?;
            Ok(bytes.len())
        }
        fn flush(&mut self) -> std::io::Result<()> {
            Ok(())
        }
    }
    let frames: Vec<u64> = (0..50).collect();
    let sink = FilmSink::Stream(Box::new(Closed(4)), "stdout".to_owned());
    let settings = film_settings(&frames, Chroma::C420);
    let writer = Writer::film(sink, FilmFormat::Y4m, settings, 2, &Unfinished::default()).unwrap();
    let error = run(writer, &frames).unwrap_err().to_string();
    assert!(error.starts_with("stdout: cannot write: "), "{error}");
}

#[test]
fn a_missing_folder_is_an_error_that_names_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let target = Target::parse(&folder.path().join("no/f_#.png")).unwrap();
    let settings = StillSettings {
        target,
        format: StillFormat::Png,
        settings: hash("a"),
        exr_color: ExrColor::Half,
        fps: Fps::DEFAULT,
    };
    let writer = Writer::stills(settings, SIZE, 2, &Unfinished::default()).unwrap();
    let error = run(writer, &(0..20).collect::<Vec<_>>()).unwrap_err().to_string();
    assert!(error.contains("f_") && error.contains("cannot write"), "{error}");
}

/// A file, and how to check a changed copy of it.
type Checked = (Vec<u8>, Box<dyn Fn(&Path, &Stamp) -> Result<(), Unfit>>);

/// One good file of every kind, with frame 3 or frames 0..4.
fn good_files(folder: &Path) -> Vec<(&'static str, Checked, Stamp)> {
    let mut files: Vec<(&'static str, Checked, Stamp)> = Vec::new();
    for (name, format) in [("a.png", StillFormat::Png), ("a.exr", StillFormat::Exr)] {
        stills(folder, name, &[3], ExrColor::Half);
        let check = move |p: &Path, s: &Stamp| check_still(p, format, &expected(s, 1));
        files.push((name, (fs::read(folder.join(name)).unwrap(), Box::new(check)), Stamp::of_frame(&hash("a"), 3)));
    }
    for (name, format) in [("b.apng", FilmFormat::Apng), ("b.gif", FilmFormat::Gif), ("b.y4m", FilmFormat::Y4m)] {
        film(&folder.join(name), format, &[0, 1, 2, 3], Chroma::C420).unwrap();
        let check = move |p: &Path, s: &Stamp| check_film(p, format, &expected(s, 4));
        files.push((name, (fs::read(folder.join(name)).unwrap(), Box::new(check)), Stamp::of_film(&hash("a"), 4)));
    }
    files
}

#[test]
fn resume_keeps_whole_files_of_the_same_settings_only() {
    let folder = tempfile::tempdir().unwrap();
    for (name, (bytes, check), stamp) in good_files(folder.path()) {
        let path = folder.path().join(name);
        assert_eq!(check(&path, &stamp), Ok(()), "{name}");
        assert_eq!(check(&path, &Stamp::of_frame(&hash("b"), 3)), Err(Unfit::Different), "{name}");
        if name != "b.y4m" {
            assert_eq!(check(&path, &Stamp::of_frame(&hash("a"), 4)), Err(Unfit::Different), "{name}");
        }
        assert_eq!(check(&folder.path().join("none"), &stamp), Err(Unfit::Missing), "{name}");
        let cut = folder.path().join("cut");
        for keep in [0, 1, 20, bytes.len() / 2, bytes.len() - 20, bytes.len() - 1] {
            fs::write(&cut, &bytes[..keep]).unwrap();
            assert!(check(&cut, &stamp).is_err(), "{name} cut to {keep} of {}", bytes.len());
        }
        fs::write(&cut, b"something else").unwrap();
        assert!(check(&cut, &stamp).is_err(), "{name}");
    }
}

#[test]
fn checking_damaged_files_never_panics() {
    let folder = tempfile::tempdir().unwrap();
    let cut = folder.path().join("damaged");
    for (_, (bytes, check), stamp) in good_files(folder.path()) {
        let mut state = 1u32;
        for _ in 0..60 {
            let mut copy = bytes.clone();
            for _ in 0..3 {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                let at = state as usize % copy.len();
                copy[at] ^= (state >> 24) as u8 | 1;
            }
            fs::write(&cut, &copy).unwrap();
            let _ = check(&cut, &stamp);
        }
    }
}

#[test]
fn lists_of_one_step_play_at_their_own_rate() {
    let list: FrameList = "0-60x3".parse().unwrap();
    assert_eq!(list.step().and_then(|s| Fps::DEFAULT.divided(s)), Fps::new(10, 1));
}
