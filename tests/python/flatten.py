"""Writes a stage with instances out: one prim per appearance, with its matrix baked in.

For tests of instancing. It follows USD's own functions (GetLocalTransformation,
ComputeInstanceTransformsAtTimes, instance proxies) and shares nothing with the renderer's walk. It
also says which primId and instanceId each appearance ought to show: the place of the prim in its
prototypes, and one flat number over all levels of instancing, the outermost first.
"""

from dataclasses import dataclass

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom

PROXIES = Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate)
ANY = Usd.TraverseInstanceProxies(Usd.PrimIsActive & Usd.PrimIsLoaded)
NOT_COPIED = ("xformOp", "visibility", "purpose")


@dataclass
class Appearance:
    """One prim in one place: object-to-world matrices at the flattener's times."""

    prim: Usd.Prim
    matrices: list[np.ndarray]
    instance_id: int

    @property
    def name(self) -> tuple[str, int]:
        """What tells appearances apart: path in the prototypes, and flat number."""
        return canonical(self.prim), self.instance_id


def canonical(prim: Usd.Prim) -> str:
    """The path of a prim, in its prototype where it is part of a native instance."""
    return str((prim.GetPrimInPrototype() if prim.IsInstanceProxy() else prim).GetPath())


class Flattener:
    """Finds all appearances of a stage's gprims at a frame."""

    def __init__(self, stage, frame=0.0, times=(0.0,), purposes=("default", "proxy")):
        self.stage = stage
        self.frame = frame
        self.times = [frame + time for time in times]
        self.purposes = purposes
        self.found: list[Appearance] = []
        identity = [np.eye(4)] * len(self.times)
        self._visit(stage.GetPseudoRoot(), identity, identity, "default", 0, (), PROXIES)

    def _visit(self, prim, world, base, purpose, number, inside, predicate):
        self._walk([(prim, world, purpose)], base, number, inside, predicate)

    def _walk(self, subtree, base, number, inside, predicate):
        """Native instances of one prototype are numbered together, in order, below one place."""
        members: dict = {}
        while subtree:
            prim, world, purpose = subtree.pop(0)
            imageable = UsdGeom.Imageable(prim)
            if not imageable:
                subtree[:0] = [(c, world, purpose) for c in prim.GetFilteredChildren(predicate)]
                continue
            if imageable.GetVisibilityAttr().Get(self.frame) == "invisible":
                continue
            if imageable.GetPurposeAttr().HasAuthoredValue():
                purpose = imageable.GetPurposeAttr().Get()
            world = self._placed(prim, world, base)
            if prim.IsA(UsdGeom.PointInstancer):
                if purpose in self.purposes and prim.GetPath() not in inside:
                    self._instancer(prim, world, purpose, number, inside)
                continue
            if prim.IsA(UsdGeom.Gprim) and purpose in self.purposes:
                self.found.append(Appearance(prim, world, number))
            below = [(child, world, purpose) for child in prim.GetFilteredChildren(predicate)]
            if prim.IsInstance():
                key = (prim.GetPrototype().GetPath(), purpose)
                members.setdefault(key, []).append(below)
            else:
                subtree[:0] = below
        for copies in members.values():
            for i, below in enumerate(copies):
                own = number if len(copies) == 1 else number * len(copies) + i
                self._walk(below, base, own, inside, predicate)

    def _placed(self, prim, world, base):
        xform = UsdGeom.Xformable(prim)
        if not xform:
            return world
        local = [np.array(xform.GetLocalTransformation(time)) for time in self.times]
        above = base if xform.GetResetXformStack() else world
        return [a @ b for a, b in zip(local, above, strict=True)]

    def _instancer(self, prim, world, purpose, number, inside):
        instancer = UsdGeom.PointInstancer(prim)
        indices = instancer.GetProtoIndicesAttr().Get(self.frame)
        targets = instancer.GetPrototypesRel().GetForwardedTargets()
        mask = instancer.ComputeMaskAtTime(self.frame) or [True] * len(indices)
        rates = (instancer.GetVelocitiesAttr(), instancer.GetAngularVelocitiesAttr())
        rated = any(rate.HasAuthoredValue() for rate in rates)
        matrices = [
            instancer.ComputeInstanceTransformsAtTime(
                time,
                self.frame if rated else time,
                UsdGeom.PointInstancer.ExcludeProtoXform,
                UsdGeom.PointInstancer.IgnoreMask,
            )
            for time in self.times
        ]
        for i, index in enumerate(indices):
            if not mask[i] or not 0 <= index < len(targets):
                continue
            prototype = self.stage.GetPrimAtPath(targets[index])
            if not prototype:
                continue
            place = [np.array(m[i]) @ w for m, w in zip(matrices, world, strict=True)]
            predicate = PROXIES if Usd.PrimDefaultPredicate(prototype) else ANY
            own = number * len(indices) + i
            self._visit(prototype, place, place, purpose, own, (*inside, prim.GetPath()), predicate)


def flatten(stage, frame=0.0, times=(0.0,), camera="/camera") -> tuple[Usd.Stage, dict]:
    """The stage written out, and the name of the appearance that each path of it is."""
    flat = Usd.Stage.CreateInMemory()
    flat.SetTimeCodesPerSecond(stage.GetTimeCodesPerSecond())
    UsdGeom.SetStageUpAxis(flat, UsdGeom.GetStageUpAxis(stage))
    source = stage.GetPrimAtPath(camera)
    _copy(source, UsdGeom.Camera.Define(flat, camera).GetPrim(), with_transform=True)
    names = {}
    for i, appearance in enumerate(Flattener(stage, frame, times).found):
        prim = appearance.prim
        copy = flat.DefinePrim(f"/flat/p{i}", prim.GetTypeName())
        _copy(prim, copy)
        for primvar in UsdGeom.PrimvarsAPI(prim).FindPrimvarsWithInheritance():
            _copy_attribute(primvar.GetAttr(), copy)
        op = UsdGeom.Xformable(copy).AddTransformOp().GetAttr()
        if len(times) == 1:
            op.Set(_matrix(appearance.matrices[0]))
        else:
            for time, matrix in zip(times, appearance.matrices, strict=True):
                op.Set(_matrix(matrix), frame + time)
        names[str(copy.GetPath())] = appearance.name
    return flat, names


def _matrix(matrix):
    return Gf.Matrix4d(*np.asarray(matrix, dtype=float).ravel().tolist())


def _copy(source, target, with_transform=False):
    for attribute in source.GetAuthoredAttributes():
        if with_transform or not attribute.GetName().startswith(NOT_COPIED):
            _copy_attribute(attribute, target)


def _copy_attribute(attribute, target):
    name = attribute.GetName()
    copy = target.CreateAttribute(name, attribute.GetTypeName(), attribute.IsCustom())
    for key in ("interpolation", "elementSize"):
        if attribute.HasAuthoredMetadata(key):
            copy.SetMetadata(key, attribute.GetMetadata(key))
    value = attribute.Get(Usd.TimeCode.Default())
    if value is not None:
        copy.Set(value)
    for time in attribute.GetTimeSamples():
        copy.Set(attribute.Get(time), time)
    if attribute.GetVariability() == Sdf.VariabilityUniform:
        copy.SetVariability(Sdf.VariabilityUniform)
