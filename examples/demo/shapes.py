"""Control meshes of the demo: lathes, curled sheets, creased boxes, height fields.

A Shape is plain numpy data; `write_mesh` turns it into a Catmull-Clark UsdGeomMesh. Lengths are
scene units (centimetres), y is up, colours are linear.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, Vt


@dataclass
class Shape:
    """Points, faces, creases and vertex colours of one control mesh."""

    points: np.ndarray
    faces: list[list[int]]
    colors: np.ndarray
    creases: list[tuple[list[int], float]] = field(default_factory=list)

    def joined(self, other: Shape) -> Shape:
        """Both shapes in one mesh."""
        first = len(self.points)
        return Shape(
            np.vstack([self.points, other.points]),
            self.faces + [[i + first for i in face] for face in other.faces],
            np.vstack([self.colors, other.colors]),
            self.creases + [([i + first for i in line], s) for line, s in other.creases],
        )

    def moved(self, matrix: np.ndarray, offset=(0.0, 0.0, 0.0)) -> Shape:
        """The shape with points matrix @ p + offset."""
        points = self.points @ np.asarray(matrix).T + np.asarray(offset)
        return Shape(points, self.faces, self.colors, self.creases)


def mix(a, b, f):
    """Linear blend of two colours; f may be an array."""
    f = np.asarray(f, dtype=float)[..., None]
    return np.asarray(a) * (1.0 - f) + np.asarray(b) * f


def grid_faces(rows: int, columns: int, wrap: bool = False, first: int = 0) -> list[list[int]]:
    """Quads over a row-major lattice; `wrap` closes each row into a ring."""
    faces = []
    for r in range(rows - 1):
        for c in range(columns if wrap else columns - 1):
            d = (c + 1) % columns
            a, b = first + r * columns, first + (r + 1) * columns
            faces.append([a + c, a + d, b + d, b + c])
    return faces


def lathe(profile, colors, sides: int = 8, creases: dict[int, float] | None = None) -> Shape:
    """A profile of (radius, height) turned about y, closed at both ends by a polygon.

    `creases` gives rings of the profile a sharpness.
    """
    angles = 2.0 * np.pi * np.arange(sides) / sides
    points, vertex_colors = [], []
    for (radius, height), color in zip(profile, colors, strict=True):
        for a in angles:
            points.append((radius * np.cos(a), height, -radius * np.sin(a)))
            vertex_colors.append(color)
    rows = len(profile)
    faces = grid_faces(rows, sides, wrap=True)
    faces.append(list(reversed(range(sides))))
    faces.append([(rows - 1) * sides + i for i in range(sides)])
    rings = [
        ([ring * sides + i for i in [*range(sides), 0]], sharpness)
        for ring, sharpness in sorted((creases or {}).items())
    ]
    return Shape(np.array(points), faces, np.array(vertex_colors), rings)


def shell(front: np.ndarray, thickness: float, colors: np.ndarray, sharpness: float) -> Shape:
    """A closed sheet: the lattice `front` (rows, columns, 3) and its copy pushed backwards, with a
    creased rim. `colors` is (rows, columns, 3)."""
    rows, columns, _ = front.shape
    du = np.gradient(front, axis=1)
    dv = np.gradient(front, axis=0)
    normal = np.cross(du, dv)
    normal /= np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1.0e-9)
    back = front - thickness * normal
    n = rows * columns
    points = np.vstack([front.reshape(n, 3), back.reshape(n, 3)])
    faces = grid_faces(rows, columns)
    faces += [[i + n for i in reversed(face)] for face in grid_faces(rows, columns)]
    rim = list(range(columns))
    rim += [r * columns + columns - 1 for r in range(1, rows)]
    rim += [(rows - 1) * columns + c for c in reversed(range(columns - 1))]
    rim += [r * columns for r in reversed(range(1, rows - 1))]
    for a, b in zip(rim, rim[1:] + rim[:1], strict=True):
        faces.append([b, a, a + n, b + n])
    loop = [*rim, rim[0]]
    creases = [(loop, sharpness), ([i + n for i in loop], sharpness)]
    flat = colors.reshape(n, 3)
    return Shape(points, faces, np.vstack([flat, flat]), creases)


def box(size, colors, sharpness: float) -> Shape:
    """A box with all twelve edges creased; one colour a corner, in the order of x, y, z bits."""
    half = np.asarray(size) / 2.0
    corners = [[1 if i >> k & 1 else -1 for k in range(3)] for i in range(8)]
    faces = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]]
    creases = []
    for a in range(8):
        for bit in (1, 2, 4):
            if not a & bit:
                creases.append(([a, a | bit], sharpness))
    return Shape(np.array(corners) * half, faces, np.asarray(colors, dtype=float), creases)


def rounded(values: np.ndarray, digits: int) -> np.ndarray:
    """Few digits, so that the text stays small, and no negative zeros."""
    return np.round(values, digits).astype(np.float32) + np.float32(0.0)


def vec3f(values: np.ndarray, digits: int) -> Vt.Vec3fArray:
    """Rounded values as USD's array."""
    return Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(rounded(values, digits)))


def write_mesh(stage: Usd.Stage, path: str, shape: Shape, scheme: str = "catmullClark"):
    """Defines a UsdGeomMesh."""
    mesh = UsdGeom.Mesh.Define(stage, path)
    mesh.CreateSubdivisionSchemeAttr(scheme)
    mesh.CreatePointsAttr(vec3f(shape.points, 2))
    mesh.CreateFaceVertexCountsAttr([len(face) for face in shape.faces])
    mesh.CreateFaceVertexIndicesAttr([i for face in shape.faces for i in face])
    if shape.creases:
        mesh.CreateCreaseLengthsAttr([len(line) for line, _ in shape.creases])
        mesh.CreateCreaseIndicesAttr([i for line, _ in shape.creases for i in line])
        mesh.CreateCreaseSharpnessesAttr([sharpness for _, sharpness in shape.creases])
    low = rounded(shape.points.min(axis=0), 2)
    high = rounded(shape.points.max(axis=0), 2)
    mesh.CreateExtentAttr([Gf.Vec3f(*low.tolist()), Gf.Vec3f(*high.tolist())])
    write_colors(mesh, shape.colors)
    return mesh


def write_colors(gprim, colors: np.ndarray) -> None:
    """displayColor: constant for one colour, else one a vertex. Dark ones keep a digit more."""
    constant = len(colors) == 1
    token = UsdGeom.Tokens.constant if constant else UsdGeom.Tokens.vertex
    primvar = UsdGeom.PrimvarsAPI(gprim).CreatePrimvar(
        "displayColor", Sdf.ValueTypeNames.Color3fArray, interpolation=token
    )
    primvar.Set(vec3f(np.asarray(colors), 3 if np.median(colors) < 0.1 else 2))
