"""The bench of loading runs and checks its images."""

import subprocess
import sys
from pathlib import Path

SCRIPT = Path(__file__).parents[2] / "scripts" / "load_time.py"


def test_small_stages_are_timed():
    run = subprocess.run(
        [sys.executable, str(SCRIPT), "--quick"], capture_output=True, text=True, timeout=120
    )
    assert run.returncode == 0, run.stderr
    rows = [line.split() for line in run.stdout.splitlines()[1:]]
    assert [row[:2] for row in rows] == [["100", "meshes"], ["1000", "instances"]]
    assert all(float(value) > 0 for row in rows for value in row[2:])
