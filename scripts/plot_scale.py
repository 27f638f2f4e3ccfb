"""Runs the comparison's scenes in growing sizes, and shows how cost grows with them.

    scripts/plot_scale.py [--sizes M ...] [--scene NAME] [--out DIR] [--peers FLAGS]
                          [--binary FILE]

Each size is a process of its own, so that peaks of memory are its own, and is traced once more in
an image of so many more pixels: micropolygons that follow the pixels get smaller with them.
Without `--sizes`, millions of micropolygons go from 1 fourfold to 16, and last to 48.9, the
largest. Embree is left out.
DIR (docs/figures) gets scale.md, a table with the slopes, and, where matplotlib is installed
(scripts/requirements-figures.txt), scale.png, both axes logarithmic.
"""

import argparse
import datetime
import json
import math
import subprocess
import sys
import tempfile
from pathlib import Path

from processor import processor

ROOT = Path(__file__).resolve().parent.parent
# Millions; the last is 437 x 437 grids of 16 x 16.
SIZES = [1.0, 4.0, 16.0, (437 / 62.5) ** 2]
# More than these the bench does not take.
MOST = 100.0
GIB = 1 << 30
# What each run gets by itself.
OWN_FLAGS = ("--alone", "--scene", "--size", "--json", "--largest", "--quick")
# Pixels of the smallest size where the image grows along, rays a pixel, and how many words the
# flags have that say so.
GROWING = (640, 360)
GROWING_SAMPLES = 4
GROWING_FLAGS = {"--image": 3, "--samples": 2, "--order": 2}


def measure(bench: list[str], millions: float, scene: str, flags: list[str]) -> list[dict]:
    """What the bench finds out about one size: a still scene and a moving one."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "numbers.json"
        command = ["--alone", "--scene", scene, "--size", str(millions), "--json", str(file)]
        done = subprocess.run(
            [*bench, *command, *flags], cwd=ROOT, check=False, stdout=subprocess.DEVNULL
        )
        if done.returncode:
            sys.exit(f"plot_scale: {millions:g} million: the bench failed with {done.returncode}")
        return json.loads(file.read_text())


def growing(flags: list[str], times: float) -> list[str]:
    """Flags for an image of so many times the pixels; its sides are multiples of 4."""
    flags = [word for flag in flags for word in flag.split("=", 1)]
    for flag, words in GROWING_FLAGS.items():
        if flag in flags:
            at = flags.index(flag)
            flags = flags[:at] + flags[at + words :]
    sides = (str(round(side * math.sqrt(times) / 4) * 4) for side in GROWING)
    return [*flags, "--image", *sides, "--samples", str(GROWING_SAMPLES), "--order", "block"]


def size(text: str) -> float:
    """A size that the bench takes, or an error that says which those are."""
    millions = float(text)
    if not 0 < millions <= MOST:
        raise argparse.ArgumentTypeError(f"{text} is not above 0 and at most {MOST:g}")
    return millions


def slope(rows: list[dict], value: str) -> float:
    """Exponent of growth from the smallest size to the largest."""
    first, last = rows[0], rows[-1]
    grown = math.log(last["micropolygons"] / first["micropolygons"])
    return math.log(last[value] / first[value]) / grown


def derive(row: dict) -> None:
    """Adds what is plotted: seconds of a build, and of a ray in a packet and by itself."""
    row["build_seconds"] = row["micropolygons"] / row["build_mquads"] * 1e-6
    row["ray_microseconds"] = 1 / row["mrays"]
    row["single_microseconds"] = 1 / row["mrays_single"]
    row["growing_microseconds"] = 1 / row["mrays_growing"]


def table(rows: list[dict], command: str) -> str:
    """The table, in Markdown."""
    by_motion = [[r for r in rows if r["moving"] == moving] for moving in (False, True)]
    header = "scene, M quads, build s, Mquads/s, Mrays/s, one by one, growing image"
    header = [*header.split(", "), "nodes/ray", "tested/ray", "B/quad", "GiB building", "GiB peak"]
    width, height = GROWING
    lines = [
        "### Cost against size",
        "",
        f"`{command}`, {processor()}, {rows[0]['threads']} threads, {datetime.date.today()}.",
        "Rates are the best of the rounds; camera rays with lens and time, in packets, and then a",
        "part of them one by one: rays of a packet share what they fetch, the less the smaller",
        "micropolygons are in an image that stays as large. So packets are timed again in an image",
        f"that grows along, from {width}x{height} pixels of {GROWING_SAMPLES} rays on, by",
        "block: all sizes have as many micropolygons a pixel there. Peaks are of the whole",
        "process, in the image that stays, with the mesh that is built from and the rays.",
        "",
        f"| {' | '.join(header)} |",
        f"|{'---|' * len(header)}",
    ]
    for row in (row for part in by_motion for row in part):
        cells = [row["scene"], f"{row['micropolygons'] * 1e-6:.1f}", f"{row['build_seconds']:.3f}"]
        cells += [f"{row['build_mquads']:.1f}", f"{row['mrays']:.2f}", f"{row['mrays_single']:.2f}"]
        cells += [f"{row['mrays_growing']:.2f}"]
        cells += [f"{row['nodes']:.1f}", f"{row['tested']:.1f}", f"{row['bytes']:.2f}"]
        cells += [f"{row[peak] / GIB:.2f}" for peak in ("peak_building", "peak")]
        lines.append(f"| {' | '.join(cells)} |")
    lines += [""]
    # One size does not grow.
    for part in (p for p in by_motion if p[-1]["micropolygons"] > p[0]["micropolygons"]):
        build, ray = slope(part, "build_seconds"), slope(part, "ray_microseconds")
        single = slope(part, "single_microseconds")
        grows = slope(part, "growing_microseconds")
        first, last = part[0]["micropolygons"], part[-1]["micropolygons"]
        logarithm = math.log(math.log(last) / math.log(first)) / math.log(last / first)
        lines += [
            f"{part[0]['scene'].capitalize()}, from the smallest to the largest: the time of a",
            f"build grows as size to the power of {build:.2f} (1 is linear), that of a ray to the",
            f"power of {ray:.2f} in packets, of {grows:.2f} in packets of an image that grows",
            f"along, and of {single:.2f} by itself (0 is constant, {logarithm:.2f} the logarithm).",
            "",
        ]
    return "\n".join(lines)


def plot(rows: list[dict], file: Path) -> bool:
    """The picture; False without matplotlib."""
    try:
        import matplotlib as mpl
    except ImportError:
        return False
    mpl.use("Agg")
    from matplotlib import pyplot as plt

    shown = [
        ("build_seconds", "build, seconds"),
        ("ray_microseconds", "a ray in a packet, microseconds"),
        ("growing_microseconds", "the same in a growing image"),
        ("single_microseconds", "a ray by itself, microseconds"),
        ("peak_building", "peak memory while building, GiB"),
    ]
    figure, axes = plt.subplots(1, len(shown), figsize=(20, 4), layout="constrained")
    for axis, (value, title) in zip(axes, shown, strict=True):
        for moving, color in ((False, "tab:blue"), (True, "tab:orange")):
            part = [r for r in rows if r["moving"] == moving]
            sizes = [r["micropolygons"] * 1e-6 for r in part]
            unit = GIB if value.startswith("peak") else 1
            values = [r[value] / unit for r in part]
            axis.loglog(sizes, values, "o-", color=color, label=part[0]["scene"])
            if not value.endswith("_microseconds"):
                linear = [values[0] * size / sizes[0] for size in sizes]
                axis.loglog(sizes, linear, ":", color=color, label="linear")
            else:
                growth = [math.log(s * 1e6) / math.log(sizes[0] * 1e6) for s in sizes]
                logarithmic = [values[0] * g for g in growth]
                axis.loglog(sizes, logarithmic, ":", color=color, label="logarithmic")
        axis.set(title=title, xlabel="million micropolygons")
        axis.grid(visible=True, which="both", alpha=0.3)
        axis.legend()
    figure.savefig(file, dpi=120)
    return True


def main() -> None:
    """Measures, writes and prints."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sizes", type=size, nargs="+", default=SIZES, help="millions")
    parser.add_argument("--scene", default="sheet", help="sheet, patches, fur or combed")
    parser.add_argument("--out", type=Path, default=ROOT / "docs/figures")
    parser.add_argument("--peers", default="", help="more flags for the bench, in one string")
    parser.add_argument("--binary", help="the bench, where it is built already")
    options = parser.parse_args()
    own = [f for f in options.peers.split() if f.split("=")[0] in OWN_FLAGS]
    if own:
        parser.error(f"--peers cannot have {own[0]}: each size gets its own")
    if options.binary and not Path(options.binary).is_file():
        parser.error(f"--binary: there is no {options.binary}")
    build = ["cargo", "run", "--release", "--locked", "-q", "-p", "hdtrapeze-peers", "--"]
    bench = [options.binary] if options.binary else build
    rows: list[dict] = []
    sizes, flags = sorted(options.sizes), options.peers.split()
    for millions in sizes:
        found = measure(bench, millions, options.scene, flags)
        other = growing(flags, millions / sizes[0])
        for row, again in zip(found, measure(bench, millions, options.scene, other), strict=True):
            row["mrays_growing"] = again["mrays"]
        rows += found
    for row in rows:
        derive(row)
    options.out.mkdir(parents=True, exist_ok=True)
    # As it was called, but for where the result goes.
    told = [f"--sizes {' '.join(f'{s:g}' for s in sorted(options.sizes))}"]
    told += [f"--scene {options.scene}"] if options.scene != "sheet" else []
    told += [f'--peers "{options.peers}"'] if options.peers else []
    text = table(rows, " ".join(["scripts/plot_scale.py", *told]))
    (options.out / "scale.md").write_text(text)
    print(text)
    if not plot(rows, options.out / "scale.png"):
        print("plot_scale: no picture: matplotlib is not installed (pip install matplotlib)")


if __name__ == "__main__":
    main()
