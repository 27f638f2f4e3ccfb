"""The collections of a RenderPass: what it prunes, what it shows, what it holds out.

The rules are UsdRenderPass's. A pruned prim goes with all below it. renderVisibility and
cameraVisibility are asked for each piece of geometry by itself, so a pattern has to reach it
(`/World/car//`, not `/World/car`). With rays from the camera only, the two mean the same.

What a point instancer places is pruned and held out by the instancer's path or by its own; it is
visible as the instancer is, and prototypes below the instancer by their own path too.
"""

from pxr import Sdf, Tf, Usd, UsdRender

from .guard import reason
from .log import SceneLog


class PassCollections:
    """The collections of one RenderPass; without a pass everything is shown."""

    def __init__(self, render_pass: UsdRender.Pass | None, log: SceneLog):
        def query(name: str, default_is_all: bool):
            return _query(render_pass.GetPrim(), name, default_is_all, log) if render_pass else None

        self._shown = [
            found
            for name in ("renderVisibility", "cameraVisibility")
            if (found := query(name, True)) is not None
        ]
        self._pruned = query("prune", False)
        self._matte = query("matte", False)

    @property
    def has_any(self) -> bool:
        """False where every prim is shown as it is."""
        return bool(self._shown) or self._pruned is not None or self._matte is not None

    def prunes(self, path: Sdf.Path, instancers: tuple = ()) -> bool:
        """Whether the prim is left out with all below it; `instancers` place it."""
        return _has_any(self._pruned, path, instancers)

    def prunes_with_parents(self, path: Sdf.Path) -> bool:
        """Whether the prim or anything above it is pruned."""
        return self._pruned is not None and any(map(self.prunes, path.GetPrefixes()))

    def shows(self, path: Sdf.Path, instancers: tuple = ()) -> bool:
        """Whether the prim's own geometry is visible."""
        if instancers and not path.HasPrefix(instancers[-1]):
            return True  # as the instancer, which was asked before
        return all(query.IsPathIncluded(path) for query in self._shown)

    def is_matte(self, path: Sdf.Path, instancers: tuple = ()) -> bool:
        """Whether the prim's own geometry is a matte object."""
        return _has_any(self._matte, path, instancers)


def _has_any(query, path: Sdf.Path, instancers: tuple) -> bool:
    return query is not None and any(map(query.IsPathIncluded, (path, *instancers)))


def _query(prim: Usd.Prim, name: str, default_is_all: bool, log: SceneLog):
    """Who is in the collection, or None where it has nothing to say: all are, or none is."""
    collection = Usd.CollectionAPI.Get(prim, name)
    path = prim.GetPath()
    try:
        good, why = collection.Validate()
        if good:
            _check_targets(collection, name, log)
            _check_expression(collection, name, log)
            if default_is_all or not collection.HasNoIncludedPaths():
                return collection.ComputeMembershipQuery()
            return None
        why = " ".join(why.split()).removesuffix(".")
    except Tf.ErrorException as error:
        why = reason(error)
    log.warn(path, "collection", f"its collection {name} is ignored: {why}")
    return None


def _check_targets(collection: Usd.CollectionAPI, name: str, log: SceneLog) -> None:
    """Says which prims it names that are not there."""
    prim = collection.GetPrim()
    stage = prim.GetStage()
    for relationship in (collection.GetIncludesRel(), collection.GetExcludesRel()):
        for target in relationship.GetTargets():
            missing = target.IsPrimPath() and not stage.GetPrimAtPath(target)
            if missing and stage.GetPopulationMask().Includes(target):
                text = f"its collection {name} names {target}, which is no prim"
                log.warn(prim.GetPath(), "collection", text)


def _check_expression(collection: Usd.CollectionAPI, name: str, log: SceneLog) -> None:
    """Says where USD does not look at the collection's pattern."""
    authored = collection.GetMembershipExpressionAttr().HasAuthoredValue()
    if authored and not collection.IsInExpressionMode():
        text = (
            f"the membershipExpression of its collection {name} does not count, because USD takes "
            f"includes, excludes and includeRoot first: author includeRoot = 0, or "
            f'mode = "expression"'
        )
        log.warn(collection.GetPrim().GetPath(), "collection", text)
