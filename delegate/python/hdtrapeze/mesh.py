"""Reads UsdGeomMesh: topology with every subdivision attribute, and points as raw samples.

Nothing is checked here beyond the types: the renderer checks counts and indices, and warns.
"""

from dataclasses import dataclass, field

import numpy as np
from pxr import Usd, UsdGeom

from .guard import token
from .log import SceneLog
from .points import Points, read_points
from .shutter import Shutter

SCHEMES = {
    "catmullClark": "CATMULL_CLARK",
    "loop": "LOOP",
    "bilinear": "BILINEAR",
    "none": "NONE",
}
BOUNDARIES = {"none": "NONE", "edgeOnly": "EDGE_ONLY", "edgeAndCorner": "EDGE_AND_CORNER"}
FACE_VARYING = {
    "none": "NONE",
    "cornersOnly": "CORNERS_ONLY",
    "cornersPlus1": "CORNERS_PLUS1",
    "cornersPlus2": "CORNERS_PLUS2",
    "boundaries": "BOUNDARIES",
    "all": "ALL",
}
TRIANGLES = {"catmullClark": "CATMULL_CLARK", "smooth": "SMOOTH"}
ORIENTATIONS = {"rightHanded": "RIGHT_HANDED", "leftHanded": "LEFT_HANDED"}

_NO_INTS = np.zeros(0, dtype=np.int32)
_NO_FLOATS = np.zeros(0, dtype=np.float32)


@dataclass
class Topology:
    """Options by USD's names, and index arrays as authored."""

    scheme: str = "none"
    boundary: str = "edgeAndCorner"
    face_varying: str = "cornersPlus1"
    triangles: str = "catmullClark"
    orientation: str = "rightHanded"
    face_vertex_counts: np.ndarray = field(default_factory=lambda: _NO_INTS)
    face_vertex_indices: np.ndarray = field(default_factory=lambda: _NO_INTS)
    holes: np.ndarray = field(default_factory=lambda: _NO_INTS)
    crease_indices: np.ndarray = field(default_factory=lambda: _NO_INTS)
    crease_lengths: np.ndarray = field(default_factory=lambda: _NO_INTS)
    crease_sharpnesses: np.ndarray = field(default_factory=lambda: _NO_FLOATS)
    corner_indices: np.ndarray = field(default_factory=lambda: _NO_INTS)
    corner_sharpnesses: np.ndarray = field(default_factory=lambda: _NO_FLOATS)
    varies: bool = False


@dataclass
class Mesh:
    """Geometry of one mesh; see shapes.Shape."""

    topology: Topology
    points: Points
    kind: str = "mesh"

    @property
    def is_empty(self) -> bool:
        """Whether there is neither a face nor a point."""
        return not self.topology.face_vertex_counts.size and not any(
            array.size for array in self.points.arrays
        )

    @property
    def varies(self) -> bool:
        """Whether topology or points may differ at another frame."""
        return self.topology.varies or self.points.varies

    def send(self, session, prim: int, before: "Mesh | None") -> None:
        """Sends topology and points, as far as `before` had others."""
        if before is None or before.topology is not self.topology:
            session.set_topology(prim, self.topology)
        if before is None or before.points is not self.points:
            session.set_points(prim, self.points)


def read_mesh(prim: Usd.Prim, shutter: Shutter, log: SceneLog, before: Mesh | None) -> Mesh:
    """The mesh at the frame; what does not vary is taken over from `before`."""
    mesh = UsdGeom.Mesh(prim)
    topology = before.topology if before else None
    if topology is None or topology.varies:
        topology = read_topology(mesh, shutter, log)
    points = before.points if before else None
    if points is None or points.varies or topology.varies:
        points = read_points(mesh, shutter, topology.varies, log)
    return Mesh(topology, points)


def read_topology(mesh: UsdGeom.Mesh, shutter: Shutter, log: SceneLog) -> Topology:
    """Topology at the frame."""

    arrays = {
        "face_vertex_counts": (mesh.GetFaceVertexCountsAttr(), np.int32),
        "face_vertex_indices": (mesh.GetFaceVertexIndicesAttr(), np.int32),
        "holes": (mesh.GetHoleIndicesAttr(), np.int32),
        "crease_indices": (mesh.GetCreaseIndicesAttr(), np.int32),
        "crease_lengths": (mesh.GetCreaseLengthsAttr(), np.int32),
        "crease_sharpnesses": (mesh.GetCreaseSharpnessesAttr(), np.float32),
        "corner_indices": (mesh.GetCornerIndicesAttr(), np.int32),
        "corner_sharpnesses": (mesh.GetCornerSharpnessesAttr(), np.float32),
    }
    topology = Topology(
        scheme=token(mesh.GetSubdivisionSchemeAttr(), SCHEMES, shutter.time, log),
        boundary=token(mesh.GetInterpolateBoundaryAttr(), BOUNDARIES, shutter.time, log),
        face_varying=token(
            mesh.GetFaceVaryingLinearInterpolationAttr(), FACE_VARYING, shutter.time, log
        ),
        triangles=token(mesh.GetTriangleSubdivisionRuleAttr(), TRIANGLES, shutter.time, log),
        orientation=token(mesh.GetOrientationAttr(), ORIENTATIONS, shutter.time, log),
        varies=any(attribute.ValueMightBeTimeVarying() for attribute, _ in arrays.values()),
    )
    for name, (attribute, dtype) in arrays.items():
        value = attribute.Get(shutter.time)
        if value is not None:
            array = np.ascontiguousarray(value, dtype=dtype)
            if array.ndim != 1:
                raise ValueError("not an array of numbers")
            setattr(topology, name, array)
    return topology
