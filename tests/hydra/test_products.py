"""Products of RenderSettings prims: files that the delegate writes itself, of hosts that want whole
images. They hold what `hdtrapeze record` writes."""

import os

import numpy as np
import pytest
import sdk
from hdtrapeze.cli import main
from images import exr_header, read_exr, read_png
from test_agreement import SCENES

FILES = ("main.exr", "other.0003.exr", "stretched.exr")


def usdrecord(host, scene, *flags):
    """OpenUSD's own command."""
    tool = os.environ.get("OPENUSD_USDRECORD")
    if not tool:
        pytest.skip("OPENUSD_USDRECORD is not set")
    command = [sdk.python(), tool, "--disableGpu", "--renderer", "Trapeze", "--imageWidth", "96"]
    done = host.start([*command, *flags, str(scene), "out.#.png"])
    assert done.returncode == 0, done.stdout
    return done.stdout


def recorded(scene, folder, monkeypatch, *flags):
    folder.mkdir()
    monkeypatch.chdir(folder)
    assert main(["record", "-q", "-w", "96", *flags, str(scene), "out.#.exr"]) == 0


def assert_alike(ours, other):
    """The same channels in the same types. Depths and colours may differ by the last bits, since
    Hydra's cameras are floats; ids may have other numbers, one for one."""
    assert sorted(ours) == sorted(other)
    for name, values in ours.items():
        theirs = other[name]
        assert (values.shape, values.dtype) == (theirs.shape, theirs.dtype), name
        if name == "id.X":
            pairs = set(zip(values.ravel().tolist(), theirs.ravel().tolist(), strict=True))
            assert len(pairs) == len({a for a, _ in pairs}) == len({b for _, b in pairs}) == 5
        else:
            difference = np.abs(values.astype(float) - theirs)
            assert difference.max() < (1e-6 if name == "zz.Z" else 1e-2), name
            assert (difference > 1e-4).mean() < 0.002, name


def test_usdrecord_writes_what_record_writes(host, tmp_path, monkeypatch):
    scene = SCENES / "products.usda"
    flags = ["--renderSettingsPrimPath", "/Render/Settings", "--frames", "3:3"]
    log = usdrecord(host, scene, *flags)
    assert "Trapeze <" not in log
    assert not (tmp_path / "out.3.png").exists(), "usdrecord did not find the products"
    folder = tmp_path / "record"
    recorded(scene, folder, monkeypatch, *flags)
    for name in FILES:
        assert_alike(read_exr(tmp_path / name), read_exr(folder / name))
    difference = read_png(tmp_path / "picture.png") != read_png(folder / "picture.png")
    assert difference.mean() < 0.01
    header = exr_header(tmp_path / "other.0003.exr")
    assert header["hdtrapeze/renderProduct"] == "/Render/Other"
    assert header["hdtrapeze/frame"] == 3
    theirs = exr_header(folder / "other.0003.exr")
    for name in ("dataWindow", "displayWindow", "pixelAspectRatio"):
        assert header[name] == theirs[name]


RECORD = """
    stage = Usd.Stage.Open(scene)
    assert stage.GetSessionLayer().ImportFromString("#usda 1.0\\n" + over)
    record(stage, "own.png", "/main_cam", 1.0, 96, ActiveRenderSettingsPrimPath="/Render/Settings")
"""


def product(name, file, text=""):
    name_of_file = f'token productName = "{file}"' if file else ""
    return f'def RenderProduct "{name}"\n{{\n{name_of_file}\n{text}\n}}\n'


def test_what_cannot_be_gives_one_warning_and_the_rest_is_written(host, tmp_path):
    (tmp_path / "folder.exr").mkdir()
    products = {
        "Deep": ("b.exr", 'token productType = "deepRaster"'),
        "NoName": ("", ""),
        "Jpeg": ("a.jpg", ""),
        "Again": ("./main.exr", ""),
        "Empty": ("e.exr", "int2 resolution = (0, 4)"),
        "Nothing": ("f.exr", "float4 dataWindowNDC = (0.5, 0.5, 0.5, 0.6)"),
        "NoPixel": ("j.exr", "float4 dataWindowNDC = (0.5, 0.5, 0.5001, 0.6)"),
        "Lost": ("missing/g.exr", ""),
        "Closed": ("/proc/k.exr", ""),
        "Folder": ("folder.exr", ""),
        "Var": ("h.exr", "rel orderedVars = </Render/Bad>"),
        "Setting": ("i.exr", 'int trapeze:samples = 0\nstring trapeze:x = "y"'),
    }
    if host.scene_index:  # else OpenUSD itself has an error
        products["Camera"] = ("c.exr", "rel camera = </World>")
    paths = ", ".join(f"</Render/{name}>" for name in ["Main", "Digits", *products])
    over = f"""
        over "Render"
        {{
            over "Settings"
            {{
                rel products = [{paths}]
            }}
            def RenderVar "Bad"
            {{
                string sourceName = "nonsense"
            }}
            def RenderVar "Words"
            {{
                string sourceName = "label"
                token sourceType = "primvar"
                token dataType = "string"
            }}
            {"".join(product(name, *rest) for name, rest in products.items())}
            {product("Digits", "a%099999999999d.exr", "rel orderedVars = </Render/Words>")}
        }}
    """
    ran = host.run(RECORD, scene=SCENES / "products.usda", over=over)
    sizes = (read_exr(tmp_path / "main.exr")["A"].shape[::-1], (96, 64))
    empty = [path for path, text in ran.warnings if "orderedVars is empty" in text]
    assert len(empty) == len(set(empty))
    rest = [warning for warning in ran.warnings if "orderedVars is empty" not in warning[1]]
    expected = [*products, "Bad", "Setting"]
    assert sorted(path for path, _ in rest) == ["", *sorted(f"/Render/{name}" for name in expected)]
    texts = dict(rest)
    assert texts["/Render/Closed"] == "the folder /proc is not writable; it is not written"
    assert texts["/Render/Empty"].endswith(f"65536 pixels; {sizes[host.scene_index]} is used")
    assert texts[""].startswith("AOV primvars:label: no prim has such a primvar of numbers")
    written = {path.name for path in tmp_path.iterdir() if path.suffix == ".exr"}
    digits = {name for name in written if name.startswith("a0")}
    assert len(digits) == 1 and len(max(digits)) == len("a.exr") + 64
    assert written - digits == {"main.exr", "e.exr", "f.exr", "i.exr", "folder.exr"}
    # The settings' where the host knows them, as `hdtrapeze record` has it, else the host's own.
    size = sizes[host.scene_index]
    for name in ("e.exr", "f.exr"):
        assert read_exr(tmp_path / name)["A"].shape[::-1] == size
    assert list(read_exr(tmp_path / "i.exr")) and not list((tmp_path / "folder.exr").iterdir())


def test_interactive_hosts_get_no_files(host, tmp_path):
    ran = host.run(
        """
        stage = Usd.Stage.Open(scene)
        view = View(stage, "/main_cam")
        view.engine.SetActiveRenderSettingsPrimPath("/Render/Settings")
        view.render()
        tell(samples=view.stats()["numCompletedSamples"])
        """,
        scene=SCENES / "products.usda",
    )
    assert ran.told == {"samples": 4}
    assert not list(tmp_path.glob("*.exr"))


BLURRED = """#usda 1.0
(
    subLayers = [@{scene}@]
)
def RenderSettings "Settings"
{{
    int2 resolution = (96, 64)
    rel camera = </main_cam>
    rel products = [</Blurred>, </Shutter>, </Still>, </Instant>]
    int trapeze:samples = 16
    {more}
}}
{products}
"""


@pytest.mark.parametrize("more", ["", "uniform bool disableMotionBlur = 1"])
def test_motion_of_products(host, tmp_path, monkeypatch, more):
    """Each product may have a shutter of its own, or none."""
    products = {
        "Blurred": "",
        "Shutter": "double2 trapeze:shutter = (-0.1, 0.2)",
        "Still": "uniform bool disableMotionBlur = 1",
        "Instant": "uniform bool instantaneousShutter = 1",
    }
    if more:
        products["Blurred"] = "uniform bool disableMotionBlur = 0"
    text = "".join(product(name, f"{name}.exr", rest) for name, rest in products.items())
    scene = tmp_path / "scene.usda"
    scene.write_text(BLURRED.format(scene=SCENES / "motion.usda", more=more, products=text))
    host.run(
        """
        stage = Usd.Stage.Open(scene)
        record(stage, "own.png", "/main_cam", 2.0, ActiveRenderSettingsPrimPath="/Settings")
        """,
        scene=scene,
    )
    folder = tmp_path / "record"
    recorded(scene, folder, monkeypatch, "-rs", "/Settings", "-f", "2:2")
    images, differs = {}, {}
    for name in products:
        ours, other = read_exr(tmp_path / f"{name}.exr"), read_exr(folder / f"{name}.exr")
        images[name] = ours["A"].astype(float)
        differs[name] = (np.abs(images[name] - other["A"]) > 1e-3).mean()
    if not host.scene_index and not more:  # OpenUSD's scene delegate does not tell
        assert differs.pop("Instant") > 0.1
    assert max(differs.values()) < 0.005, differs
    assert (images["Blurred"] != images["Still"]).mean() > 0.05


def test_each_frame_has_its_files(host, tmp_path):
    host.run(
        """
        stage = Usd.Stage.Open(scene)
        recorder = UsdAppUtils.FrameRecorder(PLUGIN, False)
        recorder.SetImageWidth(96)
        recorder.SetActiveRenderSettingsPrimPath("/Render/Settings")
        camera = UsdGeom.Camera(stage.GetPrimAtPath("/main_cam"))
        for frame in (1.0, 2.0, 3.0):
            assert recorder.Record(stage, camera, Usd.TimeCode(frame), "own.png")
        """,
        scene=SCENES / "products.usda",
    )
    written = sorted(path.name for path in tmp_path.glob("other.*.exr"))
    assert written == [f"other.{frame:04}.exr" for frame in (1, 2, 3)]


def test_hosts_may_go_or_edit_while_products_render(host):
    host.run(
        """
        for i in range(4):
            stage = Usd.Stage.Open(scene)
            view = View(stage, "/main_cam", samples=2000)
            view.engine.SetRendererSetting("enableInteractive", False)
            view.engine.SetActiveRenderSettingsPrimPath("/Render/Settings")
            view.draw()
            time.sleep(0.02 * i)
            if i == 2:
                for x in (1.0, 2.0, 3.0):
                    edit(stage, "/World.xformOp:translate", Gf.Vec3d(x, 0, 0))
                    view.draw()
            if i == 3:
                view.set(samples=2)
                view.render()
            del view
        """,
        scene=SCENES / "products.usda",
    )


def test_purposes_are_the_hosts(host):
    """Prims of other purposes are not synced: a warning says so."""
    over = """
        over "Render"
        {
            over "Settings"
            {
                uniform token[] includedPurposes = ["default", "proxy", "render"]
                rel products = </Render/Picture>
            }
        }
    """
    ran = host.run(RECORD, scene=SCENES / "products.usda", over=over)
    assert [path for path, _ in ran.warnings] == ["/Render/Settings"]
    assert "names render, which the host leaves out" in ran.warnings[0][1]


def test_cameras_of_products_know_a_shutter_that_is_set_later(index_host, tmp_path):
    scene = tmp_path / "moving_camera.usda"
    scene.write_text(
        """#usda 1.0
def Camera "cam" {
    double3 xformOp:translate = (0, 0, 20)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def Camera "moving" {
    double3 xformOp:translate.timeSamples = { 0: (-6, 0, 20), 2: (6, 0, 20) }
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def Sphere "s" {
}
def Scope "Render" {
    def RenderSettings "Settings" {
        rel camera = </cam>
        rel products = </Render/P>
        uniform int2 resolution = (64, 64)
    }
    def RenderProduct "P" {
        rel camera = </moving>
        token productName = "p.exr"
        uniform int2 resolution = (64, 64)
        rel orderedVars = </Render/V>
    }
    def RenderVar "V" {
        token dataType = "color4f"
        string sourceName = "Ci"
    }
}
"""
    )
    ran = index_host.run(
        """import shutil
stage = Usd.Stage.Open(scene)
view = View(stage, "/cam", interactive=False, samples=16)
view.engine.SetActiveRenderSettingsPrimPath("/Render/Settings")
view.render()
shutil.move("p.exr", "sharp.exr")
view.set(overrideShutter=True, shutterOpen=-0.5, shutterClose=0.5)
view.render()""",
        scene=scene,
    )
    columns = [
        (read_exr(ran.folder / n)["A"] > 0).any(axis=0).mean() for n in ("sharp.exr", "p.exr")
    ]
    assert columns[0] < 0.4 and columns[1] > 0.6
