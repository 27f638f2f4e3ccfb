"""Implicit prims that are flat all over, as meshes: UsdGeomCube and UsdGeomPlane."""

import numpy as np
from pxr import Usd, UsdGeom

from .guard import number
from .log import SceneLog
from .mesh import Mesh, Points, Topology
from .shutter import Shutter

_CUBE_POINTS = np.array(
    [(x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)], dtype=np.float32
)
# Bit 2 of a corner's number is x, bit 1 is y, bit 0 is z; faces are counter-clockwise from outside.
_CUBE_FACES = np.array(
    [0, 1, 3, 2, 4, 6, 7, 5, 0, 4, 5, 1, 2, 3, 7, 6, 0, 2, 6, 4, 1, 5, 7, 3], dtype=np.int32
)
_PLANE_AXES = {"X": (1, 2), "Y": (2, 0), "Z": (0, 1)}


def read_cube(prim: Usd.Prim, shutter: Shutter, log: SceneLog, before: Mesh | None) -> Mesh:
    """A cube of the authored size about the origin."""
    cube = UsdGeom.Cube(prim)
    attribute = cube.GetSizeAttr()
    size = number(attribute, shutter.time)
    topology = Topology(
        orientation=cube.GetOrientationAttr().Get() or "rightHanded",
        face_vertex_counts=np.full(6, 4, dtype=np.int32),
        face_vertex_indices=_CUBE_FACES,
    )
    points = np.ascontiguousarray(_CUBE_POINTS * np.float32(size))
    varies = attribute.ValueMightBeTimeVarying()
    return Mesh(topology, Points([shutter.open], [points], varies))


def read_plane(prim: Usd.Prim, shutter: Shutter, log: SceneLog, before: Mesh | None) -> Mesh:
    """A rectangle about the origin, facing along its axis."""
    plane = UsdGeom.Plane(prim)
    width = number(plane.GetWidthAttr(), shutter.time)
    length = number(plane.GetLengthAttr(), shutter.time)
    axis = plane.GetAxisAttr().Get() or "Z"
    # Width runs along x (along z where the plane faces x), length along y (along z for y).
    u, v = _PLANE_AXES.get(axis, (0, 1))
    size = {"X": (length, width), "Y": (length, width)}.get(axis, (width, length))
    points = np.zeros((4, 3), dtype=np.float32)
    for corner, (su, sv) in enumerate([(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)]):
        points[corner, u] = su * size[0]
        points[corner, v] = sv * size[1]
    topology = Topology(
        orientation=plane.GetOrientationAttr().Get() or "rightHanded",
        face_vertex_counts=np.array([4], dtype=np.int32),
        face_vertex_indices=np.arange(4, dtype=np.int32),
    )
    varies = any(a.ValueMightBeTimeVarying() for a in (plane.GetWidthAttr(), plane.GetLengthAttr()))
    return Mesh(topology, Points([shutter.open], [points], varies))
