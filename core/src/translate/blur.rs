//! How far the blur of a prim's motion is scaled (UsdGeomMotionAPI's motion:blurScale).

use crate::diagnostics::{Code, Warning};
use crate::motion::Shutter;

/// The shutter that a prim's samples are resolved to: [`Shutter::scaled`] by its blur scale. A scale
/// that is negative or not finite is taken as 1, with a warning.
pub fn prim_shutter(
    path: &str,
    blur_scale: f64,
    shutter: Shutter,
    warnings: &mut Vec<Warning>,
) -> Shutter {
    let scaled = shutter.scaled(blur_scale);
    if blur_scale >= 0.0 && (scaled.close - scaled.open).is_finite() {
        return scaled;
    }
    let (code, what) = match blur_scale < 0.0 {
        true => (Code::Unsupported, "negative"),
        false => (Code::NotFinite, "not finite"),
    };
    let text = format!("its motion blur scale {blur_scale} is {what}; it is taken as 1");
    warnings.push(Warning::new(path, code, text));
    shutter
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_keep_their_distance_from_the_frame_in_proportion() {
        let scaled = |scale: f64| {
            let shutter = Shutter {
                open: -0.25,
                close: 1.75,
            };
            let mut warnings = Vec::new();
            let Shutter { open, close } = prim_shutter("/p", scale, shutter, &mut warnings);
            (open, close, warnings.len())
        };
        assert_eq!(scaled(1.0), (-0.25, 1.75, 0));
        assert_eq!(scaled(2.0), (-0.5, 3.5, 0));
        assert_eq!(scaled(0.0), (0.0, 0.0, 0));
        for wrong in [
            -1.0,
            f64::NAN,
            f64::INFINITY,
            f64::NEG_INFINITY,
            f64::MAX * 0.9,
        ] {
            let (open, close, warnings) = scaled(wrong);
            assert_eq!((open, close), (-0.25, 1.75), "{wrong}");
            assert_eq!(warnings, 1, "{wrong}");
        }
    }
}
