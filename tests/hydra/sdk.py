"""The OpenUSD whose Hydra is tested, as scripts/hydra.sh describes it, and the plugin for it."""

import os
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
PLUGIN = ROOT / "build/hydra/plugin/hdTrapeze"
PROBE = ROOT / "build/hydra/hdTrapezeProbe.so"
ABSENT = (
    "no OpenUSD SDK is configured: set OPENUSD_ROOT, or OPENUSD_INCLUDE_DIR, OPENUSD_LIBRARY, "
    "OPENUSD_PYTHONPATH and OPENUSD_LD_LIBRARY_PATH, and run `make hydra`"
)


def configured() -> bool:
    """Whether the environment names an OpenUSD."""
    return bool(os.environ.get("OPENUSD_ROOT") or os.environ.get("OPENUSD_INCLUDE_DIR"))


def python() -> str:
    """The host's interpreter; not .venv's, which has another `pxr`."""
    return os.environ.get("OPENUSD_PYTHON") or getattr(sys, "_base_executable", sys.executable)


def environment(scene_index: bool) -> dict[str, str]:
    """Variables of a host: its `pxr`, libraries, plugin, and which way scenes reach Hydra."""
    root = os.environ.get("OPENUSD_ROOT")
    kept = {
        k: v for k, v in os.environ.items() if not k.startswith(("PXR_", "USDIMAGING", "PYTHON"))
    }
    return kept | {
        "PYTHONPATH": os.environ.get("OPENUSD_PYTHONPATH") or f"{root}/lib/python",
        "LD_LIBRARY_PATH": os.environ.get("OPENUSD_LD_LIBRARY_PATH") or f"{root}/lib",
        "PXR_PLUGINPATH_NAME": str(PLUGIN),
        "USDIMAGINGGL_ENGINE_ENABLE_SCENE_INDEX": str(int(scene_index)),
    }
