"""UsdSkel: which prims are bound to which skeleton, and where that takes them.

A prim whose points have their own joints and weights gets new points, in its own space: skinning
happens in the skeleton's space, and from there it is the way between the two prims. A prim with
one set of joints for all of it gets a new transform instead, as in UsdSkel's own baking. Blend
shapes move points first. Keys are the authored times within the shutter, and as many more as keep
straight lines between them within the tolerance of turning objects (see transforms).
"""

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdSkel, Vt

from .guard import FAULTS, mistyped, warn_unreadable
from .log import SceneLog
from .points import Points
from .primvars import Primvar, Sample
from .shutter import Shutter
from .skel_input import (
    BINDING,
    BlendShapes,
    has_influences,
    read_bind_transform,
    read_influences,
    read_method,
)
from .skel_pose import CODE, Pose
from .transforms import Between, Level, TransformReader, curve_keys, point_keys
from .typed import Mistyped, get

_IDENTITY = np.eye(4)


class Skinning:
    """The skeletons of one stage, between two edits of it."""

    def __init__(self, log: SceneLog):
        self._log = log
        self.forget()

    def forget(self) -> None:
        """Forgets everything, as the stage has changed."""
        self._cache = UsdSkel.Cache()
        self._roots: set[Sdf.Path] = set()
        self._outermost: dict[Sdf.Path, Usd.Prim | None] = {}
        self._poses: dict[Sdf.Path, Pose] = {}
        self._skinned: dict[Sdf.Path, Skinned] = {}

    def begin_frame(self, shutter: Shutter, transforms: TransformReader) -> None:
        """What `Skinned` is asked for is from now on that of another frame."""
        for pose in self._poses.values():
            pose.begin_frame()
        for skinned in self._skinned.values():
            skinned.begin_frame(shutter, transforms)
        self._frame = shutter, transforms

    def enter(self, prim: Usd.Prim, predicate) -> None:
        """Reads the bindings below `prim` where it is, or is below, a SkelRoot."""
        root = self._outermost_root(prim)
        if root is None or root.GetPath() in self._roots:
            return
        self._roots.add(root.GetPath())
        skel_root = UsdSkel.Root(root)
        self._cache.Populate(skel_root, predicate)
        for binding in self._cache.ComputeSkelBindings(skel_root, predicate):
            for query in binding.GetSkinningTargets():
                if has_influences(query) or query.HasBlendShapes():
                    self._bind(query, binding.GetSkeleton())

    def _outermost_root(self, prim: Usd.Prim) -> Usd.Prim | None:
        """The first SkelRoot on the way down to `prim`, each prim looked at once."""
        waiting = []
        while prim and not prim.IsPseudoRoot() and prim.GetPath() not in self._outermost:
            waiting.append(prim)
            prim = prim.GetParent()
        root = self._outermost.get(prim.GetPath()) if prim else None
        for below in reversed(waiting):
            root = root or (below if below.IsA(UsdSkel.Root) else None)
            self._outermost[below.GetPath()] = root
        return root

    def _bind(self, query: UsdSkel.SkinningQuery, skeleton: UsdSkel.Skeleton) -> None:
        prim = skeleton.GetPrim()
        pose = self._poses.get(prim.GetPath())
        if pose is None:
            pose = Pose(prim, self._cache.GetSkelQuery(skeleton), self._log)
            self._poses[prim.GetPath()] = pose
        skinned = Skinned(query, pose, self._log)
        skinned.begin_frame(*self._frame)
        self._skinned[query.GetPrim().GetPath()] = skinned

    def of(self, prim: Usd.Prim) -> "Skinned | None":
        """How the prim is skinned; None where it is not."""
        return self._skinned.get(prim.GetPath()) if self._skinned else None

    def deform(self, prim: Usd.Prim, shape, before) -> None:
        """Replaces the points of `shape`, unless it has taken over those of `before`."""
        skinned = self.of(prim)
        if skinned is None:
            if UsdSkel.BindingAPI(prim).GetJointIndicesAttr().HasAuthoredValue():
                self._warn_unbound(prim)
        elif prim.IsA(UsdGeom.PointBased) and not (before and shape.points is before.points):
            shape.points = skinned.points() or shape.points

    def _warn_unbound(self, prim: Usd.Prim) -> None:
        if not prim.HasAPI(UsdSkel.BindingAPI):
            why = "but SkelBindingAPI is not applied to it"
        elif not UsdSkel.Root.Find(prim):
            why = "but is below no SkelRoot"
        else:
            why = "but no skeleton"
            above = prim
            while above and not above.IsPseudoRoot():
                targets = UsdSkel.BindingAPI(above).GetSkeletonRel().GetForwardedTargets()
                if targets:
                    why = f"but its skeleton {targets[0]} is none"
                    break
                above = above.GetParent()
        text = f"it has joint influences, {why}; the rest shape is rendered"
        self._log.warn(prim.GetPath(), CODE, text)


class Skinned:
    """One prim that a skeleton moves."""

    def __init__(self, query: UsdSkel.SkinningQuery, pose: Pose, log: SceneLog):
        self._query = query
        self._pose = pose
        self._log = log
        self._prim = query.GetPrim()
        self._kept: dict[str, tuple] = {}
        point_based = UsdGeom.PointBased(self._prim)
        self._rest = point_based.GetPointsAttr() if point_based else None

    def begin_frame(self, shutter: Shutter, transforms: TransformReader) -> None:
        """What is asked for is from now on that of another frame."""
        self._shutter = shutter
        self._transforms = transforms
        self._read = False

    def use(self, shutter: Shutter, transforms: TransformReader) -> None:
        """Evaluates over another shutter than the frame's, for a prim whose blur is scaled."""
        if shutter is not self._shutter:
            self.begin_frame(shutter, transforms)

    # What is read once a frame -------------------------------------------------------------------

    def _prepare(self) -> None:
        if self._read:
            return
        self._read = True
        self._influences = self._shapes = None
        time, query = self._shutter.time, self._query
        try:
            points = get(self._rest, time) if self._rest else None
        except Mistyped:
            return  # whoever reads the prim warns
        self._count = 0 if points is None else len(points)
        wrong = mistyped(self._prim, BINDING)
        if wrong:
            text = f"{wrong}; the rest shape is rendered"
            self._log.warn(self._prim.GetPath(), "type", text)
            return
        if has_influences(query) and self._pose.is_empty:
            text = f"its skeleton {self._pose.prim.GetPath()} has no joints"
            self._log.warn(self._prim.GetPath(), CODE, f"{text}; the rest shape is rendered")
        try:
            if self._pose.can_skin and has_influences(query):
                bound = (query.GetJointIndicesPrimvar(), query.GetJointWeightsPrimvar())
                self._influences = self._keep(
                    "influences",
                    any(primvar and primvar.ValueMightBeTimeVarying() for primvar in bound),
                    lambda: read_influences(query, self._pose, self._count, time, self._log),
                )
            if self._count and query.HasBlendShapes():
                self._shapes = self._keep(
                    "shapes",
                    False,
                    lambda: BlendShapes(query, self._prim, self._count, self._log),
                )
            self._method = read_method(query, self._log)
        except FAULTS as error:
            self._influences = self._shapes = None
            warn_unreadable(self._log, self._prim.GetPath(), error, "the rest shape is rendered")
        if self._influences and not self._influences.rigid and not self._count:
            self._influences = None
        if self._influences:
            target = self._prim.GetParent() if self._influences.rigid else self._prim
            self._between = Between(self._transforms, self._pose.prim, target)

    def _keep(self, name: str, varies: bool, read):
        """What `read` gives, kept from frame to frame while the number of points stays."""
        known = self._kept.get(name)
        if varies or known is None or known[0] != self._count:
            known = self._kept[name] = self._count, read()
        return known[1]

    def _bind_transform(self, time: float) -> Gf.Matrix4d:
        attribute = self._query.GetGeomBindTransformAttr()
        return self._keep(
            "bind transform",
            bool(attribute) and attribute.ValueMightBeTimeVarying(),
            lambda: read_bind_transform(self._query, self._shutter.code(time), self._log),
        )

    # What comes of it ----------------------------------------------------------------------------

    def shared_by(self, instance: Usd.Prim) -> tuple:
        """What must be the same for two instances to share what is skinned in them."""
        query, skeleton = self._query, self._pose.prim
        animation = self._pose.animation
        bound = (query.GetJointIndicesPrimvar(), query.GetJointWeightsPrimvar())
        attributes = [*(primvar.GetAttr() for primvar in bound), query.GetGeomBindTransformAttr()]
        if skeleton.GetPath().HasPrefix(instance.GetPath()):
            space = skeleton.GetPrimInPrototype().GetPath()
        else:
            space = self._prim.GetPath()  # each instance stands elsewhere to the skeleton
        return (
            space,
            animation.GetPrim().GetPath() if animation else None,
            tuple(str(attribute.GetPath()) for attribute in attributes if attribute),
            tuple(query.GetJointOrder() or ()),
            query.GetSkinningMethod(),
        )

    def place(self) -> None:
        """Gives a prim that moves as one its transform."""
        self._prepare()
        if self._influences and self._influences.rigid:
            self._transforms.replace_own(self._prim, self._level())

    def _level(self) -> Level:
        influences = self._influences

        def evaluate(time):
            matrix = UsdSkel.SkinTransform(
                self._method,
                self._bind_transform(time),
                influences.transforms(self._pose, self._shutter.code(time)),
                influences.joints,
                influences.weights,
            )
            return np.array(matrix, dtype=np.float64) @ self._between.at(time)

        return Level(*curve_keys(self._times(self._joint_times()), evaluate))

    def points(self) -> Points | None:
        """Points over the shutter, in the prim's space; None where they are as authored."""
        self._prepare()
        skins = self._influences is not None and not self._influences.rigid
        blends = self._shapes is not None and self._shapes.moves_points
        if not skins and not blends:
            return None
        shutter = self._shutter
        moving = self._rest.ValueMightBeTimeVarying()
        times = set(self._pose.weight_times(shutter)) if blends else set()
        if skins:
            times |= self._joint_times()
        if moving:
            times |= set(shutter.keys(self._rest.GetTimeSamples()))
        rest = _vectors(self._rest.Get(shutter.time))

        def evaluate(time):
            code = shutter.code(time)
            at_rest = _vectors(self._rest.Get(code)) if moving else rest
            if at_rest is None or len(at_rest) != self._count:
                at_rest = rest  # another number of points has no influences
            points = Vt.Vec3fArray(at_rest)
            if blends:
                self._shapes.apply(self._pose, code, points)
            return self._skin(time, points) if skins else np.array(points)

        kept, arrays = point_keys(self._times(times), evaluate)
        varies = moving or self._pose.varies or (skins and self._between.varies)
        return Points(kept, arrays, varies)

    def _joint_times(self) -> set[float]:
        shutter = self._shutter
        times = self._pose.joint_times(shutter) | self._between.times
        bind = self._query.GetGeomBindTransformAttr()
        if bind and bind.ValueMightBeTimeVarying():
            times |= set(shutter.keys(bind.GetTimeSamples()))
        return times

    def _times(self, needed: set[float]) -> list[float]:
        """The times of keys needed for sure; where one is, so are those of open and close."""
        shutter = self._shutter
        if shutter.moves and needed - {shutter.open}:
            return sorted({shutter.open, shutter.close, *needed})
        return [shutter.open]

    def _skin(self, time: float, points: Vt.Vec3fArray) -> np.ndarray:
        influences = self._influences
        UsdSkel.SkinPoints(
            self._method,
            self._bind_transform(time),
            influences.transforms(self._pose, self._shutter.code(time)),
            influences.joints,
            influences.weights,
            influences.per_point,
            points,
            False,
        )
        return _transformed(np.array(points), self._between.at(time))

    # Normals -------------------------------------------------------------------------------------

    def turn_normals(self, primvars: dict[str, Primvar], shape) -> None:
        """Blends and skins the normals among the primvars, at the frame.

        Normals that belong to no point are left out: the surface has its own.
        """
        self._prepare()
        topology = getattr(shape, "topology", None)
        if getattr(topology, "scheme", "none") != "none":
            return  # a smooth surface does not use them
        corners = getattr(topology, "face_vertex_indices", None)
        skins = self._influences is not None and not self._influences.rigid
        blends = self._shapes is not None and self._shapes.turns_normals
        normals = primvars.get("normals")
        if normals is None or not (skins or blends):
            return
        sample = normals.at_frame()
        values, indices = sample.values.astype(np.float32), sample.indices
        if indices is not None:
            if len(indices) == 0 or indices.min() < 0 or indices.max() >= len(values):
                return  # the renderer warns
            values = values[indices]
        per_point = normals.interpolation in ("vertex", "varying") and len(values) == self._count
        per_corner = normals.interpolation == "faceVarying" and corners is not None
        per_corner = per_corner and len(values) == len(corners)
        per_corner = per_corner and corners.min() >= 0 and corners.max() < self._count
        turned = Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(values))
        if blends and per_point:
            self._shapes.apply_to_normals(self._pose, self._shutter.time, turned)
        if skins:
            if not per_point and not per_corner:
                del primvars["normals"]
                text = f"{normals.interpolation} normals are not skinned; they are not used"
                self._log.warn(self._prim.GetPath(), CODE, text)
                return
            turned = self._skin_normals(turned, None if per_point else corners)
        turned = np.array(turned)
        length = np.linalg.norm(turned, axis=1, keepdims=True)
        turned = turned / np.where(length > 0.0, length, 1.0)
        varies = normals.varies or self._pose.varies or (skins and self._between.varies)
        sample = Sample(0.0, turned.astype(np.float32), None)
        primvars["normals"] = Primvar(normals.interpolation, [sample], bool(varies))

    def _skin_normals(self, normals: Vt.Vec3fArray, corners: np.ndarray | None) -> np.ndarray:
        influences = self._influences
        if corners is not None:
            influences = influences.expanded(corners)
        frame = 0.0
        joints = np.array(influences.transforms(self._pose, self._shutter.time))
        UsdSkel.SkinNormals(
            self._method,
            _matrix3(_for_normals(np.array(self._bind_transform(frame)))),
            Vt.Matrix3dArray.FromNumpy(np.ascontiguousarray(_for_normals(joints))),
            influences.joints,
            influences.weights,
            influences.per_point,
            normals,
            False,
        )
        return np.array(normals, dtype=np.float64) @ _for_normals(self._between.at(frame))


def _vectors(points) -> Vt.Vec3fArray | None:
    """Points of any precision."""
    if points is None or isinstance(points, Vt.Vec3fArray):
        return points
    return Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(points, dtype=np.float32))


def _transformed(points: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    if (matrix == _IDENTITY).all():
        return points
    return (points @ matrix[:3, :3] + matrix[3, :3]).astype(np.float32)


def _for_normals(matrices: np.ndarray) -> np.ndarray:
    """Inverse transposes of the linear parts, (..., 3, 3)."""
    return np.swapaxes(np.linalg.pinv(matrices[..., :3, :3]), -1, -2)


def _matrix3(values: np.ndarray) -> Gf.Matrix3d:
    return Gf.Matrix3d(*(float(value) for value in values.ravel()))
