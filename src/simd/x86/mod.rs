//! AVX2 and AVX-512. Every `unsafe` here is the call of an intrinsic whose feature is a part of the level: the level's
//! types are named only by `dispatch`, which has checked the machine.
#![allow(unused_unsafe, reason = "intrinsics of x86-64's baseline are safe to call, those beside them are not")]

/// Calls one intrinsic.
macro_rules! call {
    ($intrinsic:ident $(::<$constant:ident>)? ($($arg:expr),*)) => {
        // SAFETY: the intrinsic's feature is in the level (head of `x86`).
        unsafe { $intrinsic $(::<$constant>)? ($($arg),*) }
    };
}

mod avx2;
mod avx512;
mod columns;
mod corners;
mod texels;
mod vectors;
mod words;

pub(super) use avx2::Avx2;
pub(super) use avx512::Avx512;
