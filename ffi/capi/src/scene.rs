//! Scene edits: `trz_mesh_*`, `trz_grids_*`, `trz_implicit_*`, `trz_camera_*`, `trz_prim_*`.
//!
//! Each function checks what memory safety needs, copies its input, and queues one edit. Whether
//! the data make sense (indices in range, counts that match) is found at commit.

use std::ffi::c_char;

use hdtrapeze_core::scene::{CameraDesc, PrimId};
use hdtrapeze_delegate::{Edit, Kind};

use crate::fault::{Fault, call, with_session};
use crate::types::*;
use crate::{convert, input};

/// Queues a prim; safety as for the functions that call it.
pub(crate) unsafe fn create(
    session: *mut trz_session,
    kind: Kind,
    path: *const c_char,
    out: *mut trz_id,
) -> trz_result {
    // SAFETY: the caller passes null or valid pointers.
    unsafe {
        with_session(session, |session| {
            let out = input::place(out, "out")?;
            let path = input::text(path, "path")?;
            *out = session.create(kind, path)?.0;
            Ok(())
        })
    }
}

/// Queues one edit; safety as for the functions that call it.
pub(crate) unsafe fn edit(
    session: *mut trz_session,
    id: trz_id,
    make: impl FnOnce() -> Result<Edit, Fault>,
) -> trz_result {
    // SAFETY: the caller passes null or a live session.
    unsafe {
        with_session(session, |session| {
            session.find(PrimId(id))?;
            Ok(session.edit(PrimId(id), make()?)?)
        })
    }
}

/// Queues a mesh without faces. path (UTF-8) names it in messages; two prims may have one path.
///
/// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT (path), TRZ_ERROR_POISONED.
/// Threads: any.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trz_mesh_create(
    session: *mut trz_session,
    path: *const c_char,
    out: *mut trz_id,
) -> trz_result {
    // SAFETY: the caller passes null or valid pointers.
    unsafe { create(session, Kind::Mesh, path, out) }
}

/// Queues a mesh's topology; everything is copied. Creases or corners whose lists do not fit each
/// other are dropped with a warning.
///
/// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT, TRZ_ERROR_NOT_FOUND,
/// TRZ_ERROR_OUT_OF_MEMORY, TRZ_ERROR_POISONED. Threads: any.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trz_mesh_set_topology(
    session: *mut trz_session,
    mesh: trz_id,
    topology: *const trz_topology,
) -> trz_result {
    // SAFETY: the caller passes null or valid pointers.
    unsafe {
        with_session(session, |session| {
            session.find(PrimId(mesh))?;
            let topology = convert::topology(&input::read(topology, "topology")?)?;
            Ok(session.set_topology(PrimId(mesh), &topology)?)
        })
    }
}

/// Queues the subsets of a mesh, in place of those before; everything is copied, and the array may be
/// NULL where there are none. The AOV subsetId holds their numbers in it: of the family materialBind,
/// else of the family of the first subset of faces. Indices that are no faces or come twice, faces in two
/// subsets of a family whose type does not allow it, and faces that a partition lacks give warnings at
/// commit, with the subset's path; the rest counts, and where subsets overlap the first.
///
/// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT, TRZ_ERROR_NOT_FOUND,
/// TRZ_ERROR_OUT_OF_MEMORY, TRZ_ERROR_POISONED. Threads: any.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trz_mesh_set_subsets(
    session: *mut trz_session,
    mesh: trz_id,
    subsets: *const trz_subset,
    subset_count: usize,
) -> trz_result {
    // SAFETY: the caller passes null or valid pointers.
    unsafe {
        edit(session, mesh, || {
            let subsets = input::slice(subsets, subset_count, "subsets")?;
            convert::subsets(subsets).map(Edit::Subsets)
        })
    }
}

/// Queues an empty prim of curves. path (UTF-8) names it in messages. Its points are set with
/// trz_prim_set_points, its widths and normals with trz_prim_set_primvar.
///
/// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT (path), TRZ_ERROR_POISONED.
/// Threads: any.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trz_curves_create(
    session: *mut trz_session,
    path: *const c_char,
    out: *mut trz_id,
) -> trz_result {
    // SAFETY: the caller passes null or valid pointers.
    unsafe { create(session, Kind::Curves, path, out) }
}

/// Queues basis, wrap and counts of a curves prim, in place of those before; everything is copied. Its
/// points stay.
///
/// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT, TRZ_ERROR_NOT_FOUND,
/// TRZ_ERROR_OUT_OF_MEMORY, TRZ_ERROR_POISONED. Threads: any.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trz_curves_set(
    session: *mut trz_session,
    curves_prim: trz_id,
    curves: *const trz_curves,
) -> trz_result {
    // SAFETY: the caller passes null or valid pointers.
    unsafe {
        edit(session, curves_prim, || {
            convert::curves(&input::read(curves, "curves")?).map(Edit::Curves)
        })
    }
}

/// Queues an empty prim of spheres. path (UTF-8) names it in messages. Their centres are set with
/// trz_prim_set_points; the primvar widths gives their diameters (1 where there is none).
///
/// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT (path), TRZ_ERROR_POISONED.
/// Threads: any.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trz_spheres_create(
    session: *mut trz_session,
    path: *const c_char,
    out: *mut trz_id,
) -> trz_result {
    // SAFETY: the caller passes null or valid pointers.
    unsafe { create(session, Kind::Spheres, path, out) }
}

/// Queues an empty prim of pre-diced grids. path (UTF-8) names it in messages.
///
/// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT (path), TRZ_ERROR_POISONED.
/// Threads: any.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trz_grids_create(
    session: *mut trz_session,
    path: *const c_char,
    out: *mut trz_id,
) -> trz_result {
    // SAFETY: the caller passes null or valid pointers.
    unsafe { create(session, Kind::Grids, path, out) }
}

/// Queues the grids of a grids prim, in place of those before; everything is copied. Rates must be
/// 1 to 16, and position_count what rates and keys add up to.
///
/// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT, TRZ_ERROR_NOT_FOUND,
/// TRZ_ERROR_OUT_OF_MEMORY, TRZ_ERROR_POISONED. Threads: any.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trz_grids_set(
    session: *mut trz_session,
    grids_prim: trz_id,
    grids: *const trz_grids,
) -> trz_result {
    // SAFETY: the caller passes null or valid pointers.
    unsafe {
        edit(session, grids_prim, || {
            convert::grids(&input::read(grids, "grids")?).map(Edit::Grids)
        })
    }
}

/// Queues an implicit prim without sizes. path (UTF-8) names it in messages.
///
/// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT (path), TRZ_ERROR_POISONED.
/// Threads: any.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trz_implicit_create(
    session: *mut trz_session,
    path: *const c_char,
    out: *mut trz_id,
) -> trz_result {
    // SAFETY: the caller passes null or valid pointers.
    unsafe { create(session, Kind::Implicit, path, out) }
}

/// Queues kind and sizes of an implicit prim, in place of those before; everything is copied. Sizes
/// that are not finite or are negative are found at commit. Primvars of a cube or a plane have values
/// for the mesh that Hydra draws for it, whose faces elementId tells: a cube's are +z, -z, +y, -y, +x,
/// -x. Other kinds have one value, and elementId 0.
///
/// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT, TRZ_ERROR_NOT_FOUND,
/// TRZ_ERROR_OUT_OF_MEMORY, TRZ_ERROR_POISONED. Threads: any.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trz_implicit_set(
    session: *mut trz_session,
    prim: trz_id,
    implicit: *const trz_implicit,
) -> trz_result {
    // SAFETY: the caller passes null or valid pointers.
    unsafe {
        edit(session, prim, || {
            convert::implicit(&input::read(implicit, "implicit")?).map(Edit::Implicit)
        })
    }
}

/// Queues a NURBS patch without points. path (UTF-8) names it in messages.
///
/// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT (path), TRZ_ERROR_POISONED.
/// Threads: any.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trz_nurbs_patch_create(
    session: *mut trz_session,
    path: *const c_char,
    out: *mut trz_id,
) -> trz_result {
    // SAFETY: the caller passes null or valid pointers.
    unsafe { create(session, Kind::NurbsPatch, path, out) }
}

/// Queues orders, knots and weights of a NURBS patch, in place of those before; everything is copied.
/// The patch is closed where its opposite boundaries lie on one another. Primvars have one value, one
/// a point, or, where they vary, one an end of a segment (points - order + 2 along u and along v);
/// elementId is 0.
///
/// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT, TRZ_ERROR_NOT_FOUND,
/// TRZ_ERROR_OUT_OF_MEMORY, TRZ_ERROR_POISONED. Threads: any.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trz_nurbs_patch_set(
    session: *mut trz_session,
    prim: trz_id,
    patch: *const trz_nurbs_patch,
) -> trz_result {
    // SAFETY: the caller passes null or valid pointers.
    unsafe {
        edit(session, prim, || {
            convert::nurbs_patch(&input::read(patch, "patch")?).map(Edit::NurbsPatch)
        })
    }
}

/// Queues NURBS curves without points. path (UTF-8) names them in messages.
///
/// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT (path), TRZ_ERROR_POISONED.
/// Threads: any.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trz_nurbs_curves_create(
    session: *mut trz_session,
    path: *const c_char,
    out: *mut trz_id,
) -> trz_result {
    // SAFETY: the caller passes null or valid pointers.
    unsafe { create(session, Kind::NurbsCurves, path, out) }
}

/// Queues orders, knots and weights of NURBS curves, in place of those before; everything is copied.
/// Primvars are as for curves (trz_curves_set); one that varies has a value at each end of a segment:
/// points - order + 2 a curve.
///
/// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT, TRZ_ERROR_NOT_FOUND,
/// TRZ_ERROR_OUT_OF_MEMORY, TRZ_ERROR_POISONED. Threads: any.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trz_nurbs_curves_set(
    session: *mut trz_session,
    prim: trz_id,
    curves: *const trz_nurbs_curves,
) -> trz_result {
    // SAFETY: the caller passes null or valid pointers.
    unsafe {
        edit(session, prim, || {
            convert::nurbs_curves(&input::read(curves, "curves")?).map(Edit::NurbsCurves)
        })
    }
}

/// Queues a camera with trz_camera_default's values. path (UTF-8) names it in messages and
/// metadata.
///
/// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT (path), TRZ_ERROR_POISONED.
/// Threads: any.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trz_camera_create(
    session: *mut trz_session,
    path: *const c_char,
    out: *mut trz_id,
) -> trz_result {
    // SAFETY: the caller passes null or valid pointers.
    unsafe { create(session, Kind::Camera, path, out) }
}

/// Fills out, whose struct_size the caller has set, with UsdGeomCamera's fallbacks in scene units.
///
/// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT (struct_size). Threads: any.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trz_camera_default(out: *mut trz_camera) -> trz_result {
    call(|| {
        // SAFETY: the caller passes null or a struct of the size it tells.
        unsafe { input::write(out, convert::camera_to_c(&CameraDesc::default()), "out") }
    })
}

/// Queues a camera's lens, film back, shutter and clipping planes; everything is copied.
///
/// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT, TRZ_ERROR_NOT_FOUND,
/// TRZ_ERROR_OUT_OF_MEMORY, TRZ_ERROR_POISONED. Threads: any.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trz_camera_set(
    session: *mut trz_session,
    camera: trz_id,
    desc: *const trz_camera,
) -> trz_result {
    // SAFETY: the caller passes null or valid pointers.
    unsafe {
        edit(session, camera, || {
            convert::camera(&input::read(desc, "camera")?).map(|desc| Edit::Camera(Box::new(desc)))
        })
    }
}

/// Queues the transform of a prim, instancer or camera: level_count levels, its own first, then its
/// parent's, up to the root, or to the root of the prototype that it is part of (included); none is the
/// identity. Everything is copied.
///
/// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT (a level without samples),
/// TRZ_ERROR_NOT_FOUND, TRZ_ERROR_OUT_OF_MEMORY, TRZ_ERROR_POISONED. Threads: any.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trz_prim_set_transform(
    session: *mut trz_session,
    prim: trz_id,
    levels: *const trz_transform_samples,
    level_count: usize,
) -> trz_result {
    // SAFETY: the caller passes null or valid pointers.
    unsafe {
        edit(session, prim, || {
            convert::transform(input::slice(levels, level_count, "levels")?).map(Edit::Transform)
        })
    }
}

/// Queues the points of a mesh, of curves or spheres, and their velocities and accelerations;
/// everything is copied. Samples of unequal counts are rendered without motion, with a warning at
/// commit, unless velocities move them; velocities that do not fit are ignored, with a warning.
///
/// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT, TRZ_ERROR_NOT_FOUND,
/// TRZ_ERROR_OUT_OF_MEMORY, TRZ_ERROR_POISONED. Threads: any.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trz_prim_set_points(
    session: *mut trz_session,
    prim: trz_id,
    points: *const trz_points,
) -> trz_result {
    // SAFETY: the caller passes null or valid pointers.
    unsafe {
        edit(session, prim, || {
            convert::points(&input::read(points, "points")?).map(Edit::Points)
        })
    }
}

/// Queues a primvar under its USD name (displayColor, st...), without "primvars:", in place of the
/// one before; NULL removes it. Everything is copied. Only what shading or an AOV asks for takes
/// part in a render. UsdGeomPointBased's own normals have the name normals. An instancer's primvar goes to
/// what its instances place: one value an instance, by its index (vertex, varying, face-varying or
/// uniform; Hydra's instance interpolation is any of them), or one for all. A prim's own primvar of the
/// name wins, then that of the innermost instancer.
///
/// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT, TRZ_ERROR_NOT_FOUND,
/// TRZ_ERROR_OUT_OF_MEMORY, TRZ_ERROR_POISONED. Threads: any.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trz_prim_set_primvar(
    session: *mut trz_session,
    prim: trz_id,
    name: *const c_char,
    primvar: *const trz_primvar,
) -> trz_result {
    // SAFETY: the caller passes null or valid pointers.
    unsafe {
        with_session(session, |session| {
            session.find(PrimId(prim))?;
            let name = input::text(name, "name")?;
            if name.is_empty() {
                return Err(Fault::invalid("a primvar needs a name"));
            }
            if primvar.is_null() {
                let removal = Edit::Primvar(name.to_owned(), None);
                return Ok(session.edit(PrimId(prim), removal)?);
            }
            let primvar = convert::primvar(&input::read(primvar, "primvar")?)?;
            Ok(session.set_primvar(PrimId(prim), name, &primvar)?)
        })
    }
}

/// Queues whether a prim is seen by the camera: 1 (as created) or 0.
///
/// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT, TRZ_ERROR_NOT_FOUND,
/// TRZ_ERROR_POISONED. Threads: any.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trz_prim_set_visible(
    session: *mut trz_session,
    prim: trz_id,
    visible: u32,
) -> trz_result {
    // SAFETY: the caller passes null or a live session.
    unsafe {
        edit(session, prim, || {
            input::flag(visible, "visible").map(Edit::Visible)
        })
    }
}

/// Queues how a prim's motion is blurred. blur_scale (USD's motion:blurScale, 1 as created) is a
/// factor on times relative to the frame for all that moves it: transform levels, instances, points
/// and their velocities, sizes; so 0 is no blur, and the frame's own instant stays where it is.
/// Where it is not 1, samples are needed around blur_scale times the shutter. What is negative or
/// not finite is taken as 1, with a warning at commit. nonlinear_sample_count (USD's
/// motion:nonlinearSampleCount) is the number of positions, evenly spaced over the shutter, where
/// accelerations bend a path; 0, as created: as many as keep within a tenth of a pixel of it.
///
/// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT, TRZ_ERROR_NOT_FOUND,
/// TRZ_ERROR_POISONED. Threads: any.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trz_prim_set_motion(
    session: *mut trz_session,
    prim: trz_id,
    blur_scale: f64,
    nonlinear_sample_count: u32,
) -> trz_result {
    let count = (nonlinear_sample_count != 0).then_some(nonlinear_sample_count);
    // SAFETY: the caller passes null or a live session.
    unsafe { edit(session, prim, || Ok(Edit::Motion(blur_scale, count))) }
}

/// Queues whether both sides of a prim's surface are outsides (USD's doubleSided): 1, or 0 (as
/// created). The AOVs normal and Neye of a double-sided prim are those of the side that is seen, of
/// others those of the front from either side; and see TRZ_CULL_BACK_UNLESS_DOUBLE_SIDED. Colours do not
/// depend on it: both sides are lit.
///
/// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT, TRZ_ERROR_NOT_FOUND,
/// TRZ_ERROR_POISONED. Threads: any.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trz_prim_set_double_sided(
    session: *mut trz_session,
    prim: trz_id,
    double_sided: u32,
) -> trz_result {
    // SAFETY: the caller passes null or a live session.
    unsafe {
        edit(session, prim, || {
            input::flag(double_sided, "double_sided").map(Edit::DoubleSided)
        })
    }
}

/// Queues whether a prim is a matte object (a holdout): 1, or 0 (as created). A matte object hides
/// what lies behind it, with zero colour and zero alpha, and other AOVs stay at their background.
///
/// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT, TRZ_ERROR_NOT_FOUND,
/// TRZ_ERROR_POISONED. Threads: any.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trz_prim_set_matte(
    session: *mut trz_session,
    prim: trz_id,
    matte: u32,
) -> trz_result {
    // SAFETY: the caller passes null or a live session.
    unsafe {
        edit(session, prim, || {
            input::flag(matte, "matte").map(Edit::Matte)
        })
    }
}

/// Queues the number that the primId AOV and ray hits show for a prim; 0 as created.
///
/// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT, TRZ_ERROR_NOT_FOUND,
/// TRZ_ERROR_POISONED. Threads: any.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trz_prim_set_pick_id(
    session: *mut trz_session,
    prim: trz_id,
    prim_id: i32,
) -> trz_result {
    // SAFETY: the caller passes null or a live session.
    unsafe { edit(session, prim, || Ok(Edit::PickId(prim_id))) }
}

/// Tells that all edits of a prim have been queued: it may be translated and diced right away, on the
/// session's threads, while the host goes on with others. A hint that changes nothing but when the work
/// is done; edits that come later are as good as before. Worth it where the active camera and the
/// settings have been queued before, and each prim's edits follow each other.
///
/// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_NOT_FOUND, TRZ_ERROR_OUT_OF_MEMORY, TRZ_ERROR_POISONED.
/// Threads: any.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trz_prim_complete(session: *mut trz_session, prim: trz_id) -> trz_result {
    // SAFETY: the caller passes null or a live session.
    unsafe { with_session(session, |session| Ok(session.complete(PrimId(prim))?)) }
}

/// Queues the removal of a prim or camera. Its id is not found any more from now on.
///
/// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_NOT_FOUND, TRZ_ERROR_POISONED. Threads: any.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trz_prim_remove(session: *mut trz_session, prim: trz_id) -> trz_result {
    // SAFETY: the caller passes null or a live session.
    unsafe { edit(session, prim, || Ok(Edit::Remove)) }
}

/// Queues which camera to render through; 0 for none.
///
/// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT (not a camera), TRZ_ERROR_NOT_FOUND,
/// TRZ_ERROR_POISONED. Threads: any.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trz_session_set_active_camera(
    session: *mut trz_session,
    camera: trz_id,
) -> trz_result {
    // SAFETY: the caller passes null or a live session.
    unsafe {
        with_session(session, |session| {
            Ok(session.set_active_camera((camera != 0).then_some(PrimId(camera)))?)
        })
    }
}
