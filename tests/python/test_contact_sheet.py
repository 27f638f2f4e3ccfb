"""The contact sheet tells files that fail from those that have nothing to show."""

import importlib.util
from pathlib import Path

import pytest
from scenes import add_camera, add_mesh, add_quad, new_stage

Image = pytest.importorskip("PIL.Image", reason="Pillow is in scripts/requirements-dev.txt")

ROOT = Path(__file__).resolve().parents[2]
SPEC = importlib.util.spec_from_file_location("contact_sheet", ROOT / "scripts/contact_sheet.py")
contact_sheet = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(contact_sheet)


def test_a_tile_and_a_line_for_each_file(tmp_path, capsys):
    stage = new_stage()
    add_camera(stage, "/main_cam")
    add_quad(stage)
    add_mesh(stage, "/bad", [(0, 0, 0)], [3], [0, 1, 2])
    stage.Export(str(tmp_path / "b.usda"))
    (tmp_path / "a").mkdir()
    (tmp_path / "a/broken.usda").write_text("#usda 1.0\nnonsense\n")
    sheet = tmp_path / "out/sheet.png"
    flags = ["-o", str(sheet), "--width", "40", "--samples", "1", "--columns", "2"]
    assert contact_sheet.main([str(tmp_path), *flags]) == 1
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("a/broken.usda  error, ")
    assert any(line.startswith("b.usda         1 warned, ") for line in lines)
    assert "2 files: 1 warned, 1 error" in lines
    with Image.open(sheet) as image:
        assert image.size == (2 * 46 + 6, 40 + 36 + 6)
        assert image.getpixel((6 + 20, 6 + 20)) < (60, 60, 60)
        assert image.getpixel((6 + 46 + 20, 6 + 20)) > (60, 60, 60)  # the quad of b.usda


@pytest.mark.parametrize(
    ("code", "said", "kind", "messages"),
    [
        (0, "", "ok", 0),
        (0, "info: 2 materials\n", "ok", 0),
        (0, "warning: /a: x\nwarning: /b: y\n", "warned", 2),
        (0, "warning: the stage has nothing to render for the purposes asked for", "empty", 1),
        (3, "error: cannot be read", "error", 2),
        (-11, "", "error", 1),
    ],
)
def test_what_came_of_a_file(tmp_path, code, said, kind, messages):
    picture = tmp_path / "x.png"
    picture.touch()
    result = contact_sheet.judge("x", code, said, picture, 1.0)
    assert (result.kind, len(result.messages)) == (kind, messages)
    assert contact_sheet.judge("x", 0, said, tmp_path / "none.png", 1.0).failed


def test_only_usd_files_are_found(tmp_path):
    for name in ("a.usd", "b/c.usdz", "b/d.USDA", "e.png", ".hidden/f.usda"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
    found = [str(p.relative_to(tmp_path)) for p in contact_sheet.find_files(tmp_path, [])]
    assert found == ["a.usd", "b/c.usdz", "b/d.USDA"]
    assert contact_sheet.find_files(tmp_path, ["b/*z"]) == [tmp_path / "b/c.usdz"]


def test_a_file_that_takes_too_long(tmp_path):
    found = contact_sheet.render(tmp_path, "x", tmp_path / "x.png", [], timeout=0.01)
    assert found.kind == "time out"
    assert found.failed


def test_a_picture_that_shows_nothing_is_blank(tmp_path):
    results = []
    for name, alpha in (("full", 255), ("blank", 0)):
        Image.new("RGBA", (8, 8), (200, 0, 0, alpha)).save(tmp_path / f"{name}.png")
        results.append(contact_sheet.Result(name, "ok", 0.0, [], tmp_path / f"{name}.png"))
    contact_sheet.paste(results, 8, 2)
    assert [result.kind for result in results] == ["ok", "blank"]
