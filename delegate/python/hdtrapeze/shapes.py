"""Which reader makes geometry of which type of prim.

A reader takes a prim, the shutter, the log and what it made of the same prim before (or None), and
gives a Shape: raw data that knows how to send itself. Types without a reader are not rendered.
"""

from collections.abc import Callable
from typing import Protocol

from pxr import Usd, UsdGeom

from .curves import read_curves
from .implicit import KINDS, read_implicit
from .mesh import read_mesh
from .nurbs import read_nurbs_patch
from .nurbs_curves import read_nurbs_curves
from .spheres import read_spheres


class Shape(Protocol):
    """The geometry of one prim at one frame."""

    kind: str
    """What Session.create makes of it."""

    @property
    def is_empty(self) -> bool:
        """Whether there is nothing to draw."""

    @property
    def varies(self) -> bool:
        """Whether it may differ at another frame."""

    def send(self, session, prim: int, before: "Shape | None") -> None:
        """Gives the session what differs from `before`, which it has."""


Reader = Callable[..., Shape]

READERS: list[tuple[type, Reader]] = [
    (UsdGeom.Mesh, read_mesh),
    *((schema, read_implicit) for schema in KINDS),
    (UsdGeom.NurbsPatch, read_nurbs_patch),
    (UsdGeom.NurbsCurves, read_nurbs_curves),
    (UsdGeom.BasisCurves, read_curves),
    (UsdGeom.Points, read_spheres),
]


def find_reader(prim: Usd.Prim) -> Reader | None:
    """The reader of the first type that the prim is."""
    return next((reader for schema, reader in READERS if prim.IsA(schema)), None)
