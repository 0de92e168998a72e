use super::SimdLevel;

/// The wide types of one level. Only this module implements it; the types of levels that a machine may lack are
/// private, so code runs with them only below [`super::dispatch`].
pub trait Simd: Copy + Send + Sync + 'static {
    /// The level that the implementor stands for.
    const LEVEL: SimdLevel;
}
