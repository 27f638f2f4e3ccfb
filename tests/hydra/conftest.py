"""Where no OpenUSD is configured, every test here is skipped. Where one is, nothing is."""

import sys
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parent.parent / "python"))

import sdk
from driver import Host


def pytest_collection_modifyitems(items):
    if not sdk.configured():
        for item in items:
            if Path(__file__).parent in item.path.parents:
                item.add_marker(pytest.mark.skip(reason=sdk.ABSENT))


@pytest.fixture(params=[False, True], ids=["delegate", "sceneindex"])
def host(request, tmp_path) -> Host:
    """Runs scripts in OpenUSD's Hydra, with its scene delegate and with its scene indices."""
    return Host(tmp_path, scene_index=request.param)


@pytest.fixture
def delegate_host(tmp_path) -> Host:
    """For what is the same both ways."""
    return Host(tmp_path, scene_index=False)


@pytest.fixture
def index_host(tmp_path) -> Host:
    """For what arrives by scene indices alone."""
    return Host(tmp_path, scene_index=True)
