"""Renders every USD file of a folder tree small, and pastes the pictures into one sheet.

    scripts/contact_sheet.py scenes -o out/contact_sheet.png --only '*.usda'

Each file is rendered by a process of its own, with a time limit. Each tile has the file's name and
what came of it:

    ok         rendered without a warning
    N warned   rendered, with N warnings
    empty      the file says of itself that it has nothing to render: a layer of materials, say
    blank      rendered, but hardly a pixel is covered
    error      the command failed
    time out   it took longer than --timeout

A table of the same, with every message, goes to the terminal. Exits with 1 where a file failed or
took too long. The background is chequered where a picture is transparent.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from fnmatch import fnmatch
from pathlib import Path

SUFFIXES = (".usd", ".usda", ".usdc", ".usdz")
NOTHING = "nothing to render"
"""In the message about a stage that has no geometry."""
COLORS = {
    "ok": (90, 170, 90),
    "warned": (215, 160, 40),
    "empty": (130, 130, 130),
    "blank": (200, 80, 200),
    "error": (220, 60, 50),
    "time out": (220, 60, 50),
}


@dataclass
class Result:
    """What came of one file."""

    name: str
    kind: str
    seconds: float
    messages: list[str] = field(default_factory=list)
    picture: Path | None = None

    @property
    def status(self) -> str:
        """The kind, with the number of warnings and the time."""
        kind = f"{len(self.messages)} warned" if self.kind == "warned" else self.kind
        return f"{kind}, {self.seconds:.1f} s"

    @property
    def failed(self) -> bool:
        """Whether there should have been a picture."""
        return self.kind in ("error", "time out")


def find_files(folder: Path, only: list[str]) -> list[Path]:
    """USD files below `folder` in the order of their names; hidden folders are left out."""
    found = []
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder)
        hidden = any(part.startswith(".") for part in name.parts)
        wanted = not only or any(fnmatch(str(name), pattern) for pattern in only)
        if path.suffix.lower() in SUFFIXES and path.is_file() and wanted and not hidden:
            found.append(path)
    return found


def render(path: Path, name: str, picture: Path, flags: list[str], timeout: float) -> Result:
    """Renders one file into `picture`, in a process of its own."""
    command = [sys.executable, "-m", "hdtrapeze", "record", *flags, str(path), str(picture)]
    start = time.monotonic()
    try:
        run = subprocess.run(
            command, capture_output=True, text=True, timeout=timeout, errors="replace"
        )
    except subprocess.TimeoutExpired:
        return Result(name, "time out", time.monotonic() - start)
    return judge(name, run.returncode, run.stderr, picture, time.monotonic() - start)


def judge(name: str, code: int, said: str, picture: Path, seconds: float) -> Result:
    """What a process came to, by its exit code, what it said on stderr, and the picture."""
    lines = [line.strip() for line in said.splitlines() if line.strip()]
    if code != 0 or not picture.exists():
        return Result(name, "error", seconds, [*lines[-3:], f"exit code {code}"])
    warnings = [line.removeprefix("warning: ") for line in lines if line.startswith("warning: ")]
    nothing = any(NOTHING in line for line in warnings)
    kind = "empty" if nothing else "warned" if warnings else "ok"
    return Result(name, kind, seconds, warnings, picture)


def coverage(picture) -> float:
    """Mean alpha of an RGBA picture, from 0 to 1."""
    counts = picture.getchannel("A").histogram()
    return sum(i * count for i, count in enumerate(counts)) / (255.0 * sum(counts))


def chequered(width: int, height: int):
    """A background on which transparency shows."""
    from PIL import Image

    tile = Image.new("RGB", (width, height), (22, 26, 38))
    square = Image.new("RGB", (8, 8), (28, 33, 47))
    for y in range(0, height, 8):
        for x in range((y // 8 % 2) * 8, width, 16):
            tile.paste(square, (x, y))
    return tile


def paste(results: list[Result], width: int, columns: int):
    """The sheet: a tile for each result, all as wide as `width` and as high as the highest."""
    from PIL import Image, ImageDraw, ImageFont

    pictures = {}
    for result in results:
        if result.picture:
            with Image.open(result.picture) as image:
                pictures[result.name] = image.convert("RGBA")
            if result.kind in ("ok", "warned") and coverage(pictures[result.name]) < 0.001:
                result.kind = "blank"
    height = max((image.height for image in pictures.values()), default=width * 3 // 4)
    font, gap, line = ImageFont.load_default(12), 6, 15
    rows = -(-len(results) // columns)
    step_x, step_y = width + gap, height + 2 * line + gap
    sheet = Image.new("RGB", (columns * step_x + gap, rows * step_y + gap), (14, 14, 16))
    draw = ImageDraw.Draw(sheet)
    for i, result in enumerate(results):
        x, y = gap + i % columns * step_x, gap + i // columns * step_y
        background = chequered(width, height)
        picture = pictures.get(result.name)
        if picture:
            background.paste(picture, (0, (height - picture.height) // 2), picture)
        sheet.paste(background, (x, y))
        name = result.name
        while len(name) > 4 and draw.textlength(name, font) > width:
            name = "..." + name[4:]
        draw.text((x, y + height + 1), name, (230, 230, 230), font)
        draw.text((x, y + height + line), result.status, COLORS[result.kind], font)
    return sheet


def table(results: list[Result]) -> str:
    """One line for each result, and its messages below it."""
    width = max((len(result.name) for result in results), default=0)
    lines = []
    for result in results:
        lines.append(f"{result.name:{width}}  {result.status}")
        lines += [f"    {message}" for message in result.messages]
    kinds = [result.kind for result in results]
    counts = ", ".join(f"{kinds.count(kind)} {kind}" for kind in COLORS if kind in kinds)
    return "\n".join([*lines, f"{len(results)} files: {counts or 'none'}"])


def main(arguments: list[str]) -> int:
    """Runs the tool."""
    cores = os.cpu_count() or 1
    parser = argparse.ArgumentParser(
        description=__doc__.splitlines()[0],
        epilog="What follows -- are flags of `hdtrapeze record`.",
    )
    parser.add_argument("folder", type=Path, help="where the USD files are, at any depth")
    parser.add_argument("-o", "--output", type=Path, default=Path("out/contact_sheet.png"))
    parser.add_argument("--only", action="append", default=[], metavar="PATTERN", help="of names")
    parser.add_argument("--width", type=int, default=320, help="of a picture, in pixels")
    parser.add_argument("--samples", type=int, default=16, help="a pixel")
    parser.add_argument("--columns", type=int, default=6)
    parser.add_argument("--timeout", type=float, default=60.0, help="seconds for one file")
    parser.add_argument("--jobs", type=int, default=min(cores, 4), help="files at a time")
    split = arguments.index("--") if "--" in arguments else len(arguments)
    args, extra = parser.parse_args(arguments[:split]), arguments[split + 1 :]
    if not args.folder.is_dir():
        parser.error(f"{args.folder} is not a folder")
    files = find_files(args.folder, args.only)
    if not files:
        print(f"{args.folder} has no USD files", file=sys.stderr)
        return 1
    flags = ["--imageWidth", str(args.width), "--samples", str(args.samples)]
    flags += ["--threads", str(max(cores // max(args.jobs, 1), 1)), *extra]
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(max(args.jobs, 1)) as pool:
        jobs = [
            pool.submit(
                render,
                path,
                str(path.relative_to(args.folder)),
                Path(folder) / f"{i}.png",
                flags,
                args.timeout,
            )
            for i, path in enumerate(files)
        ]
        results = [job.result() for job in jobs]
        sheet = paste(results, args.width, min(args.columns, len(results)))
    args.output.parent.mkdir(parents=True, exist_ok=True)
    sheet.save(args.output)
    print(table(results))
    print(f"The sheet is {args.output}, {sheet.width} x {sheet.height}.")
    return 1 if any(result.failed for result in results) else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
