"""Finds point instancers that are, through any number of others, among their own prototypes."""

import bisect

from pxr import Sdf, Usd, UsdGeom

from .prototypes import find_all


def endless_instancers(stage: Usd.Stage) -> set[Sdf.Path]:
    """Paths of the instancers of a stage from which following prototypes does not end."""
    everything = find_all(stage, UsdGeom.PointInstancer, Usd.PrimAllPrimsPredicate)
    found = {prim.GetPath(): UsdGeom.PointInstancer(prim) for prim in everything}
    paths = sorted(found)
    below = {path: _reached(found[path], paths) for path in paths}
    # What only leads to instancers that end, ends: take those away until nothing changes.
    above: dict[Sdf.Path, list[Sdf.Path]] = {path: [] for path in paths}
    for path, reached in below.items():
        for other in reached:
            above[other].append(path)
    left = {path: len(reached) for path, reached in below.items()}
    ending = [path for path, count in left.items() if count == 0]
    while ending:
        path = ending.pop()
        del left[path]
        for other in above[path]:
            left[other] -= 1
            if left[other] == 0:
                ending.append(other)
    return set(left)


def _reached(instancer: UsdGeom.PointInstancer, paths: list[Sdf.Path]) -> set[Sdf.Path]:
    """Instancers in the subtrees of the prototypes; `paths` are those of all, sorted."""
    reached = set()
    for target in instancer.GetPrototypesRel().GetForwardedTargets():
        at = bisect.bisect_left(paths, target)
        while at < len(paths) and paths[at].HasPrefix(target):
            reached.add(paths[at])
            at += 1
    return reached
