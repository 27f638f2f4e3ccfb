"""Reads UsdGeomMesh: topology with every subdivision attribute, and points as raw samples.

Nothing is checked here beyond the types: the renderer checks counts and indices, and warns.
"""

from dataclasses import dataclass, field

import numpy as np
from pxr import Usd, UsdGeom

from .guard import token
from .log import SceneLog
from .shutter import Shutter, bracketing_samples
from .transforms import MAX_KEYS, TOLERANCE
from .varying import changes_topology, points_at_frame, warn_still

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
class Points:
    """Object-space points at times relative to the frame."""

    times: list[float]
    arrays: list[np.ndarray]  # (n, 3) f32 each
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


def read_points(
    mesh: UsdGeom.PointBased, shutter: Shutter, topology_varies: bool, log: SceneLog
) -> Points:
    """Points as authored around the shutter, or moved by their velocities where these are authored.

    USD's rules: with velocities, the sample at or before the frame moves along them. Without, where
    the topology changes, the points are those of the frame, with a warning that they do not move.
    """
    attribute = mesh.GetPointsAttr()
    varies = attribute.ValueMightBeTimeVarying()
    moved = _by_velocities(mesh, shutter)
    if moved:
        return moved
    if shutter.moves:
        samples = bracketing_samples(attribute, shutter)
        if samples and not (topology_varies and changes_topology(mesh.GetPrim(), samples, shutter)):
            arrays = [_array(attribute.Get(Usd.TimeCode(time))) for time in samples]
            return Points([time - shutter.frame for time in samples], arrays, True)
        if samples:
            warn_still(mesh.GetPrim(), log)
    if topology_varies:
        return Points([shutter.open], [_array(points_at_frame(mesh.GetPrim(), shutter))], varies)
    return Points([shutter.open], [_array(attribute.Get(shutter.code(shutter.open)))], varies)


def _by_velocities(mesh: UsdGeom.PointBased, shutter: Shutter) -> Points | None:
    velocities = mesh.GetVelocitiesAttr()
    if shutter.frame is None or not velocities.HasAuthoredValue():
        return None
    value, points = velocities.Get(shutter.time), mesh.GetPointsAttr().Get(shutter.time)
    if value is None or points is None or len(value) != len(points) or not len(points):
        return None  # USD ignores velocities that do not fit
    times = [shutter.open, shutter.close] if shutter.moves else [shutter.open]
    if shutter.moves and mesh.GetAccelerationsAttr().HasAuthoredValue():
        times = _acceleration_times(mesh, shutter, _array(points))
    arrays = [_array(mesh.ComputePointsAtTime(shutter.code(time), shutter.time)) for time in times]
    return Points(times, arrays, True)


def _acceleration_times(
    mesh: UsdGeom.PointBased, shutter: Shutter, points: np.ndarray
) -> list[float]:
    """Times between which points under acceleration stay within a tolerance of straight lines.

    The chord of a parabola misses it by a dt^2 / 8. The tolerance is that of curved transforms,
    relative to the size of the mesh or of its path.
    """
    accelerations = mesh.GetAccelerationsAttr().Get(shutter.time)
    if accelerations is None or len(accelerations) != len(points):
        return [shutter.open, shutter.close]
    per_code = mesh.GetPrim().GetStage().GetTimeCodesPerSecond() ** -2
    span = shutter.close - shutter.open
    bend = np.linalg.norm(_array(accelerations), axis=1).max() * per_code * span**2 / 8.0
    size = max(np.ptp(points, axis=0).max(), bend, 1e-30)
    ratio = bend / (TOLERANCE * size)
    count = int(np.clip(np.ceil(np.sqrt(ratio)), 1, MAX_KEYS - 1)) if np.isfinite(ratio) else 1
    return list(np.linspace(shutter.open, shutter.close, count + 1))


def _array(value) -> np.ndarray:
    if value is None:
        return np.zeros((0, 3), dtype=np.float32)
    array = np.ascontiguousarray(value, dtype=np.float32)
    if array.size and (array.ndim != 2 or array.shape[1] != 3):
        raise ValueError("not an array of triples")
    return array.reshape(-1, 3)
