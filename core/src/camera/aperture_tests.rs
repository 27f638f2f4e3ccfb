//! Oracles: areas and second moments of polygons and arcs in closed form, and counts in cells.

use super::*;
use std::f64::consts::PI;

fn aperture(desc: ApertureDesc) -> Aperture {
    let mut notes = CameraNotes::new();
    let aperture = Aperture::new(&desc, &mut notes);
    assert!(notes.is_empty(), "{notes:?}");
    aperture
}

fn shapes() -> Vec<ApertureDesc> {
    let mut all = Vec::new();
    for blades in [3, 4, 5, 6, 9, 64] {
        for roundness in [0.0, 1.0e-5, 0.3, 0.9, 0.999] {
            for (rotation, ratio) in [(0.0, 1.0), (33.0, 0.5), (-400.0, 3.0)] {
                all.push(ApertureDesc {
                    blades,
                    rotation,
                    ratio,
                    roundness,
                });
            }
        }
    }
    all
}

/// Points on the outline, counter-clockwise: of the square's rim, from the middle of its right side.
fn outline(aperture: &Aperture, count: usize) -> Vec<DVec2> {
    (0..count)
        .map(|i| {
            let turn = 8.0 * i as f64 / count as f64;
            let (side, along) = ((turn + 1.0).rem_euclid(8.0) / 2.0, (turn + 1.0) % 2.0);
            let at = along / 2.0;
            let (u, v) = match side as u32 {
                0 => (1.0, at),
                1 => (1.0 - at, 1.0),
                2 => (0.0, 1.0 - at),
                _ => (at, 0.0),
            };
            aperture.point(u as f32, v as f32).as_dvec2()
        })
        .collect()
}

fn area(outline: &[DVec2]) -> f64 {
    let next = outline.iter().cycle().skip(1);
    outline
        .iter()
        .zip(next)
        .map(|(a, b)| a.perp_dot(*b))
        .sum::<f64>()
        * 0.5
}

#[test]
fn every_shape_has_the_disks_area() {
    for desc in shapes() {
        let area = area(&outline(&aperture(desc), 1 << 14));
        assert!((area - PI).abs() < 1e-3, "{desc:?}: {area}");
    }
}

#[test]
fn corners_stand_where_they_should() {
    let corners = |blades, rotation, ratio| {
        let desc = ApertureDesc {
            blades,
            rotation,
            ratio,
            roundness: 0.0,
        };
        let shape = aperture(desc);
        // The farthest points of a fine outline, one a corner, before squeezing.
        let points = outline(&shape, 1 << 16);
        let unsqueezed = |p: &DVec2| *p / DVec2::new(ratio.sqrt(), 1.0 / ratio.sqrt());
        let n = f64::from(blades);
        let distance = (2.0 * PI / (n * (2.0 * PI / n).sin())).sqrt();
        for k in 0..blades {
            let angle = 2.0 * PI * f64::from(k) / n + PI / 2.0 + rotation.to_radians();
            let corner = DVec2::from_angle(angle) * distance;
            let nearest = points
                .iter()
                .map(|p| (unsqueezed(p) - corner).length())
                .fold(f64::INFINITY, f64::min);
            assert!(nearest < 1e-3, "{desc:?} corner {k}: {nearest}");
        }
        let farthest = points
            .iter()
            .map(|p| unsqueezed(p).length())
            .fold(0.0, f64::max);
        assert!(farthest < distance + 1e-6);
    };
    corners(3, 0.0, 1.0);
    corners(5, 20.0, 1.0);
    corners(6, 10.0, 2.0);
    corners(7, 721.0, 0.4);
}

/// Mean of x^2 + y^2 over a regular polygon of area pi: R^2 (2 + cos(2 pi / n)) / 6.
#[test]
fn second_moments_of_polygons_are_known() {
    for blades in [3, 5, 8] {
        let shape = aperture(ApertureDesc {
            blades,
            ..ApertureDesc::default()
        });
        let n = 512;
        let mut sum = 0.0;
        for i in 0..n * n {
            let (u, v) = ((i % n) as f32 + 0.5, (i / n) as f32 + 0.5);
            sum += shape
                .point(u / n as f32, v / n as f32)
                .as_dvec2()
                .length_squared();
        }
        let turn = 2.0 * PI / f64::from(blades);
        let radius2 = 2.0 * PI / (f64::from(blades) * turn.sin());
        let expected = radius2 * (2.0 + turn.cos()) / 6.0;
        let mean = sum / f64::from(n * n);
        assert!(
            (mean - expected).abs() < 1e-4,
            "{blades}: {mean} {expected}"
        );
    }
}

/// Equal areas: small squares become quadrilaterals of pi times their area, of any shape.
#[test]
fn the_density_is_even() {
    for desc in shapes().into_iter().filter(|d| d.blades < 10) {
        let shape = aperture(desc);
        let n = 64;
        let at = |i: u32, j: u32| {
            shape
                .point(i as f32 / n as f32, j as f32 / n as f32)
                .as_dvec2()
        };
        let mut odd = 0;
        for i in 0..n {
            for j in 0..n {
                let corners = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
                let ratio = area(&corners) / PI * f64::from(n * n);
                assert!(ratio > 0.0, "{desc:?} {i} {j}: turned over");
                // Cells that a corner's spoke or the map's diagonal bends are not quadrilaterals.
                odd += u32::from((ratio - 1.0).abs() > 0.02);
            }
        }
        let spokes = (desc.blades + 4) * n;
        assert!(odd < spokes, "{desc:?}: {odd} of {}", n * n);
    }
}

#[test]
fn full_roundness_is_the_disk_and_little_roundness_the_polygon() {
    for blades in [0, 1, 2, 5, 300] {
        let roundness = if (3..=256).contains(&blades) {
            1.0
        } else {
            0.0
        };
        let desc = ApertureDesc {
            blades,
            roundness,
            rotation: 12.0,
            ..ApertureDesc::default()
        };
        let shape = aperture(desc);
        assert_eq!(shape, Aperture::Round);
        for (u, v) in [(0.1, 0.7), (0.5, 0.5), (0.99, 0.01)] {
            assert_eq!(shape.point(u, v), concentric_disk(u, v));
        }
    }
    let with = |roundness| {
        aperture(ApertureDesc {
            blades: 5,
            roundness,
            ..ApertureDesc::default()
        })
    };
    let (straight, bent, round) = (with(0.0), with(1.0e-5), with(0.99999));
    for (u, v) in [(0.0, 0.0), (0.3, 0.9), (1.0, 0.4), (0.5, 0.5), (0.49, 0.5)] {
        assert!((straight.point(u, v) - bent.point(u, v)).length() < 1e-4);
        assert!((round.point(u, v).length() - concentric_disk(u, v).length()).abs() < 1e-4);
    }
}

#[test]
fn keplers_equation_is_solved() {
    for blades in [3, 4, 7, 32, 256] {
        for roundness in [1.0e-6, 1.0e-3, 0.1, 0.5, 0.9, 0.999_999] {
            let Blades {
                arc: Some(side), ..
            } = Blades::new(blades, 0.0, DVec2::ONE, roundness)
            else {
                panic!("straight");
            };
            for i in 0..=100 {
                let share = f64::from(i) / 100.0;
                let angle = side.angle(share);
                let found = angle - side.eccentricity * angle.sin();
                let off = (found / side.half_area - share).abs();
                assert!(off < 1e-7, "{blades} {roundness} {share}: {off}");
            }
        }
    }
}

#[test]
fn an_oval_is_a_squeezed_disk() {
    let shape = aperture(ApertureDesc {
        ratio: 0.25,
        ..ApertureDesc::default()
    });
    assert_eq!(shape, Aperture::Oval(Vec2::new(0.5, 2.0)));
    let p = concentric_disk(0.2, 0.9);
    assert_eq!(shape.point(0.2, 0.9), Vec2::new(p.x * 0.5, p.y * 2.0));
}

#[test]
fn bad_numbers_are_noted_and_give_something_usable() {
    let bad = [
        ApertureDesc {
            ratio: 0.0,
            ..ApertureDesc::default()
        },
        ApertureDesc {
            ratio: f64::NAN,
            ..ApertureDesc::default()
        },
        ApertureDesc {
            rotation: f64::INFINITY,
            blades: 5,
            ..ApertureDesc::default()
        },
        ApertureDesc {
            roundness: -1.0,
            blades: 5,
            ..ApertureDesc::default()
        },
        ApertureDesc {
            roundness: f64::NAN,
            blades: u32::MAX,
            ..ApertureDesc::default()
        },
    ];
    for desc in bad {
        let mut notes = CameraNotes::new();
        let shape = Aperture::new(&desc, &mut notes);
        assert_eq!(notes.len(), 1, "{desc:?}: {notes:?}");
        for (u, v) in [(0.0, 0.0), (0.5, 0.5), (1.0, 0.3)] {
            assert!(shape.point(u, v).length() < 1.6);
        }
    }
}
