"""Framing: data windows within and beyond the image, shapes of pixels, window policies. The host's
image is the one that `hdtrapeze record` writes."""

import numpy as np
import pytest
from driver import record
from images import exr_header, read_exr
from test_agreement import SCENES

SCENE = SCENES / "still.usda"

FRAMED = """
    stage = Usd.Stage.Open(scene)
    view = View(stage, "/main_cam", samples=16)
    def rect(x0, y0, x1, y1):
        return Gf.Rect2i(Gf.Vec2i(x0, y0), Gf.Vec2i(x1 - 1, y1 - 1))
    width, height = size
    framing = CameraUtil.Framing(
        Gf.Range2f(Gf.Vec2f(0, 0), Gf.Vec2f(width, height)), rect(*window), aspect)
    view.engine.SetFraming(framing)
    view.engine.SetRenderBufferSize(Gf.Vec2i(width, height))
    if policy:
        view.engine.SetOverrideWindowPolicy(getattr(CameraUtil, policy))
    view.render()
    view.save("framed.exr")
"""


def framed(host, window=None, size=(96, 64), aspect=1.0, policy=""):
    given = {"size": size, "window": window or (0, 0, *size), "aspect": aspect, "policy": policy}
    ran = host.run(FRAMED, scene=SCENE, **given)
    assert ran.warnings == []
    return read_exr(ran.folder / "framed.exr"), exr_header(ran.folder / "framed.exr")


@pytest.mark.parametrize(
    ("window", "flags"),
    [
        ((10, 8, 60, 40), ["--crop", "10", "8", "60", "40"]),
        ((-12, -12, 108, 76), ["--overscan", "12"]),
    ],
    ids=["crop", "overscan"],
)
def test_data_windows(host, tmp_path, window, flags):
    ours, header = framed(host, window)
    other = record(SCENE, tmp_path / "record.exr", "-w", 96, "--samples", 16, *flags)
    theirs = exr_header(tmp_path / "record.exr")
    assert header["dataWindow"] == theirs["dataWindow"]
    assert header["displayWindow"] == theirs["displayWindow"]
    colors = np.stack([ours[name] for name in "RGBA"], axis=-1)
    assert colors.shape == other.shape
    np.testing.assert_allclose(colors[..., 3], other[..., 3], atol=2.1 / 16)
    assert (np.abs(colors[..., 3] - other[..., 3]) > 1e-3).mean() < 0.005


@pytest.mark.parametrize(
    ("policy", "conform", "aspect"),
    [
        ("MatchVertically", "adjustApertureWidth", 1.0),
        ("MatchVertically", "adjustApertureWidth", 2.0),
        ("MatchHorizontally", "adjustApertureHeight", 2.0),
        ("Fit", "expandAperture", 1.0),
        ("Fit", "expandAperture", 2.0),
        ("Crop", "cropAperture", 1.0),
        ("Crop", "cropAperture", 2.0),
        ("DontConform", "adjustPixelAspectRatio", 1.0),
    ],
)
def test_window_policies_and_shapes_of_pixels(delegate_host, tmp_path, policy, conform, aspect):
    ours, _ = framed(delegate_host, None, (48, 48), aspect, policy)
    scene = tmp_path / "settings.usda"
    scene.write_text(
        f"""#usda 1.0
        (
            subLayers = [@{SCENE}@]
        )
        def RenderSettings "Settings"
        {{
            int2 resolution = (48, 48)
            float pixelAspectRatio = {aspect}
            token aspectRatioConformPolicy = "{conform}"
            rel camera = </main_cam>
        }}
        """
    )
    flags = ["--samples", 16, "--renderSettingsPrimPath", "/Settings"]
    other = record(scene, tmp_path / "record.exr", *flags)
    assert (np.abs(ours["A"] - other[..., 3]) > 1e-3).mean() < 0.005
