"""A frame is the same, whichever frames were rendered before it."""

import numpy as np
import pytest
from hdtrapeze import Options, Renderer
from pxr import Sdf, Usd
from scenes import add_camera

GRID = """
    int[] faceVertexCounts = [4, 4, 4, 4]
    int[] faceVertexIndices = [0, 1, 4, 3, 1, 2, 5, 4, 3, 4, 7, 6, 4, 5, 8, 7]
    point3f[] points = [(-3, -3, 0), (0, -3, 0), (3, -3, 0), (-3, 0, 0), (0, 0, 2), (3, 0, 0),
        (-3, 3, 0), (0, 3, 0), (3, 3, 0)]
    color3f[] primvars:displayColor = [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0)] (
        interpolation = "faceVarying")
    int[] primvars:displayColor:indices = [0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 3, 2, 1, 0]
"""
TRIANGLES = """
    int[] faceVertexCounts = [3, 3, 3]
    int[] faceVertexIndices = [0, 1, 3, 1, 2, 3, 2, 0, 3]
    point3f[] points = [(-3, -3, 0), (3, -3, 0), (0, 3, 0), (0, 0, 5)]
"""
CURVES = """
    int[] curveVertexCounts = [4]
    point3f[] points = [(-3, -3, 0), (-1, 3, 0), (1, 3, 0), (3, -2, 0)]
    float[] widths = [1] (interpolation = "constant")
"""
LINES = """
    uniform token type = "linear"
    int[] curveVertexCounts = [4]
    point3f[] points = [(-3, -3, 0), (-1, 3, 0), (1, 3, 0), (3, -2, 0)]
    float[] widths = [1] (interpolation = "constant")
"""
SUBSET = """
    def GeomSubset "part" {
        int[] indices = [0, 1]
        uniform token elementType.timeSamples = {1: "face", 2: "point"}
    }
"""
PATCH = """
    int uVertexCount = 2
    int vVertexCount = 2
    int uOrder = 2
    int vOrder = 2
    double[] uKnots = [0, 0, 1, 1]
    double[] vKnots = [0, 0, 1, 1]
    point3f[] points = [(-3, -3, 0), (3, -3, 0), (-3, 3, 0), (3, 3, 0)]
"""
NURBS_CURVES = """
    int[] curveVertexCounts = [4]
    int[] order = [4]
    double[] knots = [0, 0, 0, 0, 1, 1, 1, 1]
    point3f[] points = [(-3, -3, 0), (-1, 3, 0), (1, 3, 0), (3, -2, 2)]
    float[] widths = [1] (interpolation = "constant")
"""


def words(name, first, second):
    return f'uniform token {name}.timeSamples = {{1: "{first}", 2: "{second}"}}'


SCHEME = words("subdivisionScheme", "none", "catmullClark")
BOUNDARY = words("interpolateBoundary", "none", "edgeOnly").removeprefix("uniform ")
FACE_VARYING = words("faceVaryingLinearInterpolation", "none", "all").removeprefix("uniform ")
TRIANGLE_RULE = words("triangleSubdivisionRule", "catmullClark", "smooth").removeprefix("uniform ")
ORIENTATION = words("orientation", "rightHanded", "leftHanded")
DOUBLE_SIDED = "uniform bool doubleSided.timeSamples = {1: 0, 2: 1}"
AXIS = words("axis", "X", "Y")
FORM = words("primvars:trapeze:curves", "ribbons", "tubes")
HALF_TURN = 'double xformOp:rotateY = 180\nuniform token[] xformOpOrder = ["xformOp:rotateY"]\n'

PRIMS = {
    "scheme": ("Mesh", GRID + SCHEME),
    "boundary": ("Mesh", GRID + BOUNDARY),
    "face-varying": ("Mesh", GRID + FACE_VARYING),
    "triangles": ("Mesh", TRIANGLES + TRIANGLE_RULE),
    "orientation": ("Mesh", GRID + ORIENTATION),
    "double-sided": ("Mesh", HALF_TURN + GRID + DOUBLE_SIDED),
    "subset": ("Mesh", GRID + SUBSET),
    "cube-orientation": ("Cube", ORIENTATION),
    "cylinder-axis": ("Cylinder", AXIS),
    "plane-double-sided": ("Plane", HALF_TURN + DOUBLE_SIDED),
    "curve-type": ("BasisCurves", CURVES + words("type", "linear", "cubic")),
    "curve-basis": ("BasisCurves", CURVES + words("basis", "bezier", "bspline")),
    "curve-wrap": ("BasisCurves", LINES + words("wrap", "nonperiodic", "periodic")),
    "curve-form": ("BasisCurves", CURVES + FORM),
    "nurbs-curve-form": ("NurbsCurves", NURBS_CURVES + FORM),
    "patch-orientation": ("NurbsPatch", PATCH + ORIENTATION),
}

AOVS = ["color", "normal", "subsetId"]


def frames_of(stage, frames):
    """Images of frames that one renderer makes, one after the other."""
    options = Options(
        width=24, height=24, samples=4, aovs=AOVS, cull="backUnlessDoubleSided", camera="/camera"
    )
    images = []
    with Renderer(options) as renderer:
        for frame in frames:
            renderer.load(stage, frame)
            renderer.render()
            images.append({name: renderer.aov(name).copy() for name in AOVS})
    return images


@pytest.mark.parametrize("prim", PRIMS)
def test_values_that_change_in_time_change_in_a_sequence(prim):
    kind, body = PRIMS[prim]
    layer = Sdf.Layer.CreateAnonymous(".usda")
    assert layer.ImportFromString(f'#usda 1.0\ndef {kind} "shape" {{\n{body}\n}}\n')
    stage = Usd.Stage.Open(layer)
    add_camera(stage)
    sequence = frames_of(stage, [1, 2, 1])
    for frame, image in zip([1, 2, 1], sequence, strict=True):
        alone = frames_of(stage, [frame])[0]
        for name in AOVS:
            np.testing.assert_array_equal(image[name], alone[name], err_msg=f"{name} at {frame}")
    assert any(not np.array_equal(sequence[0][n], sequence[1][n]) for n in AOVS)
