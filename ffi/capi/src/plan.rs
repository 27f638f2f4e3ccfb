//! What is made of render products, for hosts that render and write them by themselves: `trz_plan_*`.

use std::ffi::{CString, c_char};
use std::ptr::null;

use hdtrapeze_core::scene::RenderSettings;
use hdtrapeze_delegate::plan::{self, Plan, data_window};
use hdtrapeze_delegate::render_loop::Job;

use crate::constants::*;
use crate::fault::{Fault, call, with_session};
use crate::session::c_string;
use crate::types::*;
use crate::{convert, input};

/// What becomes of one file.
pub(crate) struct PlannedFile {
    result: trz_result,
    why: CString,
    path: CString,
    render: u32,
    settings: trz_settings,
    /// Pointers to the names.
    aovs: Vec<*const c_char>,
    _names: Vec<CString>,
}

impl PlannedFile {
    fn new(jobs: &[Job], at: Result<usize, Fault>, path: &str) -> Self {
        let (why, job) = match at {
            Ok(job) => (None, job),
            Err(why) => (Some(why), 0),
        };
        let settings = match why {
            None => jobs[job].view.settings.clone(),
            Some(_) => RenderSettings::default(),
        };
        let names: Vec<_> = settings.aovs.iter().map(|name| c_string(name)).collect();
        let mut in_c = convert::settings_to_c(&settings);
        in_c.struct_size = size_of::<trz_settings>() as u32;
        Self {
            result: why.as_ref().map_or(TRZ_OK, Fault::code),
            why: c_string(why.as_ref().map_or("", Fault::message)),
            path: c_string(path),
            render: job as u32,
            settings: in_c,
            aovs: names.iter().map(|name| name.as_ptr()).collect(),
            _names: names,
        }
    }

    fn to_c(&self) -> trz_planned {
        let is_written = self.result == TRZ_OK;
        trz_planned {
            struct_size: 0,
            result: self.result,
            why: self.why.as_ptr(),
            path: if is_written {
                self.path.as_ptr()
            } else {
                null()
            },
            render: self.render,
            aov_count: if is_written {
                self.aovs.len() as u32
            } else {
                0
            },
            aovs: if is_written {
                self.aovs.as_ptr()
            } else {
                null()
            },
            settings: if is_written {
                &raw const self.settings
            } else {
                null()
            },
        }
    }
}

fn files(plan: &Plan) -> Vec<PlannedFile> {
    let jobs = &plan.jobs;
    let mut files: Vec<_> = plan
        .products
        .iter()
        .map(|planned| match planned {
            Ok(at) => {
                let path = jobs[at.job].files[at.file].path.to_string_lossy();
                PlannedFile::new(jobs, Ok(at.job), &path)
            }
            Err(why) => PlannedFile::new(jobs, Err(why.clone().into()), ""),
        })
        .collect();
    let own = plan.own.clone().map(|()| jobs.len() - 1);
    files.push(PlannedFile::new(jobs, own.map_err(Fault::from), ""));
    files
}

/// Says what trz_view_render would make of a view and its products, for a host that renders and writes
/// each by itself: which share a render, where they are written, and which cannot be, of which one warning
/// tells. Renders are numbered in the order in which trz_view_render makes them. The caller gives the plan
/// back to trz_plan_destroy. No edit and no render of the session is changed; it remembers the files, so
/// that a plan of another frame tells where that would replace them.
///
/// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT, TRZ_ERROR_OUT_OF_MEMORY,
/// TRZ_ERROR_POISONED. Threads: any.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trz_plan_create(
    session: *mut trz_session,
    view: *const trz_view,
    products: *const *const trz_product,
    product_count: usize,
    out: *mut *mut trz_plan,
) -> trz_result {
    // SAFETY: the caller passes null or valid pointers.
    unsafe {
        with_session(session, |session| {
            let products = input::slice(products, product_count, "products")?;
            let request = convert::request(session, &input::read(view, "view")?, products)?;
            let out = input::place(out, "out")?;
            let files = files(&session.plan(&request));
            *out = Box::into_raw(Box::new(trz_plan { files }));
            Ok(())
        })
    }
}

/// Fills out, whose struct_size the caller has set, with what becomes of a product, by its place in the
/// array of trz_plan_create; the number after the last is the host's own image.
///
/// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT (struct_size), TRZ_ERROR_NOT_FOUND.
/// Threads: any.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trz_plan_describe(
    plan: *const trz_plan,
    product: usize,
    out: *mut trz_planned,
) -> trz_result {
    call(|| {
        // SAFETY: the caller passes null or a live plan.
        let plan = unsafe { plan.as_ref() }.ok_or_else(|| Fault::null("plan"))?;
        let file = plan.files.get(product).ok_or_else(|| {
            let text = format!("the plan has {} products", plan.files.len() - 1);
            Fault::new(TRZ_ERROR_NOT_FOUND, text)
        })?;
        // SAFETY: the caller passes null or a struct of the size it tells.
        unsafe { input::write(out, file.to_c(), "out") }
    })
}

/// Frees a plan. NULL is ignored.
///
/// Errors: none. Threads: any, but no other call on the plan may be running or follow.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trz_plan_destroy(plan: *mut trz_plan) {
    if plan.is_null() {
        return;
    }
    call(|| {
        // SAFETY: the caller passes a plan of trz_plan_create, once, with no call running.
        drop(unsafe { Box::from_raw(plan) });
        Ok(())
    });
}

/// The pixels of a dataWindowNDC (xmin, ymin, xmax, ymax, y up; 0 0 1 1 is the image), as
/// trz_settings.data_window has them: those whose centres are inside. All 0 for the image.
///
/// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT (the size is not 1 to 65536 pixels, the
/// window cannot be), TRZ_ERROR_NOT_FOUND (it holds no pixel, or more than 65536 across or down).
/// Threads: any.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trz_data_window(
    ndc: *const f32,
    width: u32,
    height: u32,
    out: *mut i32,
) -> trz_result {
    call(|| {
        // SAFETY: the caller passes null, or pointers to four numbers.
        let (ndc, out) = unsafe {
            (
                input::slice(ndc, 4, "ndc")?,
                input::place(out.cast::<[i32; 4]>(), "out")?,
            )
        };
        let ndc = [ndc[0], ndc[1], ndc[2], ndc[3]];
        let size = [width, height].map(|size| i32::try_from(size).unwrap_or_default());
        plan::check(size, ndc).map_err(Fault::invalid)?;
        let window = data_window(ndc, size);
        *out = window
            .map_err(|why| Fault::new(TRZ_ERROR_NOT_FOUND, why))?
            .unwrap_or_default();
        Ok(())
    })
}
