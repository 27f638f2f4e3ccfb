"""Runs scripts in a process of the configured OpenUSD, and scenes through `hdtrapeze record`.

The test process has usd-core's `pxr`, which knows no Hydra, so hosts are processes of their own.
"""

import json
import re
import subprocess
import textwrap
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import sdk
from hdtrapeze.cli import main
from images import read_exr

HERE = Path(__file__).parent


@dataclass
class Ran:
    """What a script of a host left."""

    told: dict
    log: str
    folder: Path

    @property
    def warnings(self) -> list[tuple[str, str]]:
        """The renderer's warnings and errors: path of the prim, text."""
        found = re.findall(r"(?:Warning|Error).* -- Trapeze(?: <([^>]*)>)?: (.*)", self.log)
        return [(path, text) for path, text in found]

    def image(self, name: str) -> np.ndarray:
        """An EXR's colour, (height, width, RGBA)."""
        return rgba(self.folder / name)


class Host:
    """A host with or without scene indices, in a folder of the test's."""

    def __init__(self, folder: Path, scene_index: bool):
        self.folder = folder
        self.scene_index = scene_index

    def run(self, script: str, timeout: float = 60.0, **given) -> Ran:
        """Runs `script`, with all of host.py and the values `given`; its `tell(name=value)` comes
        back. A script that fails, crashes or hangs fails the test."""
        told = self.folder / "told.json"
        told.unlink(missing_ok=True)
        job = self.folder / "job.py"
        job.write_text(textwrap.dedent(script), encoding="utf-8")
        values = {name: str(v) if isinstance(v, Path) else v for name, v in given.items()}
        command = [sdk.python(), str(HERE / "host.py"), str(job), json.dumps(values)]
        done = self.start(command, timeout)
        assert done.returncode == 0, f"exit {done.returncode}\n{done.stdout}"
        result = json.loads(told.read_text()) if told.exists() else {}
        return Ran(result, done.stdout, self.folder)

    def start(self, command: list[str], timeout: float = 60.0) -> subprocess.CompletedProcess:
        """Any command of the host's OpenUSD, in the test's folder."""
        assert sdk.PLUGIN.exists(), "the plugin is not built: make hydra"
        return subprocess.run(
            command,
            cwd=self.folder,
            env=sdk.environment(self.scene_index),
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=timeout,
        )


def rgba(path) -> np.ndarray:
    """An EXR's colour, (height, width, RGBA), as floats."""
    channels = read_exr(path)
    return np.stack([channels[name] for name in "RGBA"], axis=-1).astype(np.float32)


def record(scene: Path, out: Path, *flags) -> np.ndarray | None:
    """The colour that `hdtrapeze record` renders, in 16 bits as Hydra's hosts write it; None where
    the name is that of several files."""
    assert main(["record", "-q", str(scene), str(out), *map(str, flags)]) == 0
    return None if "#" in str(out) else rgba(out)
