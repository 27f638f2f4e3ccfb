"""Reads implicit prims: UsdGeomCube, Plane, Sphere, Cylinder, Cone and Capsule.

Their sizes are numbers that may be animated; USD interpolates them linearly, and so does the
renderer, from raw samples.
"""

from dataclasses import dataclass

import numpy as np
from pxr import Usd, UsdGeom

from .log import SceneLog
from .mesh import ORIENTATIONS
from .shutter import Shutter, bracketing_samples
from .typed import get_or_fallback, might_vary, token

KINDS = {
    UsdGeom.Cube: ("CUBE", ("size",)),
    UsdGeom.Plane: ("PLANE", ("width", "length")),
    UsdGeom.Sphere: ("SPHERE", ("radius",)),
    UsdGeom.Cylinder_1: ("CYLINDER", ("height", "radiusBottom", "radiusTop")),
    UsdGeom.Cylinder: ("CYLINDER", ("height", "radius", "radius")),
    UsdGeom.Cone: ("CONE", ("height", "radius")),
    UsdGeom.Capsule_1: ("CAPSULE", ("height", "radiusBottom", "radiusTop")),
    UsdGeom.Capsule: ("CAPSULE", ("height", "radius", "radius")),
}
"""The renderer's kind of each schema, and the attributes that are its sizes, in its order."""

AXES = ("X", "Y", "Z")


@dataclass
class Implicit:
    """Geometry of one implicit prim; see shapes.Shape."""

    shape: str
    """A TRZ_IMPLICIT_ name."""
    axis: str
    orientation: str
    times: list[float]
    sizes: np.ndarray
    """(n, 3), f64; what the shape does not have is 0."""
    varies: bool
    kind: str = "implicit"
    is_empty: bool = False

    def send(self, session, prim: int, before: "Implicit | None") -> None:
        """Sends all of it: it is small."""
        session.set_implicit(prim, self)


def read_implicit(
    prim: Usd.Prim, shutter: Shutter, log: SceneLog, before: Implicit | None
) -> Implicit:
    """The prim at the frame, with the samples of its sizes around the shutter."""
    if before is not None and not before.varies:
        return before
    schema, (shape, names) = next((s, k) for s, k in KINDS.items() if prim.IsA(s))
    attributes = [prim.GetAttribute(name) for name in names]
    times = [shutter.open]
    samples = [bracketing_samples(attribute, shutter) or [] for attribute in attributes]
    if any(samples):
        times = [time - shutter.frame for time in sorted({t for one in samples for t in one})]
    sizes = np.zeros((len(times), 3))
    for row, time in zip(sizes, times, strict=True):
        code = shutter.code(time)
        row[: len(names)] = [get_or_fallback(a, code, log, shutter.time) for a in attributes]
    axis = [schema(prim).GetAxisAttr()] if hasattr(schema, "GetAxisAttr") else []
    orientation = UsdGeom.Gprim(prim).GetOrientationAttr()
    return Implicit(
        shape=shape,
        axis=token(axis[0], AXES, shutter.time, log) if axis else "Z",
        orientation=token(orientation, ORIENTATIONS, shutter.time, log),
        times=times,
        sizes=sizes,
        varies=might_vary(*attributes, *axis, orientation),
    )
