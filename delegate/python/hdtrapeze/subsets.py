"""Reads UsdGeomSubset: the subsets of a mesh as authored.

Nothing is checked here beyond the types: the renderer checks indices and families, and warns.
"""

from dataclasses import dataclass

import numpy as np
from pxr import Usd, UsdGeom

from .guard import FAULTS, warn_unreadable
from .log import SceneLog
from .typed import get, might_vary, token

ELEMENTS = {
    "face": "FACE",
    "point": "POINT",
    "edge": "EDGE",
    "segment": "SEGMENT",
    "tetrahedron": "TETRAHEDRON",
}
FAMILIES = {
    "unrestricted": "UNRESTRICTED",
    "nonOverlapping": "NON_OVERLAPPING",
    "partition": "PARTITION",
}

_CHILDREN = Usd.TraverseInstanceProxies(Usd.PrimIsActive & Usd.PrimIsLoaded)


@dataclass
class Subset:
    """One subset at the frame."""

    path: str
    family: str
    family_type: str
    """A key of FAMILIES."""
    element: str
    """A key of ELEMENTS."""
    indices: np.ndarray
    """int32."""


def read_subsets(prim: Usd.Prim, time: Usd.TimeCode, log: SceneLog) -> tuple[list[Subset], bool]:
    """The subsets of a mesh in the order of its children, and whether one may vary."""
    subsets, varies, families = [], False, {}
    for child in _children(prim):
        subset = UsdGeom.Subset(child)
        try:
            family = get(subset.GetFamilyNameAttr(), Usd.TimeCode.Default()) or ""
            if family not in families:
                families[family] = _family_type(prim, family, log)
            indices, element = subset.GetIndicesAttr(), subset.GetElementTypeAttr()
            value = get(indices, time)
            subsets.append(
                Subset(
                    str(child.GetPath()),
                    family,
                    families[family],
                    token(element, ELEMENTS, time, log),
                    np.array([] if value is None else value, dtype=np.int32),
                )
            )
            varies |= might_vary(indices, element)
        except FAULTS as error:
            warn_unreadable(log, child.GetPath(), error, "this subset is ignored")
    return subsets, varies


def warn_of_unused(prim: Usd.Prim, log: SceneLog) -> None:
    """Says that subsets of this prim, which is no mesh, do nothing."""
    if count := len(_children(prim)):
        what = "GeomSubset does" if count == 1 else f"{count} GeomSubsets do"
        text = f"its {what} nothing: only those of a Mesh are used"
        log.warn(prim.GetPath(), "subset", text)


def _children(prim: Usd.Prim) -> list[Usd.Prim]:
    return [child for child in prim.GetFilteredChildren(_CHILDREN) if child.IsA(UsdGeom.Subset)]


def _family_type(prim: Usd.Prim, family: str, log: SceneLog) -> str:
    """familyType of a family of the mesh's subsets."""
    name = f"subsetFamily:{family}:familyType"
    attribute = prim.GetAttribute(name) if family else None
    value = attribute.Get() if attribute else None
    if value is None or value in FAMILIES:
        return value or "unrestricted"
    text = f"{name} is {value!r}, which is none of {', '.join(FAMILIES)}; unrestricted is used"
    log.warn(prim.GetPath(), "token-familyType", text)
    return "unrestricted"
