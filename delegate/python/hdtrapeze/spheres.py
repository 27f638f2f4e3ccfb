"""Reads UsdGeomPoints: points as raw samples. Their widths are a primvar, see primvars.py."""

from dataclasses import dataclass

from pxr import Usd, UsdGeom

from .log import SceneLog
from .mesh import Points, read_points
from .shutter import Shutter


@dataclass
class Spheres:
    """Geometry of one prim of spheres; see shapes.Shape."""

    points: Points
    kind: str = "spheres"

    @property
    def is_empty(self) -> bool:
        """Whether there is no point."""
        return not any(array.size for array in self.points.arrays)

    @property
    def varies(self) -> bool:
        """Whether the points may differ at another frame."""
        return self.points.varies

    def send(self, session, prim: int, before: "Spheres | None") -> None:
        """Sends the points where `before` had others."""
        if before is None or before.points is not self.points:
            session.set_points(prim, self.points)


def read_spheres(
    prim: Usd.Prim, shutter: Shutter, log: SceneLog, before: Spheres | None
) -> Spheres:
    """The points at the frame; those that do not vary are taken over from `before`."""
    if before and not before.points.varies:
        return before
    points = UsdGeom.Points(prim)
    # Particles are born and die: a change of their number is a change of topology.
    varies = points.GetPointsAttr().ValueMightBeTimeVarying()
    return Spheres(read_points(points, shutter, varies, log))
