"""A skeleton in time: skinning transforms and blend shape weights, as UsdSkel computes them.

UsdSkel does the mathematics. Here its results are cached for a frame, and what it could not compute
or what is not finite is replaced by the rest pose, with one warning that names the prim.
"""

import numpy as np
from pxr import Usd, UsdSkel, Vt

from .guard import mistyped
from .log import SceneLog
from .shutter import Shutter

CODE = "skinning"
"""Code of every warning about skinning."""

_PARTS = ("translations", "rotations", "scales")
_SKELETON = ("joints", "bindTransforms", "restTransforms")
_ANIMATION = ("joints", *_PARTS, "blendShapes", "blendShapeWeights")


class Pose:
    """One Skeleton prim (`prim` may be in an instance) with the animation bound to it."""

    def __init__(self, prim: Usd.Prim, query: UsdSkel.SkeletonQuery, log: SceneLog):
        self.prim = prim
        self._query = query
        self._log = log
        self._at_rest = False
        self.animation = query.GetAnimQuery() if query else None
        if self.animation and self._has_mistyped(self.animation.GetPrim(), _ANIMATION):
            self.animation = None
            self._at_rest = True
        self.joints = list(query.GetJointOrder() or ()) if query else []
        self._singular = np.zeros(len(self.joints), dtype=bool)
        self.can_skin = (
            not self._has_mistyped(prim, _SKELETON)
            and self._check_joints()
            and self._check_binding()
            and self._check_rest()
        )
        """Whether there are skinning transforms."""
        self.is_empty = bool(query) and not self.joints and not mistyped(prim, ("joints",))
        """Whether it has no joints, which is no fault where there are blend shapes only."""
        self.begin_frame()

    @property
    def varies(self) -> bool:
        """Whether joints or weights may differ at another frame."""
        query = self.animation
        return bool(query) and (
            query.JointTransformsMightBeTimeVarying() or query.BlendShapeWeightsMightBeTimeVarying()
        )

    def begin_frame(self) -> None:
        """Forgets what was computed for the last frame."""
        self._transforms: dict[Usd.TimeCode, Vt.Matrix4dArray] = {}
        self._weights: dict[Usd.TimeCode, Vt.FloatArray | None] = {}

    def joint_times(self, shutter: Shutter) -> set[float]:
        """Relative times at which the joints need keys for sure."""
        times = self.animation.GetJointTransformTimeSamples() if self.animation else []
        return set(shutter.keys(list(times)))

    def weight_times(self, shutter: Shutter) -> set[float]:
        """Relative times at which the weights of blend shapes need keys for sure."""
        times = self.animation.GetBlendShapeWeightTimeSamples() if self.animation else []
        return set(shutter.keys(list(times)))

    def transforms(self, time: Usd.TimeCode) -> Vt.Matrix4dArray:
        """Matrices that take each joint's points from the bind pose to the pose at `time`."""
        if time not in self._transforms:
            self._transforms[time] = self._compute(time)
        return self._transforms[time]

    def weights(self, time: Usd.TimeCode) -> Vt.FloatArray | None:
        """Weights of the animation's blend shapes, in its order; None where it has none."""
        if time not in self._weights:
            self._weights[time] = self._compute_weights(time)
        return self._weights[time]

    # What may be wrong ---------------------------------------------------------------------------

    def _warn(self, text: str, prim: Usd.Prim | None = None) -> bool:
        self._log.warn((prim or self.prim).GetPath(), CODE, text)
        return False

    def _has_mistyped(self, prim: Usd.Prim, names: tuple) -> bool:
        wrong = mistyped(prim, names)
        if wrong:
            what = "it keeps its rest shape" if prim == self.prim else "the rest pose is used"
            self._log.warn(prim.GetPath(), "type", f"{wrong}; {what}")
        return wrong is not None

    def _check_joints(self) -> bool:
        keep = "what it skins keeps its rest shape"
        if not self._query:
            joints = UsdSkel.Skeleton(self.prim).GetJointsAttr().Get() or []
            valid, reason = UsdSkel.Topology(joints).Validate()
            reason = reason.rstrip(".") if not valid else "UsdSkel cannot read it"
            return self._warn(f"{reason}; {keep}")
        bind = self._query.GetJointWorldBindTransforms() or []
        if len(bind) != len(self.joints):
            authored = UsdSkel.Skeleton(self.prim).GetBindTransformsAttr().Get() or []
            count = f"{len(authored)} bindTransforms for {len(self.joints)} joints"
            return self._warn(f"{count}; {keep}")
        matrices = np.array(bind, dtype=np.float64).reshape(-1, 4, 4)
        with np.errstate(all="ignore"):
            self._singular = ~(np.abs(np.linalg.det(matrices[:, :3, :3])) > 0.0)
        self._singular |= ~np.isfinite(matrices).all(axis=(1, 2))
        if self._singular.any():
            names = some([self.joints[i] for i in np.flatnonzero(self._singular)])
            self._warn(f"bindTransforms of {names} cannot be inverted; they are taken as unmoved")
        return len(self.joints) > 0

    def _check_binding(self) -> bool:
        """Looks at the animation; skinning goes on without it."""
        if not self.animation:
            if self._at_rest:
                return True  # it has been warned about
            target = _animation_target(self.prim)
            if target:
                self._warn(f"skel:animationSource names {target}, which is no SkelAnimation")
            return True
        joints = list(self.animation.GetJointOrder() or ())
        prim = self.animation.GetPrim()
        if not joints:
            if any(prim.GetAttribute(name).HasAuthoredValue() for name in _PARTS):
                self._warn("it has no joints; the rest pose is used", prim)
        elif not set(joints) & set(self.joints):
            text = f"none of its joints ({some(joints)}) is one of {self.prim.GetPath()}"
            self._warn(f"{text}; the rest pose is used", prim)
        return True

    def _check_rest(self) -> bool:
        mapper = self._query.GetMapper() if self.animation else None
        if mapper and not mapper.IsNull() and not mapper.IsSparse():
            return True
        if self._query.HasRestPose():
            return True
        count = len(UsdSkel.Skeleton(self.prim).GetRestTransformsAttr().Get() or [])
        lacks = "no animation" if not mapper or mapper.IsNull() else "not all joints animated"
        text = f"{lacks}, and {count} restTransforms for {len(self.joints)} joints"
        return self._warn(f"{text}; what it skins keeps its rest shape")

    # The pose ------------------------------------------------------------------------------------

    def _compute(self, time: Usd.TimeCode) -> Vt.Matrix4dArray:
        if not self._transforms:
            self._parts_are_wrong = not self._parts_fit(time)
        if self._at_rest or self._parts_are_wrong:
            return self._mended(None)
        found = self._query.ComputeSkinningTransforms(time)
        matrices = np.array(found).reshape(-1, 4, 4)
        if len(matrices) != len(self.joints) or not np.isfinite(matrices).all():
            return self._mended(time)
        return self._with_identity(matrices, self._singular) if self._singular.any() else found

    def _parts_fit(self, time: Usd.TimeCode) -> bool:
        """Whether the animation has one translation, rotation and scale for each of its joints."""
        mapper = self._query.GetMapper() if self.animation else None
        if not mapper or mapper.IsNull():
            return True
        count = len(self.animation.GetJointOrder())
        prim = self.animation.GetPrim()
        sizes = {name: len(prim.GetAttribute(name).Get(time) or ()) for name in _PARTS}
        if all(size == count for size in sizes.values()):
            return True
        parts = ", ".join(f"{size} {name}" for name, size in sizes.items())
        self._warn(f"{parts} for {count} joints; the rest pose is used", prim)
        return False

    def _mended(self, time: Usd.TimeCode | None) -> Vt.Matrix4dArray:
        """The pose with the rest pose of joints that are not finite (of all: None)."""
        query, count = self._query, len(self.joints)
        rest = np.array(query.ComputeJointLocalTransforms(Usd.TimeCode.Default(), True))
        rest = rest.reshape(-1, 4, 4)
        local = rest
        if time is not None:
            local = np.array(query.ComputeJointLocalTransforms(time)).reshape(-1, 4, 4)
            wrong = ~np.isfinite(local).all(axis=(1, 2))
            if wrong.any():
                names = some([self.joints[i] for i in np.flatnonzero(wrong)])
                text = f"the transform of {names} is not finite; its rest transform is used"
                self._warn(text, self.animation.GetPrim() if self.animation else None)
                if len(rest) == len(local):
                    local = np.where(wrong[:, None, None], rest, local)
        if len(local) != count:
            return self._with_identity(np.zeros((count, 4, 4)), np.ones(count, dtype=bool))
        posed = Vt.Matrix4dArray(count)
        UsdSkel.ConcatJointTransforms(query.GetTopology(), Vt.Matrix4dArray.FromNumpy(local), posed)
        bind = query.GetJointWorldBindTransforms()
        found = [bind[i].GetInverse() * posed[i] for i in range(count)]
        matrices = np.array(found).reshape(-1, 4, 4)
        wrong = self._singular | ~np.isfinite(matrices).all(axis=(1, 2))
        return self._with_identity(matrices, wrong)

    @staticmethod
    def _with_identity(matrices: np.ndarray, where: np.ndarray) -> Vt.Matrix4dArray:
        mended = np.where(where[:, None, None], np.eye(4), matrices)
        return Vt.Matrix4dArray.FromNumpy(np.ascontiguousarray(mended))

    def _compute_weights(self, time: Usd.TimeCode) -> Vt.FloatArray | None:
        names = list(self.animation.GetBlendShapeOrder() or ()) if self.animation else []
        if not names:
            return None
        weights = np.array(self.animation.ComputeBlendShapeWeights(time), dtype=np.float32)
        prim = self.animation.GetPrim()
        if len(weights) != len(names):
            count = f"{len(weights)} blendShapeWeights for {len(names)} blendShapes"
            self._warn(f"{count}; no blend shape is used", prim)
            return None
        wrong = ~np.isfinite(weights)
        if wrong.any():
            text = f"weights of {some([names[i] for i in np.flatnonzero(wrong)])} are not finite"
            self._warn(f"{text}; 0 is used", prim)
            weights[wrong] = 0.0
        return Vt.FloatArray.FromNumpy(weights)


def some(names: list) -> str:
    """The first few names."""
    shown = ", ".join(str(name) for name in names[:3])
    return f"{shown} and {len(names) - 3} more" if len(names) > 3 else shown


def _animation_target(prim: Usd.Prim):
    """What the nearest skel:animationSource names, at `prim` or above."""
    while prim and not prim.IsPseudoRoot():
        if prim.HasAPI(UsdSkel.BindingAPI):
            targets = UsdSkel.BindingAPI(prim).GetAnimationSourceRel().GetForwardedTargets()
            if targets or UsdSkel.BindingAPI(prim).GetAnimationSourceRel().HasAuthoredTargets():
                return targets[0] if targets else None
        prim = prim.GetParent()
    return None
