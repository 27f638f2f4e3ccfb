"""Scenes as the renderer understands them, from Hydra's hosts and from `hdtrapeze dump`."""

from pathlib import Path

import pytest
from dumps import blocks, placements

DUMPS = Path(__file__).parent.parent / "dumps"
DUMP = """
stage = Usd.Stage.Open(scene)
view = View(stage, "/main_cam", size=(960, 700), samples=1)
view.draw(stage.GetStartTimeCode())
view.engine.StopRenderer()
view.dump("dump.txt")
"""


def both(host, name) -> tuple[str, str]:
    """The host's dump, and the committed one of the command."""
    host.run(DUMP, scene=DUMPS / f"{name}.usda")
    return (host.folder / "dump.txt").read_text(), (DUMPS / f"{name}.txt").read_text()


def test_meshes(host):
    ours, other = map(blocks, both(host, "mesh"))
    assert {"mesh /World/Creased", "mesh /World/Polygons", "camera /main_cam"} <= ours.keys()
    assert ours == other


def test_motion(host):
    ours, other = map(blocks, both(host, "motion"))
    assert len(ours) == 8
    if not host.scene_index:
        # The scene delegate samples the camera's shutter, whatever interval it is asked for: motion
        # beyond it, which a blur scale above 1 would show, is not known.
        (open_at, *_, close_at) = _transforms(ours.pop("mesh /Moves/Scaled"))
        assert (open_at, close_at) == ("(0.75 0 0 1)", "(1 0.5 0 1)")
        other.pop("mesh /Moves/Scaled")
    assert ours == other


def _transforms(lines) -> list[str]:
    """Where an object's origin is."""
    return [line[line.rindex("(") : -1] for line in lines if line.startswith("  transform")]


def test_other_prims(host):
    ours, other = map(blocks, both(host, "prims"))
    if not host.scene_index:
        # The scene delegate makes meshes of implicit surfaces.
        names = [heading for heading in other if heading.startswith("implicit ")]
        assert len(names) == 6
        for heading in names:
            other.pop(heading)
            ours.pop(heading.replace("implicit", "mesh"))
    assert len(ours) >= 4
    assert ours == other


def test_instances(host):
    ours, other = both(host, "instances")
    placed, expected = placements(ours), placements(other)
    if host.scene_index:
        # Scene indices place native instances of a prototype by one more instancer, where they are.
        expected.append(("", "((1 0 0 0) (0 1 0 0) (0 0 1 0) (0 0 0 1))"))
    assert len(placed) >= 9
    assert placed == sorted(expected)


@pytest.mark.parametrize(("command", "given"), [
    ("dumpScene", {}),
    ("dumpScene", {"path": "nowhere/dump.txt"}),
    ("saveImage", {"path": "before_a_render.exr"}),
    ("makeCoffee", {"path": "cup"}),
])  # fmt: skip
def test_commands_that_fail(delegate_host, command, given):
    script = """
    view = View(Usd.Stage.CreateInMemory())
    tell(worked=view.engine.InvokeRendererCommand(command, given))
    """
    ran = delegate_host.run(script, command=command, given=given)
    assert ran.told == {"worked": False}
    assert len(ran.warnings) == 1
