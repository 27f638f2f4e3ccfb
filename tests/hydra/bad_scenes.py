"""Prims that are wrong in one way each, by name; beside each stands a square that is not."""

HEAD = """#usda 1.0
(
    upAxis = "Y"
    startTimeCode = 1
    endTimeCode = 2
)

def Camera "main_cam"
{
    float horizontalAperture = 24
    float verticalAperture = 16
    float focalLength = 35
    double shutter:open = -0.25
    double shutter:close = 0.25
    double3 xformOp:translate = (0, 0, 12)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}

def Mesh "Good"
{
    uniform token subdivisionScheme = "none"
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(-3, -1, 0), (-1, -1, 0), (-1, 1, 0), (-3, 1, 0)]
}

"""

QUAD = {
    "uniform token subdivisionScheme": '"none"',
    "int[] faceVertexCounts": "[4]",
    "int[] faceVertexIndices": "[0, 1, 2, 3]",
    "point3f[] points": "[(1, -1, 0), (3, -1, 0), (3, 1, 0), (1, 1, 0)]",
}
INSTANCER = {
    "rel prototypes": "</Bad/Leaf>",
    "int[] protoIndices": "[0, 0]",
    "point3f[] positions": "[(0, 0, 0), (0, 1, 0)]",
}


def _prim(kind, values, inside=""):
    lines = [f"    {name} = {value}" for name, value in values.items() if value is not None]
    return "\n".join([f'def {kind} "Bad"', "{", *lines, inside, "}", ""])


def mesh(values):
    """A square with some attributes as given, or without those that are None."""
    return _prim("Mesh", QUAD | values)


def instancer(values, leaf=True):
    """Two squares."""
    inside = _prim("Mesh", QUAD).replace('"Bad"', '"Leaf"') if leaf else ""
    return _prim("PointInstancer", INSTANCER | values, inside)


COLOR = "color3f[] primvars:displayColor"

SCENES = {
    "unknown_type": _prim("Contraption", {"int parts": "7"}),
    "volume": _prim("Volume", {}),
    "no_points": mesh({"point3f[] points": None}),
    "empty_points": mesh({"point3f[] points": "[]"}),
    "no_topology": mesh({"int[] faceVertexCounts": None, "int[] faceVertexIndices": None}),
    "indices_beyond": mesh({"int[] faceVertexIndices": "[0, 1, 2, 9]"}),
    "negative_indices": mesh({"int[] faceVertexIndices": "[0, 1, -2, 3]"}),
    "negative_counts": mesh({"int[] faceVertexCounts": "[-4]"}),
    "too_few_indices": mesh({"int[] faceVertexIndices": "[0, 1]"}),
    "not_numbers": mesh({"point3f[] points": "[(nan, 0, 0), (3, -1, 0), (inf, 1, 0), (1, 1, 0)]"}),
    "huge": mesh({"point3f[] points": "[(1e38, 0, 0), (-1e38, -1, 0), (3, 1e38, 0), (1, 1, 0)]"}),
    "loop_on_quads": mesh({"uniform token subdivisionScheme": '"loop"'}),
    "scheme": mesh({"uniform token subdivisionScheme": '"fractal"'}),
    "creases": mesh({
        "uniform token subdivisionScheme": '"catmullClark"',
        "int[] creaseIndices": "[0, 1, 77]",
        "int[] creaseLengths": "[2, 5]",
        "float[] creaseSharpnesses": "[1]",
    }),
    "holes": mesh({"int[] holeIndices": "[5, -1]"}),
    "color_length": mesh({COLOR: '[(1, 0, 0), (0, 1, 0)] (interpolation = "vertex")'}),
    "color_face_varying": mesh({COLOR: '[(1, 0, 0)] (interpolation = "faceVarying")'}),
    "color_empty": mesh({COLOR: '[] (interpolation = "vertex")'}),
    "color_indices": mesh({
        COLOR: '[(1, 0, 0), (0, 1, 0)] (interpolation = "vertex")',
        "int[] primvars:displayColor:indices": "[0, 1, 2, -1]",
    }),
    "lengths_differ": mesh({
        "point3f[] points": None,
        "point3f[] points.timeSamples": "{1: [(1, -1, 0), (3, -1, 0), (3, 1, 0), (1, 1, 0)],"
        " 2: [(1, -1, 0)]}",
    }),
    "velocities": mesh({
        "point3f[] points": None,
        "point3f[] points.timeSamples": "{1: [(1, -1, 0), (3, -1, 0), (3, 1, 0), (1, 1, 0)]}",
        "vector3f[] velocities.timeSamples": "{1: [(1, 0, 0)]}",
    }),
    "flat": mesh({
        "double3 xformOp:scale": "(0, 0, 0)",
        "uniform token[] xformOpOrder": '["xformOp:scale"]',
    }),
    "nowhere": mesh({
        "double3 xformOp:translate": "(nan, inf, 0)",
        "uniform token[] xformOpOrder": '["xformOp:translate"]',
    }),
    "no_instances": instancer({"int[] protoIndices": "[]", "point3f[] positions": "[]"}),
    "no_positions": instancer({"point3f[] positions": None}),
    "few_positions": instancer({"point3f[] positions": "[(0, 0, 0)]"}),
    "few_orientations": instancer({"quath[] orientations": "[(1, 0, 0, 0)]"}),
    "zero_orientations": instancer({"quath[] orientations": "[(0, 0, 0, 0), (nan, 0, 0, 0)]"}),
    "prototypes_beyond": instancer({"int[] protoIndices": "[0, 3]"}),
    "no_prototypes": instancer({"rel prototypes": None}),
    "lost_prototypes": instancer({"rel prototypes": "</Nowhere>"}),
    "instance_color": instancer({COLOR: '[(1, 0, 0)] (interpolation = "vertex")'}),
    "curve_counts": _prim("BasisCurves", {
        "int[] curveVertexCounts": "[2, 9]",
        "point3f[] points": "[(1, -1, 0), (3, 1, 0), (2, 1, 0)]",
        "uniform token type": '"cubic"',
    }),
    "curve_widths": _prim("BasisCurves", {
        "int[] curveVertexCounts": "[2]",
        "point3f[] points": "[(1, -1, 0), (3, 1, 0)]",
        "uniform token type": '"linear"',
        "float[] widths": '[nan, 1, -1] (interpolation = "vertex")',
    }),
    "sphere": _prim("Sphere", {
        "double radius": "-1",
        "double3 xformOp:translate": "(2, 0, 0)",
        "uniform token[] xformOpOrder": '["xformOp:translate"]',
    }),
    "points": _prim("Points", {"point3f[] points": "[]", "float[] widths": "[1, 2]"}),
    "camera": _prim("Camera", {"float horizontalAperture": "0", "double shutter:open": "nan"}),
}  # fmt: skip
