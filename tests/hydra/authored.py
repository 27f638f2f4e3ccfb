"""Stages that tests author, for Hydra's hosts and for `hdtrapeze record`."""

from pxr import Gf, Vt
from scenes import add_camera, add_quad, new_stage
from test_agreement import compare


def stage_with(author, opens=0.0, closes=0.0):
    """A shutter, and what `author` adds before a wall."""
    stage = new_stage()
    stage.SetTimeCodesPerSecond(24)
    add_camera(stage, shutter__open=opens, shutter__close=closes)
    author(stage)
    add_quad(stage, "/wall", -6, -6, 6, 6, z=-3, color=(0.6, 0.6, 0.6))
    return stage


def export(host, author, opens=0.0, closes=0.0):
    """The file of such a stage, in the host's folder."""
    scene = host.folder / "scene.usda"
    stage = stage_with(author, opens, closes)
    stage.GetRootLayer().Export(str(scene))
    return scene


def same(host, author, opens=0.0, closes=0.0, frame=0.0, warned=()):
    """What `author` adds is the same by way of both."""
    scene = export(host, author, opens, closes)
    compare(host, scene.with_suffix(""), "/camera", frame, warned=warned)


def vectors(points):
    """A Vec3fArray."""
    return Vt.Vec3fArray([Gf.Vec3f(*map(float, point)) for point in points])
