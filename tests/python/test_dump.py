"""`hdtrapeze dump`: committed texts, stable from run to run; its flags and faults.

`TRZ_WRITE_DUMPS=1 pytest tests/python/test_dump.py` writes the texts anew: read what changed.
"""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from hdtrapeze.cli import main

DUMPS = Path(__file__).parent.parent / "dumps"
SCENES = sorted(path.stem for path in DUMPS.glob("*.usda"))


def dump(capsys, *arguments) -> str:
    """The command's output."""
    assert main(["dump", "-q", *map(str, arguments)]) == 0
    return capsys.readouterr().out


@pytest.mark.parametrize("name", SCENES)
def test_committed_text(name, capsys):
    text = dump(capsys, DUMPS / f"{name}.usda")
    golden = DUMPS / f"{name}.txt"
    if os.environ.get("TRZ_WRITE_DUMPS"):
        golden.write_text(text, encoding="utf-8")
    assert text == golden.read_text(encoding="utf-8")


def test_there_are_scenes():
    assert len(SCENES) >= 4


def test_flags_choose_what_is_told(capsys):
    scene = DUMPS / "mesh.usda"
    assert "ForRenders" not in dump(capsys, scene)
    assert "mesh /World/ForRenders" in dump(capsys, scene, "--purposes", "render")
    masked = dump(capsys, scene, "--mask", "/World/Polygons,/main_cam")
    assert "Polygons" in masked
    assert "Creased" not in masked
    still = dump(capsys, DUMPS / "motion.usda", "--no-motion-blur")
    assert "shutter 0 0" in still
    assert " at shutter" not in still


def test_frames_follow_each_other(capsys):
    text = dump(capsys, DUMPS / "motion.usda", "--frames", "1:2")
    assert text.startswith("frame 1\nhdtrapeze dump 1\n")
    assert "\nframe 2\nhdtrapeze dump 1\n" in text
    assert dump(capsys, DUMPS / "motion.usda", "-d").startswith("default time\n")


def test_whole_numbers_keep_their_sign(tmp_path, capsys):
    numbers = "3000000000, 7"
    for kind, text in (("uint[]", numbers), ("uint64[]", numbers), ("int[]", "-3, 7")):
        scene = tmp_path / f"{kind}.usda"
        scene.write_text(
            '#usda 1.0\ndef Points "dots" {\n    point3f[] points = [(0, 0, 0), (1, 0, 0)]\n'
            f'    {kind} primvars:number = [{text}] (interpolation = "vertex")\n}}\n'
        )
        found = dump(capsys, scene, "--aov", "primvars:number")
        assert f"primvar number vertex 2: {text.replace(',', '')}\n" in found


def test_into_a_file(tmp_path, capsys):
    out = tmp_path / "scene.txt"
    assert dump(capsys, DUMPS / "mesh.usda", "-o", out) == ""
    assert out.read_text() == dump(capsys, DUMPS / "mesh.usda")
    assert [path.name for path in tmp_path.iterdir()] == ["scene.txt"]
    assert main(["dump", str(DUMPS / "mesh.usda"), "-o", str(tmp_path / "no/scene.txt")]) == 3
    assert "error: " in capsys.readouterr().err


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is full")
def test_a_full_disk():
    command = [sys.executable, "-m", "hdtrapeze", "dump", "-q", str(DUMPS / "mesh.usda")]
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True)
    assert done.returncode == 3
    assert done.stderr == "error: The text cannot be written: No space left on device.\n"


@pytest.mark.parametrize("flags", [["--sampels", "4"], ["--samples", "many"], ["--samples", "0"]])
def test_usage_errors_point_to_the_help(capsys, flags):
    try:
        code = main(["dump", str(DUMPS / "mesh.usda"), *flags])
    except SystemExit as end:
        code = end.code
    assert code == 2
    assert capsys.readouterr().err.endswith("See `hdtrapeze dump --help`.\n")


def test_wrong_commands(capsys, tmp_path):
    with pytest.raises(SystemExit) as wrong:
        main(["dump"])
    assert wrong.value.code == 2
    assert main(["dump", str(tmp_path / "none.usda")]) == 3
    assert "does not exist" in capsys.readouterr().err
