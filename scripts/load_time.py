"""Times how `record` loads stages of many prims, and of many instances.

    scripts/load_time.py [--quick]

Each stage has a grid of cubes: as meshes of eight points with a transform each, or as one point
instancer. Sizes grow threefold, so that times per prim show whether loading is linear. Each render
is a process of its own, 320 pixels wide with one sample, and its image is checked: something must
be seen. Times are those of the processor, user and system, and of the clock; memory is the peak.
"""

import argparse
import multiprocessing
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from pxr import Gf, Sdf, Usd, UsdGeom, Vt

CORNERS = Vt.Vec3fArray([(x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
FACES = Vt.IntArray([0, 1, 3, 2, 4, 6, 7, 5, 0, 4, 5, 1, 2, 3, 7, 6, 0, 2, 6, 4, 1, 5, 7, 3])
TYPES = Sdf.ValueTypeNames


def author(spec: Sdf.PrimSpec, name: str, kind: Sdf.ValueTypeName, value: object) -> None:
    """Gives a prim a value at the default time."""
    Sdf.AttributeSpec(spec, name, kind).default = value


def new_stage(path: Path, side: int) -> Usd.Stage:
    """A stage with a camera over a square of `side` by `side` cubes, two apart."""
    stage = Usd.Stage.CreateNew(str(path))
    camera = UsdGeom.Camera.Define(stage, "/Camera")
    camera.AddTranslateOp().Set(Gf.Vec3d(side, side, 4 * side))
    camera.CreateClippingRangeAttr(Gf.Vec2f(0.1, 1e6))
    return stage


def write_meshes(path: Path, count: int) -> None:
    """`count` meshes, a thousand in a group."""
    side = round(count**0.5)
    stage = new_stage(path, side)
    layer = stage.GetRootLayer()
    counts = Vt.IntArray([4] * 6)
    with Sdf.ChangeBlock():
        for i in range(count):
            prim = Sdf.CreatePrimInLayer(layer, f"/World/Group{i // 1000}/Mesh{i}")
            prim.specifier, prim.typeName = Sdf.SpecifierDef, "Mesh"
            author(prim, "points", TYPES.Point3fArray, CORNERS)
            author(prim, "faceVertexCounts", TYPES.IntArray, counts)
            author(prim, "faceVertexIndices", TYPES.IntArray, FACES)
            place = Gf.Vec3d(i % side * 2, i // side * 2, 0)
            author(prim, "xformOp:translate", TYPES.Double3, place)
            order = Vt.TokenArray(["xformOp:translate"])
            author(prim, "xformOpOrder", TYPES.TokenArray, order)
        for group in range((count + 999) // 1000):
            layer.GetPrimAtPath(f"/World/Group{group}").specifier = Sdf.SpecifierDef
        layer.GetPrimAtPath("/World").specifier = Sdf.SpecifierDef
    stage.Save()


def write_instances(path: Path, count: int) -> None:
    """`count` instances of a cube."""
    side = round(count**0.5)
    stage = new_stage(path, side)
    instancer = UsdGeom.PointInstancer.Define(stage, "/Instancer")
    UsdGeom.Cube.Define(stage, "/Instancer/Cube").CreateSizeAttr(1.0)
    instancer.CreatePrototypesRel().AddTarget("/Instancer/Cube")
    instancer.CreateProtoIndicesAttr(Vt.IntArray(count))
    places = [(i % side * 2.0, i // side * 2.0, 0.0) for i in range(count)]
    instancer.CreatePositionsAttr(Vt.Vec3fArray(places))
    stage.Save()


def measure(stage: Path, image: Path) -> tuple[float, float, float]:
    """Renders; seconds of the processor and of the clock, and MB at the peak."""
    command = [sys.executable, "-m", "hdtrapeze", "record", "--quiet", "-w", "320"]
    command += ["--samples", "1", str(stage), str(image)]
    start = time.monotonic()
    child = subprocess.Popen(command)
    _, status, usage = os.wait4(child.pid, 0)
    child.returncode = os.waitstatus_to_exitcode(status)
    if child.returncode:
        sys.exit(f"{stage.name}: record failed with {child.returncode}")
    check(image)
    return (
        usage.ru_utime + usage.ru_stime,
        time.monotonic() - start,
        usage.ru_maxrss / 1024,
    )


def check(image: Path) -> None:
    """At least a fiftieth of the image is covered: limit surfaces of cubes are small."""
    from PIL import Image

    alpha = Image.open(image).convert("RGBA").getchannel("A")
    covered = sum(alpha.histogram()[1:]) / (alpha.width * alpha.height)
    if covered < 0.02:
        sys.exit(f"{image.name}: only {covered:.1%} of the image is covered")


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="one small stage of each kind")
    quick = parser.parse_args().quick
    kinds = [
        ("meshes", write_meshes, (10_000, 30_000, 100_000)),
        ("instances", write_instances, (100_000, 300_000, 1_000_000)),
    ]
    print("stage                 processor s   clock s   us each     MB")
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    with tempfile.TemporaryDirectory() as folder:
        for name, write, counts in kinds:
            for count in (counts[0] // 100,) if quick else counts:
                stage = Path(folder) / f"{name}{count}.usdc"
                title = f"{count} {name}"
                # Apart, so that its memory does not count for the processes that are measured.
                writer = multiprocessing.get_context("spawn").Process(
                    target=write, args=(stage, count)
                )
                writer.start()
                writer.join()
                if writer.exitcode:
                    sys.exit(f"{title}: the stage cannot be written")
                cpu, clock, peak = measure(stage, stage.with_suffix(".png"))
                each = cpu / count * 1e6
                print(f"{title:<20} {cpu:12.2f} {clock:9.2f} {each:9.1f} {peak:6.0f}")
                stage.unlink()


if __name__ == "__main__":
    main()
