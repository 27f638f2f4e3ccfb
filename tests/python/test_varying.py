"""Meshes whose topology changes in time."""

import numpy as np
import pytest
from pxr import Gf, Vt
from scenes import (
    add_camera,
    add_mesh,
    new_stage,
    one_warning,
    quad_coverage,
    quad_points,
    render,
    set_samples,
)


def array(points):
    return Vt.Vec3fArray([Gf.Vec3f(*map(float, point)) for point in points])


def stage_of(samples):
    """A mesh with (points, counts, indices) at each time."""
    stage = new_stage()
    add_camera(stage)
    mesh = add_mesh(stage, "/mesh", [], [], [])
    attributes = (
        mesh.GetPointsAttr(),
        mesh.GetFaceVertexCountsAttr(),
        mesh.GetFaceVertexIndicesAttr(),
    )
    for time, (points, counts, indices) in samples.items():
        for attribute, value in zip(attributes, (array(points), counts, indices), strict=True):
            attribute.Set(value, time)
    return stage, mesh


LEFT, RIGHT = (-3, -1, -1, 1), (1, -1, 3, 1)
QUAD = ([4], [0, 1, 2, 3])
TURNED = ([4], [3, 2, 1, 0])
# Fewer points: the first and the last of two quads are the same.
TWO = ([4, 4], [0, 1, 2, 3, 4, 5, 6, 7])


def test_other_numbers_of_points_do_not_move():
    both = quad_points(*LEFT) + quad_points(*RIGHT)
    stage, _ = stage_of({0: (quad_points(*LEFT), *QUAD), 1: (both, *TWO), 2: (both, *TWO)})
    for frame, corners in ((0.0, [LEFT]), (0.75, [LEFT]), (1.0, [LEFT, RIGHT])):
        image = render(stage, frame=frame, shutter=(-0.5, 0.5))
        expected = sum(quad_coverage(*corner) for corner in corners)
        np.testing.assert_array_equal(image.alpha, expected)
        one_warning(image, "/mesh", "topology changes within the shutter")


@pytest.mark.parametrize("shutter", [(0, 0), (-0.25, 0.25)])
def test_points_come_with_the_topology_that_holds(shutter):
    """As many points and faces, but in another order: no sample may be mixed with the other."""
    turned = list(reversed(quad_points(*RIGHT)))
    stage, _ = stage_of({0: (quad_points(*LEFT), *QUAD), 1: (turned, *TURNED)})
    for frame, corners in ((0.0, LEFT), (0.5, LEFT), (0.9, LEFT), (1.0, RIGHT)):
        image = render(stage, frame=frame, shutter=shutter)
        np.testing.assert_array_equal(image.alpha, quad_coverage(*corners))
        if shutter[1] > 0:
            one_warning(image, "/mesh", "topology changes within the shutter")
        else:
            assert image.warnings == []


def test_topology_that_stays_within_the_shutter_blurs():
    still = quad_points(*RIGHT)
    moved = {
        0: (quad_points(*LEFT), *QUAD),
        1: (quad_points(-1, -1, 1, 1), *QUAD),
        2: (still + still, *TWO),
    }
    stage, _ = stage_of(moved)
    image = render(stage, frame=0.0, shutter=(0, 1), samples=64)
    times = (np.arange(64) + 0.5) / 64
    frames = [quad_coverage(-3 + 2 * t, -1, -1 + 2 * t, 1) for t in times]
    np.testing.assert_allclose(image.alpha, np.mean(frames, axis=0), atol=0.05)
    assert image.warnings == []


def test_velocities_move_the_sample_of_the_frame():
    both = quad_points(*LEFT) + quad_points(*RIGHT)
    stage, mesh = stage_of({0: (quad_points(*LEFT), *QUAD), 1: (both, *TWO)})
    speed = Gf.Vec3f(2, 0, 0) * stage.GetTimeCodesPerSecond()
    velocities = {0: Vt.Vec3fArray([speed] * 4), 1: Vt.Vec3fArray([speed] * 8)}
    set_samples(mesh.CreateVelocitiesAttr(), velocities)
    image = render(stage, frame=0.0, shutter=(0, 1), samples=64)
    times = (np.arange(64) + 0.5) / 64
    frames = [quad_coverage(-3 + 2 * t, -1, -1 + 2 * t, 1) for t in times]
    np.testing.assert_allclose(image.alpha, np.mean(frames, axis=0), atol=0.05)
    assert image.warnings == []
    # Those that do not fit the points are no help.
    mesh.GetVelocitiesAttr().Set(Vt.Vec3fArray([speed] * 3), 0)
    image = render(stage, frame=0.0, shutter=(0, 1))
    np.testing.assert_array_equal(image.alpha, quad_coverage(*LEFT))
    one_warning(image, "/mesh", "3 velocities for 4 values")
