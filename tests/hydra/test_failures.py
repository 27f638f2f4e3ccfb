"""Renders that fail: one message, no hang, and the edit that mends it is rendered."""

import numpy as np
import pytest
from test_agreement import SCENES

BREAKS = """
    stage = Usd.Stage.Open(scene)
    view = View(stage, "/main_cam", interactive=interactive, samples=4)
    view.render(2)
    view.save("before.exr")
    nowhere = Gf.Vec3d(float("nan"), 0, 0)
    place = stage.GetAttributeAtPath("/main_cam.xformOp:translate").Get()
    view.set(samples=1_000_000)
    view.draw(2)
    while view.stats()["state"] != "rendering":
        time.sleep(0.001)
    edit(stage, "/main_cam.xformOp:translate", nowhere)
    view.render(2)
    tell(state=view.stats()["state"])
    edit(stage, "/Moves.xformOp:translate", Gf.Vec3d(9, 9, 9), 2)
    view.render(2)
    edit(stage, "/Moves.xformOp:translate", Gf.Vec3d(-3, 1.5, 0), 2)
    view.set(samples=4)
    edit(stage, "/main_cam.xformOp:translate", place)
    view.render(2)
    view.save("after.exr")
"""


@pytest.mark.parametrize("interactive", [True, False])
def test_a_camera_that_cannot_be_used(host, interactive):
    """While it renders; told once, whatever else is edited meanwhile."""
    ran = host.run(BREAKS, scene=SCENES / "motion.usda", interactive=interactive)
    assert ran.told == {"state": "failed"}
    assert len(ran.warnings) == 1
    assert "camera /main_cam" in ran.warnings[0][1]
    np.testing.assert_array_equal(ran.image("before.exr"), ran.image("after.exr"))


def test_usdrecord_ends(host):
    script = """
    stage = Usd.Stage.Open(scene)
    edit(stage, "/main_cam.xformOp:translate", Gf.Vec3d(float("nan"), 0, 0))
    record(stage, "failed.exr", "/main_cam", 2.0)
    """
    ran = host.run(script, scene=SCENES / "motion.usda")
    assert len(ran.warnings) == 1
