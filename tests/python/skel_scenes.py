"""Small stages with skeletons: an arm of two bones along x, and what it takes to bind prims to it.

The upper bone goes from the origin to x = 2, the lower one from there to x = 4. Each joint turns
about z.
"""

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdSkel, Vt

JOINTS = ("upper", "upper/lower")
LENGTH = 2.0


def turn(degrees):
    """A rotation about z."""
    return Gf.Quatf(Gf.Rotation(Gf.Vec3d(0, 0, 1), degrees).GetQuat())


def shifted(*by):
    """A matrix that translates."""
    return Gf.Matrix4d().SetTranslate(Gf.Vec3d(*by))


def add_skeleton(stage, path, joints=JOINTS, rest=True):
    """A Skeleton in its bind pose."""
    skeleton = UsdSkel.Skeleton.Define(stage, path)
    skeleton.CreateJointsAttr(list(joints))
    steps = [LENGTH if "/" in joint else 0.0 for joint in joints]
    bind = [shifted(LENGTH * joint.count("/"), 0, 0) for joint in joints]
    skeleton.CreateBindTransformsAttr(Vt.Matrix4dArray(bind))
    if rest:
        matrices = [shifted(step, 0, 0) for step in steps]
        skeleton.CreateRestTransformsAttr(Vt.Matrix4dArray(matrices))
    return skeleton


def add_animation(stage, path, angles, joints=JOINTS):
    """A SkelAnimation that turns the joints; angles as {time: (upper, lower)}, None: default."""
    animation = UsdSkel.Animation.Define(stage, path)
    animation.CreateJointsAttr(list(joints))
    steps = [Gf.Vec3f(LENGTH if "/" in joint else 0.0, 0, 0) for joint in joints]
    animation.CreateTranslationsAttr(Vt.Vec3fArray(steps))
    animation.CreateScalesAttr(Vt.Vec3hArray([Gf.Vec3h(1, 1, 1)] * len(joints)))
    rotations = animation.CreateRotationsAttr()
    for time, degrees in angles.items():
        value = Vt.QuatfArray([turn(angle) for angle in degrees])
        rotations.Set(value, Usd.TimeCode.Default() if time is None else time)
    return animation


def bind(prim, joints, weights, per_point, skeleton=None, interpolation="vertex", **attributes):
    """Applies SkelBindingAPI with joint influences; attributes: geom_bind, joint_names, method."""
    api = UsdSkel.BindingAPI.Apply(prim.GetPrim())
    constant = interpolation == "constant"
    api.CreateJointIndicesPrimvar(constant, per_point).Set(Vt.IntArray([int(j) for j in joints]))
    api.CreateJointWeightsPrimvar(constant, per_point).Set(
        Vt.FloatArray([float(w) for w in weights])
    )
    if skeleton:
        api.CreateSkeletonRel().SetTargets([Sdf.Path(skeleton)])
    if "geom_bind" in attributes:
        api.CreateGeomBindTransformAttr(attributes["geom_bind"])
    if "joint_names" in attributes:
        api.CreateJointsAttr(attributes["joint_names"])
    if "method" in attributes:
        api.CreateSkinningMethodAttr(attributes["method"])
    return api


def animate(prim, animation):
    """Gives everything below `prim` an animation."""
    api = UsdSkel.BindingAPI.Apply(prim.GetPrim())
    api.CreateAnimationSourceRel().SetTargets([Sdf.Path(animation)])


def strip(steps=8, half=0.25):
    """Points, counts and indices of a strip along the arm, two points for each step of x."""
    x = np.linspace(0.0, 2 * LENGTH, steps + 1)
    points = np.array([(v, y, 0.0) for v in x for y in (-half, half)])
    faces = [(2 * i, 2 * i + 2, 2 * i + 3, 2 * i + 1) for i in range(steps)]
    return points, [4] * steps, [index for face in faces for index in face]


def strip_weights(points, blend=0.5):
    """Two joints a point; weights change from upper to lower over +-blend about the elbow."""
    share = np.clip((points[:, 0] - LENGTH) / (2 * blend) + 0.5, 0.0, 1.0)
    joints = [j for _ in points for j in (0, 1)]
    return joints, np.stack([1 - share, share], axis=1).ravel()


def add_mesh(stage, path, points, counts, indices, scheme="none"):
    """A mesh of numpy points."""
    mesh = UsdGeom.Mesh.Define(stage, path)
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(np.asarray(points, dtype=np.float32)))
    mesh.CreateFaceVertexCountsAttr(counts)
    mesh.CreateFaceVertexIndicesAttr(indices)
    mesh.CreateSubdivisionSchemeAttr(scheme)
    return mesh


def add_arm(stage, path="/arm", angles=None, steps=8, half=0.25, **binding):
    """A SkelRoot with skeleton, animation and a strip bound to them; gives the mesh."""
    root = UsdSkel.Root.Define(stage, path)
    skeleton = add_skeleton(stage, f"{path}/skeleton")
    if angles is not None:
        add_animation(stage, f"{path}/animation", angles)
        animate(root, f"{path}/animation")
    points, counts, indices = strip(steps, half)
    mesh = add_mesh(stage, f"{path}/strip", points, counts, indices)
    joints, weights = strip_weights(points)
    bind(mesh, joints, weights, 2, skeleton.GetPath(), **binding)
    return mesh


def add_blend_shape(stage, path, offsets, indices=None, normals=None):
    """A BlendShape."""
    shape = UsdSkel.BlendShape.Define(stage, path)
    shape.CreateOffsetsAttr(Vt.Vec3fArray([Gf.Vec3f(*map(float, o)) for o in offsets]))
    if indices is not None:
        shape.CreatePointIndicesAttr(Vt.IntArray([int(i) for i in indices]))
    if normals is not None:
        shape.CreateNormalOffsetsAttr(Vt.Vec3fArray([Gf.Vec3f(*map(float, n)) for n in normals]))
    return shape


def use_blend_shapes(mesh, names, targets):
    """Binds blend shapes to a mesh, each by its name in the animation."""
    api = UsdSkel.BindingAPI.Apply(mesh.GetPrim())
    api.CreateBlendShapesAttr(Vt.TokenArray(list(names)))
    api.CreateBlendShapeTargetsRel().SetTargets([Sdf.Path(target) for target in targets])


def weigh(animation, names, weights):
    """Gives an animation blend shape weights, as {time: weights}."""
    animation.CreateBlendShapesAttr(Vt.TokenArray(list(names)))
    attribute = animation.CreateBlendShapeWeightsAttr()
    for time, values in weights.items():
        value = Vt.FloatArray([float(v) for v in values])
        attribute.Set(value, Usd.TimeCode.Default() if time is None else time)
