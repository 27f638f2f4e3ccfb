"""Reads UsdGeomMesh: topology with every subdivision attribute, and points as raw samples.

Nothing is checked here beyond the types: the renderer checks counts and indices, and warns.
"""

from dataclasses import dataclass, field

import numpy as np
from pxr import Usd, UsdGeom

from .log import SceneLog
from .points import Points, read_points
from .shutter import Shutter
from .subsets import Subset, read_subsets
from .typed import get, get_or_ignore, might_vary, token

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
    subsets: list[Subset] = field(default_factory=list)
    subsets_vary: bool = False
    kind: str = "mesh"

    @property
    def is_empty(self) -> bool:
        """Whether there is neither a face nor a point."""
        return not self.topology.face_vertex_counts.size and not any(
            array.size for array in self.points.arrays
        )

    @property
    def varies(self) -> bool:
        """Whether topology, points or subsets may differ at another frame."""
        return self.topology.varies or self.points.varies or self.subsets_vary

    def send(self, session, prim: int, before: "Mesh | None") -> None:
        """Sends topology, points and subsets, as far as `before` had others."""
        if before is None or before.topology is not self.topology:
            session.set_topology(prim, self.topology)
        if before is None or before.points is not self.points:
            session.set_points(prim, self.points)
        if before is None or before.subsets is not self.subsets:
            session.set_subsets(prim, self.subsets)


def read_mesh(prim: Usd.Prim, shutter: Shutter, log: SceneLog, before: Mesh | None) -> Mesh:
    """The mesh at the frame; what does not vary is taken over from `before`."""
    mesh = UsdGeom.Mesh(prim)
    topology = before.topology if before else None
    if topology is None or topology.varies:
        topology = read_topology(mesh, shutter, log)
    points = before.points if before else None
    if points is None or points.varies or topology.varies:
        points = read_points(mesh, shutter, topology.varies, log)
    if before and not before.subsets_vary:
        return Mesh(topology, points, before.subsets)
    return Mesh(topology, points, *read_subsets(prim, shutter.time, log))


ARRAYS = {
    "face_vertex_counts": ("faceVertexCounts", np.int32),
    "face_vertex_indices": ("faceVertexIndices", np.int32),
    "holes": ("holeIndices", np.int32),
    "crease_indices": ("creaseIndices", np.int32),
    "crease_lengths": ("creaseLengths", np.int32),
    "crease_sharpnesses": ("creaseSharpnesses", np.float32),
    "corner_indices": ("cornerIndices", np.int32),
    "corner_sharpnesses": ("cornerSharpnesses", np.float32),
}
NEEDED = ("faceVertexCounts", "faceVertexIndices")
"""Without them, a mesh is not rendered."""

TOKENS = {
    "scheme": ("subdivisionScheme", SCHEMES),
    "boundary": ("interpolateBoundary", BOUNDARIES),
    "face_varying": ("faceVaryingLinearInterpolation", FACE_VARYING),
    "triangles": ("triangleSubdivisionRule", TRIANGLES),
    "orientation": ("orientation", ORIENTATIONS),
}
"""USD's names of a topology's fields, and the values they may have."""


def read_topology(mesh: UsdGeom.Mesh, shutter: Shutter, log: SceneLog) -> Topology:
    """Topology at the frame. Only what is authored is read: most meshes author little."""
    prim = mesh.GetPrim()
    authored = set(prim.GetAuthoredPropertyNames())
    topology = Topology(scheme="catmullClark")
    for field_name, (name, known) in TOKENS.items():
        if name in authored:
            attribute = prim.GetAttribute(name)
            topology.varies |= might_vary(attribute)
            setattr(topology, field_name, token(attribute, known, shutter.time, log))
    for field_name, (name, dtype) in ARRAYS.items():
        if name not in authored:
            continue
        attribute = prim.GetAttribute(name)
        topology.varies |= might_vary(attribute)
        if name in NEEDED:
            value = get(attribute, shutter.time)
        else:
            value = get_or_ignore(attribute, shutter.time, log)
        if value is not None:
            setattr(topology, field_name, np.ascontiguousarray(value, dtype=dtype))
    return topology
