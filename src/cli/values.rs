//! Readers of option values that several options share. Named values are listed by `--help` and completed by
//! shells.

use clap::builder::{PossibleValuesParser, TypedValueParser};
use kinora::{
    accel::{AccelSpec, Precision},
    dynamics::RebuildPolicy,
    render::Shading,
    report::Kind,
    simd::SimdLevel,
    world::TopKind,
};

/// Longest side of a picture in pixels, and its largest area.
const MAX_SIDE: u32 = 65_535;
const MAX_AREA: u64 = 1 << 27;

/// Most samples a pixel.
const MAX_SAMPLES: i64 = 1 << 20;

/// One of several named values.
pub(crate) fn named<T, const N: usize>(values: [(&'static str, T); N]) -> impl TypedValueParser<Value = T>
where
    T: Copy + Send + Sync + 'static,
{
    PossibleValuesParser::new(values.map(|v| v.0)).map(move |name| {
        let found = values.iter().find(|v| v.0 == name);
        found.expect("the parser lets only these names pass").1
    })
}

/// Samples a pixel.
pub(crate) fn samples() -> impl TypedValueParser<Value = u32> {
    clap::value_parser!(u32).range(1..=MAX_SAMPLES)
}

/// What a pixel shows.
pub(crate) fn shading() -> impl TypedValueParser<Value = Shading> {
    named(Shading::ALL.map(|s| (s.name(), s)))
}

/// What `--simd` asks for.
#[derive(Clone, Copy, Debug)]
pub(crate) enum SimdChoice {
    /// The highest level of this machine.
    Auto,
    /// This level, if the machine has it.
    Level(SimdLevel),
}

/// A SIMD level or `auto`.
pub(crate) fn simd() -> impl TypedValueParser<Value = SimdChoice> {
    let [a, b, c] = SimdLevel::ALL.map(|l| (l.name(), SimdChoice::Level(l)));
    named([("auto", SimdChoice::Auto), a, b, c])
}

/// How exact answers are.
pub(crate) fn precision() -> impl TypedValueParser<Value = Precision> {
    named(Precision::ALL.map(|p| (p.name(), p)))
}

/// The level over groups.
pub(crate) fn top() -> impl TypedValueParser<Value = TopKind> {
    named(TopKind::ALL.map(|k| (k.name(), k)))
}

/// What to report.
pub(crate) fn report() -> impl TypedValueParser<Value = Kind> {
    named(Kind::ALL.map(|k| (k.name(), k)))
}

/// A structure with its settings.
pub(crate) fn accel(text: &str) -> Result<AccelSpec, String> {
    text.parse().map_err(|e: kinora::accel::SpecError| e.to_string())
}

/// Width and height in pixels.
pub(crate) fn size(text: &str) -> Result<(u32, u32), String> {
    let side = |t: &str| t.parse::<u32>().ok().filter(|_| t.bytes().all(|b| b.is_ascii_digit()));
    let parsed = text.split_once(['x', 'X']).and_then(|(w, h)| Some((side(w)?, side(h)?)));
    let (w, h) = parsed.ok_or("expected WIDTHxHEIGHT in pixels, as 1280x720")?;
    let sides = 1..=MAX_SIDE;
    if !sides.contains(&w) || !sides.contains(&h) || u64::from(w) * u64::from(h) > MAX_AREA {
        return Err(format!("sides must be 1 to {MAX_SIDE} and the area at most {MAX_AREA} pixels"));
    }
    Ok((w, h))
}

/// How structures are kept good.
pub(crate) fn policy(text: &str) -> Result<RebuildPolicy, String> {
    match text {
        "async" => return Ok(RebuildPolicy::Async),
        "auto" => return Ok(RebuildPolicy::Auto),
        "refit" => return Ok(RebuildPolicy::Refit),
        "rebuild" => return Ok(RebuildPolicy::Rebuild),
        _ => {}
    }
    let every = text.strip_prefix("swap-every=").and_then(|k| k.parse().ok()).filter(|&k| k > 0);
    let expected = || "expected async, auto, refit, rebuild, or swap-every=K with K of 1 or more".to_owned();
    every.map(RebuildPolicy::SwapEvery).ok_or_else(expected)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_two_positive_numbers_within_bounds() {
        assert_eq!(size("1280x720"), Ok((1280, 720)));
        assert_eq!(size("1X1"), Ok((1, 1)));
        for wrong in ["", "x", "1280", "0x1", "1x0", "-1x5", "1x5x6", "65536x1", "60000x60000", "1.5x2", "+1x2"] {
            assert!(size(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn policies_are_named() {
        assert_eq!(policy("async"), Ok(RebuildPolicy::Async));
        assert_eq!(policy("swap-every=3"), Ok(RebuildPolicy::SwapEvery(3)));
        for wrong in ["", "swap-every=0", "swap-every=", "swap-every=x", "never"] {
            assert!(policy(wrong).is_err(), "{wrong}");
        }
    }
}
