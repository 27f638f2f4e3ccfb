"""Writes the demo scene: paper windmills at dusk, one of them still.

    .venv/bin/python examples/demo/make_demo.py [OUTPUT.usda]

One windmill rests in focus; the wind turns all others, carries a ribbon and tumbling petals
across the shutter; lamps far behind and dew close to the lens fall out of focus. What it exercises:
Catmull-Clark surfaces with creases, nested moving transforms (stand, head, spin), native instances,
point instances with moving positions and orientations, points that deform, vertex colours, and
UsdGeomCamera's lens, shutter and exposure.

The light is the renderer's camera light, so that shading shows which way a surface faces; depth and
glow are painted into displayColor. Lengths are centimetres, y is up, the frame is 1.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdRender, Vt
from shapes import (
    Shape,
    box,
    grid_faces,
    lathe,
    mix,
    rounded,
    shell,
    vec3f,
    write_colors,
    write_mesh,
)

FRAME = 1.0
SHUTTER = (-0.25, 0.25)
KEYS = [FRAME - 0.25, FRAME, FRAME + 0.25]

CORAL, SAFFRON, CREAM = (1.0, 0.16, 0.1), (1.0, 0.55, 0.06), (1.0, 0.86, 0.62)
TEAL, SKY, PLUM, ROSE = (0.02, 0.42, 0.45), (0.2, 0.72, 0.95), (0.34, 0.05, 0.42), (1.0, 0.24, 0.44)
WOOD_DARK, WOOD_LIGHT = (0.12, 0.05, 0.03), (0.5, 0.27, 0.14)

CAMERA_EYE = np.array([0.0, 16.0, 112.0])
CAMERA_PITCH = -1.2
HERO = np.array([7.5, 0.0, 0.0])
HERO_HUB = 17.5


def vane(radius: float, width: float, curl: float, deep, bright, inner, rows=6, columns=5) -> Shape:
    """One paper vane along +x that curls towards +z: `deep` at the hub, `bright` at the tip,
    `inner` on the edge that folds over."""
    r = np.linspace(0.06, 1.0, rows)[:, None]
    w = np.linspace(0.0, 1.0, columns)[None, :]
    breadth = width * np.sin(np.pi * np.clip(r, 0.0, 1.0) ** 0.85) ** 0.7 + 0.12 * width
    arc = breadth / curl
    phi = w * curl
    x = radius * r * (1.0 - 0.3 * w**2 * r)
    y = arc * np.sin(phi)
    z = arc * (1.0 - np.cos(phi)) + 0.0 * x
    front = np.stack(np.broadcast_arrays(x, y, z), axis=-1)
    colors = mix(deep, bright, np.broadcast_to(r**0.8, x.shape) * (1.0 - 0.25 * w))
    colors = colors * (1.0 - w[..., None]) ** 0.5 + np.asarray(inner) * (
        1.0 - (1.0 - w[..., None]) ** 0.5
    )
    return shell(front, 0.12, colors, 3.0)


def ring(count: int, palettes, radius: float, width: float, curl: float, **lattice) -> Shape:
    """Vanes around the origin, in the xy plane; they face +z."""
    parts = []
    for k in range(count):
        a = 2.0 * np.pi * k / count
        turn = np.array([[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, 1]])
        parts.append(vane(radius, width, curl, *palettes[k % len(palettes)], **lattice).moved(turn))
    shape = parts[0]
    for part in parts[1:]:
        shape = shape.joined(part)
    return shape


def wheel(count: int, palettes, radius=8.0, width=4.6, curl=2.6, hub=0.9) -> Shape:
    """A whole windmill head that faces +z, with a button in the middle."""
    shape = ring(count, palettes, radius, width, curl)
    profile = [(0.35, -0.9), (1.0, -0.5), (1.15, 0.5), (0.8, 1.15), (0.3, 1.35)]
    button = lathe(profile, [WOOD_DARK, WOOD_DARK, CREAM, CREAM, SAFFRON], 8, {2: 2.0, 4: 1.5})
    lie = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])
    return shape.joined(button.moved(lie, (0, 0, hub)))


def stick() -> Shape:
    """A turned stand of unit height with creased beads."""
    profile = [(2.2, 0.0), (2.2, 0.6), (0.75, 1.2), (0.5, 2.2), (0.85, 3.0), (0.4, 3.8)]
    profile += [(0.34, 9.0), (0.3, 16.0), (0.62, 16.6), (0.62, 17.4), (0.3, 18.2)]
    colors = [mix(WOOD_DARK, WOOD_LIGHT, np.clip(h / 17.0, 0, 1)) for _, h in profile]
    for i in (4, 8, 9):
        colors[i] = np.array(SAFFRON) * 0.8
    return lathe(profile, colors, 8, {0: 4.0, 1: 3.0, 4: 2.0, 8: 2.5, 9: 2.5})


def add_windmill(stage, path, position, heading, tilt, scale, speed, phase, head, lean=0.0):
    """Stand, head and spin, each with its own transform; `speed` in degrees a frame."""
    root = UsdGeom.Xform.Define(stage, path)
    root.AddTranslateOp().Set(Gf.Vec3d(*position))
    root.AddRotateYOp().Set(heading)
    sway = root.AddRotateZOp()
    if lean:
        sway.Set(-0.5 * lean, FRAME - 0.5)
        sway.Set(0.5 * lean, FRAME + 0.5)
    else:
        sway.Set(0.0)
    root.AddScaleOp().Set(Gf.Vec3f(scale))
    stand = stage.DefinePrim(f"{path}/Stand", "Xform")
    stand.GetReferences().AddInternalReference("/Shapes/Stand")
    stand.SetInstanceable(True)
    top = UsdGeom.Xform.Define(stage, f"{path}/Head")
    top.AddTranslateOp().Set(Gf.Vec3d(0.0, HERO_HUB, 1.2))
    top.AddRotateXOp().Set(tilt)
    spin = UsdGeom.Xform.Define(stage, f"{path}/Head/Spin")
    turn = spin.AddRotateZOp()
    if speed:
        turn.Set(phase - speed, FRAME - 1.0)
        turn.Set(phase + speed, FRAME + 1.0)
    else:
        turn.Set(phase)
    vanes = stage.DefinePrim(f"{path}/Head/Spin/Vanes", "Xform")
    vanes.GetReferences().AddInternalReference(f"/Shapes/{head}")
    vanes.SetInstanceable(True)


def add_shapes(stage) -> None:
    """What windmills and instancers refer to; abstract, so not drawn by itself."""
    stage.CreateClassPrim("/Shapes")
    deep_rose, deep_gold, deep_sea = (0.35, 0.0, 0.12), (0.5, 0.1, 0.0), (0.0, 0.06, 0.16)
    coral = (deep_rose, CORAL, SAFFRON)
    cream = (deep_gold, CREAM, ROSE)
    sea = (deep_sea, SKY, CREAM)
    teal = (deep_sea, TEAL, SKY)
    plum = ((0.08, 0.0, 0.12), PLUM, ROSE)
    gold = (deep_gold, SAFFRON, CREAM)
    UsdGeom.Xform.Define(stage, "/Shapes/HeroHead")
    write_mesh(
        stage, "/Shapes/HeroHead/Paper", wheel(8, [coral, cream], width=5.2, curl=2.9, hub=2.6)
    )
    small = ring(8, [sea, teal], radius=4.2, width=2.7, curl=2.9, rows=5, columns=4)
    turn = np.pi / 8.0
    lift = np.array([[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1]])
    write_mesh(stage, "/Shapes/HeroHead/Inner", small.moved(lift, (0.0, 0.0, 1.7)))
    # Three heads of one geometry and their own colours.
    heads = {"SeaHead": [sea, teal], "PlumHead": [plum, gold], "FireHead": [coral, gold]}
    for name, palettes in heads.items():
        shape, path = wheel(6, palettes), f"/Shapes/{name}/Paper"
        UsdGeom.Xform.Define(stage, f"/Shapes/{name}")
        if name == "SeaHead":
            write_mesh(stage, path, shape)
        else:
            stage.DefinePrim(path).GetReferences().AddInternalReference("/Shapes/SeaHead/Paper")
            write_colors(stage.GetPrimAtPath(path), shape.colors)
    UsdGeom.Xform.Define(stage, "/Shapes/Stand")
    write_mesh(stage, "/Shapes/Stand/Wood", stick())


def add_field(stage) -> None:
    """The windmills: one at rest, the others in the wind, in rows that recede."""
    UsdGeom.Xform.Define(stage, "/World/Field")
    add_windmill(stage, "/World/Field/Hero", HERO, -8.0, -4.0, 1.0, 0.0, 11.0, "HeroHead")
    others = [
        # x, z, heading, scale, degrees a frame, head, sway
        (-9.5, -20.0, 10.0, 1.0, 64.0, "SeaHead", 2.0),
        (-17.0, 36.0, 16.0, 0.8, 90.0, "PlumHead", 3.0),
        (25.0, -42.0, -14.0, 1.15, 80.0, "PlumHead", 2.0),
        (-31.0, -62.0, 12.0, 1.1, 75.0, "FireHead", 2.0),
        (4.0, -88.0, 0.0, 1.1, 100.0, "SeaHead", 3.0),
        (-14.0, -135.0, 6.0, 1.2, 70.0, "PlumHead", 2.0),
        (44.0, -120.0, -10.0, 1.25, 85.0, "FireHead", 2.0),
        (-58.0, -165.0, 14.0, 1.3, 95.0, "SeaHead", 2.0),
        (22.0, -185.0, -4.0, 1.3, 60.0, "FireHead", 2.0),
        (-30.0, -235.0, 8.0, 1.35, 80.0, "FireHead", 2.0),
        (68.0, -230.0, -12.0, 1.4, 80.0, "SeaHead", 2.0),
        (2.0, -290.0, 0.0, 1.4, 80.0, "PlumHead", 2.0),
        (-80.0, -300.0, 10.0, 1.5, 80.0, "PlumHead", 2.0),
        (42.0, -330.0, -6.0, 1.5, 80.0, "SeaHead", 2.0),
    ]
    for i, (x, z, heading, scale, speed, head, sway) in enumerate(others):
        path = f"/World/Field/Windmill_{i:02d}"
        position = (x, ground_height(x, z), z)
        # The wind comes from the left; every other head turns the other way.
        signed = speed if i % 2 else -speed
        add_windmill(stage, path, position, heading, -3.0, scale, signed, 37.0 * i, head, sway)


def ground_height(x, z):
    """Low dunes, flat near the hero."""
    far = np.clip(np.abs(np.asarray(z, dtype=float)) / 120.0, 0.0, 1.0)
    wave = np.sin(0.06 * x + 0.045 * z) + 0.6 * np.sin(0.11 * x - 0.07 * z + 1.0)
    return 1.6 * far * wave - 0.4


def add_ground(stage) -> None:
    """A sheet of dunes; light pools around the hero, stands darken it where they touch."""
    zs = 60.0 - 820.0 * np.linspace(0.0, 1.0, 26) ** 1.6
    us = np.linspace(-1.0, 1.0, 22)
    us = np.sign(us) * np.abs(us) ** 1.4
    x = us[None, :] * (60.0 + 0.9 * (60.0 - zs[:, None]))
    z = np.broadcast_to(zs[:, None], x.shape)
    y = ground_height(x, z)
    points = np.stack([x, y, z], axis=-1)
    pool = np.exp(-(((x - HERO[0]) / 34.0) ** 2) - ((z + 10.0) / 60.0) ** 2)
    horizon = np.clip(-z / 700.0, 0.0, 1.0)
    colors = mix((0.1, 0.12, 0.5), (4.0, 1.5, 1.9), pool)
    colors = colors + horizon[..., None] ** 2 * np.array([0.9, 0.25, 0.3])
    shape = Shape(points.reshape(-1, 3), grid_faces(len(zs), len(us)), colors.reshape(-1, 3))
    shape.faces = [list(reversed(face)) for face in shape.faces]
    write_mesh(stage, "/World/Ground", shape)


def add_backdrop(stage) -> None:
    """A bent sheet behind everything: the last light at the horizon, night above."""
    angles = np.radians(np.linspace(-50.0, 50.0, 13))
    heights = np.array([-40.0, 0.0, 25.0, 55.0, 95.0, 150.0, 360.0])
    colors = [(0.3, 0.06, 0.05), (0.42, 0.1, 0.06), (0.24, 0.05, 0.09), (0.09, 0.025, 0.1)]
    colors += [(0.025, 0.014, 0.06), (0.008, 0.01, 0.034), (0.003, 0.004, 0.012)]
    points, vertex_colors = [], []
    for height, color in zip(heights, colors, strict=True):
        for a in angles:
            points.append((860.0 * np.sin(a), height, 100.0 - 860.0 * np.cos(a)))
            side = 0.35 + 0.65 * np.exp(-((a - 0.1) ** 2) / 0.06)
            vertex_colors.append(np.array(color) * side)
    faces = grid_faces(len(heights), len(angles))
    shape = Shape(np.array(points), faces, np.array(vertex_colors))
    write_mesh(stage, "/World/Backdrop", shape)


def ribbon_points(time: float, rows=30, columns=3) -> np.ndarray:
    """The ribbon's middle sheet at a time code: a wave that runs along it while it flies."""
    s = np.linspace(0.0, 1.0, rows)[:, None]
    w = np.linspace(-1.0, 1.0, columns)[None, :]
    t = time - FRAME
    phase = 13.0 * s - 1.1 * t
    x = -44.0 + 92.0 * s + 7.0 * t + 0.0 * w
    y = 9.0 + 3.0 * np.sin(phase) * (0.4 + 0.6 * s) + 6.0 * s**2 + 1.5 * t + 0.0 * w
    z = -30.0 + 9.0 * np.cos(phase) + 12.0 * s + 0.0 * w
    twist = 2.3 * np.sin(0.8 * phase + 0.4) + 0.4
    half = 1.7 * np.sin(np.pi * np.clip(0.04 + 0.94 * s, 0, 1)) ** 0.5
    return np.stack([x, y + w * half * np.cos(twist), z + w * half * np.sin(twist)], axis=-1)


def add_ribbon(stage) -> None:
    """A flying ribbon whose points deform."""
    front = ribbon_points(FRAME)
    rows, columns, _ = front.shape
    s = np.linspace(0.0, 1.0, rows)
    colors = np.where(s[:, None] < 0.5, mix(PLUM, TEAL, 2.0 * s), mix(TEAL, SKY, 2.0 * s - 1.0))
    colors = np.repeat(colors[:, None, :], columns, axis=1)
    mesh = write_mesh(stage, "/World/Ribbon", shell(front, 0.15, colors, 4.0))
    attribute = mesh.GetPointsAttr()
    attribute.Clear()
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for time in KEYS:
        points = shell(ribbon_points(time), 0.15, colors, 4.0).points
        attribute.Set(vec3f(points, 2), time)
        low, high = np.minimum(low, points.min(axis=0)), np.maximum(high, points.max(axis=0))
    mesh.CreateExtentAttr(vec3f(np.array([low, high]), 2))


def scattered(count: int, seed: int) -> np.ndarray:
    """Points of an additive (R3) sequence in the unit cube: even, and the same on any machine."""
    g = 1.2207440846057596
    steps = np.array([1.0 / g, 1.0 / g**2, 1.0 / g**3])
    return (0.5 + steps * np.arange(seed, seed + count)[:, None]) % 1.0


def add_petals(stage) -> None:
    """Creased petals that tumble with the wind: point instances with moving positions and
    orientations."""
    count = 40
    instancer = UsdGeom.PointInstancer.Define(stage, "/World/Petals")
    sizes = [(1.5, 0.18, 1.0), (1.1, 0.2, 1.1), (0.8, 0.8, 0.8)]
    tints = [(ROSE, CREAM), (SAFFRON, CORAL), (SKY, (0.5, 0.95, 1.0))]
    for i, (size, (a, b)) in enumerate(zip(sizes, tints, strict=True)):
        colors = [mix(a, b, k / 7.0) for k in range(8)]
        write_mesh(stage, f"/World/Petals/Petal_{i}", box(size, colors, (1.0, 2.0, 3.5)[i]))
    instancer.CreatePrototypesRel().SetTargets(
        [Sdf.Path(f"/World/Petals/Petal_{i}") for i in range(3)]
    )
    instancer.CreateProtoIndicesAttr([i % 3 for i in range(count)])
    unit = scattered(count, 7)
    depth = 30.0 - 240.0 * unit[:, 2] ** 1.5
    # Every third drifts near the plane in focus, where its streak is drawn by motion alone.
    near = np.arange(count) % 3 == 0
    depth = np.where(near, 9.0 - 24.0 * unit[:, 2], depth)
    spread = (CAMERA_EYE[2] - depth) / CAMERA_EYE[2]
    start = np.stack(
        [
            52.0 * (unit[:, 0] - 0.5) * spread,
            14.0 + (26.0 * unit[:, 1] - 10.0) * spread,
            depth,
        ],
        axis=-1,
    )
    speed = np.stack(
        [7.0 + 8.0 * unit[:, 1], -2.5 + 4.0 * unit[:, 0], 5.0 * unit[:, 2] - 2.0], axis=-1
    )
    speed[near] *= 0.4
    axes = scattered(count, 301) - 0.5
    axes /= np.linalg.norm(axes, axis=-1, keepdims=True)
    turn = np.radians(60.0 + 140.0 * unit[:, 0])
    positions, orientations = instancer.CreatePositionsAttr(), instancer.CreateOrientationsAttr()
    for time in (FRAME - 0.5, FRAME, FRAME + 0.5):
        moved = start + (time - FRAME) * speed
        positions.Set(vec3f(moved, 2), time)
        half = 0.5 * turn * (time - FRAME) + 3.0 * unit[:, 2]
        quaternions = [
            Gf.Quath(float(np.cos(h)), *(float(v) for v in rounded(np.sin(h) * a, 3)))
            for h, a in zip(half, axes, strict=True)
        ]
        orientations.Set(Vt.QuathArray(quaternions), time)
    instancer.CreateScalesAttr(vec3f(np.repeat(0.6 + 0.7 * unit[:, 1:2], 3, axis=1), 2))


def ball(color) -> Shape:
    """A cube whose limit surface is nearly a ball."""
    return box((2.0, 2.0, 2.0), [color], 0.0)


def add_glows(stage, path, centres, radii, colors) -> None:
    """Balls brighter than white, for the lens to spread: one prototype a colour."""
    instancer = UsdGeom.PointInstancer.Define(stage, path)
    targets = []
    for i, color in enumerate(colors):
        shape = ball(color)
        shape.creases = []
        write_mesh(stage, f"{path}/Glow_{i}", shape)
        targets.append(Sdf.Path(f"{path}/Glow_{i}"))
    instancer.CreatePrototypesRel().SetTargets(targets)
    instancer.CreateProtoIndicesAttr([i % len(colors) for i in range(len(centres))])
    instancer.CreatePositionsAttr(vec3f(np.asarray(centres), 2))
    # The limit of a cube of side 2 has a radius of about 0.87 at faces and corners.
    instancer.CreateScalesAttr(vec3f(np.repeat(np.asarray(radii)[:, None] / 0.87, 3, axis=1), 2))


def add_lamps(stage) -> None:
    """Two strings of lamps far behind, and drops of dew just before the lens."""
    x = np.linspace(-1.0, 1.0, 12)
    bend = np.array([1.0, -1.0] * 6)
    near = np.stack(
        [112.0 * x + 3.0 * bend, 26.0 + 34.0 * x**2 - 9.0 * x + 2.0 * bend, -300.0 - 50.0 * x],
        axis=-1,
    )
    far = np.stack([200.0 * x - 34.0, 64.0 + 20.0 * (x + 0.3) ** 2, -520.0 + 60.0 * x], axis=-1)
    sizes = 2.3 + 0.9 * scattered(12, 5)[:, 0]
    warm = [(10.0, 3.6, 0.8), (9.0, 1.9, 0.7), (9.0, 5.2, 1.8)]
    add_glows(stage, "/World/LampsNear", near, sizes, warm)
    cool = [(0.5, 2.3, 3.6), (3.0, 0.5, 1.7), (3.6, 1.4, 0.4)]
    add_glows(stage, "/World/LampsFar", far, 1.5 * sizes, cool)
    unit = scattered(8, 23)
    side = np.where(np.arange(8) % 3 == 0, 11.0, -9.0)
    dew = np.stack(
        [side + 5.0 * (unit[:, 0] - 0.5), 10.0 + 4.5 * unit[:, 1], 58.0 + 14.0 * unit[:, 2]],
        axis=-1,
    )
    add_glows(stage, "/World/Dew", dew, 0.2 + 0.12 * unit[:, 0], [(2.4, 1.5, 0.7), (1.0, 1.7, 2.2)])


def add_camera(stage) -> None:
    """85 mm at f/1.8 on the hero's near vanes."""
    camera = UsdGeom.Camera.Define(stage, "/World/Camera")
    camera.AddTranslateOp().Set(Gf.Vec3d(*CAMERA_EYE.tolist()))
    camera.AddRotateXOp().Set(CAMERA_PITCH)
    camera.CreateHorizontalApertureAttr(36.0)
    camera.CreateVerticalApertureAttr(20.25)
    camera.CreateFocalLengthAttr(85.0)
    camera.CreateFStopAttr(1.8)
    pitch = np.radians(CAMERA_PITCH)
    forward = np.array([0.0, np.sin(pitch), -np.cos(pitch)])
    hub = HERO + np.array([0.0, HERO_HUB, 3.0])
    camera.CreateFocusDistanceAttr(round(float(forward @ (hub - CAMERA_EYE)), 2))
    camera.CreateClippingRangeAttr(Gf.Vec2f(1.0, 5000.0))
    camera.CreateShutterOpenAttr(SHUTTER[0])
    camera.CreateShutterCloseAttr(SHUTTER[1])
    # The camera light gives white paper pi times less than white: 2^1.65 brings it back.
    camera.CreateExposureAttr(1.65)


def add_render_settings(stage) -> None:
    """Names the camera, so that no renderer needs to be told."""
    settings = UsdRender.Settings.Define(stage, "/Render/Settings")
    settings.CreateCameraRel().SetTargets([Sdf.Path("/World/Camera")])
    stage.SetMetadata("renderSettingsPrimPath", str(settings.GetPath()))


def make(path: Path) -> None:
    """Writes the whole scene."""
    stage = Usd.Stage.CreateInMemory()
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    UsdGeom.SetStageMetersPerUnit(stage, 0.01)
    stage.SetTimeCodesPerSecond(24.0)
    stage.SetFramesPerSecond(24.0)
    stage.SetStartTimeCode(FRAME)
    stage.SetEndTimeCode(FRAME)
    world = UsdGeom.Xform.Define(stage, "/World")
    stage.SetDefaultPrim(world.GetPrim())
    add_shapes(stage)
    add_camera(stage)
    add_ground(stage)
    add_backdrop(stage)
    add_field(stage)
    add_ribbon(stage)
    add_petals(stage)
    add_lamps(stage)
    add_render_settings(stage)
    path.write_text(stage.GetRootLayer().ExportToString(), encoding="utf-8")


if __name__ == "__main__":
    make(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).with_name("demo.usda"))
