//! The structures by name: [`AccelKind`], [`AccelSpec`] and the built [`AnyAccel`].

use std::{fmt, str::FromStr};

use super::{
    Accel, AccelConfig, AccelStats, BuildError, Closest, Counter, HitSink, Refit, TravRay, Violation,
    bvh2::Bvh2,
    bvh8::Bvh8,
    events::Events,
    grid::Grid,
    grug::Grug,
    kdtree::KdTree,
    list::List,
    run::{ClosestAllTask, ClosestPacketTask, ClosestTask, OccludedAllTask, OccludedPacketTask, OccludedTask},
    ssh::Ssh,
};
use crate::{
    geom::{Aabb, Forms, Hit, Ray, Triangles},
    simd::{Simd, SimdLevel, check_float_mode, dispatch},
};

/// A structure's name or a setting that does not exist.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SpecError {
    /// No structure has this name.
    #[error("unknown structure `{name}`; there are: {known}")]
    UnknownKind {
        /// The name asked for.
        name: String,
        /// The names that exist.
        known: String,
    },
    /// A setting is not of the form `key=value`.
    #[error("{structure}: `{text}` is not of the form key=value")]
    Malformed {
        /// The structure's name.
        structure: &'static str,
        /// What was found.
        text: String,
    },
    /// The structure does not know a setting, or cannot use its value.
    #[error("{structure}: setting `{key}`: {reason}")]
    Setting {
        /// The structure's name.
        structure: &'static str,
        /// The setting's name.
        key: String,
        /// What is wrong with it.
        reason: String,
    },
}

/// Applies `key=value` pairs to a structure's default settings.
fn configure<A: Accel>(settings: &[(String, String)]) -> Result<A::Config, SpecError> {
    let mut config = A::Config::default();
    for (key, value) in settings {
        let error = |reason| SpecError::Setting { structure: A::NAME, key: key.clone(), reason };
        if !A::Config::KEYS.contains(&key.as_str()) {
            let known = A::Config::KEYS.join(", ");
            return Err(error(if known.is_empty() {
                "unknown; there are no settings".into()
            } else {
                format!("unknown; there are: {known}")
            }));
        }
        config.set(key, value).map_err(error)?;
    }
    Ok(config)
}

/// Makes the enums over all structures; a row is `Variant => type`.
macro_rules! register_accels {
    ($($(#[$doc:meta])* $kind:ident => $ty:ty,)*) => {
        /// A kind of acceleration structure, by name.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        pub enum AccelKind {
            $($(#[$doc])* $kind,)*
        }

        /// A built structure of any kind. One match on the kind a call, none below.
        #[derive(Clone, Debug)]
        pub enum AnyAccel {
            $($(#[$doc])* $kind($ty),)*
        }

        impl AccelKind {
            /// Every kind.
            pub const ALL: &[Self] = &[$(Self::$kind),*];

            /// Name on the command line, in benches and in reports.
            pub fn name(self) -> &'static str {
                match self {
                    $(Self::$kind => <$ty>::NAME,)*
                }
            }

            fn check(self, settings: &[(String, String)]) -> Result<(), SpecError> {
                match self {
                    $(Self::$kind => configure::<$ty>(settings).map(drop),)*
                }
            }

            /// Builds over `prims` with `key=value` settings, in the current rayon pool.
            ///
            /// # Errors
            /// Unknown settings, an index out of range, a limit of the structure passed, or a calling thread that does not compute as
            /// [`check_float_mode`] asks.
            pub fn build(self, settings: &[(String, String)], prims: &Triangles<'_>) -> Result<AnyAccel, BuildError> {
                check_float_mode()?;
                match self {
                    $(Self::$kind => Ok(AnyAccel::$kind(<$ty>::build(prims, &configure::<$ty>(settings)?)?)),)*
                }
            }
        }

        impl AnyAccel {
            /// Which structure it is.
            pub fn kind(&self) -> AccelKind {
                match self {
                    $(Self::$kind(_) => AccelKind::$kind,)*
                }
            }

            /// As [`Accel::REFITS`].
            pub fn refits(&self) -> bool {
                match self {
                    $(Self::$kind(_) => <$ty>::REFITS,)*
                }
            }

            /// As [`Accel::node_format`].
            pub fn node_format(&self) -> &'static str {
                match self {
                    $(Self::$kind(a) => a.node_format(),)*
                }
            }

            /// As [`Accel::refit_into`]; an `out` of another kind is replaced by a copy first.
            pub fn refit_into(&self, out: &mut Self, prims: &Triangles<'_>) -> Refit {
                if self.kind() != out.kind() {
                    out.clone_from(self);
                }
                match (self, out) {
                    $((Self::$kind(a), Self::$kind(b)) => a.refit_into(b, prims),)*
                    _ => Refit::NeedsRebuild,
                }
            }

            /// As [`Accel::closest`].
            #[inline(always)]
            pub fn closest<S: Simd, C: Counter, K: HitSink>(
                &self,
                prims: &Triangles<'_>,
                ray: &TravRay,
                best: &mut Closest,
                sink: &K,
                count: &mut C,
            ) {
                match self {
                    $(Self::$kind(accel) => S::call(ClosestTask { accel, prims, ray, best, sink, count }),)*
                }
            }

            /// As [`Accel::occluded`].
            #[inline(always)]
            pub fn occluded<S: Simd, C: Counter, K: HitSink>(
                &self,
                prims: &Triangles<'_>,
                ray: &TravRay,
                sink: &K,
                count: &mut C,
            ) -> bool {
                match self {
                    $(Self::$kind(accel) => S::call(OccludedTask { accel, prims, ray, sink, count }),)*
                }
            }

            /// As [`Accel::closest_all`].
            pub(super) fn closest_all(
                &self,
                level: SimdLevel,
                prims: &Triangles<'_>,
                rays: &[Ray],
                packet: usize,
                forms: Forms,
                out: &mut [Option<Hit>],
            ) {
                match self {
                    $(Self::$kind(accel) => dispatch(level, ClosestAllTask { accel, prims, rays, packet, forms, out }),)*
                }
            }

            /// As [`Accel::occluded_all`].
            pub(super) fn occluded_all(
                &self,
                level: SimdLevel,
                prims: &Triangles<'_>,
                rays: &[Ray],
                packet: usize,
                forms: Forms,
                out: &mut [bool],
            ) {
                match self {
                    $(Self::$kind(accel) => dispatch(level, OccludedAllTask { accel, prims, rays, packet, forms, out }),)*
                }
            }

            /// As [`Accel::closest_packet`].
            #[inline(always)]
            pub fn closest_packet<S: Simd, C: Counter, K: HitSink>(
                &self,
                prims: &Triangles<'_>,
                rays: &[TravRay],
                active: u32,
                best: &mut [Closest],
                sinks: &[K],
                count: &mut C,
            ) {
                match self {
                    $(Self::$kind(accel) => S::call(ClosestPacketTask { accel, prims, rays, active, best, sinks, count }),)*
                }
            }

            /// As [`Accel::occluded_packet`].
            #[inline(always)]
            pub fn occluded_packet<S: Simd, C: Counter, K: HitSink>(
                &self,
                prims: &Triangles<'_>,
                rays: &[TravRay],
                active: u32,
                sinks: &[K],
                count: &mut C,
            ) -> u32 {
                match self {
                    $(Self::$kind(accel) => S::call(OccludedPacketTask { accel, prims, rays, active, sinks, count }),)*
                }
            }

            /// As [`Accel::validate`].
            ///
            /// # Errors
            /// The first violation found.
            pub fn validate(&self, prims: &Triangles<'_>) -> Result<(), Violation> {
                match self {
                    $(Self::$kind(a) => a.validate(prims),)*
                }
            }

            /// As [`Accel::stats`].
            pub fn stats(&self) -> AccelStats {
                match self {
                    $(Self::$kind(a) => a.stats(),)*
                }
            }

            /// As [`Accel::bounds`].
            #[inline(always)]
            pub fn bounds(&self) -> Aabb {
                match self {
                    $(Self::$kind(a) => a.bounds(),)*
                }
            }

            /// As [`Accel::decay`].
            pub fn decay(&self) -> f64 {
                match self {
                    $(Self::$kind(a) => a.decay(),)*
                }
            }
        }
    };
}

register_accels! {
    /// Brute force.
    List => List,
    /// Binary hierarchy of boxes.
    Bvh2 => Bvh2,
    /// Hierarchy of boxes with eight children a node.
    Bvh8 => Bvh8,
    /// Uniform grid.
    Grid => Grid,
    /// Kd-tree.
    Kdtree => KdTree,
    /// Single slab hierarchy.
    Ssh => Ssh,
    /// Hierarchy of sorted event lists.
    Events => Events,
    /// Grouped uniform grid over a forest of kd-trees.
    Grug => Grug,
}

impl AccelKind {
    /// All names, separated by commas.
    pub fn names() -> String {
        Self::ALL.iter().map(|k| k.name()).collect::<Vec<_>>().join(", ")
    }
}

impl fmt::Display for AccelKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for AccelKind {
    type Err = SpecError;

    fn from_str(name: &str) -> Result<Self, SpecError> {
        let unknown = || SpecError::UnknownKind { name: name.to_owned(), known: Self::names() };
        Self::ALL.iter().copied().find(|k| k.name() == name).ok_or_else(unknown)
    }
}

/// A structure with its settings: `NAME[:key=value,...]`, checked when parsed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AccelSpec {
    kind: AccelKind,
    settings: Vec<(String, String)>,
}

impl AccelSpec {
    /// A kind with its default settings.
    pub fn new(kind: AccelKind) -> Self {
        Self { kind, settings: Vec::new() }
    }

    /// This specification with one more setting; a later setting of the same key wins.
    ///
    /// # Errors
    /// When the structure does not know the setting or cannot use its value.
    pub fn with(mut self, key: &str, value: &str) -> Result<Self, SpecError> {
        self.settings.push((key.to_owned(), value.to_owned()));
        self.kind.check(&self.settings)?;
        Ok(self)
    }

    /// The structure.
    pub fn kind(&self) -> AccelKind {
        self.kind
    }

    /// This specification with `build=fast`; `None` where a builder is named already, and for structures that have no such one.
    #[must_use]
    pub fn fast(&self) -> Option<Self> {
        let is_free = self.settings.iter().all(|(key, _)| key != "build");
        is_free.then(|| self.clone().with("build", "fast").ok()).flatten()
    }

    /// Builds over `prims`, in the current rayon pool.
    ///
    /// # Errors
    /// As [`AccelKind::build`].
    pub fn build(&self, prims: &Triangles<'_>) -> Result<AnyAccel, BuildError> {
        self.kind.build(&self.settings, prims)
    }
}

impl fmt::Display for AccelSpec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.kind.name())?;
        for (i, (key, value)) in self.settings.iter().enumerate() {
            write!(f, "{}{key}={value}", if i == 0 { ':' } else { ',' })?;
        }
        Ok(())
    }
}

impl FromStr for AccelSpec {
    type Err = SpecError;

    fn from_str(text: &str) -> Result<Self, SpecError> {
        let (name, settings) = text.split_once(':').unwrap_or((text, ""));
        let spec = Self::new(name.parse()?);
        settings.split(',').filter(|s| !s.is_empty()).try_fold(spec, |spec, pair| {
            let malformed = || SpecError::Malformed { structure: spec.kind.name(), text: pair.to_owned() };
            let (key, value) = pair.split_once('=').ok_or_else(malformed)?;
            spec.with(key, value)
        })
    }
}
