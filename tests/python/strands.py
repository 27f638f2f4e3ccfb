"""Curves and points for the tests."""

import numpy as np
from pxr import Gf, UsdGeom, Vt

WHITE = 15000.0 * 2 * (1 - np.cos(np.radians(0.53 / 2)))
"""Radiance of a white surface that faces the standard camera."""

ZIGZAG = [(-2, -1, 0), (-1, 1, 0.5), (0, -1, 0), (1, 1, -0.5), (2, -1, 0), (2.5, 0, 0), (3, 1, 0)]


def vectors(points):
    """An array of triples."""
    array = np.ascontiguousarray(np.asarray(points, dtype=np.float32).reshape(-1, 3))
    return Vt.Vec3fArray.FromNumpy(array) if len(array) else Vt.Vec3fArray()


def floats(values):
    """An array of numbers."""
    array = np.atleast_1d(np.asarray(values, dtype=np.float32))
    return Vt.FloatArray.FromNumpy(array) if len(array) else Vt.FloatArray()


def add_curves(
    stage,
    path,
    points,
    counts=None,
    basis="linear",
    wrap="nonperiodic",
    widths=0.5,
    interpolation="constant",
    color=(1, 1, 1),
):
    """Curves; `basis` may be linear. Widths None: not authored."""
    curves = UsdGeom.BasisCurves.Define(stage, path)
    curves.CreatePointsAttr(vectors(points))
    curves.CreateCurveVertexCountsAttr([len(points)] if counts is None else counts)
    curves.CreateTypeAttr("linear" if basis == "linear" else "cubic")
    if basis != "linear":
        curves.CreateBasisAttr(basis)
    curves.CreateWrapAttr(wrap)
    if widths is not None:
        curves.CreateWidthsAttr(floats(widths))
        curves.SetWidthsInterpolation(interpolation)
    if color is not None:
        curves.CreateDisplayColorAttr([Gf.Vec3f(*color)])
    return curves


def add_points(stage, path, points, widths=0.5, interpolation=None, color=(1, 1, 1)):
    """Points. Widths None: not authored; more than one: one a point unless said otherwise."""
    spheres = UsdGeom.Points.Define(stage, path)
    spheres.CreatePointsAttr(vectors(points))
    if widths is not None:
        spheres.CreateWidthsAttr(floats(widths))
        several = np.size(widths) > 1
        spheres.SetWidthsInterpolation(interpolation or ("vertex" if several else "constant"))
    if color is not None:
        spheres.CreateDisplayColorAttr([Gf.Vec3f(*color)])
    return spheres


def normals(curves, values, interpolation):
    """Authors normals, which make ribbons."""
    curves.CreateNormalsAttr(vectors(values))
    curves.SetNormalsInterpolation(interpolation)
    return curves


def brightness(image):
    """Mean radiance where something is, in units of white."""
    color = image["color"]
    return color[..., :3].sum() / 3 / color[..., 3].sum() / WHITE
