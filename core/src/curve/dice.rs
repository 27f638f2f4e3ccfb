//! Dices curves: first what each needs, then its grids, both in parallel.

use std::sync::atomic::{AtomicBool, Ordering};

use rayon::prelude::*;

use super::emit::{self, Placing, Taken};
use super::keys::{self, Keys};
use super::layout::{Form, Plan};
use super::rate::{Rater, Rating, normal_at};
use super::set::{CurveSet, Station};
use super::strand::{Section, Strand, carry, face, lie_across, view_of};
use crate::camera::Camera;
use crate::dice::fill::{Frame, Part, Size, fill};
use crate::dice::{DiceError, Eye, RasterMetric};
use crate::grid::DicedMesh;
use crate::motion::PointPath;
use crate::scene::CurveForm;

/// Factor on the shading rate where there are too many micropolygons: cells go with its root.
const COARSER: f32 = 4.0;
/// Times that the rate is made coarser.
const ATTEMPTS: usize = 8;

/// What is diced, and how finely.
pub struct CurveDice<'a> {
    /// The curves, in object space.
    pub set: &'a CurveSet,
    /// From their points' keys to the output keys and the space that is traced.
    pub path: &'a PointPath,
    /// Measures what `path` gives.
    pub metric: &'a RasterMetric,
    /// What ribbons face; none where nothing may depend on where the camera is: then curves without
    /// normals are tubes.
    pub camera: Option<&'a Camera>,
    /// What curves without normals become.
    pub form: CurveForm,
    /// Shading rate, pixels.
    pub shading_rate: f32,
    /// Above this the shading rate is made coarser.
    pub max_micropolygons: u64,
    /// Set from outside to stop early.
    pub cancel: &'a AtomicBool,
}

/// Diced curves and what it took.
pub struct CurveDiced {
    /// The grids.
    pub mesh: DicedMesh,
    /// True where the budget of micropolygons made the rate coarser.
    pub coarsened: bool,
    /// Stations evaluated.
    pub evaluations: u64,
}

#[derive(Default)]
struct Chunk {
    plans: Vec<Plan>,
    stations: Vec<Station>,
    size: Size,
}

/// Dices curves.
///
/// # Errors
/// Cancelled, or too large for memory or 32-bit numbers.
pub fn dice(input: &CurveDice<'_>) -> Result<CurveDiced, DiceError> {
    let eyes = input.camera.map(|c| Eye::at_keys(c, input.path));
    let mut rate = input.shading_rate;
    let mut chunks = Vec::new();
    let mut coarsened = false;
    for attempt in 0..ATTEMPTS {
        let eyes = eyes.clone();
        let rating = Rating::new(input.set, input.path, input.metric, eyes, input.form, rate);
        chunks = plan(&rating, input)?;
        let cells: u64 = chunks.iter().map(|c: &Chunk| c.size.cells).sum();
        if cells <= input.max_micropolygons || attempt + 1 == ATTEMPTS {
            break;
        }
        coarsened = true;
        rate *= COARSER;
    }
    let forms: Vec<(u32, Form)> = chunks
        .iter()
        .flat_map(|c| c.plans.iter().map(|p| (p.span, p.form)))
        .collect();
    let keys = keys::find(input.set, &forms, input.path, input.metric, input.camera);
    let sizes: Vec<Size> = chunks.iter().map(|c| c.size).collect();
    let channels: Vec<usize> = input.set.channels.iter().map(|c| c.width).collect();
    let frame = Frame {
        origin: keys.path.origin(),
        key_times: keys.path.key_times(),
        normal_keys: keys.normals,
        channels: &channels,
    };
    let mesh = fill(&frame, &sizes, |i, part| {
        if !input.cancel.load(Ordering::Relaxed) {
            emit_chunk(input.set, &keys, &chunks[i], part);
        }
    })?;
    if input.cancel.load(Ordering::Relaxed) {
        return Err(DiceError::Cancelled);
    }
    let stations: usize = chunks.iter().map(|c| c.stations.len()).sum();
    Ok(CurveDiced {
        mesh,
        coarsened,
        evaluations: stations as u64,
    })
}

fn plan(rating: &Rating<'_>, input: &CurveDice<'_>) -> Result<Vec<Chunk>, DiceError> {
    let spans = &input.set.curves.spans;
    // Enough to make a thread's buffers worth it, few enough to spread.
    let chunk = (spans.len() / 64).clamp(1, 1024);
    (0..spans.len().div_ceil(chunk))
        .into_par_iter()
        .map_init(
            || Rater::new(rating),
            |rater, c| {
                if input.cancel.load(Ordering::Relaxed) {
                    return Err(DiceError::Cancelled);
                }
                let mut out = Chunk::default();
                let end = ((c + 1) * chunk).min(spans.len());
                for (i, span) in spans[c * chunk..end].iter().enumerate() {
                    let first = out.stations.len();
                    let Some(form) = rater.plan(span, &mut out.stations) else {
                        continue;
                    };
                    form.measure(&out.stations[first..], &mut out.size);
                    out.plans.push(Plan {
                        span: (c * chunk + i) as u32,
                        form,
                        stations: first as u32..out.stations.len() as u32,
                    });
                }
                out.stations.shrink_to_fit();
                Ok(out)
            },
        )
        .collect()
}

fn emit_chunk(set: &CurveSet, keys: &Keys, chunk: &Chunk, part: &mut Part<'_>) {
    let mut strand = Strand::new(set);
    let mut sections: Vec<Section> = Vec::new();
    let (mut radii, mut before) = (Vec::new(), Vec::new());
    let mut values = Vec::new();
    let closed = set.kind().is_periodic();
    for plan in &chunk.plans {
        let span = &set.curves.spans[plan.span as usize];
        let stations = &chunk.stations[plan.stations.start as usize..plan.stations.end as usize];
        let taken = Taken::new(plan.form, stations, span.element, part);
        let ring = match plan.form {
            Form::Tube { sides, .. } => emit::corners(sides),
            Form::Flat | Form::Facing => Vec::new(),
        };
        before.clear();
        set.radii(span, stations, &mut radii);
        for key in 0..keys.path.key_times().len() {
            strand.load(span, &keys.path, key);
            strand.sections(stations, &radii, &mut sections);
            let placing = Placing {
                key,
                matrix: keys.path.matrix(key),
                normal_matrix: keys.path.normal_matrix(key),
                origin: keys.path.origin(),
            };
            match (plan.form, &keys.eyes) {
                (Form::Facing, Some(eyes)) => {
                    let to_eye = view_of(&keys.path, key, eyes[key]);
                    face(&mut sections, &placing.matrix.matrix3, &to_eye, &mut before);
                    emit::ribbon(&placing, &taken, stations, &sections, Some(&to_eye), part);
                }
                (Form::Flat | Form::Facing, _) => {
                    lie_across(&mut sections, |i| normal_at(set, span, &stations[i]));
                    if closed {
                        let last = sections.len() - 1;
                        sections[last] = sections[0];
                    }
                    emit::ribbon(&placing, &taken, stations, &sections, None, part);
                }
                (Form::Tube { .. }, _) => {
                    carry(&mut sections, closed, &mut before);
                    emit::tube(
                        &placing, &taken, plan.form, stations, &sections, &ring, part,
                    );
                }
            }
        }
        for (c, channel) in set.channels.iter().enumerate() {
            values.clear();
            for station in stations {
                values.extend(
                    (0..channel.width)
                        .map(|component| set.channel_value(channel, component, span, station)),
                );
            }
            emit::channel(&taken, plan.form, stations, c, &values, part);
        }
    }
}
