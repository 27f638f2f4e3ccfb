"""What prims inherit in primvars, in a form that tells whether two prims inherit the same."""

import hashlib

from pxr import Usd, UsdGeom

from .shutter import Shutter


class Inherited:
    """Reads inherited primvars for one frame, each prim once."""

    def __init__(self, shutter: Shutter, names: tuple[str, ...]):
        self._shutter = shutter
        self._names = names
        self._known: dict = {}

    def below(self, prim: Usd.Prim) -> tuple:
        """What all prims below `prim` inherit: names and values of constant primvars."""
        return tuple(sorted(self._below(prim).items()))

    def by(self, prim: Usd.Prim) -> tuple:
        """What `prim` itself inherits: what it has no own value of."""
        api = UsdGeom.PrimvarsAPI(prim)
        found = self._below(prim.GetParent()).items()
        return tuple(sorted(item for item in found if not api.GetPrimvar(item[0]).HasValue()))

    def _below(self, prim: Usd.Prim) -> dict[str, str]:
        waiting = []
        while prim and not prim.IsPseudoRoot() and prim.GetPath() not in self._known:
            waiting.append(prim)
            prim = prim.GetParent()
        found = self._known.get(prim.GetPath(), {}) if prim else {}
        for below in reversed(waiting):
            api = UsdGeom.PrimvarsAPI(below)
            own = {name: api.GetPrimvar(name) for name in self._names}
            own = {name: primvar for name, primvar in own.items() if primvar.HasAuthoredValue()}
            for name, primvar in own.items():
                found = found | {name: self._value(primvar)}
            self._known[below.GetPath()] = found
        return found

    def _value(self, primvar: UsdGeom.Primvar) -> str:
        """The value, or where it may change the name of who has it; nothing where it ends here."""
        if primvar.GetInterpolation() != UsdGeom.Tokens.constant:
            return ""
        if primvar.ValueMightBeTimeVarying():
            return str(primvar.GetAttr().GetPath())
        value = primvar.ComputeFlattened(self._shutter.time)
        return digest((primvar.GetTypeName().type.typeName, value))


def digest(value) -> str:
    """A short name for a value, by its text."""
    return hashlib.blake2b(repr(value).encode(), digest_size=8).hexdigest()
