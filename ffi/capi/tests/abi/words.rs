//! USD's words.

use std::ffi::CString;

use crate::support::last_error;
use hdtrapeze::*;

fn word(attribute: &str, word: &str) -> (trz_result, u32) {
    let [attribute, word] = [attribute, word].map(|text| CString::new(text).unwrap());
    let mut out = u32::MAX;
    // SAFETY: pointers to live values.
    let result = unsafe { trz_word(attribute.as_ptr(), word.as_ptr(), &mut out) };
    (result, out)
}

#[test]
fn words_stand_for_constants() {
    assert_eq!(word("subdivisionScheme", "loop"), (TRZ_OK, TRZ_SCHEME_LOOP));
    assert_eq!(
        word("interpolateBoundary", "none"),
        (TRZ_OK, TRZ_BOUNDARY_NONE)
    );
    assert_eq!(word("orientation", "leftHanded"), (TRZ_OK, 1));
    assert_eq!(word("axis", "X"), (TRZ_OK, TRZ_AXIS_X));
    assert_eq!(word("basis", "hermite"), (TRZ_OK, TRZ_BASIS_HERMITE));
    assert_eq!(word("trapeze:curves", "tubes"), (TRZ_OK, TRZ_CURVES_TUBES));
}

#[test]
fn without_a_known_word_it_is_the_fallback() {
    for (attribute, fallback) in [
        ("subdivisionScheme", TRZ_SCHEME_CATMULL_CLARK),
        ("interpolateBoundary", TRZ_BOUNDARY_EDGE_AND_CORNER),
        ("faceVaryingLinearInterpolation", TRZ_FVAR_CORNERS_PLUS1),
        ("triangleSubdivisionRule", TRZ_TRIANGLES_CATMULL_CLARK),
        ("orientation", TRZ_ORIENTATION_RIGHT_HANDED),
        ("basis", TRZ_BASIS_BEZIER),
        ("wrap", TRZ_WRAP_NONPERIODIC),
        ("axis", TRZ_AXIS_Z),
        ("trapeze:curves", TRZ_CURVES_DEFAULT),
    ] {
        assert_eq!(word(attribute, ""), (TRZ_OK, fallback), "{attribute}");
        let unknown = word(attribute, "nothing");
        assert_eq!(unknown, (TRZ_ERROR_NOT_FOUND, fallback), "{attribute}");
    }
    for (attribute, told) in [
        (
            "axis",
            "axis is 'nothing', which is none of X, Y, Z; Z is used",
        ),
        (
            "trapeze:curves",
            "primvars:trapeze:curves is 'nothing', which is none of auto, ribbons, tubes; it is ignored",
        ),
    ] {
        word(attribute, "nothing");
        assert_eq!(last_error(), told);
    }
    assert_eq!(word("colour", "red").0, TRZ_ERROR_INVALID_ARGUMENT);
}
