"""The same scene through a Hydra host and through `hdtrapeze record` gives the same image.

Blur is no exception: samples are the same ones, so that noise is, too. What OpenUSD's hosts cannot
say is left out of the scenes, or the test says which host says it.
"""

import os
from pathlib import Path

import numpy as np
import pytest
import sdk
from driver import record, rgba

SCENES = Path(__file__).parent / "scenes"
RECORD = "record(Usd.Stage.Open(scene), 'hydra.exr', camera, frame, **choices)"


def assert_alike(ours, other):
    """Equal but for the last bit of matrices and lenses, which Hydra hands on as floats: values may
    differ by a bit of 16 bits, and few samples are on the other side of an edge."""
    assert ours.shape == other.shape
    assert (other[..., 3] > 0).mean() > 0.05, "there is something to be seen"
    assert (np.abs(ours - other) > 1e-3 * other).mean() < 0.002
    assert np.abs(ours - other).max() < 2.5 / 64
    np.testing.assert_allclose(ours.mean((0, 1)), other.mean((0, 1)), atol=1e-5)


def assert_near(ours, other):
    """Equal but for the tolerance that one of them keeps to arcs by: few of a pixel's samples are
    on the other side of an edge."""
    assert ours.shape == other.shape
    assert np.abs(ours - other).mean() < 4e-4
    assert np.abs(ours - other).max() < 5.5 / 64


def compare(
    host, name, camera="/main_cam", frame=2.0, flags=(), warned=(), alike=assert_alike, **choices
):
    """FrameRecorder's image beside the command's."""
    scene = SCENES / f"{name}.usda"
    ran = host.run(RECORD, scene=scene, camera=camera, frame=frame, choices=choices)
    assert sorted(ran.warnings) == sorted(warned)
    time = ["-d"] if frame is None else ["-f", f"{frame:g}"]
    named = ["-cam", camera] if camera else []
    other = record(scene, host.folder / "record.exr", "-w", 96, *time, *named, *flags)
    alike(ran.image("hydra.exr"), other)
    return other


@pytest.mark.parametrize("name", ["still", "motion", "camera", "instances"])
def test_scenes(host, name):
    compare(host, name)


def test_blur_is_there(delegate_host):
    """That is, agreement is not that of scenes which stand still."""
    for name in ("motion", "camera"):
        scene, out = SCENES / f"{name}.usda", delegate_host.folder / "still.exr"
        blurred = record(scene, out, "-w", 96, "-f", 2)
        still = record(scene, out, "-w", 96, "-f", 2, "--no-motion-blur")
        assert (blurred != still).mean() > 0.05


def test_native_instances_that_move(host):
    """OpenUSD's scene indices tell no samples of native instances, but those of their prims."""
    compare(host, "native")


def test_what_turns_goes_along_its_arc(host):
    """By a quarter within the shutter, of one piece and instanced; but authored matrices go
    straight. The scene delegate tells of three times, the renderer turns things in between."""
    compare(host, "spins", alike=assert_alike if host.scene_index else assert_near)


def test_baked_matrices_go_straight(host):
    """No sample lies within the shutter, and what it begins with is not shrunk."""
    compare(host, "baked")


@pytest.mark.parametrize("camera", ["/main_cam", "/Rig/orbit_cam"])
def test_orbits(index_host, camera):
    """Scene indices evaluate where a centre is, too."""
    compare(index_host, "orbits", camera)


@pytest.mark.parametrize(("frame", "choices", "flags"), [
    (1.0, {}, []),
    (2.5, {}, []),
    (2.0, {"CameraLightEnabled": False}, ["--disableCameraLight"]),
    (2.0, {"Complexity": 1.1}, ["-c", "medium"]),
    (2.0, {"ImageWidth": 61}, ["-w", 61]),
])  # fmt: skip
def test_flags(host, frame, choices, flags):
    compare(host, "motion", frame=frame, flags=flags, **choices)


def test_default_time(host):
    """What has time samples alone is not there, or where it is without them."""
    paths = ("/Accelerates", "/Deforms", "/Flies")
    warned = [(path, "1 faces but no points; dropped (topology)") for path in paths]
    compare(host, "motion", frame=None, warned=warned)


@pytest.mark.parametrize("purposes", [[], ["render", "guide"], ["proxy"]])
def test_purposes_and_an_orthographic_camera(host, purposes):
    flags = ["--purposes", ",".join(purposes or ["default"])]
    image = compare(host, "purposes", "/Flat", 1.0, flags, IncludedPurposes=purposes)
    quads = 1 + len(purposes)
    assert image[..., 3].mean() == pytest.approx(quads * 0.8 * 0.8 / 12, rel=0.05)


def test_bounds_are_framed_without_a_camera(host):
    compare(host, "purposes", None, 1.0)


USDRECORD = os.environ.get("OPENUSD_USDRECORD")


@pytest.mark.skipif(not USDRECORD, reason="OPENUSD_USDRECORD names no usdrecord.py")
def test_usdrecord_as_it_is(host):
    """OpenUSD's own command, over frames."""
    scene = SCENES / "motion.usda"
    flags = ["-w", "96", "-f", "1:2", "-cam", "/main_cam", "-color", "disabled"]
    files = [str(scene), "hydra.###.exr"]
    done = host.start(
        [sdk.python(), USDRECORD, "--disableGpu", "--renderer", "Trapeze", *flags, *files]
    )
    assert done.returncode == 0, done.stdout
    record(scene, host.folder / "record.###.exr", *flags)
    for frame in ("001", "002"):
        ours = rgba(host.folder / f"hydra.{frame}.exr")
        assert_alike(ours, rgba(host.folder / f"record.{frame}.exr"))
