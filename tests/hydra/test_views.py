"""Views that are drawn again and again: blur from the first image on, size, stop, several views in
one process, views that go while they render, and many of them one after the other."""

import math

import numpy as np
import pytest
from driver import record, rgba
from hdtrapeze.cli import main
from images import read_exr
from test_agreement import SCENES, assert_alike

FLAGS = ("-w", 96, "-f", 2, "--float", "--samples", 4)


def expected(host, *flags, name="motion"):
    """What the command renders, in 32 bits as views save it."""
    return record(SCENES / f"{name}.usda", host.folder / "record.exr", *FLAGS, *flags)


def test_the_first_image_is_blurred(host):
    script = """
    view = View(Usd.Stage.Open(scene), "/main_cam", samples=4)
    view.render(2)
    view.save("view.exr")
    """
    for name in ("motion", "instances", "camera"):
        ran = host.run(script, scene=SCENES / f"{name}.usda")
        image = expected(host, name=name)
        assert_alike(ran.image("view.exr"), image)
        still = expected(host, "--no-motion-blur", name=name)
        assert (still != image).mean() > 0.01


@pytest.mark.parametrize(
    ("open_at", "close_at"),
    [(-0.1, 0.1), (0, 0.5), (-0.5, 0), (-1, 2), (1, 0), (math.nan, 0.25), (0, math.inf)],
)
def test_shutters(host, open_at, close_at):
    """Also those that hold no sample; one that closes before it opens, which does not blur;
    and those that are no numbers."""
    script = """
    stage = Usd.Stage.Open(scene)
    edit(stage, "/main_cam.shutter:open", open_at)
    edit(stage, "/main_cam.shutter:close", close_at)
    stage.GetRootLayer().Export("scene.usda")
    view = View(stage, "/main_cam", samples=4)
    view.render(2)
    view.save("view.exr")
    """
    scene = SCENES / "instances.usda"
    ran = host.run(script, scene=scene, open_at=open_at, close_at=close_at)
    record(host.folder / "scene.usda", host.folder / "record.exr", *FLAGS)
    assert_alike(ran.image("view.exr"), rgba(host.folder / "record.exr"))


def test_a_camera_without_a_shutter(delegate_host):
    """As usdview's free one: the settings have a shutter for it, where the host takes samples for
    what is asked for."""
    script = """
    stage = Usd.Stage.Open(scene)
    frustum = UsdGeom.Camera(stage.GetPrimAtPath("/main_cam")).GetCamera(2).frustum
    view = View(stage, samples=4, overrideShutter=override, shutterOpen=-0.25, shutterClose=0.25)
    view.engine.SetCameraState(frustum.ComputeViewMatrix(), frustum.ComputeProjectionMatrix())
    view.render(2)
    view.save("view.exr")
    """
    scene = SCENES / "instances.usda"
    delegate_host.scene_index = True
    still = delegate_host.run(script, scene=scene, override=False).image("view.exr")
    assert_alike(still, expected(delegate_host, "--no-motion-blur", name="instances"))
    blurred = delegate_host.run(script, scene=scene, override=True).image("view.exr")
    assert_alike(blurred, expected(delegate_host, name="instances"))


@pytest.mark.parametrize(("settings", "flags"), [
    ({"samples": 9, "seed": 7}, ["--samples", 9, "--seed", 7]),
    ({"filter": "box", "filterWidth": 3.0}, ["--filter", "box", "--filter-width", 3]),
    ({"shadingRate": 4.0}, ["--shading-rate", 4]),
    ({"disableMotionBlur": True}, ["--no-motion-blur"]),
    ({"disableDepthOfField": True}, ["--no-defocus"]),
])  # fmt: skip
def test_settings_of_a_view(delegate_host, settings, flags):
    script = """
    view = View(Usd.Stage.Open(scene), "/main_cam", interactive=False, **settings)
    view.render(2)
    view.save("view.exr")
    """
    ran = delegate_host.run(
        script, scene=SCENES / "camera.usda", settings={"samples": 4} | settings
    )
    assert_alike(ran.image("view.exr"), expected(delegate_host, *flags, name="camera"))


def test_size_changes_while_it_renders(host):
    script = """
    view = View(Usd.Stage.Open(scene), "/main_cam", interactive=False, samples=4)
    for i in range(30):
        view.resize((20 + 7 * i % 60, 10 + 11 * i % 40))
        view.draw(2)
    view.resize((48, 32))
    view.render(2)
    view.save("view.exr")
    """
    ran = host.run(script, scene=SCENES / "motion.usda")
    assert ran.warnings == []
    assert_alike(ran.image("view.exr"), expected(host, "-w", 48))


def test_stopped_and_started_again(host):
    """A stopped view is done, whatever is edited; started again it shows the edits."""
    script = """
    stage = Usd.Stage.Open(scene)
    view = View(stage, "/main_cam", interactive=False, samples=1_000_000)
    assert view.engine.IsStopRendererSupported()
    view.draw(2)
    view.engine.StopRenderer()
    edit(stage, "/Slowed.xformOp:translate", Gf.Vec3d(1, 0, 0), 2)
    view.set(samples=500_000)
    done = [view.draw(2), view.draw(2)]
    edit(stage, "/Slowed.xformOp:translate", Gf.Vec3d(0, -1.5, 0), 2)
    view.engine.RestartRenderer()
    done.append(view.draw(2))
    view.set(samples=4)
    view.render(2)
    view.save("view.exr")
    for _ in range(20):
        view.engine.StopRenderer()
        view.engine.RestartRenderer()
    view.render(2)
    tell(done=done)
    """
    ran = host.run(script, scene=SCENES / "motion.usda")
    assert ran.told == {"done": [True, True, False]}
    assert_alike(ran.image("view.exr"), expected(host))


def test_two_views_with_shutters_of_their_own(host):
    """One process, one stage: what one camera is sampled for is not what the other is."""
    script = """
    stage = Usd.Stage.Open(scene)
    other = stage.DefinePrim("/other_cam")
    Sdf.CopySpec(stage.GetRootLayer(), "/main_cam", stage.GetRootLayer(), "/other_cam")
    edit(stage, "/other_cam.shutter:open", 0.0)
    edit(stage, "/other_cam.shutter:close", 0.75)
    stage.GetRootLayer().Export("scene.usda")
    views = [View(stage, path, samples=4) for path in ("/main_cam", "/other_cam")]
    for _ in range(3):
        for view in views:
            view.draw(2)
    for index, view in enumerate(views):
        view.render(2)
        view.save(f"{index}.exr")
    """
    ran = host.run(script, scene=SCENES / "instances.usda")
    for index, camera in enumerate(("/main_cam", "/other_cam")):
        flags = [str(flag) for flag in (*FLAGS, "-cam", camera)]
        assert main(["record", "-q", str(host.folder / "scene.usda"), "record.exr", *flags]) == 0
        assert_alike(ran.image(f"{index}.exr"), rgba("record.exr"))


@pytest.fixture(autouse=True)
def in_the_test_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def test_views_end_while_they_render(host):
    """At any moment, at once, and without a word."""
    script = """
    stage = Usd.Stage.Open(scene)
    longest = 0.0
    for i in range(40):
        view = View(stage, "/main_cam", samples=1_000_000)
        view.draw(2)
        time.sleep(0.001 * (i % 10))
        begin = time.monotonic()
        del view
        longest = max(longest, time.monotonic() - begin)
    tell(longest=longest)
    """
    ran = host.run(script, scene=SCENES / "instances.usda")
    assert ran.told["longest"] < 5.0
    assert ran.warnings == []


def test_memory_of_many_views(host):
    """Views that come and go, with their scene and images, leave nothing behind."""
    script = """
    import gc, resource
    stage = Usd.Stage.Open(scene)

    def resident():
        gc.collect()
        pages = int(Path("/proc/self/statm").read_text().split()[1])
        return pages * resource.getpagesize()

    sizes = []
    for i in range(count + 1):
        view = View(stage, "/main_cam", size=(16, 16), samples=1, threads=1)
        view.render(2)
        del view
        if i % (count // 4) == 0:
            sizes.append(resident())
    tell(sizes=sizes)
    """
    ran = host.run(script, scene=SCENES / "instances.usda", count=200 if host.scene_index else 1000)
    sizes = np.array(ran.told["sizes"]) / 1e6
    # The first ones fill pools. A view that stayed would take more than 10 kB, whatever it is of.
    assert sizes[-1] - sizes[1] < 7.5, sizes


def test_images_of_other_aovs(host):
    """Ids and depths of the buffers that a view shows, as `hdtrapeze record` has them."""
    script = """
    view = View(Usd.Stage.Open(scene), "/main_cam", samples=4)
    view.render(2)
    view.save("view.exr")
    """
    host.run(script, scene=SCENES / "still.usda")
    flags = [a for name in ("depth", "primId", "elementId", "instanceId") for a in ("--aov", name)]
    expected(host, *flags, name="still")
    ours, other = read_exr(host.folder / "view.exr"), read_exr(host.folder / "record.exr")
    np.testing.assert_allclose(ours["depth.Z"], other["depth.Z"], atol=2e-6)
    for name in ("elementId.X", "instanceId.X"):
        np.testing.assert_array_equal(ours[name], other[name])
    pairs = set(zip(ours["primId.X"].ravel(), other["primId.X"].ravel(), strict=True))
    assert len(pairs) == 5, "hosts number prims in their own ways, one for one"


def test_what_turns_stands_as_at_the_frame(host):
    """Where the shutter is not used: neither shrunk nor turned, also what is instanced."""
    script = """
    view = View(Usd.Stage.Open(scene), "/main_cam", samples=4, disableMotionBlur=True)
    view.render(2)
    view.save("view.exr")
    """
    ran = host.run(script, scene=SCENES / "turns.usda")
    assert_alike(ran.image("view.exr"), expected(host, "--no-motion-blur", name="turns"))


RATE = """#usda 1.0
def RenderSettings "Settings"
{
    float trapeze:timeCodesPerSecond = 48
}
"""


@pytest.mark.parametrize("teller", ["prim", "host", "nobody"])
def test_velocities_of_a_stage_at_another_rate(host, teller):
    """Hosts before 25.05 do not tell the stage's rate: who knows it can, else the guess is said."""
    script = """
    stage = Usd.Stage.Open(scene)
    stage.GetRootLayer().timeCodesPerSecond = 48
    stage.GetRootLayer().Export("scene.usda")
    assert stage.GetSessionLayer().ImportFromString(settings)
    view = View(stage, "/main_cam", samples=4)
    if teller == "prim":
        view.engine.SetActiveRenderSettingsPrimPath("/Settings")
    if teller == "host":
        view.set(timeCodesPerSecond=48.0)
    view.render(2)
    view.save("view.exr")
    """
    ran = host.run(script, scene=SCENES / "motion.usda", settings=RATE, teller=teller)
    record(host.folder / "scene.usda", host.folder / "record.exr", *FLAGS)
    ours, other = ran.image("view.exr"), rgba(host.folder / "record.exr")
    if teller == "nobody":
        assert ran.log.count("does not tell the stage's time codes a second") == 1
        assert (np.abs(ours - other) > 0.1).mean() > 0.005
    else:
        assert "time codes a second" not in ran.log
        assert_alike(ours, other)


def test_images_are_saved_as_exr_alone(delegate_host):
    script = """
    view = View(Usd.Stage.Open(scene), "/main_cam", samples=1)
    view.render(2)
    tell(saved=view.engine.InvokeRendererCommand("saveImage", {"path": "view.jpg"}))
    """
    ran = delegate_host.run(script, scene=SCENES / "still.usda")
    assert not ran.told["saved"] and not (ran.folder / "view.jpg").exists()
    assert "view.jpg must end in .exr" in ran.log


def test_another_shutter_where_nothing_is_shown(host, tmp_path):
    """It is the camera that has to be synced again, and there is no prim to ask for it."""
    scene = tmp_path / "empty.usda"
    scene.write_text('#usda 1.0\ndef Camera "cam" {\n}\n')
    host.run(
        """stage = Usd.Stage.Open(scene)
view = View(stage, "/cam", size=(48, 32), samples=4)
view.render()
view.set(overrideShutter=True, shutterOpen=-0.5, shutterClose=0.5)
view.render(timeout=10)""",
        scene=scene,
    )
