"""What the tests author and measure: small stages, one render call, where things land in pixels.

The standard camera stands at (0, 0, 10) and looks along -z; at z = 0 it sees 10 x 10 units, so a
40 x 40 image has 4 pixels a unit, and pixel (row, column) has its centre at
x = (column + 0.5) / 4 - 5, y = 5 - (row + 0.5) / 4.
"""

import numpy as np
from hdtrapeze import Options, Renderer
from pxr import Gf, Usd, UsdGeom, Vt

SIZE = 40
VIEW = 10.0
DISTANCE = 10.0


def new_stage():
    """An empty stage in memory, y up."""
    stage = Usd.Stage.CreateInMemory()
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    return stage


def add_camera(stage, path="/camera", **attributes):
    """The standard camera; attributes by their USD names."""
    camera = UsdGeom.Camera.Define(stage, path)
    camera.AddTranslateOp(opSuffix="stand").Set(Gf.Vec3d(0, 0, DISTANCE))
    defaults = {
        "horizontalAperture": 20.0,
        "verticalAperture": 20.0,
        "focalLength": 20.0,
        "clippingRange": Gf.Vec2f(0.5, 100.0),
    }
    for name, value in (defaults | attributes).items():
        camera.GetPrim().GetAttribute(name.replace("__", ":")).Set(value)
    return camera


def add_mesh(stage, path, points, counts, indices, scheme="none", color=None):
    """A mesh; scheme none unless said otherwise."""
    mesh = UsdGeom.Mesh.Define(stage, path)
    mesh.CreatePointsAttr(Vt.Vec3fArray([Gf.Vec3f(*map(float, p)) for p in points]))
    mesh.CreateFaceVertexCountsAttr(counts)
    mesh.CreateFaceVertexIndicesAttr(indices)
    mesh.CreateSubdivisionSchemeAttr(scheme)
    if color is not None:
        mesh.CreateDisplayColorAttr([Gf.Vec3f(*color)])
    return mesh


def quad_points(x0, y0, x1, y1, z=0.0):
    """Corners counter-clockwise, seen from +z."""
    return [(x0, y0, z), (x1, y0, z), (x1, y1, z), (x0, y1, z)]


def add_quad(stage, path="/quad", x0=-2.0, y0=-2.0, x1=2.0, y1=2.0, z=0.0, color=(1, 1, 1)):
    """A rectangle that faces the standard camera."""
    return add_mesh(stage, path, quad_points(x0, y0, x1, y1, z), [4], [0, 1, 2, 3], color=color)


def add_grid(stage, path="/grid", n=2, half=2.0, scheme="none", color=None):
    """n x n quads over [-half, half]^2; face number = row * n + column, rows upwards."""
    steps = np.linspace(-half, half, n + 1)
    points = [(x, y, 0.0) for y in steps for x in steps]
    indices = []
    for row in range(n):
        for column in range(n):
            a = row * (n + 1) + column
            indices += [a, a + 1, a + n + 2, a + n + 1]
    return add_mesh(stage, path, points, [4] * (n * n), indices, scheme, color)


def add_cube(stage, path="/cube", half=1.5, scheme="catmullClark", color=None):
    """A cube mesh with outward faces."""
    points = [(x, y, z) for x in (-half, half) for y in (-half, half) for z in (-half, half)]
    faces = [0, 1, 3, 2, 4, 6, 7, 5, 0, 4, 5, 1, 2, 3, 7, 6, 0, 2, 6, 4, 1, 5, 7, 3]
    return add_mesh(stage, path, points, [4] * 6, faces, scheme, color)


def set_samples(attribute, samples):
    """Time samples from a dict."""
    for time, value in samples.items():
        attribute.Set(value, time)


class Image(dict):
    """AOVs by name, with the warnings and statistics of the render."""

    warnings: list
    statistics: dict
    prim_paths: dict

    @property
    def alpha(self):
        return self["color"][..., 3]


def render(
    stage, frame=0.0, aovs=("color",), width=SIZE, height=SIZE, render_pass=None, **settings
):
    """One frame through /camera with a box filter and few samples, unless said otherwise."""
    settings = {"samples": 4, "filter": "box"} | settings
    if "camera" not in settings and stage.GetPrimAtPath("/camera"):
        settings["camera"] = "/camera"
    options = Options(width=width, height=height, aovs=list(aovs), **settings)
    with Renderer(options, render_pass=render_pass) as renderer:
        renderer.load(stage, frame)
        renderer.render()
        image = Image({name: renderer.aov(name) for name in aovs})
        image.warnings = list(renderer.log.warnings)
        image.statistics = renderer.statistics()
        image.prim_paths = dict(renderer.prim_paths)
    return image


def pixel(x, y, z=0.0, size=SIZE):
    """(row, column) in which the standard camera sees a point."""
    scale = size / VIEW * DISTANCE / (DISTANCE - z)
    return int(size / 2 - y * scale), int(size / 2 + x * scale)


def quad_coverage(x0, y0, x1, y1, z=0.0, size=SIZE):
    """Exact coverage of each pixel by a rectangle that faces the standard camera."""
    scale = size / VIEW * DISTANCE / (DISTANCE - z)

    def span(low, high):
        edges = np.arange(size + 1)
        return np.clip(np.minimum(high, edges[1:]) - np.maximum(low, edges[:-1]), 0, 1)

    columns = span(size / 2 + x0 * scale, size / 2 + x1 * scale)
    rows = span(size / 2 - y1 * scale, size / 2 - y0 * scale)
    return rows[:, None] * columns[None, :]


def one_warning(image, path, *words):
    """Asserts that there is exactly one warning, about `path`, with `words` in it."""
    assert [w[0] for w in image.warnings] == [path], image.warnings
    for word in words:
        assert word in image.warnings[0][2], image.warnings
