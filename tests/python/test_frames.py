"""Frame ranges and placeholders follow usdrecord."""

import pytest
from hdtrapeze import UsageError
from hdtrapeze.frames import OutputPath, parse_frames
from pxr import UsdUtils


@pytest.mark.parametrize(
    ("spec", "frames", "decimals"),
    [
        ("12", [12], 0),
        ("1:3", [1, 2, 3], 0),
        ("3:1", [3, 2, 1], 0),
        ("1:7x3", [1, 4, 7], 0),
        ("1:8x3", [1, 4, 7], 0),
        ("7:1x3", [7, 4, 1], 0),
        ("7:1x-3", [7, 4, 1], 0),
        ("-2:-1", [-2, -1], 0),
        ("100", [100], 0),
        ("0:1x0.1", [i / 10 for i in range(11)], 1),
        ("1:2x0.5", [1, 1.5, 2], 1),
        ("1,10:11,20.25", [1, 10, 11, 20.25], 2),
    ],
)
def test_frame_specs(spec, frames, decimals):
    assert parse_frames(spec) == (frames, decimals)


@pytest.mark.parametrize("spec", ["", "x", "1:2:3", "1:", "1,,2", "1x2", "nan", "1:2x"])
def test_wrong_frame_specs(spec):
    with pytest.raises(UsageError, match="not a frame range"):
        parse_frames(spec)


@pytest.mark.parametrize("spec", ["1:2x0", "1:2x-1"])
def test_strides_that_lead_nowhere(spec):
    with pytest.raises(UsageError, match="nowhere"):
        parse_frames(spec)


@pytest.mark.parametrize(
    "spec", ["12", "101:105", "105:101", "101:109x2", "101:110x2", "101:104x0.5"]
)
def test_ranges_are_those_of_usd(spec):
    usd = UsdUtils.TimeCodeRange.CreateFromFrameSpec(spec)
    assert parse_frames(spec)[0] == pytest.approx([code.GetValue() for code in usd])


def test_placeholders():
    assert OutputPath("a.####.exr").at(7) == "a.0007.exr"
    assert OutputPath("a_##.#.exr").at(1.5) == "a_01.5.exr"
    assert OutputPath("a#.exr").at(123) == "a123.exr"
    assert OutputPath("a.exr").at(3) == "a.exr"
    for name in ("a<F4>.exr", "a$F4.exr", "a%04d.exr"):
        assert OutputPath(name).at(7) == "a0007.exr"


@pytest.mark.parametrize(
    ("path", "frames", "decimals", "words"),
    [
        ("a.exr", [1, 2], 0, "placeholder"),
        ("a.###.exr", None, 0, "--frames"),
        ("a.###.exr", [1, 1.5], 1, "###.#"),
    ],
)
def test_paths_that_cannot_hold_the_frames(path, frames, decimals, words):
    with pytest.raises(UsageError, match=words):
        OutputPath(path).check(frames, decimals)


def test_two_placeholders():
    with pytest.raises(UsageError, match="more than one"):
        OutputPath("##/a.##.exr")


def test_one_frame_needs_no_placeholder():
    OutputPath("a.exr").check([5], 0)
