"""The same scene through a Hydra host and through `hdtrapeze record` gives the same image."""

from pathlib import Path

import numpy as np
import pytest
from driver import record

SCENES = Path(__file__).parent / "scenes"


def assert_alike(ours, other):
    """Equal but for the last bit of matrices and lenses: Hydra hands some on as floats, which may
    round a value of 16 bits otherwise, and put few samples on the other side of an edge."""
    different = ours != other
    assert different.mean() < 0.002
    assert np.abs(ours - other).max() < 2.5 / 64
    np.testing.assert_allclose(ours.mean((0, 1)), other.mean((0, 1)), atol=1e-5)


@pytest.mark.parametrize("name", ["still"])
def test_still(host, tmp_path, name):
    scene = SCENES / f"{name}.usda"
    ran = host.run("record(Usd.Stage.Open(scene), 'hydra.exr', '/main_cam')", scene=scene)
    assert ran.warnings == []
    ours = ran.image("hydra.exr")
    other = record(scene, tmp_path / "record.exr", "-w", 96)
    assert ours.shape == other.shape == (64, 96, 4)
    assert_alike(ours, other)
