"""Renders the demo scene once and writes it twice: out/demo.exr and out/demo.png.

Takes the flags of `hdtrapeze record`: `scripts/demo.py --samples 16` is quick.
"""

import sys
from pathlib import Path

from hdtrapeze.errors import HdTrapezeError
from hdtrapeze.flags import make_parser
from hdtrapeze.log import SceneLog
from hdtrapeze.progress import ProgressBar
from hdtrapeze.record import make_options, write
from hdtrapeze.render import Renderer
from hdtrapeze.stage import open_stage

ROOT = Path(__file__).resolve().parent.parent
SCENE = ROOT / "examples/demo/demo.usda"
FRAME = 1.0
DEFAULTS = ["--camera", "/World/Camera", "--samples", "256"]
AOVS = ["--aov", "cameraDepth", "--aov", "normal", "--aov", "motionVectors", "--aov", "primId"]


def main(flags: list[str]) -> int:
    """Renders, writes, names the files."""
    exr, png = ROOT / "out/demo.exr", ROOT / "out/demo.png"
    exr.parent.mkdir(exist_ok=True)
    command = ["record", *DEFAULTS, *AOVS, *flags, str(SCENE), str(exr)]
    args = make_parser("").parse_args(command)
    try:
        with Renderer(make_options(args), SceneLog()) as renderer:
            renderer.load(open_stage(args.usdFilePath), FRAME)
            with ProgressBar(SCENE.name, args.quiet) as bar:
                renderer.render(bar)
            write(renderer, str(exr), "EXR", args, FRAME, complete=True)
            write(renderer, str(png), "PNG", args, FRAME, complete=True)
            seconds = renderer.statistics()["total_seconds"]
    except HdTrapezeError as error:
        print(f"error: {error}", file=sys.stderr)
        return error.exit_code
    print(f"The demo took {seconds:.1f} s at {args.samples} samples a pixel. It is in")
    print(f"    {exr}\n    {png}")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
