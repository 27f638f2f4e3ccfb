//! USD's words, as the constants that they stand for.

use std::ffi::c_char;

use crate::constants::*;
use crate::fault::{Fault, call};
use crate::input;
use crate::types::*;

/// An attribute, USD's fallback, and the words that there are.
type Words = (&'static str, u32, &'static [(&'static str, u32)]);

const WORDS: [Words; 9] = [
    (
        "subdivisionScheme",
        TRZ_SCHEME_CATMULL_CLARK,
        &[
            ("catmullClark", TRZ_SCHEME_CATMULL_CLARK),
            ("loop", TRZ_SCHEME_LOOP),
            ("bilinear", TRZ_SCHEME_BILINEAR),
            ("none", TRZ_SCHEME_NONE),
        ],
    ),
    (
        "interpolateBoundary",
        TRZ_BOUNDARY_EDGE_AND_CORNER,
        &[
            ("none", TRZ_BOUNDARY_NONE),
            ("edgeOnly", TRZ_BOUNDARY_EDGE_ONLY),
            ("edgeAndCorner", TRZ_BOUNDARY_EDGE_AND_CORNER),
        ],
    ),
    (
        "faceVaryingLinearInterpolation",
        TRZ_FVAR_CORNERS_PLUS1,
        &[
            ("none", TRZ_FVAR_NONE),
            ("cornersOnly", TRZ_FVAR_CORNERS_ONLY),
            ("cornersPlus1", TRZ_FVAR_CORNERS_PLUS1),
            ("cornersPlus2", TRZ_FVAR_CORNERS_PLUS2),
            ("boundaries", TRZ_FVAR_BOUNDARIES),
            ("all", TRZ_FVAR_ALL),
        ],
    ),
    (
        "triangleSubdivisionRule",
        TRZ_TRIANGLES_CATMULL_CLARK,
        &[
            ("catmullClark", TRZ_TRIANGLES_CATMULL_CLARK),
            ("smooth", TRZ_TRIANGLES_SMOOTH),
        ],
    ),
    (
        "orientation",
        TRZ_ORIENTATION_RIGHT_HANDED,
        &[
            ("rightHanded", TRZ_ORIENTATION_RIGHT_HANDED),
            ("leftHanded", TRZ_ORIENTATION_LEFT_HANDED),
        ],
    ),
    (
        "basis",
        TRZ_BASIS_BEZIER,
        &[
            ("bezier", TRZ_BASIS_BEZIER),
            ("bspline", TRZ_BASIS_BSPLINE),
            ("catmullRom", TRZ_BASIS_CATMULL_ROM),
            ("hermite", TRZ_BASIS_HERMITE),
        ],
    ),
    (
        "wrap",
        TRZ_WRAP_NONPERIODIC,
        &[
            ("nonperiodic", TRZ_WRAP_NONPERIODIC),
            ("periodic", TRZ_WRAP_PERIODIC),
            ("pinned", TRZ_WRAP_PINNED),
        ],
    ),
    (
        "axis",
        TRZ_AXIS_Z,
        &[("X", TRZ_AXIS_X), ("Y", TRZ_AXIS_Y), ("Z", TRZ_AXIS_Z)],
    ),
    (
        "trapeze:curves",
        TRZ_CURVES_DEFAULT,
        &[
            ("auto", TRZ_CURVES_AUTO),
            ("ribbons", TRZ_CURVES_RIBBONS),
            ("tubes", TRZ_CURVES_TUBES),
        ],
    ),
];

/// The constant that a word stands for as the value of an attribute, by their names in USD. An empty word
/// is USD's fallback; so is one that is not known, which is TRZ_ERROR_NOT_FOUND, with out written: then
/// the last error is a sentence for users.
/// Attributes: subdivisionScheme, interpolateBoundary, faceVaryingLinearInterpolation,
/// triangleSubdivisionRule, orientation, basis, wrap, axis and trapeze:curves.
///
/// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT (attribute), TRZ_ERROR_NOT_FOUND (word).
/// Threads: any.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trz_word(
    attribute: *const c_char,
    word: *const c_char,
    out: *mut u32,
) -> trz_result {
    // SAFETY: the caller passes null or valid pointers.
    unsafe {
        call(|| {
            let (attribute, word) = (
                input::text(attribute, "attribute")?,
                input::text(word, "word")?,
            );
            let out = input::place(out, "out")?;
            let Some((_, fallback, words)) = WORDS.iter().find(|of| of.0 == attribute) else {
                return Err(Fault::invalid(format!(
                    "{attribute} is no attribute of words"
                )));
            };
            let found = words.iter().find(|known| known.0 == word);
            *out = found.map_or(*fallback, |known| known.1);
            match found.is_some() || word.is_empty() {
                true => Ok(()),
                false => Err(Fault::new(
                    TRZ_ERROR_NOT_FOUND,
                    unknown(attribute, word, *fallback, words),
                )),
            }
        })
    }
}

/// What there is to say of a word that is not known.
fn unknown(attribute: &str, word: &str, fallback: u32, words: &[(&str, u32)]) -> String {
    let known: Vec<&str> = words.iter().map(|known| known.0).collect();
    let known = known.join(", ");
    // USD's attributes are never without a value; primvars of this renderer may be.
    match words.iter().find(|known| known.1 == fallback) {
        Some((used, _)) => {
            format!("{attribute} is '{word}', which is none of {known}; {used} is used")
        }
        None => {
            format!("primvars:{attribute} is '{word}', which is none of {known}; it is ignored")
        }
    }
}
