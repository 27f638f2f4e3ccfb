"""The tests need the renderer's library: `cargo build --release -p hdtrapeze-capi`."""

import logging

import pytest


@pytest.fixture(autouse=True)
def messages(caplog):
    """What is logged shows where a test fails."""
    caplog.set_level(logging.INFO, logger="hdtrapeze")
    return caplog
