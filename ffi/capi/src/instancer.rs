//! Instancers: `trz_instancer_*`, and what is part of their prototypes.

use std::ffi::c_char;
use std::sync::Arc;

use hdtrapeze_core::scene::PrimId;
use hdtrapeze_delegate::{Edit, Kind};

use crate::scene::{create, edit};
use crate::types::*;
use crate::{convert, input};

/// Queues an instancer without instances. path (UTF-8) names it in messages; two may have one path. It
/// draws nothing itself: trz_prim_set_instancer makes prims (and other instancers) part of its
/// prototypes. Of the functions for prims it takes trz_prim_set_transform (its levels up to the world,
/// or to the root of the prototype that it is part of), trz_prim_set_primvar (one value an instance),
/// trz_prim_set_visible, trz_prim_set_motion and trz_prim_remove; remove what is part of it too.
///
/// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT (path), TRZ_ERROR_POISONED.
/// Threads: any.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trz_instancer_create(
    session: *mut trz_session,
    path: *const c_char,
    out: *mut trz_id,
) -> trz_result {
    // SAFETY: the caller passes null or valid pointers.
    unsafe { create(session, Kind::Instancer, path, out) }
}

/// Queues the instances of an instancer, in place of those before; everything is copied. Arrays that do
/// not fit each other, and numbers that are not finite, are found at commit: what can be is rendered,
/// with a warning.
///
/// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT, TRZ_ERROR_NOT_FOUND,
/// TRZ_ERROR_OUT_OF_MEMORY, TRZ_ERROR_POISONED. Threads: any.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trz_instancer_set(
    session: *mut trz_session,
    instancer: trz_id,
    instances: *const trz_instancer,
) -> trz_result {
    // SAFETY: the caller passes null or valid pointers.
    unsafe {
        edit(session, instancer, || {
            let arrays = convert::instancer(&input::read(instances, "instances")?)?;
            Ok(Edit::Instances(Arc::new(arrays)))
        })
    }
}

/// Queues that a prim, or another instancer, is part of prototype number `prototype` of an instancer: it
/// appears once for each instance of that prototype, and not by itself. instancer 0: it stands by
/// itself, as created. Its transform levels then end at the root of the prototype.
///
/// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT (a camera, or not an instancer),
/// TRZ_ERROR_NOT_FOUND, TRZ_ERROR_POISONED. Threads: any.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trz_prim_set_instancer(
    session: *mut trz_session,
    prim: trz_id,
    instancer: trz_id,
    prototype: u32,
) -> trz_result {
    let part = (instancer != 0).then_some((PrimId(instancer), prototype));
    // SAFETY: the caller passes null or a live session.
    unsafe { edit(session, prim, || Ok(Edit::PartOf(part))) }
}
