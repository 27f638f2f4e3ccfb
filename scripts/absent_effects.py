"""Counts the instructions that effects cost where a scene does not use them.

    scripts/absent_effects.py [--markdown FILE]

Builds core's example `absent_effects`, whose scenes come in pairs that differ by an effect that
changes nothing, and runs each under callgrind (of valgrind), which counts the instructions of the
traced or rendered part alone. Counts do not depend on what else the machine does; those of the
memory allocator, whose lists look otherwise after a scene that was made otherwise, are left out.
Fails where a pair of which the second must cost what the first does differs by more than 0.1 %, or
where they do not test the same nodes and micropolygons. Valgrind knows no AVX-512: AVX2 and plain
instructions are counted. Without valgrind (Debian: `apt-get install valgrind`) nothing is counted.
"""

import argparse
import datetime
import re
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

from processor import processor

ROOT = Path(__file__).resolve().parent.parent
BINARY = ROOT / "target/release/examples/absent_effects"
# Of the instructions of a pair's first.
LIMIT = 0.001


@dataclass(frozen=True)
class Pair:
    """Two cases, of which the second has an effect more that it does not use."""

    first: str
    second: str
    # May differ, and why.
    because: str = ""


TRACED = [
    Pair("static", "static, rays with times"),
    Pair("static, rays with times", "static, a still thing beside", "one more object"),
    Pair("static, a still thing beside", "static, a thing of moving points beside"),
    Pair("static, a still thing beside", "static, a thing with a moving matrix beside"),
]
IMAGES = [
    Pair("still", "still, samples that are equal"),
    Pair("still", "motion and lens, disabled"),
    Pair("still", "culled, but all is double-sided"),
]
# For comparison: effects that are used.
USED = [Pair("still", "lens", "used"), Pair("still", "motion", "used")]


# What callgrind_annotate says of a function of the memory allocator: its own instructions.
ALLOCATOR = re.compile(r"^\s*([\d,]+) \([^)]*\)\s+\S*malloc/(?:malloc|arena)\.[ch]:", re.MULTILINE)


@dataclass(frozen=True)
class Count:
    """What a case took."""

    instructions: int
    # Hits, nodes and micropolygons tested.
    tests: tuple[int, ...]


def count(case: str, level: str, folder: str) -> Count:
    """Runs a case under callgrind."""
    command = [
        "valgrind",
        "--tool=callgrind",
        f"--callgrind-out-file={folder}/out",
        "--collect-atstart=no",
        "--toggle-collect=*absent_effects*measured*",
        str(BINARY),
        case,
        level,
    ]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        sys.exit(f"absent_effects: {case}, {level}: {done.stderr}")
    said, *tests = done.stdout.split()
    found = re.search(r"Collected : (\d+)", done.stderr)
    if said != level or found is None or int(found[1]) == 0:
        sys.exit(f"absent_effects: {case}, {level}: nothing was counted:\n{done.stderr}")
    annotate = ["callgrind_annotate", "--auto=no", "--threshold=100", f"{folder}/out"]
    told = subprocess.run(annotate, capture_output=True, text=True, check=True).stdout
    allocator = sum(int(own.replace(",", "")) for own in ALLOCATOR.findall(told))
    return Count(int(found[1]) - allocator, tuple(map(int, tests)))


def main() -> int:
    """Prints the table; 1 where something costs that must not."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--markdown", type=Path, help="writes the table there too")
    file = parser.parse_args().markdown
    if shutil.which("valgrind") is None:
        print("absent_effects: skipped, no valgrind")
        return 0
    build = ["cargo", "build", "--release", "--locked", "-p", "hdtrapeze-core"]
    subprocess.run([*build, "--example", "absent_effects"], cwd=ROOT, check=True)
    ways = [
        (f"{way} ", level) for level in ("avx2", "scalar") for way in ("packets", "single", "any")
    ]
    pairs = [(way, level, pair) for way, level in ways for pair in TRACED]
    pairs += [("image ", "avx2", pair) for pair in IMAGES + USED]
    lines = [
        "### Instructions of effects that are absent",
        "",
        f"`scripts/absent_effects.py`, {processor()}, {datetime.date.today()}.",
        "",
        "Thousands of instructions, counted by callgrind, of 4096 rays, or an image of 48 x 48",
        "pixels with 16 samples, the memory allocator left out. Callgrind knows no AVX-512: it",
        "counts AVX2 and plain Rust alone.",
        "",
        "| what | with | without the effect | | with it | | difference | |",
        "|---|---|---|---|---|---|---|---|",
    ]
    failed = []
    known: dict[tuple[str, str], Count] = {}
    with tempfile.TemporaryDirectory() as folder:
        for way, level, pair in pairs:
            for case in (pair.first, pair.second):
                if (way + case, level) not in known:
                    known[way + case, level] = count(way + case, level, folder)
            first, second = (known[way + case, level] for case in (pair.first, pair.second))
            differ = second.instructions / first.instructions - 1
            same = pair.because == "used" or first.tests == second.tests
            if not same or (not pair.because and abs(differ) > LIMIT):
                failed.append(f"{way}{pair.second}, {level}")
            thousands = [f"{c.instructions / 1000:.1f}" for c in (first, second)]
            cells = [way.strip(), level, pair.first, thousands[0], pair.second, thousands[1]]
            lines.append(f"| {' | '.join([*cells, f'{differ:+.3%}', pair.because])} |")
    text = "\n".join(lines) + "\n"
    print(text)
    if file:
        file.write_text(text)
    for name in failed:
        print(f"absent_effects: {name}: not the same within {LIMIT:.1%}", file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
