use std::sync::Arc;

use super::*;
use crate::scene::{PrimvarSample, PrimvarValues};
use crate::surface::{ChannelKind, MeshTopology};
use crate::translate::mesh::CheckedMesh;
use crate::translate::points::PointKeys;

/// Two quads of three authored ones: face 1 was dropped.
fn mesh() -> CheckedMesh {
    CheckedMesh {
        topology: MeshTopology {
            vertex_count: 6,
            face_vertex_counts: vec![4, 4],
            face_vertex_indices: vec![0, 1, 4, 3, 1, 2, 5, 4],
            ..MeshTopology::default()
        },
        elements: vec![0, 2],
        face_vertices: vec![0, 1, 2, 3, 8, 9, 10, 11],
        authored_faces: 3,
        authored_face_vertices: 12,
        points: PointKeys {
            times: vec![0.0],
            points: Vec::new(),
        },
    }
}

const SHUTTER: Shutter = Shutter {
    open: 0.0,
    close: 1.0,
};

fn still(interpolation: Interpolation, values: Vec<f32>, indices: Vec<i32>) -> PrimvarDesc {
    PrimvarDesc::still(interpolation, 1, values, indices)
}

fn sampled(
    interpolation: Interpolation,
    samples: Vec<(f64, PrimvarValues, Vec<i32>)>,
) -> PrimvarDesc {
    let samples = samples
        .into_iter()
        .map(|(time, values, indices)| PrimvarSample {
            time,
            values: Arc::new(values),
            indices: Arc::new(indices),
        });
    PrimvarDesc {
        samples: samples.collect(),
        ..still(interpolation, vec![], vec![])
    }
}

fn run(primvar: &PrimvarDesc) -> (Option<Resolved>, Vec<Warning>) {
    let mut warnings = Vec::new();
    let counts = mesh().primvar_counts();
    let out = resolve("/m", "x", primvar, &counts, SHUTTER, &mut warnings);
    (out, warnings)
}

fn numbers(n: usize) -> Vec<f32> {
    (0..n).map(|i| i as f32).collect()
}

use Interpolation::{Constant, FaceVarying, Uniform, Varying, Vertex};
use PrimvarValues::{Float, Int};

#[test]
fn lengths_are_those_of_the_authored_mesh() {
    for (interpolation, n) in [(Uniform, 3), (Varying, 6), (Vertex, 6), (FaceVarying, 12)] {
        let (out, warnings) = run(&still(interpolation, numbers(n), vec![]));
        assert!(out.is_some() && warnings.is_empty(), "{interpolation:?}");
        let (out, warnings) = run(&still(interpolation, numbers(n + 1), vec![]));
        assert!(out.is_none() && warnings.len() == 1, "{interpolation:?}");
        let (out, _) = run(&still(interpolation, vec![0.5], vec![]));
        let out = out.unwrap();
        assert_eq!((out.interpolation, out.item(0)), (Constant, &[0.5][..]));
    }
}

#[test]
fn face_varying_follows_the_kept_faces_and_joins_equal_values() {
    let mut values = numbers(12);
    values[8] = values[1]; // vertex 1, seen from both kept faces
    let (out, _) = run(&still(FaceVarying, values, vec![]));
    let Spread::Channel(channel) = mesh().spread(out.unwrap()) else {
        panic!()
    };
    assert_eq!(channel.indices, [0, 1, 2, 3, 1, 4, 5, 6]);
    assert_eq!(channel.values, [0.0, 1.0, 2.0, 3.0, 9.0, 10.0, 11.0]);
}

#[test]
fn bad_input_is_refused_with_one_warning() {
    let nan = vec![f32::NAN];
    let wide = |width, element_size| PrimvarDesc {
        width,
        element_size,
        ..still(Constant, numbers(4), vec![])
    };
    for (primvar, code) in [
        (
            still(Uniform, vec![1.0], vec![0, 0, -1]),
            Code::PrimvarLength,
        ),
        (
            still(Uniform, vec![1.0], vec![0, 0, 1]),
            Code::PrimvarLength,
        ),
        (still(Constant, nan, vec![]), Code::NotFinite),
        (wide(0, 1), Code::PrimvarLength),
        (wide(2, 0), Code::PrimvarLength),
        (wide(2, -3), Code::PrimvarLength),
        (wide(3, 1), Code::PrimvarLength),
        (wide(2, 9), Code::PrimvarLength),
        (wide(usize::MAX, i32::MAX), Code::PrimvarLength),
    ] {
        let (out, warnings) = run(&primvar);
        assert!(out.is_none(), "{primvar:?}");
        assert_eq!(warnings.len(), 1, "{warnings:?}");
        assert_eq!(warnings[0].code, code, "{warnings:?}");
        assert!(warnings[0].text.starts_with("primvar x "), "{warnings:?}");
    }
    let (out, warnings) = run(&still(Constant, vec![], vec![]));
    assert!(out.is_none() && warnings.is_empty(), "nothing was authored");
}

#[test]
fn many_values_of_a_constant_are_told() {
    let (out, warnings) = run(&still(Constant, vec![3.0, 4.0, 5.0], vec![]));
    assert_eq!(out.unwrap().item(0), &[3.0]);
    assert_eq!(warnings.len(), 1, "{warnings:?}");
    assert!(warnings[0].text.contains("3 values"), "{warnings:?}");
    let (_, warnings) = run(&still(Constant, vec![3.0], vec![]));
    assert!(warnings.is_empty(), "{warnings:?}");
}

#[test]
fn elements_of_several_numbers_and_values_that_were_not_authored() {
    let primvar = PrimvarDesc {
        width: 2,
        element_size: 2,
        unauthored_index: 7,
        ..still(Uniform, numbers(8), vec![1, 7, 0])
    };
    let (out, warnings) = run(&primvar);
    assert!(warnings.is_empty(), "{warnings:?}");
    let out = out.unwrap();
    assert_eq!(out.lanes(), 4);
    let items = [4.0, 5.0, 6.0, 7.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 2.0, 3.0];
    assert_eq!(out.into_items(), items);
    // A value for what was not authored is a value.
    let primvar = PrimvarDesc {
        unauthored_index: 1,
        ..still(Uniform, vec![3.0, 9.0], vec![0, 1, 0])
    };
    assert_eq!(run(&primvar).0.unwrap().into_items(), [3.0, 9.0, 3.0]);
}

#[test]
fn samples_become_keys_in_the_shutter() {
    let at = |time: f64, v: f32| (time, Float(vec![v; 6]), vec![]);
    let (out, _) = run(&sampled(
        Vertex,
        vec![at(2.0, 4.0), at(-2.0, 0.0), at(0.5, 3.0)],
    ));
    let out = out.unwrap();
    assert_eq!(out.key_times, [0.0, 0.5, 1.0]);
    // A fifth of the way from -2 to 0.5 is left at 0; a third of that to 2 is gone at 1.
    let value = out.item(5);
    assert!((value[0] - 2.4).abs() < 1e-6 && value[1] == 3.0);
    assert!((value[2] - 10.0 / 3.0).abs() < 1e-6);
    let Spread::Channel(channel) = mesh().spread(out) else {
        panic!()
    };
    assert_eq!((channel.width, channel.values.len()), (3, 18));

    let (out, _) = run(&sampled(Vertex, vec![at(0.0, 4.0), at(1.0, 4.0)]));
    assert_eq!(
        out.unwrap(),
        run(&still(Vertex, vec![4.0; 6], vec![])).0.unwrap()
    );
}

#[test]
fn a_sample_that_does_not_fit_is_left_out() {
    let mut samples = vec![
        (0.0, Float(numbers(3)), vec![]),
        (0.5, Float(numbers(4)), vec![]),
        (0.75, Float(vec![f32::INFINITY; 3]), vec![]),
        (1.0, Float(vec![8.0; 3]), vec![]),
    ];
    let (out, warnings) = run(&sampled(Uniform, samples.clone()));
    assert_eq!(out.unwrap().key_times, [0.0, 1.0]);
    assert_eq!(warnings.len(), 1);
    assert!(warnings[0].text.contains("2 samples"), "{warnings:?}");
    samples.drain(..1);
    samples.pop();
    let (out, warnings) = run(&sampled(Uniform, samples));
    assert!(out.is_none() && warnings.len() == 1, "{warnings:?}");
    // One value at one time, one a face at the next.
    let (out, warnings) = run(&sampled(
        Uniform,
        vec![
            (0.0, Float(vec![1.0]), vec![]),
            (1.0, Float(numbers(3)), vec![]),
        ],
    ));
    assert!(warnings.is_empty(), "{warnings:?}");
    assert_eq!(out.unwrap().into_items(), [1.0, 0.0, 1.0, 1.0, 1.0, 2.0]);
    let never = vec![(f64::NAN, Float(numbers(3)), vec![]); 2];
    let (out, warnings) = run(&sampled(Uniform, never));
    assert!(out.is_none() && warnings[0].code == Code::TimeSamples);
}

#[test]
fn indices_that_stay_are_kept_and_others_spelled_out() {
    let same: Vec<i32> = (0..12).map(|i| i % 4).collect();
    let at = |time, indices: &[i32]| (time, Float(numbers(4)), indices.to_vec());
    let mut later = at(1.0, &same);
    later.1 = Float(vec![9.0; 4]);
    let (out, _) = run(&sampled(FaceVarying, vec![at(0.0, &same), later]));
    let out = out.unwrap();
    assert_eq!(out.values, [0.0, 9.0, 1.0, 9.0, 2.0, 9.0, 3.0, 9.0]);
    assert_eq!(out.indices.len(), 12);

    let other: Vec<i32> = (0..12).map(|i| i % 2).collect();
    let (out, _) = run(&sampled(FaceVarying, vec![at(0.0, &same), at(1.0, &other)]));
    let out = out.unwrap();
    assert_eq!(out.values, [0.0, 0.0, 1.0, 1.0, 2.0, 0.0, 3.0, 1.0]);
    assert_eq!(out.item(7), [3.0, 1.0]);
    let back: Vec<i32> = (0..3).rev().collect();
    let (out, _) = run(&sampled(Uniform, vec![at(0.0, &[0, 1, 2]), at(1.0, &back)]));
    assert_eq!(out.unwrap().into_items(), [0.0, 2.0, 1.0, 1.0, 2.0, 0.0]);
}

#[test]
fn whole_numbers_are_exact_and_hold() {
    for x in [
        0,
        1,
        -1,
        65_535,
        65_536,
        -65_536,
        i32::MAX,
        i32::MIN,
        0x1234_5678,
    ] {
        assert_eq!(join(split(x)), x);
    }
    let at = |time, first: i32| (time, Int((first..first + 6).collect()), vec![]);
    let (out, _) = run(&sampled(
        Vertex,
        vec![at(-0.5, 10), at(0.25, 20), at(1.5, 30)],
    ));
    let out = out.unwrap();
    assert_eq!(
        (out.lanes(), &out.key_times[..]),
        (2, &[0.0, 0.25, 1.0][..])
    );
    let item: Vec<i32> = out.item(3).as_chunks().0.iter().map(|&p| join(p)).collect();
    assert_eq!(item, [13, 23, 23]);
    let Spread::Channel(channel) = mesh().spread(out) else {
        panic!()
    };
    assert_eq!(channel.kind, ChannelKind::Nearest);
    assert_eq!(channel.indices, mesh().topology.face_vertex_indices);
}

#[test]
fn shading_needs_floats_of_one_width() {
    let refused = |primvar: &PrimvarDesc| {
        let mut warnings = Vec::new();
        let counts = mesh().primvar_counts();
        let out = resolve_floats("/m", "x", primvar, 3, &counts, SHUTTER, &mut warnings);
        assert_eq!(out.is_none(), !warnings.is_empty());
        out.is_none()
    };
    assert!(refused(&PrimvarDesc::still(
        Constant,
        4,
        numbers(4),
        vec![]
    )));
    assert!(!refused(&PrimvarDesc::still(
        Constant,
        3,
        numbers(3),
        vec![]
    )));
    let whole = sampled(Constant, vec![(0.0, Int(vec![1, 2, 3]), vec![])]);
    assert!(refused(&PrimvarDesc { width: 3, ..whole }));
}
