"""What binds a prim to a skeleton, checked: joint influences, bind transform, blend shapes.

UsdSkel would refuse the whole prim where one number is wrong, in words that do not say which prim.
Here the wrong number is left out, and one warning names the prim.
"""

from dataclasses import dataclass

import numpy as np
from pxr import Gf, Usd, UsdGeom, UsdSkel, Vt

from .guard import mistyped
from .log import SceneLog
from .skel_pose import CODE, Pose, some

BINDING = (
    "primvars:skel:jointIndices",
    "primvars:skel:jointWeights",
    "primvars:skel:geomBindTransform",
    "primvars:skel:skinningMethod",
    "skel:joints",
    "skel:blendShapes",
)
"""Attributes that bind a prim, for guard.mistyped."""

METHODS = (UsdSkel.Tokens.classicLinear, UsdSkel.Tokens.dualQuaternion)


@dataclass
class Influences:
    """Joints and weights of each point, or of the whole prim."""

    joints: Vt.IntArray
    weights: Vt.FloatArray
    per_point: int
    rigid: bool
    """Whether they are those of the whole prim, and it moves as one."""
    mapper: UsdSkel.AnimMapper | None
    """From the skeleton's order of joints into the prim's."""
    has_rest: bool
    """Whether there is one more joint, the last, which never moves: for points without any."""

    def transforms(self, pose: Pose, time: Usd.TimeCode) -> Vt.Matrix4dArray:
        """Skinning transforms of the joints that `joints` counts."""
        found = pose.transforms(time)
        if self.mapper:
            found = self.mapper.RemapTransforms(found, Vt.Matrix4dArray())
        return Vt.Matrix4dArray([*found, Gf.Matrix4d(1.0)]) if self.has_rest else found

    def expanded(self, points: np.ndarray) -> "Influences":
        """Influences of a list of points, by number."""
        joints = np.array(self.joints).reshape(-1, self.per_point)[points]
        weights = np.array(self.weights).reshape(-1, self.per_point)[points]
        return Influences(
            Vt.IntArray.FromNumpy(np.ascontiguousarray(joints).ravel()),
            Vt.FloatArray.FromNumpy(np.ascontiguousarray(weights).ravel()),
            self.per_point,
            False,
            self.mapper,
            self.has_rest,
        )


def has_influences(query: UsdSkel.SkinningQuery) -> bool:
    """Whether there are joint indices or weights at all, right or wrong."""
    return bool(query.GetJointIndicesPrimvar() or query.GetJointWeightsPrimvar())


def read_influences(
    query: UsdSkel.SkinningQuery, pose: Pose, count: int, time: Usd.TimeCode, log: SceneLog
) -> Influences | None:
    """Influences on a prim of `count` points; None, with a warning, where they are of no use."""
    path = query.GetPrim().GetPath()
    keep = "the rest shape is rendered"

    def refuse(text: str) -> None:
        log.warn(path, CODE, f"{text}; {keep}")

    indices, weights = query.GetJointIndicesPrimvar(), query.GetJointWeightsPrimvar()
    if not indices or not weights:
        return refuse("it has " + ("jointIndices only" if indices else "jointWeights only"))
    size, interpolation = indices.GetElementSize(), indices.GetInterpolation()
    if size != weights.GetElementSize() or size < 1:
        sizes = f"{size} and {weights.GetElementSize()}"
        return refuse(f"jointIndices and jointWeights have the element sizes {sizes}")
    if interpolation != weights.GetInterpolation() or interpolation not in (
        UsdGeom.Tokens.constant,
        UsdGeom.Tokens.vertex,
    ):
        both = f"{interpolation} and {weights.GetInterpolation()}"
        return refuse(f"jointIndices and jointWeights are {both}, not both constant or vertex")
    rigid = interpolation == UsdGeom.Tokens.constant
    joints = np.array(indices.ComputeFlattened(time), dtype=np.int32)
    shares = np.array(weights.ComputeFlattened(time), dtype=np.float32)
    wanted = size * (1 if rigid else count)
    if len(joints) != len(shares) or len(joints) != wanted:
        counts = f"{len(joints)} jointIndices and {len(shares)} jointWeights"
        return refuse(f"{counts}, where {wanted} are needed")
    order, mapper = query.GetJointOrder(), query.GetJointMapper()
    if mapper:
        unknown = sorted(set(order) - set(pose.joints))
        if unknown:
            text = f"skel:joints names {some(unknown)}, which its skeleton does not have"
            log.warn(path, CODE, f"{text}; they are taken as unmoved")
    number = len(order) if mapper else len(pose.joints)
    return _checked(Influences(joints, shares, size, rigid, mapper, False), number, path, log)


def _checked(found: Influences, number: int, path, log: SceneLog) -> Influences:
    """`found`, as arrays of numpy, without what points at none of `number` joints."""
    joints = found.joints.reshape(-1, found.per_point)
    weights = found.weights.reshape(-1, found.per_point)
    outside = (joints < 0) | (joints >= number)
    # An index without weight does no harm.
    wrong = (outside & (weights != 0.0)) | ~np.isfinite(weights)
    if wrong.any():
        many = f"{int(wrong.sum())} of {wrong.size} influences"
        text = f"{many} name none of {number} joints or are not finite; they are left out"
        log.warn(path, CODE, text)
        # The others take over the weight; a point without any others stays at rest.
        before = np.where(np.isfinite(weights), weights, 0.0).sum(axis=1)
        weights = np.where(wrong, 0.0, weights)
        left = weights.sum(axis=1)
        rows = wrong.any(axis=1)
        lost = rows & ~(np.abs(left) > 1e-6)
        scale = np.where(rows & ~lost, before / np.where(lost | (left == 0.0), 1.0, left), 1.0)
        weights = weights * scale[:, None]
        joints = np.where(outside, 0, joints)
        joints[lost, 0], weights[lost, 0] = number, 1.0
        found.has_rest = bool(lost.any())
    elif outside.any():
        joints = np.where(outside, 0, joints)
    if not wrong.any() and weights.size:
        off = np.abs(weights.sum(axis=1, dtype=np.float64) - 1.0) > 1e-3
        if off.any():
            text = f"jointWeights of {int(off.sum())} points do not add up to 1; they are used so"
            log.warn(path, CODE, text)
    found.joints = Vt.IntArray.FromNumpy(np.ascontiguousarray(joints, dtype=np.int32).ravel())
    found.weights = Vt.FloatArray.FromNumpy(np.ascontiguousarray(weights, dtype=np.float32).ravel())
    return found


def read_method(query: UsdSkel.SkinningQuery, log: SceneLog) -> str:
    """skel:skinningMethod."""
    method = query.GetSkinningMethod()
    if method in METHODS:
        return method
    text = f"skel:skinningMethod is {method!r}, which is none; {METHODS[0]} is used"
    log.warn(query.GetPrim().GetPath(), CODE, text)
    return METHODS[0]


def read_bind_transform(
    query: UsdSkel.SkinningQuery, time: Usd.TimeCode, log: SceneLog
) -> Gf.Matrix4d:
    """geomBindTransform; the identity where it flattens everything or is not finite."""
    matrix = query.GetGeomBindTransform(time)
    values = np.array(matrix)
    if np.isfinite(values).all() and abs(np.linalg.det(values[:3, :3])) > 0.0:
        return matrix
    text = "its geomBindTransform cannot be inverted; it is ignored"
    log.warn(query.GetPrim().GetPath(), CODE, text)
    return Gf.Matrix4d(1.0)


class BlendShapes:
    """Blend shapes of one prim of `count` points."""

    def __init__(self, query: UsdSkel.SkinningQuery, prim: Usd.Prim, count: int, log: SceneLog):
        self._query = UsdSkel.BlendShapeQuery(UsdSkel.BindingAPI(prim))
        self._order = list(query.GetBlendShapeOrder() or ())
        self._number = self._query.GetNumBlendShapes()
        self._mappers: dict[tuple, UsdSkel.AnimMapper] = {}
        self._log = log
        if len(self._order) != self._number:
            text = f"{len(self._order)} skel:blendShapes for {self._number} blendShapeTargets"
            log.warn(prim.GetPath(), CODE, f"{text}; only pairs are used")
        indices = self._query.ComputeBlendShapePointIndices()
        self._indices = [np.array(i, dtype=np.int64) for i in indices]
        self._names = [self._query.GetBlendShape(i).GetPath() for i in range(self._number)]
        for i, target in enumerate(query.GetBlendShapeTargetsRel().GetTargets()):
            if i < self._number and not self._query.GetBlendShape(i):
                log.warn(prim.GetPath(), CODE, f"its blend shape {target} does not exist")
        shapes = range(self._query.GetNumSubShapes())
        self._owner = [self._query.GetBlendShapeIndex(i) for i in shapes]
        offsets = [np.array(o, dtype=np.float32) for o in self._query.ComputeSubShapePointOffsets()]
        normals = [self._normal_offsets(i) for i in shapes]
        for i in range(self._number):
            self._drop_mistyped(i, offsets, normals)
        kept = [self._inside(i, count) for i in range(self._number)]
        self._offsets = [self._fitting(i, offsets[i], kept, count, "offsets") for i in shapes]
        self._normals = [self._fitting(i, normals[i], kept, count, "normalOffsets") for i in shapes]
        self._point_indices = [
            Vt.IntArray.FromNumpy(indices[keep].astype(np.int32))
            for indices, keep in zip(self._indices, kept, strict=True)
        ]

    @property
    def moves_points(self) -> bool:
        """Whether any shape has offsets."""
        return any(len(offsets) for offsets in self._offsets)

    @property
    def turns_normals(self) -> bool:
        """Whether any shape has normalOffsets."""
        return any(len(offsets) for offsets in self._normals)

    def apply(self, pose: Pose, time: Usd.TimeCode, points: Vt.Vec3fArray) -> None:
        """Adds the weighted offsets to `points`, in place."""
        self._add(pose, time, self._offsets, points)

    def apply_to_normals(self, pose: Pose, time: Usd.TimeCode, normals: Vt.Vec3fArray) -> None:
        """Adds the weighted normalOffsets to `normals`, in place; lengths are left as they are."""
        self._add(pose, time, self._normals, normals)

    def _add(self, pose, time, offsets, values) -> None:
        weights = pose.weights(time)
        if weights is None:
            return
        weights = list(self._mapper(pose).Remap(weights, Vt.FloatArray(len(self._order))))
        weights = (weights + [0.0] * self._number)[: self._number]
        shares, owners, shapes = self._query.ComputeSubShapeWeights(Vt.FloatArray(weights))
        # A target that does not exist has no shapes of its own.
        own = [i for i, shape in enumerate(shapes) if self._is_of(owners[i], shape)]
        self._query.ComputeDeformedPoints(
            Vt.FloatArray([shares[i] for i in own]),
            Vt.UIntArray([owners[i] for i in own]),
            Vt.UIntArray([shapes[i] for i in own]),
            self._point_indices,
            offsets,
            values,
        )

    def _is_of(self, owner: int, shape: int) -> bool:
        return shape < len(self._owner) and self._owner[shape] == owner

    def _mapper(self, pose: Pose) -> UsdSkel.AnimMapper:
        order = tuple(pose.animation.GetBlendShapeOrder())
        if order not in self._mappers:
            self._mappers[order] = UsdSkel.AnimMapper(list(order), self._order)
        return self._mappers[order]

    # Reading -------------------------------------------------------------------------------------

    def _normal_offsets(self, shape: int) -> np.ndarray:
        """normalOffsets of a shape or in-between; none for the shape of weight 0."""
        between = self._query.GetInbetween(shape)
        if between:
            found = between.GetNormalOffsets()
        elif self._is_primary(shape):
            found = self._query.GetBlendShape(self._owner[shape]).GetNormalOffsetsAttr().Get()
        else:
            found = None
        return np.array(found if found is not None else [], dtype=np.float32)

    def _is_primary(self, shape: int) -> bool:
        """Of the shapes with one owner, which ascend by weight, that of weight 1."""
        shares, _, shapes = self._query.ComputeSubShapeWeights(
            Vt.FloatArray([1.0 if i == self._owner[shape] else 0.0 for i in range(self._number)])
        )
        return any(i == shape and share == 1.0 for share, i in zip(shares, shapes, strict=True))

    def _drop_mistyped(self, number: int, offsets: list, normals: list) -> None:
        shape = self._query.GetBlendShape(number)
        wrong = mistyped(shape.GetPrim(), ("offsets", "normalOffsets")) if shape else None
        indices = shape.GetPointIndicesAttr().Get() if shape else None
        if indices is not None and not isinstance(indices, Vt.IntArray | Vt.UIntArray):
            wrong = mistyped(shape.GetPrim(), ("pointIndices",))
        if wrong:
            self._log.warn(self._names[number], "type", f"{wrong}; the shape is not used")
            for i, owner in enumerate(self._owner):
                if owner == number:
                    offsets[i] = normals[i] = np.zeros((0, 3), dtype=np.float32)

    def _inside(self, number: int, count: int) -> np.ndarray:
        """Which pointIndices of a shape are those of points."""
        indices = self._indices[number]
        inside = (indices >= 0) & (indices < count)
        if not inside.all():
            many = f"{int((~inside).sum())} of {len(indices)} pointIndices"
            text = f"{many} are none of {count} points; they are left out"
            self._log.warn(self._names[number], CODE, text)
        return inside

    def _fitting(self, shape, offsets, kept, count, name) -> Vt.Vec3fArray:
        """Offsets of the points that are there; none where their number is wrong."""
        owner = self._owner[shape]
        wanted = len(self._indices[owner]) or count
        offsets = offsets.reshape(-1, 3)
        if len(offsets) and len(offsets) != wanted:
            text = f"{len(offsets)} {name} for {wanted} points; they are ignored"
            self._log.warn(self._names[owner], CODE, text)
            offsets = offsets[:0]
        wrong = ~np.isfinite(offsets).all(axis=1)
        if wrong.any():
            text = f"{int(wrong.sum())} {name} are not finite; they are ignored"
            self._log.warn(self._names[owner], CODE, text)
            offsets = np.where(wrong[:, None], np.float32(0.0), offsets)
        if len(offsets) and len(self._indices[owner]):
            offsets = offsets[kept[owner]]  # with no index left, there are no offsets either
        return Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(offsets))
