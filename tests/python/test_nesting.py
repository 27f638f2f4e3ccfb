"""Instances of every nesting look like the same scene written out, prim by prim."""

import numpy as np
import pytest
from flatten import canonical, flatten
from instance_scenes import MOVING, NESTINGS, make
from scenes import render

AOVS = ("color", "depth", "primId", "instanceId", "elementId")
SIZE = 96


def names(image, name_of):
    """A number for the appearance at each pixel, by what `name_of` makes of its ids."""
    ids = np.stack([image["primId"], image["instanceId"]], axis=-1).reshape(-1, 2)
    unique, inverse = np.unique(ids, axis=0, return_inverse=True)
    found = [name_of(image.prim_paths.get(prim), instance) for prim, instance in unique.tolist()]
    return np.array(found, dtype=object)[inverse.ravel()].reshape(image["primId"].shape)


def compare(stage, frame=0.0, times=(0.0,), **settings):
    """Renders both, and gives the pixels where they show different things, and the images."""
    flat, known = flatten(stage, frame, times)
    settings = {"aovs": AOVS, "width": SIZE, "height": SIZE, "samples": 4} | settings
    a, b = render(stage, frame, **settings), render(flat, frame, **settings)

    def ours(path, instance):
        return (canonical(stage.GetPrimAtPath(path)), instance) if path else None

    def theirs(path, _):
        return known[path] if path else None

    return names(a, ours) != names(b, theirs), a, b


def differing(a, b):
    """Pixels that are not of the same color."""
    return (np.abs(a["color"] - b["color"]).max(axis=-1) > 1e-5).sum()


@pytest.mark.parametrize("author", NESTINGS, ids=lambda author: author.__name__)
def test_still_instances_are_what_they_are_written_out(author):
    stage = make(author)
    other, a, b = compare(stage)
    # Samples are the same; a ray through an edge may fall to either side.
    assert other.sum() <= 1, f"{other.sum()} pixels show something else"
    same = ~other
    assert len(np.unique(a["primId"][same])) > 2
    np.testing.assert_array_equal(a["elementId"][same], b["elementId"][same])
    np.testing.assert_allclose(a["depth"][same], b["depth"][same], rtol=1e-6)
    assert differing(a, b) <= 2
    loops = [path for path, code, _ in a.warnings if code == "instancer-loop"]
    assert len(loops) == len(a.warnings) == (2 if author.__name__ == "recursive" else 0)


@pytest.mark.parametrize("author", MOVING, ids=lambda author: author.__name__)
def test_moving_instances_blur_like_what_they_are_written_out(author):
    stage = make(author)
    times = tuple(np.linspace(0, 1, 65))
    settings = {"shutter": (0, 1), "samples": 64, "width": 64, "height": 64}
    other, a, b = compare(stage, 0.0, times, **settings)
    # One sample a pixel decides ids.
    assert other.mean() < 0.005
    np.testing.assert_allclose(a["color"], b["color"], atol=0.02)
    assert np.sqrt(np.mean((a["color"] - b["color"]) ** 2)) < 0.0005
    assert a.warnings == []


def test_a_wrong_instance_is_seen():
    """The comparison can fail: with one scale a little larger, it does."""
    stage = make(NESTINGS[0])
    flat, _ = flatten(stage)
    scales = stage.GetPrimAtPath("/i").GetAttribute("scales")
    values = list(scales.Get())
    values[1] = (2, 1.1, 1)
    scales.Set(values)
    other, a, b = compare(stage)
    assert other.sum() <= 1, "both have changed"
    assert differing(a, b) <= 2
    unchanged = render(flat, aovs=AOVS, width=SIZE, height=SIZE)
    assert differing(a, unchanged) > 20
