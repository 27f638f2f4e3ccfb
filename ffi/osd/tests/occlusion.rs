//! Occlusion culling leaves every bit of the image as it is, whatever hides what, and when, and from where.

mod hidden;

use std::sync::Arc;

use glam::{DVec3, Vec3};
use hdtrapeze_core::render::{Prepared, WorldHit, WorldRay};
use hdtrapeze_core::scene::{PrimId, RenderSettings, Scene};
use hidden::{ball, bits, placed, prepared, rendered, scene, sheet, turning, with_culling};

fn settings() -> RenderSettings {
    let aovs = [
        "color",
        "depth",
        "P",
        "normal",
        "primId",
        "instanceId",
        "elementId",
        "motionVectors",
    ];
    RenderSettings {
        resolution: [64, 36],
        samples: 4,
        shading_rate: 0.2,
        aovs: aovs.map(str::to_owned).to_vec(),
        ..RenderSettings::default()
    }
}

/// Renders with and without, on 1, 2 and 7 threads; gives what was prepared with culling last. The numbers of
/// prims that are seen must be `seen`.
fn check(scene: &Scene, seen: &[i32]) -> Prepared {
    let all = prepared(&with_culling(scene, false), None);
    assert_eq!(all.statistics().clusters, 0);
    let (frame, ..) = rendered(&all);
    let expected = bits(&frame);
    let ids = expected.iter().find(|(name, _)| name == "primId");
    let mut ids: Vec<i32> = ids.expect("ids").1.iter().map(|&id| id as i32).collect();
    ids.sort_unstable();
    ids.dedup();
    ids.retain(|&id| id >= 0);
    assert_eq!(ids, seen);
    let mut last = None;
    for threads in [1, 2, 7] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        let on = pool.build().expect("threads").install(|| {
            let on = prepared(&with_culling(scene, true), None);
            let s = on.statistics();
            let none_yet = s.clusters_culled == s.clusters && s.micropolygons == 0;
            // By what is expected of clusters; while debugging, so little is large.
            assert!(!cfg!(debug_assertions) || on.world().is_far());
            assert!(s.clusters > 0 && none_yet, "{s:?}");
            for (name, image) in bits(&rendered(&on).0) {
                let (_, wanted) = expected.iter().find(|(n, _)| *n == name).expect("the AOV");
                assert!(image == *wanted, "{name} differs on {threads} threads");
            }
            on
        });
        last = Some(on);
    }
    let on = last.expect("rendered");
    let (s, whole) = (on.statistics(), all.statistics());
    assert_eq!(s.objects, whole.objects);
    assert_eq!(s.instances, whole.instances);
    on
}

fn culled(of: &Prepared) -> f64 {
    let s = of.statistics();
    s.micropolygons_culled as f64 / (s.micropolygons + s.micropolygons_culled) as f64
}

/// A wall before a crowd.
fn crowd(wall: &[DVec3], f_stop: f64) -> Scene {
    let mut prims = vec![placed(sheet("/wall", 24, 24.0), wall)];
    for i in 0..6 {
        let place = DVec3::new(
            f64::from(i % 3) * 3.0 - 3.0,
            f64::from(i / 3) * 3.0 - 1.5,
            -8.0,
        );
        let growth = if i % 2 == 0 { 0.0 } else { 0.2 };
        prims.push(placed(ball(&format!("/ball{i}"), 6, 1.5, growth), &[place]));
    }
    scene(prims, settings(), f_stop)
}

#[test]
fn what_a_wall_hides_is_never_diced() {
    let on = check(&crowd(&[DVec3::ZERO], 0.0), &[1]);
    let s = on.statistics();
    assert!(s.clusters_culled >= 6, "{s:?}");
    assert!(culled(&on) > 0.2, "{s:?}");
}

#[test]
fn the_far_side_of_a_ball_is_not_diced() {
    let one = placed(ball("/ball", 24, 4.5, 0.0), &[DVec3::ZERO]);
    let settings = RenderSettings {
        shading_rate: 0.08,
        ..settings()
    };
    let on = check(&scene(vec![one], settings, 2.0), &[1]);
    assert!(culled(&on) > 0.2, "{:?}", on.statistics());
}

#[test]
fn what_appears_late_in_the_shutter_is_seen() {
    // At its last tenth the wall is out of the view's left half.
    let still = DVec3::ZERO;
    let mut path = vec![still; 10];
    path.push(DVec3::X * 20.0);
    let all = check(&crowd(&path, 0.0), &[1, 2, 3, 4, 5, 6, 7]);
    let none = prepared(&with_culling(&crowd(&[still], 0.0), true), None);
    rendered(&none);
    assert!(all.statistics().micropolygons > none.statistics().micropolygons);
}

#[test]
fn what_runs_along_curves_is_the_same_however_it_is_diced() {
    let mut prims = vec![placed(
        sheet("/wall", 24, 24.0),
        &[DVec3::ZERO, DVec3::X * 20.0],
    )];
    for i in 0..3 {
        let ball = turning(&format!("/ball{i}"), 6, 1.5, 2.5 - 2.0 * i as f32, 5);
        prims.push(placed(
            ball,
            &[DVec3::new(f64::from(i) * 3.5 - 3.5, 0.0, -8.0)],
        ));
    }
    check(&scene(prims, settings(), 0.0), &[1, 2, 3, 4]);
}

#[test]
fn what_only_the_rim_of_the_lens_sees_is_seen() {
    // A shield close to the lens covers the ball's image for a pinhole, and less than the lens.
    let prims = || {
        vec![
            placed(ball("/shield", 8, 0.35, 0.0), &[DVec3::Z * 11.0]),
            placed(ball("/ball", 6, 1.2, 0.0), &[DVec3::Z * -8.0]),
        ]
    };
    let settings = RenderSettings {
        samples: 16,
        ..settings()
    };
    let pinhole = check(&scene(prims(), settings.clone(), 0.0), &[1]);
    let culled = |of: &Prepared| of.statistics().clusters_culled;
    assert!(culled(&pinhole) > 0, "{:?}", pinhole.statistics());
    let wide = prepared(
        &with_culling(&scene(prims(), settings.clone(), 0.5), true),
        None,
    );
    rendered(&wide);
    assert!(culled(&wide) < culled(&pinhole));
    let both = scene(prims(), settings, 0.5);
    let off = prepared(&with_culling(&both, false), None);
    let on = prepared(&with_culling(&both, true), None);
    let (off, on) = (bits(&rendered(&off).0), bits(&rendered(&on).0));
    assert!(off == on);
    let ids = &off
        .iter()
        .find(|(name, _)| name == "primId")
        .expect("ids")
        .1;
    assert!(ids.contains(&2), "the rim sees the ball");
}

#[test]
fn any_ray_may_come_to_what_the_camera_does_not_see() {
    let crowd = crowd(&[DVec3::ZERO, DVec3::X], 0.0);
    let [on, off] = [true, false].map(|on| prepared(&with_culling(&crowd, on), None));
    rendered(&on);
    let rays: Vec<WorldRay> = (0..4000)
        .map(|i| {
            let at = |k: f64| (f64::from(i) * k).fract() * 2.0 - 1.0;
            let origin = DVec3::new(at(0.61), at(0.37), at(0.83)).normalize() * 20.0;
            let to = DVec3::new(at(0.29) * 4.0, at(0.71) * 3.0, -8.0 + at(0.53));
            WorldRay {
                origin,
                dir: (to - origin).as_vec3(),
                time: (at(0.47) as f32).abs(),
                t_min: 0.0,
                t_max: f32::INFINITY,
            }
        })
        .collect();
    let none = WorldHit {
        t: 0.0,
        u: 0.0,
        v: 0.0,
        normal: Vec3::ZERO,
        prim_id: 0,
        instance_id: 0,
        element_id: 0,
        grid: 0,
        cell: 0,
    };
    let ask = |of: &Prepared| {
        let mut hits = vec![none; rays.len()];
        of.trace_world(&rays, &mut hits);
        // Grids are numbered in their cluster.
        hits.iter_mut().for_each(|hit| hit.grid = 0);
        hits
    };
    let hits = ask(&on);
    assert!(hits == ask(&off));
    assert!(hits.iter().filter(|hit| hit.prim_id > 1).count() > 400);
}

#[test]
fn an_edit_keeps_what_was_diced_of_what_it_does_not_touch() {
    let mut crowd = with_culling(&crowd(&[DVec3::ZERO], 0.0), true);
    let first = prepared(&crowd, None);
    rendered(&first);
    let diced = first.statistics();
    let ball = crowd.prims.get_mut(&PrimId(3)).expect("a ball");
    Arc::make_mut(ball).common.transform.clear();
    let second = prepared(&crowd, Some(&first));
    let kept = second.statistics();
    assert_eq!((kept.objects_diced, kept.objects_reused), (1, 6));
    let share = kept.micropolygons as f64 / diced.micropolygons as f64;
    assert!((0.5..=1.0).contains(&share), "{share} of what was diced");
    assert!(kept.dice_seconds < diced.dice_seconds, "this commit's own");
    // Hiding the wall brings the others out.
    let wall = crowd.prims.get_mut(&PrimId(1)).expect("the wall");
    Arc::make_mut(wall).common.visible = false;
    let third = prepared(&crowd, Some(&second));
    let (image, ..) = rendered(&third);
    let (fresh, ..) = rendered(&prepared(&with_culling(&crowd, false), None));
    assert!(bits(&image) == bits(&fresh));
}

#[test]
fn small_prims_and_those_of_few_micropolygons_a_face_are_diced_at_once() {
    let coarse = RenderSettings {
        shading_rate: 4.0,
        ..settings()
    };
    let prims = || vec![ball("/ball", 40, 3.0, 0.0)];
    let s = prepared(&scene(prims(), coarse, 0.0), None).statistics();
    assert!(s.clusters == 0 && s.micropolygons > 0);
}

#[test]
fn a_prim_near_its_budget_is_diced_at_once() {
    let of = |max_micropolygons: u64| {
        let settings = RenderSettings {
            max_micropolygons,
            ..settings()
        };
        let one = scene(vec![ball("/ball", 6, 3.0, 0.0)], settings, 0.0);
        let all = prepared(&with_culling(&one, false), None).statistics();
        let clusters = prepared(&one, None).statistics().clusters;
        (all.micropolygons, clusters)
    };
    let (count, clusters) = of(u64::MAX);
    assert!(clusters > 0);
    assert_eq!(of(2 * count), (count, 0));
    assert_eq!(of(20 * count), (count, clusters));
}

#[test]
fn a_camera_that_moves_keeps_what_rays_have_had_diced() {
    let mut crowd = with_culling(&crowd(&[DVec3::ZERO], 0.0), true);
    Arc::make_mut(&mut crowd.settings).keep_finer = true;
    let first = prepared(&crowd, None);
    rendered(&first);
    let closer = |crowd: &mut Scene, by: f64| {
        let camera = crowd.cameras.values_mut().next().expect("a camera");
        for level in &mut Arc::make_mut(camera).transform {
            for matrix in &mut level.matrices {
                *matrix = glam::DMat4::from_translation(-DVec3::Z * by) * *matrix;
            }
        }
    };
    closer(&mut crowd, 0.05);
    let near = prepared(&crowd, Some(&first));
    let hidden = near.statistics().clusters_culled;
    let kept = near.statistics();
    assert_eq!((kept.objects_diced, kept.objects_reused), (0, 7));
    assert_eq!(kept.micropolygons, first.statistics().micropolygons);
    // What was hidden may come into view: it is diced as it would have been.
    let wall = crowd.prims.get_mut(&PrimId(1)).expect("the wall");
    Arc::make_mut(wall).common.visible = false;
    let open = prepared(&crowd, Some(&near));
    rendered(&open);
    assert!(open.statistics().clusters_culled < hidden);
    closer(&mut crowd, 12.0);
    let nearest = prepared(&crowd, Some(&open)).statistics();
    assert!(nearest.objects_diced >= 5, "{nearest:?}");
}
