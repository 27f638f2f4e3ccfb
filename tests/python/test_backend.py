"""The backend gpu: what it renders, and what is said where it cannot."""

import logging
import os
import re
import subprocess
import sys

import numpy as np
import pytest
from hdtrapeze import native
from hdtrapeze.devices import devices
from hdtrapeze.options import Options
from hdtrapeze.render import Renderer
from pxr import Gf, Sdf, UsdGeom
from scenes import add_quad, set_samples
from test_windows import busy_stage

AOVS = ("color", "depth", "primId", "instanceId", "elementId", "normal")

needs_device = pytest.mark.skipif(not devices(), reason="no Vulkan, Metal or DX12 device is found")


def render(stage, backend, aovs=AOVS, **options):
    options = Options(
        width=48,
        height=48,
        samples=16,
        camera="/camera",
        aovs=list(aovs),
        backend=backend,
        **options,
    )
    with Renderer(options) as renderer:
        renderer.load(stage, 0.0)
        renderer.render()
        images = {name: renderer.aov(name) for name in aovs}
        return images, renderer.log.warnings


@needs_device
def test_images_are_the_cpus():
    stage = busy_stage()
    (gpu, warnings), (cpu, _) = render(stage, "gpu"), render(stage, "cpu")
    assert warnings == []
    assert (cpu["primId"] >= 0).any() and (cpu["color"] > 0).any()
    for name in ("primId", "instanceId", "elementId"):
        assert (gpu[name] != cpu[name]).mean() < 0.002, name
    for name in ("color", "depth", "normal"):
        off = np.abs(gpu[name].astype(np.float64) - cpu[name])
        assert np.mean(off > 1e-4) < 0.01, name


@needs_device
@pytest.mark.parametrize("backend", ["gpu", "cpu"])
def test_vertices_go_to_the_gpu_while_others_are_diced(backend, caplog):
    stage = busy_stage()
    for i in range(4):
        ball = UsdGeom.Sphere.Define(stage, f"/fine{i}")
        ball.CreateRadiusAttr(2.0 + 0.1 * i)
    options = Options(width=320, height=320, samples=1, camera="/camera", backend=backend)
    (options.shading_rate, options.threads) = (0.5, 1)
    with caplog.at_level(logging.DEBUG, "hdtrapeze"), Renderer(options) as renderer:
        session = renderer.session
        debug = native.constants().TRZ_LOG_DEBUG
        session._call("trz_session_set_log", session._callback, native.ffi.NULL, debug)
        renderer.load(stage, 0.0)
        renderer.render()
    told = [re.findall(r"\d+", text) for text in caplog.messages if "went to the GPU early" in text]
    assert len(told) == (1 if backend == "gpu" else 0)
    for uploaded, beside, used in (map(int, numbers) for numbers in told):
        # By one thread: a chunk of two balls, and another one once the last is diced.
        assert uploaded > 8 << 20 and 4 << 20 < beside < uploaded and used == uploaded


def add_turning(stage):
    """A quad that turns over while the shutter is open, whose culled sides are not for a GPU."""
    quad = add_quad(stage, "/turning", -2, -2, 2, 2, z=1.0)
    scale = UsdGeom.Xformable(quad).AddScaleOp().GetAttr()
    set_samples(scale, {0: Gf.Vec3f(1, 1, 1), 1: Gf.Vec3f(-1, 1, 1)})


def add_panes(stage):
    for i in range(4):
        quad = add_quad(stage, f"/pane{i}", -6, -6, 6, 6, z=4.0 + 0.3 * i)
        UsdGeom.Xformable(quad).AddRotateXYZOp().Set((3.0 * i, 5.0 - 2.0 * i, 0))
        opacity = UsdGeom.PrimvarsAPI(quad).CreatePrimvar(
            "displayOpacity", Sdf.ValueTypeNames.FloatArray, "constant"
        )
        opacity.Set([0.3])


@needs_device
@pytest.mark.parametrize("shaded_there", [True, False])
def test_layers_are_composited_once(shaded_there):
    """Where the CPU shades, it goes on from hits whose distances are rounded otherwise."""
    stage = busy_stage()
    add_panes(stage)
    if not shaded_there:
        # Normals that turn over while the shutter is open are the CPU's.
        add_turning(stage)
    (gpu, warnings), (cpu, _) = (render(stage, backend) for backend in ("gpu", "cpu"))
    assert warnings == []
    for name in ("primId", "instanceId", "elementId"):
        assert (gpu[name] != cpu[name]).mean() < 0.002, name
    off = np.abs(gpu["color"].astype(np.float64) - cpu["color"])
    assert off.max() < 0.02 and np.mean(off > 1e-4) < 0.01


@needs_device
@pytest.mark.parametrize("cull", ["back", "front", "backUnlessDoubleSided"])
def test_sides_are_passed_through(cull):
    stage = busy_stage()
    add_panes(stage)
    (gpu, warnings), (cpu, _) = (
        render(stage, backend, AOVS[:-1], cull=cull) for backend in ("gpu", "cpu")
    )
    assert warnings == []
    for name in ("primId", "instanceId", "elementId"):
        assert (gpu[name] != cpu[name]).mean() < 0.002, name
    off = np.abs(gpu["color"].astype(np.float64) - cpu["color"])
    assert np.mean(off > 1e-4) < 0.01


@needs_device
def test_a_scene_that_it_does_not_take_is_rendered_on_the_cpu():
    stage = busy_stage()
    add_turning(stage)
    (gpu, warnings), (cpu, _) = render(stage, "gpu", cull="back"), render(stage, "cpu", cull="back")
    assert len(warnings) == 1 and "turn over" in str(warnings[0])
    for name in AOVS:
        np.testing.assert_array_equal(gpu[name], cpu[name], err_msg=name)


def command(*arguments, **environment):
    """Runs the command with more in its environment, or without what is None."""
    run = [sys.executable, "-m", "hdtrapeze", *arguments]
    variables = {k: v for k, v in (os.environ | environment).items() if v is not None}
    return subprocess.run(run, env=variables, capture_output=True, text=True, check=False)


def test_devices_says_what_each_backend_uses():
    found = command("devices", XDG_RUNTIME_DIR=None)
    assert found.returncode == 0 and "XDG_RUNTIME_DIR" not in found.stderr
    assert "--backend auto: the CPU" in found.stdout
    for device in devices():
        assert device.name in found.stdout


@needs_device
def test_a_stage_can_be_the_first_on_the_gpu(tmp_path):
    path = tmp_path / "scene.usda"
    stage = busy_stage()
    stage.GetRootLayer().Export(str(path))
    arguments = ("record", "--imageWidth", "16", "--samples", "1", "--aov", "color", "--explain")
    arguments += ("--backend", "gpu", str(path), str(tmp_path / "out.exr"))
    told = command(*arguments, HDTRAPEZE_FIRST_ON_GPU="trace")
    assert told.returncode == 0 and "from the stage trace on" in told.stdout + told.stderr


@pytest.mark.parametrize("backend", ["gpu", "auto", "cpu"])
def test_a_stage_that_there_is_not_is_told_whatever_renders(tmp_path, backend):
    if backend == "gpu" and not devices():
        pytest.skip("no Vulkan, Metal or DX12 device is found")
    path = tmp_path / "scene.usda"
    stage = busy_stage()
    stage.GetRootLayer().Export(str(path))
    arguments = ("record", "--imageWidth", "16", "--samples", "1", "--backend", backend)
    arguments += (str(path), str(tmp_path / "out.exr"))
    refused = command(*arguments, HDTRAPEZE_FIRST_ON_GPU="cook")
    assert refused.returncode != 0
    assert "'cook', which is none of bound, build, instances" in refused.stderr


@needs_device
def test_the_cost_of_rays_is_told_to_be_missing():
    stage = busy_stage()
    images, warnings = render(stage, "gpu", ("color", "cost"))
    assert len(warnings) == 1 and "cost is 0" in str(warnings[0])
    assert not images["cost"].any()
    _, warnings = render(stage, "cpu", ("color", "cost"))
    assert warnings == []


@needs_device
def test_a_command_whose_gpu_did_not_render_all_writes_it_and_ends_with_an_error(tmp_path):
    path = tmp_path / "scene.usda"
    stage = busy_stage()
    add_turning(stage)
    stage.GetRootLayer().Export(str(path))
    out = tmp_path / "out.png"
    small = ("record", "--imageWidth", "16", "--samples", "1", "--camera", "/camera")
    small += (str(path), str(out))
    for quiet, lines in (((), 2), (("--quiet",), 1)):
        ended = command(*small, "--cull", "back", "--backend", "gpu", *quiet)
        # Drivers have their own lines.
        told = [line for line in ended.stderr.splitlines() if "turn over" in line]
        assert ended.returncode == 1 and out.exists() and len(told) == lines
        assert told[-1].startswith("error: The GPU did not render all")
        assert all("frame 0: the GPU cannot trace" in line for line in told)
        out.unlink()
    explained = command(*small, "--cull", "back", "--backend", "gpu", "--explain")
    assert "backend: cpu (the GPU cannot trace" in explained.stdout
    out.unlink()
    for arguments in (("--cull", "back", "--backend", "auto"), ("--backend", "gpu")):
        ended = command(*small, *arguments)
        assert ended.returncode == 0 and "The GPU" not in ended.stderr and out.exists()
        out.unlink()


def test_without_a_driver_it_is_an_error(tmp_path):
    """VK_DRIVER_FILES tells the Vulkan loader which drivers there are."""
    nothing = {"VK_DRIVER_FILES": str(tmp_path / "none.json"), "VK_ICD_FILENAMES": ""}
    listed = command("devices", **nothing)
    assert listed.returncode == 0 and "No GPU is found" in listed.stdout
    path = tmp_path / "scene.usda"
    stage = busy_stage()
    stage.GetRootLayer().Export(str(path))
    out = tmp_path / "out.png"
    arguments = ("record", "--imageWidth", "16", "--samples", "1", str(path), str(out))
    refused = command(*arguments, "--backend", "gpu", **nothing)
    assert refused.returncode != 0 and not out.exists()
    assert len(refused.stderr.strip().splitlines()) == 1
    assert "no GPU is found" in refused.stderr
    assert command(*arguments, "--backend", "auto", **nothing).returncode == 0
    assert out.exists()
