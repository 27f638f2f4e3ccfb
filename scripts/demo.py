"""Renders the demo scene once and writes it twice: out/demo.exr and out/demo.png.

Takes the flags of `hdtrapeze record`: `scripts/demo.py --samples 16` is quick.
"""

import sys
from pathlib import Path

from hdtrapeze.errors import HdTrapezeError
from hdtrapeze.flags import make_parser
from hdtrapeze.log import SceneLog
from hdtrapeze.outputs import Output, metadata
from hdtrapeze.progress import ProgressBar
from hdtrapeze.render import Renderer
from hdtrapeze.request import make_request
from hdtrapeze.stage import open_stage

ROOT = Path(__file__).resolve().parent.parent
SCENE = ROOT / "examples/demo/demo.usda"
OUT = ROOT / "out"
FRAME = 1.0
DEFAULTS = ["--camera", "/World/Camera", "--samples", "256"]
AOVS = ["--aov", "cameraDepth", "--aov", "normal", "--aov", "motionVectors", "--aov", "primId"]


def main(flags: list[str]) -> int:
    """Renders, writes, names the files."""
    exr, png = OUT / "demo.exr", OUT / "demo.png"
    OUT.mkdir(exist_ok=True)
    command = ["record", *DEFAULTS, *AOVS, *flags, str(SCENE), str(exr)]
    args = make_parser("").parse_args(command)
    try:
        log = SceneLog()
        stage = open_stage(args.usdFilePath)
        request = make_request(args, stage, log)
        with Renderer(request.options, log) as renderer:
            renderer.load(stage, FRAME, request.camera)
            with ProgressBar(SCENE.name, args.quiet) as bar:
                renderer.render(bar)
            facts = metadata(renderer, args.usdFilePath, FRAME)
            for path in (exr, png):
                Output(request.options, str(path)).write(renderer, facts)
            seconds = renderer.statistics()["total_seconds"]
    except HdTrapezeError as error:
        print(f"error: {error}", file=sys.stderr)
        return error.exit_code
    print(f"The demo took {seconds:.1f} s at {args.samples} samples a pixel. It is in")
    print(f"    {exr}\n    {png}")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
