"""Render settings: the host's panel, words and numbers that cannot be, RenderSettings prims, the
shutter for hosts whose camera has none, statistics."""

import numpy as np
import pytest
from images import read_exr
from test_agreement import SCENES

VIEW = """
    stage = Usd.Stage.Open(scene)
    view = View(stage, "/cam", samples=2)
"""


def run(host, script, **given):
    lines = VIEW.strip("\n").splitlines() + script.strip("\n").splitlines()
    script = "\n".join(line[4:] for line in lines)
    return host.run(script, scene=SCENES / "parts.usda", **given)


def test_the_panel_shows_settings_with_their_defaults(delegate_host):
    told = run(
        delegate_host,
        """
    tell(settings=[[s.key, s.name, str(s.type), s.defValue]
                   for s in view.engine.GetRendererSettingsList()])
    """,
    ).told["settings"]
    values = {key.removeprefix("trapeze:"): value for key, _, _, value in told}
    assert values["samples"] == 64 and values["filter"] == "gaussian" and values["seed"] == 0
    assert values["overrideShutter"] is False and values["shutterOpen"] == -0.25
    assert values["backend"] == "auto" and values["timeCodesPerSecond"] == 24
    assert len({name for _, name, _, _ in told}) == len(told) == 17


@pytest.mark.parametrize(
    ("name", "value", "text"),
    [
        ("filter", "triangle", "it must be one of box, gaussian"),
        ("samples", 0, "it must be from 1 to 1048576; the render settings' is used, else 64"),
        ("threads", -1, "it must be from 0 to 4096; 0 is used"),
        ("samples", "many", "it must be a whole number"),
        ("shadingRate", -1.0, "it must be from 0.01 to 1000; the render settings' is used, else 1"),
        ("overrideShutter", 1, "it must be true or false"),
        ("nonsense", 1, "trapeze:nonsense is no setting of this renderer"),
    ],
)
def test_what_cannot_be_gives_one_warning_and_the_default(delegate_host, name, value, text):
    ran = run(
        delegate_host,
        """
    view.set(samples=64)
    view.set(**{name: value})
    view.render()
    view.render()
    tell(samples=view.stats()["numCompletedSamples"])
    """,
        name=name,
        value=value,
    )
    assert [warning for _, warning in ran.warnings if text in warning] == [
        warning for _, warning in ran.warnings
    ]
    assert len(ran.warnings) == 1
    assert ran.told == {"samples": 64}


def test_the_least_shading_rate_may_be_a_float(delegate_host):
    """Its nearest float is below it."""
    ran = run(
        delegate_host,
        """
    for i, rate in enumerate((1.0, 0.01, Vt.Float(0.01))):
        view = View(stage, "/cam", samples=1, shadingRate=rate)
        view.render()
        view.dump(f"{i}.txt")
    """,
    )
    coarse, fine, same = [(ran.folder / f"{i}.txt").read_text() for i in range(3)]
    assert coarse != fine == same
    assert ran.warnings == []


def test_names_that_all_hosts_have(delegate_host):
    told = run(
        delegate_host,
        """
    view.engine.SetRendererSetting("convergedSamplesPerPixel", 3)
    view.render()
    stats = view.stats()
    tell(samples=stats["numCompletedSamples"], done=stats["percentDone"], all=sorted(stats),
         text=stats["renderProgressAnnotation"],
         key=view.engine.GetRendererSetting("trapeze:samples"))
    """,
    ).told
    assert (told["samples"], told["done"], told["key"]) == (3, 100, 3)
    assert told["text"] == "finished, 3 of 3 samples"
    assert {"totalClockTime", "objectsDiced", "bvhBytes", "micropolygons", "traceSeconds"} < set(
        told["all"]
    )


PRIM = """#usda 1.0
def RenderSettings "Settings"
{
    int trapeze:samples = 5
    string trapeze:filter = "none"
    int trapeze:threads = 1
    int other:samples = 9
}
"""


def test_a_prim_speaks_where_the_host_has_no_opinion(host):
    ran = run(
        host,
        """
    view = View(stage, "/cam")
    layer = stage.GetSessionLayer()
    assert layer.ImportFromString(prim)
    stage.SetEditTarget(layer)
    def samples(name):
        view.render()
        tell(**{name: view.stats()["numCompletedSamples"]})
    samples("inactive")
    view.engine.SetActiveRenderSettingsPrimPath("/Settings")
    samples("active")
    stage.GetAttributeAtPath("/Settings.trapeze:samples").Set(6)
    samples("edited")
    view.set(samples=7)
    samples("host")
    view.set(samples=64)
    samples("default")
    view.set(samples="many")
    samples("bad")
    view.set(samples=64)
    samples("again")
    view.engine.SetActiveRenderSettingsPrimPath("")
    samples("none")
    """,
        prim=PRIM,
    )
    expected = {"inactive": 64, "active": 5, "edited": 6, "host": 7, "default": 64, "none": 64}
    assert ran.told == {**expected, "bad": 6, "again": 64}
    texts = sorted(text for path, text in ran.warnings if path == "/Settings")
    assert len(texts) == len(ran.warnings) - 1 == 2
    assert "trapeze:filter is none" in texts[0]
    assert texts[1] == "trapeze:threads is the host's to set; it is ignored"


def test_prims_with_too_many_micropolygons_are_told_of_together(host):
    ran = run(
        host,
        """
    for name in "xyz":
        points = UsdGeom.Points.Define(stage, f"/{name}")
        points.CreatePointsAttr([(0, 0, 0)])
        points.CreateWidthsAttr([1.0])
    view = View(stage, "/cam", samples=1, maxMicropolygons=1)
    view.render()
    """,
    )
    text = "this prim and others need more micropolygons than a prim may have; "
    assert ran.warnings == [("/x", f"{text}they are diced more coarsely (budget)")]


def blurred(ran, count):
    """Pixels of each image that the moving square covers for a part of the shutter, in one row."""
    rows = [read_exr(ran.folder / f"{i}.exr")["A"][26, 66:] for i in range(count)]
    return [np.count_nonzero((row > 0.02) & (row < 0.98)) for row in rows]


SHUTTERS = """
    view.set(samples=32)
    if free:
        view = View(stage, samples=32)
        frustum = UsdGeom.Camera(stage.GetPrimAtPath("/cam")).GetCamera(1.5).frustum
        view.engine.SetCameraState(frustum.ComputeViewMatrix(), frustum.ComputeProjectionMatrix())
    for i, shutter in enumerate(shutters):
        if shutter:
            view.set(overrideShutter=True, shutterOpen=shutter[0], shutterClose=shutter[1])
        view.render(1.5)
        view.save(f"{i}.exr")
        if i == 0:
            edit(stage, "/A.xformOp:translate", Gf.Vec3d(-3, -1, 0))
"""


def test_a_shutter_for_cameras_without_one(host):
    ran = run(host, SHUTTERS, free=True, shutters=[None, (-0.25, 0.25), (-0.5, 0.5)])
    still, short, long = blurred(ran, 3)
    if host.scene_index:
        assert short > still + 4 and long > short + 4 and ran.warnings == []
    else:
        # The host samples for its camera's shutter alone.
        assert still == short == long
        assert ["alone" in text for _, text in ran.warnings] == [True]


def test_a_shutter_within_the_cameras_is_kept_both_ways(host):
    ran = run(host, SHUTTERS, free=False, shutters=[None, (0.0, 0.25), (0.0, 0.0)])
    assert ran.warnings == []
    camera, half, none = blurred(ran, 3)
    assert camera > half + 2 > none + 4


def test_pause_keeps_samples_and_stop_ends(host):
    told = run(
        host,
        """
    view.set(samples=3000)
    assert view.engine.IsPauseRendererSupported() and view.engine.IsStopRendererSupported()

    def until(is_so):
        end = time.monotonic() + 20
        while not is_so(view.stats()):
            assert time.monotonic() < end, view.stats()
            converged = view.draw()
            time.sleep(0.002)
        return view.stats()

    until(lambda stats: stats["numCompletedSamples"] > 0)
    assert view.engine.PauseRenderer()
    paused = until(lambda stats: stats["state"] == "paused")
    time.sleep(0.05)
    still = not view.draw() and view.stats()["percentDone"] == paused["percentDone"]
    assert view.engine.ResumeRenderer()
    resumed = until(lambda stats: stats["percentDone"] > paused["percentDone"])
    assert view.engine.StopRenderer()
    stopped = view.stats()
    tell(still=still, more=resumed["renders"] - paused["renders"], state=stopped["state"],
         converged=view.draw(), after=view.stats()["renders"] - stopped["renders"])
    view.set(samples=2)
    assert view.engine.RestartRenderer()
    view.render()
    tell(end=view.stats()["renderProgressAnnotation"])
    """,
    ).told
    assert told == {
        "still": True,
        "more": 0,
        "state": "cancelled",
        "converged": True,
        "after": 0,
        "end": "finished, 2 of 2 samples",
    }
