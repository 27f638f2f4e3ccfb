"""Searches of stages with native instances that look into each prototype once.

Instances of instances multiply: ten levels of ten are 10^10 prims to a
traversal of proxies, and a hundred prims to what is authored.
"""

from collections.abc import Iterator

from pxr import Usd


class Holders:
    """Which native instances hold a prim of a schema, at any depth."""

    def __init__(self, schema: type):
        self._schema = schema
        self._known: dict = {}

    def below(self, prim: Usd.Prim) -> bool:
        """Whether `prim` or a prim below it is one, in native instances too."""
        start = (prim.GetPrototype() if prim.IsInstance() else prim).GetPath()
        # What each prototype holds itself, and the prototypes in it.
        waiting, order, inside = [prim], [], {}
        while waiting:
            top = waiting.pop()
            top = top.GetPrototype() if top.IsInstance() else top
            path = top.GetPath()
            if path in self._known or path in inside:
                continue
            inside[path] = []
            order.append(path)
            for found in Usd.PrimRange(top, Usd.PrimAllPrimsPredicate):
                if found.IsA(self._schema):
                    self._known[path] = True
                if found.IsInstance():
                    inside[path].append(found.GetPrototype().GetPath())
                    waiting.append(found)
        # The last found are mostly the innermost.
        changed = True
        while changed:
            changed = False
            for path in reversed(order):
                if not self._known.get(path) and any(map(self._known.get, inside[path])):
                    self._known[path] = changed = True
        for path in order:
            self._known.setdefault(path, False)
        return self._known[start]


def find_all(stage: Usd.Stage, schema: type, predicate) -> Iterator[Usd.Prim]:
    """All prims of a schema that `predicate` lets through, those in native instances as proxies."""
    holders = Holders(schema)
    prims = iter(Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies(predicate)))
    for prim in prims:
        if prim.IsA(schema):
            yield prim
        if prim.IsInstance() and not holders.below(prim):
            prims.PruneChildren()
