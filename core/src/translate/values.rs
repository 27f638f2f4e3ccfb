//! Primvars of curves and spheres: values that are counted a prim, an element, a segment end or a
//! point.

use crate::diagnostics::{Code, Warning};
use crate::scene::{Interpolation, PrimvarDesc};

/// How many values each interpolation has on a prim.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Counts {
    /// Elements: curves.
    pub uniform: usize,
    /// Segment ends ([`crate::curve::CurveKind::varying_values`]), or points of spheres.
    pub varying: usize,
    /// Points.
    pub vertex: usize,
}

/// A primvar's values, indices resolved, over the authored prim.
#[derive(Clone, Debug, PartialEq)]
pub enum Values {
    /// One value.
    Constant(Vec<f32>),
    /// One an element.
    Uniform(Vec<f32>),
    /// One a segment end, linear over segments.
    Varying(Vec<f32>),
    /// One a point, blended as the points are.
    Vertex(Vec<f32>),
}

impl Values {
    /// All floats.
    pub fn floats(&self) -> &[f32] {
        match self {
            Values::Constant(v) | Values::Uniform(v) | Values::Varying(v) | Values::Vertex(v) => v,
        }
    }

    /// All floats, to repair them.
    pub fn floats_mut(&mut self) -> &mut [f32] {
        match self {
            Values::Constant(v) | Values::Uniform(v) | Values::Varying(v) | Values::Vertex(v) => v,
        }
    }

    /// True where values differ along a curve.
    pub fn is_along(&self) -> bool {
        matches!(self, Values::Varying(_) | Values::Vertex(_))
    }
}

/// Resolves `primvar`, whose values must have `width` floats. What does not fit is left out with a
/// warning. A single value serves every interpolation; face-varying values are varying ones here.
/// Floats may still be not finite.
pub fn resolve(
    path: &str,
    name: &str,
    primvar: &PrimvarDesc,
    width: usize,
    counts: &Counts,
    warnings: &mut Vec<Warning>,
) -> Option<Values> {
    let mut refuse = |text: String| {
        let text = format!("primvar {name} {text}; it is ignored");
        warnings.push(Warning::new(path, Code::PrimvarLength, text));
        None
    };
    if primvar.width != width {
        return refuse(format!(
            "has {} floats a value where {width} are needed",
            primvar.width
        ));
    }
    let (values, indices) = primvar.floats_at_frame()?;
    let value_count = values.len() / width;
    if value_count == 0 {
        return None;
    }
    let out_of_range = |&i: &i32| usize::try_from(i).map_or(true, |i| i >= value_count);
    if indices.iter().any(out_of_range) {
        return refuse(format!("has indices outside its {value_count} values"));
    }
    let indexed = !indices.is_empty();
    let count = if indexed { indices.len() } else { value_count };
    let gather = |count: usize| -> Vec<f32> {
        if !indexed {
            return values[..count * width].to_vec();
        }
        let value = |&i: &i32| values[i as usize * width..][..width].iter().copied();
        indices[..count].iter().flat_map(value).collect()
    };
    let (expected, what) = match primvar.interpolation {
        _ if count == 1 => return Some(Values::Constant(gather(1))),
        Interpolation::Constant => return Some(Values::Constant(gather(1))),
        Interpolation::Uniform => (counts.uniform, "elements"),
        Interpolation::Varying | Interpolation::FaceVarying => (counts.varying, "varying values"),
        Interpolation::Vertex => (counts.vertex, "points"),
    };
    if count != expected {
        return refuse(format!(
            "has {count} values where its prim has {expected} {what}"
        ));
    }
    let values = gather(count);
    Some(match primvar.interpolation {
        Interpolation::Uniform => Values::Uniform(values),
        Interpolation::Vertex => Values::Vertex(values),
        _ => Values::Varying(values),
    })
}

/// As [`resolve`], and refused where a value is not finite.
pub fn resolve_finite(
    path: &str,
    name: &str,
    primvar: &PrimvarDesc,
    width: usize,
    counts: &Counts,
    warnings: &mut Vec<Warning>,
) -> Option<Values> {
    let values = resolve(path, name, primvar, width, counts, warnings)?;
    if values.floats().iter().all(|x| x.is_finite()) {
        return Some(values);
    }
    let text = format!("primvar {name} has values that are not finite; it is ignored");
    warnings.push(Warning::new(path, Code::NotFinite, text));
    None
}

/// Diameters, from the primvar `widths`: 1 where there is none. Negative ones, and what is no number,
/// become 0 with a warning; where their number does not fit, the first serves all over.
pub fn resolve_widths(
    path: &str,
    primvar: Option<&PrimvarDesc>,
    counts: &Counts,
    warnings: &mut Vec<Warning>,
) -> Values {
    let Some(primvar) = primvar else {
        return Values::Constant(vec![1.0]);
    };
    let before = warnings.len();
    let mut values = resolve(path, "widths", primvar, 1, counts, warnings).unwrap_or_else(|| {
        let first = primvar
            .floats_at_frame()
            .and_then(|(v, _)| v.first().copied());
        let first = first.filter(|w| primvar.width == 1 && *w >= 0.0);
        if let (Some(first), Some(warning)) = (first, warnings.get_mut(before)) {
            let kept = warning.text.trim_end_matches("it is ignored");
            warning.text = format!("{kept}its first value, {first}, is used all over");
        }
        Values::Constant(vec![first.unwrap_or(1.0)])
    });
    let floats = values.floats_mut();
    let sound = |w: &f32| (0.0..LARGEST_WIDTH).contains(w);
    let lost = floats.iter().filter(|w| !sound(w)).count();
    if lost > 0 {
        let text = format!(
            "{lost} of {} widths are negative, not finite or above {LARGEST_WIDTH:e}; they become 0",
            floats.len()
        );
        warnings.push(Warning::new(path, Code::NotFinite, text));
        for w in floats.iter_mut().filter(|w| !sound(w)) {
            *w = 0.0;
        }
    }
    values
}

/// Widths from here on are not usable: as coordinates.
const LARGEST_WIDTH: f32 = crate::motion::rates::LARGEST_COORDINATE;

#[cfg(test)]
mod tests {
    use super::*;

    const COUNTS: Counts = Counts {
        uniform: 3,
        varying: 7,
        vertex: 12,
    };

    fn primvar(interpolation: Interpolation, values: Vec<f32>, indices: Vec<i32>) -> PrimvarDesc {
        PrimvarDesc::still(interpolation, 1, values, indices)
    }

    fn run(p: &PrimvarDesc) -> (Option<Values>, Vec<Warning>) {
        let mut warnings = Vec::new();
        let out = resolve_finite("/c", "displayOpacity", p, 1, &COUNTS, &mut warnings);
        (out, warnings)
    }

    #[test]
    fn lengths_follow_the_interpolation() {
        for (interpolation, n) in [
            (Interpolation::Uniform, 3),
            (Interpolation::Varying, 7),
            (Interpolation::FaceVarying, 7),
            (Interpolation::Vertex, 12),
        ] {
            let numbers = |n: usize| (0..n).map(|i| i as f32).collect::<Vec<f32>>();
            let (out, warnings) = run(&primvar(interpolation, numbers(n), vec![]));
            assert_eq!(out.unwrap().floats(), numbers(n));
            assert!(warnings.is_empty());
            for wrong in [n - 1, n + 1] {
                let (out, warnings) = run(&primvar(interpolation, numbers(wrong), vec![]));
                assert!(out.is_none() && warnings.len() == 1, "{interpolation:?}");
            }
            let (out, _) = run(&primvar(interpolation, vec![0.5], vec![]));
            assert_eq!(out, Some(Values::Constant(vec![0.5])));
        }
    }

    #[test]
    fn indices_are_resolved_and_checked() {
        let (out, _) = run(&primvar(
            Interpolation::Uniform,
            vec![1.0, 2.0],
            vec![1, 0, 1],
        ));
        assert_eq!(out, Some(Values::Uniform(vec![2.0, 1.0, 2.0])));
        for bad in [vec![0, 2, 1], vec![0, -1, 1]] {
            let (out, warnings) = run(&primvar(Interpolation::Uniform, vec![1.0, 2.0], bad));
            assert!(out.is_none() && warnings.len() == 1);
        }
        let (out, warnings) = run(&primvar(Interpolation::Constant, vec![f32::NAN], vec![]));
        assert!(out.is_none() && warnings[0].code == Code::NotFinite);
        let (out, warnings) = run(&primvar(Interpolation::Constant, vec![], vec![]));
        assert!(out.is_none() && warnings.is_empty());
    }

    #[test]
    fn widths_are_repaired() {
        let run = |p: Option<&PrimvarDesc>| {
            let mut warnings = Vec::new();
            let out = resolve_widths("/c", p, &COUNTS, &mut warnings);
            (out, warnings)
        };
        assert_eq!(run(None), (Values::Constant(vec![1.0]), vec![]));
        let bad = vec![0.5, -1.0, f32::NAN];
        let (out, warnings) = run(Some(&primvar(Interpolation::Uniform, bad, vec![])));
        assert_eq!(out, Values::Uniform(vec![0.5, 0.0, 0.0]));
        assert_eq!(warnings.len(), 1);
        let short = primvar(Interpolation::Vertex, vec![0.25, 0.5], vec![]);
        let (out, warnings) = run(Some(&short));
        assert_eq!(out, Values::Constant(vec![0.25]));
        assert_eq!(warnings.len(), 1);
        assert!(warnings[0].text.contains("0.25"), "{}", warnings[0].text);
    }
}
