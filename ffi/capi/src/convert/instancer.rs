//! Instancers.

use std::sync::Arc;

use glam::{DMat4, Quat, Vec3};
use hdtrapeze_core::scene::{InstanceArrays, Samples};
use hdtrapeze_delegate::samples::straight_frame;

use crate::fault::Fault;
use crate::input::{copied, slice, times};
use crate::types::*;

/// Safety, here and below: pointers in the struct are null or as the header says.
pub(crate) unsafe fn instancer(from: &trz_instancer) -> Result<InstanceArrays, Fault> {
    let vec3 = |v: &[f32; 3]| Vec3::from_array(*v);
    // SAFETY: as the caller promises.
    unsafe {
        let prototypes = slice(from.prototypes, from.prototype_index_count, "prototypes")?;
        let mask = slice(from.mask, from.mask_count, "mask")?;
        let ids = slice(from.ids, from.id_count, "ids")?;
        let lists = match from.lists.is_null() {
            true => Vec::new(),
            false => lists(from.lists, from.list_counts, from.prototype_count)?,
        };
        let mut matrices = matrix_samples(&from.matrices)?;
        let mut matrices_turn = from.matrices_turn & 1 != 0;
        if from.matrices_turn & 2 != 0
            && let Some(frame) = straight_frame(&matrices.times, |i| &matrices.values[i])
        {
            matrices.times.remove(frame);
            matrices.values.remove(frame);
            matrices_turn = false;
        }
        Ok(InstanceArrays {
            lists,
            instance_count: from.instance_count,
            prototypes: copied(prototypes, |&p| p)?,
            prototype_count: from.prototype_count,
            mask: copied(mask, |&m| m)?,
            ids: copied(ids, |&id| id)?,
            positions: samples(&from.positions, "positions", vec3)?,
            orientations: samples(&from.orientations, "orientations", |q: &[f32; 4]| {
                Quat::from_array(*q)
            })?,
            scales: samples(&from.scales, "scales", vec3)?,
            matrices,
            matrices_turn,
            velocities: samples(&from.velocities, "velocities", vec3)?,
            accelerations: samples(&from.accelerations, "accelerations", vec3)?,
            angular_velocities: samples(&from.angular_velocities, "angular_velocities", vec3)?,
            time_codes_per_second: from.time_codes_per_second,
        })
    }
}

unsafe fn lists(
    first: *const *const i32,
    counts: *const usize,
    count: usize,
) -> Result<Vec<Vec<i32>>, Fault> {
    // SAFETY: as the caller promises.
    unsafe {
        let counts = slice(counts, count, "list_counts")?;
        let each = slice(first, count, "lists")?.iter().zip(counts).enumerate();
        each.map(|(k, (&list, &count))| copied(slice(list, count, &format!("lists[{k}]"))?, |&i| i))
            .collect()
    }
}

/// Arrays of `N` floats a value.
pub(super) unsafe fn samples<const N: usize, T>(
    from: &trz_float_samples,
    what: &str,
    convert: impl Fn(&[f32; N]) -> T,
) -> Result<Samples<T>, Fault> {
    // SAFETY: as the caller promises.
    unsafe {
        arrays(
            (from.times, from.sample_count, from.values, from.counts),
            what,
            convert,
        )
    }
}

unsafe fn matrix_samples(from: &trz_matrix_samples) -> Result<Samples<DMat4>, Fault> {
    // SAFETY: as the caller promises.
    unsafe {
        arrays(
            (from.times, from.sample_count, from.values, from.counts),
            "matrices",
            DMat4::from_cols_array,
        )
    }
}

/// Times, number of samples, arrays and their counts of values.
type Arrays<E> = (*const f64, usize, *const *const E, *const usize);

unsafe fn arrays<E: Copy, const N: usize, T>(
    (at, sample_count, values, counts): Arrays<E>,
    what: &str,
    convert: impl Fn(&[E; N]) -> T,
) -> Result<Samples<T>, Fault> {
    let part = |part: &str| format!("{part} of {what}");
    // SAFETY: as the caller promises.
    unsafe {
        let times_of = slice(at, sample_count, &part("times"))?;
        let values = slice(values, sample_count, what)?;
        let counts = slice(counts, sample_count, &part("counts"))?;
        let each = values.iter().zip(counts).enumerate();
        Ok(Samples {
            times: copied(times_of, |&t| t)?,
            values: each
                .map(|(i, (&array, &count))| {
                    let what = format!("{what}[{i}]");
                    let elements = slice(array, times(count, N, &what)?, &what)?;
                    let (elements, _) = elements.as_chunks::<N>();
                    Ok(Arc::new(copied(elements, &convert)?))
                })
                .collect::<Result<_, Fault>>()?,
        })
    }
}
