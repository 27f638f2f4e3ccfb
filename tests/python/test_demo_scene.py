"""The demo scene is what its script writes, and holds what it promises."""

import subprocess
import sys
from pathlib import Path

import numpy as np
from hdtrapeze.cli import main
from pxr import Sdf, Usd, UsdGeom

ROOT = Path(__file__).resolve().parents[2]
SCENE = ROOT / "examples/demo/demo.usda"


def differences(a: Sdf.Layer, b: Sdf.Layer) -> list[str]:
    """Specs that differ; floats may differ in their last rounded digit, as libms differ."""
    found = []

    def paths(layer):
        seen = []
        layer.Traverse(Sdf.Path.absoluteRootPath, seen.append)
        return {str(path) for path in seen}

    if a.pseudoRoot.GetInfo("renderSettingsPrimPath") != b.pseudoRoot.GetInfo(
        "renderSettingsPrimPath"
    ):
        found.append("renderSettingsPrimPath")
    for path in sorted(paths(a) ^ paths(b)):
        found.append(f"{path} is in one of the two only")
    for path in sorted(paths(a) & paths(b)):
        one, two = a.GetAttributeAtPath(path), b.GetAttributeAtPath(path)
        if one is None or two is None:
            continue
        times = a.ListTimeSamplesForPath(path)
        if times != b.ListTimeSamplesForPath(path):
            found.append(f"{path}: sample times")
            continue
        pairs = [(a.QueryTimeSample(path, t), b.QueryTimeSample(path, t)) for t in times]
        pairs.append((one.default, two.default))
        if not all(close(x, y) for x, y in pairs):
            found.append(f"{path}: values")
    return found


def close(x, y) -> bool:
    if x == y:
        return True
    try:
        x, y = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
    except (TypeError, ValueError):
        return False
    return x.shape == y.shape and bool(np.all(np.abs(x - y) <= 0.0101))


def test_the_script_writes_the_committed_scene(tmp_path):
    written = tmp_path / "demo.usda"
    script = ROOT / "examples/demo/make_demo.py"
    subprocess.run([sys.executable, script, written], check=True)
    assert differences(Sdf.Layer.FindOrOpen(str(SCENE)), Sdf.Layer.FindOrOpen(str(written))) == []


def test_a_changed_scene_is_noticed(tmp_path):
    changed = tmp_path / "changed.usda"
    text = SCENE.read_text(encoding="utf-8")
    assert "float fStop = " in text
    changed.write_text(text.replace("float fStop = ", "float fStop = 1"), encoding="utf-8")
    found = differences(Sdf.Layer.FindOrOpen(str(SCENE)), Sdf.Layer.FindOrOpen(str(changed)))
    assert found == ["/World/Camera.fStop: values"]


def test_its_render_settings_name_the_camera(tmp_path, capsys):
    out = tmp_path / "demo.png"
    flags = ["-w", "16", "--samples", "1", "--shading-rate", "20"]
    assert main(["record", str(SCENE), str(out), *flags]) == 0
    text = capsys.readouterr()
    assert "Camera: /World/Camera" in text.out
    assert text.err == ""


def test_it_moves_defocuses_instances_and_creases():
    stage = Usd.Stage.Open(str(SCENE))
    camera = UsdGeom.Camera.Get(stage, "/World/Camera")
    assert camera.GetShutterOpenAttr().Get() < camera.GetShutterCloseAttr().Get()
    assert camera.GetFStopAttr().Get() > 0.0
    prims = list(Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies()))
    assert any(prim.IsInstance() for prim in prims)
    assert any(prim.IsA(UsdGeom.PointInstancer) for prim in prims)
    meshes = [UsdGeom.Mesh(prim) for prim in prims if prim.IsA(UsdGeom.Mesh)]
    assert {mesh.GetSubdivisionSchemeAttr().Get() for mesh in meshes} == {"catmullClark"}
    assert any(mesh.GetCreaseIndicesAttr().Get() for mesh in meshes)
    assert any(mesh.GetPointsAttr().GetNumTimeSamples() > 2 for mesh in meshes)
    for mesh in meshes:
        counts = mesh.GetFaceVertexCountsAttr().Get()
        indices = mesh.GetFaceVertexIndicesAttr().Get()
        points = mesh.GetPointsAttr().Get(1.0)
        assert sum(counts) == len(indices)
        assert 0 <= min(indices) <= max(indices) < len(points)
        assert mesh.ValidateTopology(indices, counts, len(points))


def test_its_script_writes_both_pictures(tmp_path, monkeypatch, capsys):
    monkeypatch.syspath_prepend(str(ROOT / "scripts"))
    import demo

    monkeypatch.setattr(demo, "OUT", tmp_path)
    flags = ["-w", "16", "--samples", "1", "--shading-rate", "20", "--quiet"]
    assert demo.main(flags) == 0
    assert str(tmp_path / "demo.exr") in capsys.readouterr().out
    assert (tmp_path / "demo.exr").read_bytes()[:4] == b"\x76\x2f\x31\x01"
    assert (tmp_path / "demo.png").read_bytes()[:4] == b"\x89PNG"
