"""The same bits for any thread count, crop and order of frames; other bits for another seed."""

import numpy as np
import pytest
from hdtrapeze import Options, Renderer
from pxr import Gf, Vt
from scenes import add_camera, add_cube, add_quad, new_stage, render, set_samples

AOVS = ("color", "depth", "P", "normal", "primId", "elementId", "motionVectors", "sampleCount")


@pytest.fixture
def stage():
    stage = new_stage()
    add_camera(stage, fStop=2.0, focusDistance=9.0, shutter__open=0.0, shutter__close=1.0)
    cube = add_cube(stage, half=1.5, color=(1, 0.6, 0.2))
    set_samples(cube.AddRotateXYZOp().GetAttr(), {0: Gf.Vec3f(0), 4: Gf.Vec3f(80, 120, 200)})
    back = add_quad(stage, "/back", -4, -4, 4, 4, z=-3, color=(0.1, 0.3, 0.8))
    back.CreateDisplayOpacityAttr([0.5])
    bent = add_quad(stage, "/bent", -4, 2, -2, 4)
    for time in range(5):
        points = [(-4, 2, 0), (-2 + time, 2, 0), (-2, 4, time / 2), (-4, 4 - time / 2, 0)]
        bent.GetPointsAttr().Set(Vt.Vec3fArray([Gf.Vec3f(*map(float, p)) for p in points]), time)
        bent.CreateDisplayColorAttr().Set([Gf.Vec3f(time / 4, 1, 0)], time)
    blinking = add_quad(stage, "/blinking", 2, -4, 4, -2)
    set_samples(blinking.CreateVisibilityAttr(), {0: "inherited", 1: "invisible", 2: "inherited"})
    return stage


def same(a, b):
    for name in AOVS:
        np.testing.assert_array_equal(a[name], b[name], err_msg=name)


def test_thread_count(stage):
    settings = {"aovs": AOVS, "samples": 16, "filter": "gaussian"}
    one = render(stage, threads=1, **settings)
    same(one, render(stage, threads=3, **settings))
    same(one, render(stage, threads=1, **settings))


def test_seed(stage):
    one = render(stage, seed=1)["color"]
    assert (render(stage, seed=2)["color"] != one).any()
    np.testing.assert_array_equal(render(stage, seed=1)["color"], one)


@pytest.mark.parametrize("crop", [(5, 7, 29, 33), (0, 0, 40, 1), (0.25, 0.5, 0.75, 1.0)])
def test_crop_is_part_of_the_whole(stage, crop):
    whole = render(stage, aovs=AOVS, samples=8)
    part = render(stage, aovs=AOVS, samples=8, crop=crop)
    x0, y0, x1, y1 = crop if isinstance(crop[0], int) else (round(40 * c) for c in crop)
    inside = np.zeros((40, 40), dtype=bool)
    inside[y0:y1, x0:x1] = True
    for name in AOVS:
        np.testing.assert_array_equal(part[name][inside], whole[name][inside], err_msg=name)
    assert not part["color"][~inside].any()
    assert (part["primId"][~inside] == -1).all()


def test_frames_one_after_another_are_the_frames_alone(stage):
    options = Options(
        width=40, height=40, samples=4, filter="box", camera="/camera", aovs=list(AOVS)
    )
    with Renderer(options) as renderer:
        for frame in (0.0, 2.0, 1.0, 2.0):
            renderer.load(stage, frame)
            renderer.render()
            image = {name: renderer.aov(name) for name in AOVS}
            same(image, render(stage, frame, aovs=AOVS))
        assert renderer.statistics()["objects_reused"] > 0
        assert renderer.log.warnings == []


def test_edits_of_the_stage_are_seen(stage):
    options = Options(width=40, height=40, samples=4, filter="box", camera="/camera")
    with Renderer(options) as renderer:
        renderer.load(stage, 0.0)
        renderer.render()
        add_quad(stage, "/new", -4, 3, 4, 4, z=2)
        stage.GetPrimAtPath("/back").SetActive(False)
        stage.GetPrimAtPath("/cube").GetAttribute("primvars:displayColor").Set([(0, 1, 0)])
        renderer.load(stage, 0.0)
        renderer.render()
        np.testing.assert_array_equal(renderer.aov("color"), render(stage, 0.0)["color"])


def test_more_samples_go_to_the_same_image(stage):
    few, many = render(stage, samples=16)["color"], render(stage, samples=1024)["color"]
    middle = render(stage, samples=128)["color"]

    def rms(a):
        return np.sqrt(np.mean((a - many) ** 2))

    assert rms(middle) < 0.6 * rms(few)


def test_rays_through_the_c_abi(stage):
    with Renderer(width=40, height=40, camera="/camera") as renderer:
        renderer.load(stage, 0.0)
        renderer.commit()
        rays = np.array(
            [
                [0, 0, 10, 0, 0, -1, 0.0, 0, 1e30],
                [0, 0, 10, 0, 0, 1, 0.0, 0, 1e30],
                [3.5, 3.5, 10, 0, 0, -2, 1.0, 0, 1e30],
            ]
        )
        hits = renderer.session.trace_rays(rays)
    assert renderer.prim_paths[hits["prim_id"][0]] == "/cube"
    assert hits["prim_id"][1] == -1
    assert np.isinf(hits["t"][1])
    assert renderer.prim_paths[hits["prim_id"][2]] == "/back"
    assert hits["t"][2] == pytest.approx(6.5, rel=1e-5)  # the direction has length 2
    np.testing.assert_allclose(hits["normal"][2], [0, 0, 1], atol=1e-5)
