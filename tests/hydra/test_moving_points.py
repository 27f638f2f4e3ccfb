"""Velocities and skeletons, through Hydra's hosts and through `hdtrapeze record`."""

import pytest
import skel_scenes
from authored import export, same, vectors
from dumps import blocks
from pxr import UsdGeom
from scenes import add_quad, quad_points
from test_agreement import RECORD

QUAD = quad_points(-1, -1, 1, 1)


def flying_quad(stage):
    quad = add_quad(stage, "/quad")
    quad.GetPointsAttr().Clear()
    for time in (-1, 0, 1, 2):
        quad.GetPointsAttr().Set(vectors([(x + time, y, z) for x, y, z in QUAD]), time)
        quad.CreateVelocitiesAttr().Set(vectors([(48 + 5 * i, 12, 0) for i in range(4)]), time)
        quad.CreateAccelerationsAttr().Set(vectors([(0, -1700, 0)] * 4), time)
    return quad


def scaled(**attributes):
    def author(stage):
        api = UsdGeom.MotionAPI.Apply(flying_quad(stage).GetPrim())
        for name, value in attributes.items():
            api.GetPrim().GetAttribute(f"motion:{name}").Set(value)

    return author


@pytest.mark.parametrize(("author", "opens", "closes", "frame"), [
    (flying_quad, 0.0, 0.5, 0.0),
    (flying_quad, -0.1, 0.1, 0.0),
    (flying_quad, 0.0, 0.0, 0.0),
    (flying_quad, -0.25, 0.25, 0.5),
    (scaled(blurScale=0.0), -0.25, 0.25, 0.0),
    (scaled(blurScale=2.0), -0.25, 0.25, 0.0),
    (scaled(nonlinearSampleCount=2), -0.25, 0.25, 0.0),
    (scaled(nonlinearSampleCount=7), -0.25, 0.25, 0.0),
])  # fmt: skip
def test_velocities(host, author, opens, closes, frame):
    same(host, author, opens, closes, frame)


def test_a_blur_scale_that_a_host_gives_no_samples_for(host):
    """Scene delegates sample for the camera's shutter alone; indices for as much as is asked."""

    def author(stage):
        quad = add_quad(stage)
        move = UsdGeom.Xformable(quad).AddTranslateOp()
        for time in (-4, 4):
            move.Set((0.2 * time, 0, 0), time)
        api = UsdGeom.MotionAPI.Apply(quad.GetPrim())
        api.GetPrim().GetAttribute("motion:blurScale").Set(3.0)

    scene = export(host, author, -0.25, 0.25)
    ran = host.run(RECORD, scene=scene, camera="/camera", frame=0.0, choices={})
    told = "its motion:blurScale is above 1, but this host samples transforms for its "
    told += "camera's shutter alone: outside of it they stand still"
    assert ran.warnings == ([] if host.scene_index else [("/quad", told)])


def test_a_blur_scale_that_is_no_number(host):
    scene = export(host, scaled(blurScale=float("nan")), -0.25, 0.25)
    ran = host.run(RECORD, scene=scene, camera="/camera", frame=0.0, choices={})
    told = "its motion blur scale NaN is not finite; it is taken as 1 (not-finite)"
    assert ran.warnings == [("/quad", told)]


def test_a_skeleton_moves_points_between_its_own_samples(delegate_host):
    """OpenUSD evaluates skinning at the frame as well, with matrices that it held. (Scene indices
    of 25.02 know no skeletons.)"""

    def author(stage):
        skel_scenes.add_arm(stage, angles={0: (0, 0), 1: (20, 60)})

    host = delegate_host
    scene = export(host, author, -0.1, 0.1)
    script = """
    view = View(Usd.Stage.Open(scene), "/camera", samples=1)
    view.draw(0.5)
    view.dump("dump.txt")
    """
    host.run(script, scene=scene)
    dump = blocks((host.folder / "dump.txt").read_text())
    lines = [line for line in dump["mesh /arm/strip"] if line.startswith("  points")]
    assert [line[: line.index(":")] for line in lines] == [
        "  points at shutter 0",
        "  points at shutter 1",
    ]
    assert lines[0][22:] != lines[1][22:]
