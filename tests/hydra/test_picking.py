"""Buffers as a host has them in memory, and what it decodes ids to: what usdview picks with."""

import json
import math

import pytest
import sdk
from test_agreement import SCENES

PROBE = """
    import ctypes

    probe = ctypes.CDLL(library).probe
    behind = ctypes.c_float(red)
    for name, x, y in (("hit", 5, 5), ("background", 95, 75)):
        out = f"{name}.json".encode()
        assert probe(scene.encode(), b"/cam", 100, 80, x, y, behind, out) == 0
"""

HALF4, FLOAT1, FLOAT2, FLOAT3, INT = 11, 12, 13, 14, 24
"""HdFormat."""


def probe(host, red):
    """At a pixel of a square, and at one that shows what is behind all: that much red."""
    assert sdk.PROBE.exists(), "the probe is not built: make hydra"
    ran = host.run(PROBE, scene=SCENES / "picking.usda", library=sdk.PROBE, red=red)
    assert ran.warnings == []
    texts = [(ran.folder / f"{name}.json").read_text() for name in ("hit", "background")]
    return [json.loads(text.replace("nan", "NaN")) for text in texts]


@pytest.fixture
def probed(host):
    return probe(host, 0.25)


def test_ids_decode_to_the_prims_and_instances_that_are_there(probed):
    found = {}
    for hit in probed[0]["hits"]:
        # Squares are ten pixels apart, the one at the origin in the lower left corner.
        place = round(hit["x"] / 10 - 0.5), round(hit["y"] / 10 - 0.5)
        assert abs(hit["x"] - 10 * place[0] - 5) < 0.2 and abs(hit["y"] - 10 * place[1] - 5) < 0.2
        assert 60 <= hit["count"] <= 66
        found[place] = hit["path"], [tuple(level) for level in hit["context"]]
    expected = {(0, 0): ("/Mesh", [])}
    for i in range(4):
        path = "/Points/B/Part" if i % 2 else "/Points/A"
        expected[i, 1] = path, [("/Points", i)]
    for outer in range(2):
        for inner in range(3):
            context = [("/Outer", outer), ("/Outer/Inner", inner)]
            expected[inner, 2 + outer] = "/Outer/Inner/C", context
    for i in range(3):
        expected[i, 4] = f"/Native/N{i}/Part", []
    for i, name in enumerate(["First", "Second", "First", "Second"]):
        expected[i, 5] = f"/OfNative/D/{name}/Part", [("/OfNative", i // 2)]
    assert found == expected


def test_formats_and_values(probed):
    hit, background = (
        {name: (aov["format"], aov["value"]) for name, aov in told["aovs"].items()}
        for told in probed
    )
    for told in probed:
        assert {(aov["width"], aov["height"]) for aov in told["aovs"].values()} == {(100, 80)}
    assert background == {
        "color": (HALF4, [0.25, 0.5, 0.75, 1]),
        "depth": (FLOAT1, [1]),
        "primId": (INT, [-1]),
        "instanceId": (INT, [-1]),
        "elementId": (INT, [-1]),
        "normal": (FLOAT3, [0, 0, 0]),
        "Neye": (FLOAT3, [0, 0, 0]),
        "primvars:st": (FLOAT3, [0, 0, 0]),
        "cost": (FLOAT2, background["cost"][1]),
        "motionVectors": (FLOAT2, [0, 0]),
        "sampleCount": (INT, [4]),
    }
    assert {name: kind for name, (kind, _) in hit.items()} == {
        name: kind for name, (kind, _) in background.items()
    }
    values = {name: value for name, (_, value) in hit.items()}
    assert values["depth"][0] == pytest.approx(9 / 19, abs=1e-6)
    assert values["normal"] == values["Neye"] == [0, 0, 1]
    assert values["instanceId"] == values["elementId"] == [0]
    # Rows go up: the pixel is right of the square's middle, and above it.
    assert values["primvars:st"] == pytest.approx([0.5625, 0.5625, 0], abs=0.05)
    assert values["primvars:st"][1] > 0.5 < values["primvars:st"][0]
    assert values["cost"][0] > 0


def test_colours_in_the_format_that_is_asked_for(probed):
    for told, alpha in zip(probed, (1, 1), strict=True):
        float32, float16, unorm8 = told["colors"]
        assert float32[3] == alpha and float32[0] > 0.05
        assert float16 == pytest.approx(float32, abs=1e-3)
        assert unorm8 == pytest.approx([min(c, 1.0) for c in float32], abs=0.6 / 255)


def test_a_clear_value_that_is_no_number_is_seen_where_nothing_is(host, probed):
    for told, before, is_behind in zip(probe(host, math.nan), probed, (False, True), strict=True):
        colors = zip(told["colors"][:2], before["colors"][:2], strict=True)
        for now, then in colors:
            assert math.isnan(now[0]) == is_behind
            assert now[is_behind:] == then[is_behind:]
        assert told["aovs"]["primId"] == before["aovs"]["primId"]


def test_a_buffer_without_width_keeps_no_other_from_showing_the_image(delegate_host):
    script = """
    import ctypes

    after_width = ctypes.CDLL(library).after_width
    tell(covered=[after_width(scene.encode(), b"/cam", width) for width in (48, 0)])
    """
    ran = delegate_host.run(script, library=sdk.PROBE, scene=SCENES / "picking.usda")
    always, after_none = ran.told["covered"]
    assert 0 < always == after_none
    assert ran.warnings == []
