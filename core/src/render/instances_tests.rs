//! Cancels while a prim is placed: counts of placements that are followed, not times.

use std::sync::atomic::AtomicUsize;

use glam::Vec3;

use super::*;
use crate::motion::{Hierarchy, Shutter};
use crate::scene::{CameraDesc, InstanceArrays, InstancerDesc, RenderSettings, Samples};
use crate::translate::instancer::Instancer;

const COUNT: usize = 100 * CHUNK;

fn with_paths(cancel: &AtomicBool, test: impl FnOnce(&Paths<'_>) + Send) {
    let shutter = Shutter::default();
    let mut desc = InstancerDesc::new("/i");
    let places = (0..COUNT).map(|i| Vec3::X * i as f32).collect();
    desc.arrays = Arc::new(InstanceArrays {
        instance_count: COUNT,
        positions: Samples {
            times: vec![0.0],
            values: vec![Arc::new(places)],
        },
        ..InstanceArrays::default()
    });
    let instancer = Arc::new(Instancer::new(&desc, None, shutter, &mut Vec::new()));
    let own = Hierarchy::new(&[], shutter).expect("no transform");
    let placements = Placements::new(instancer, 0, own);
    let (camera, _) =
        Camera::new(&CameraDesc::default(), &RenderSettings::default(), shutter).expect("a camera");
    let bounds = ObjectBounds::of(&[vec![Vec3::ZERO, Vec3::ONE]]);
    let paths = Paths::new(&placements, bounds, &camera, cancel);
    // Threads that are in a chunk end it.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build();
    pool.expect("a pool").install(|| test(&paths));
}

#[test]
fn placements_are_not_classified_once_cancelled() {
    let cancel = AtomicBool::new(false);
    with_paths(&cancel, |paths| {
        let followed = || {
            let (classes, _) = paths.classify().expect("memory");
            classes
                .iter()
                .filter(|&&class| class != Class::LOST)
                .count()
        };
        assert_eq!(followed(), COUNT);
        cancel.store(true, Ordering::Relaxed);
        assert_eq!(followed(), 0);
    });
}

#[test]
fn a_cancel_while_a_set_is_filled_ends_it_with_the_chunk() {
    let cancel = AtomicBool::new(false);
    with_paths(&cancel, |paths| {
        let (classes, _) = paths.classify().expect("memory");
        let class = classes[0];
        let moments = paths.placements.at(&paths.keys[..1]);
        let made = AtomicUsize::new(0);
        let make = |_, _: &[DAffine3], out: &mut [u8]| {
            out[0] = 1;
            cancel.store(
                made.fetch_add(1, Ordering::Relaxed) >= CHUNK / 2,
                Ordering::Relaxed,
            );
        };
        let filled = paths.fill(class, &classes, COUNT, 1, &moments, make);
        assert_eq!(filled.expect("memory").len(), COUNT);
        let made = made.load(Ordering::Relaxed);
        assert!(made <= 4 * CHUNK, "{made} of {COUNT}");
    });
}
