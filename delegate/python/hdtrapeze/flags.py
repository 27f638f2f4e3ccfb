"""The flags of `hdtrapeze record`: usdrecord's, and the renderer's own."""

import argparse
import difflib
import re
import sys

from . import errors
from .named import settings
from .options import AOVS

COMPLEXITIES = {"low": 1.0, "medium": 0.7, "high": 0.5, "veryhigh": 0.25}
"""Factor on the shading rate. Subdivision surfaces are limit surfaces at every complexity."""

PRECEDENCE = """who decides, first to last:
  the image named here   flags; the RenderSettings prim; usdrecord's defaults. The prim's
                         resolution, pixel aspect, conform policy and data window count only where
                         -rs or -rp names it; with -w, and otherwise 960, the height follows from
                         the camera's aspect
  its camera             --camera; the RenderSettings prim's; the first camera named as the primary
                         camera (main_cam); else the bounds are framed
  render products        flags, but not -w and --camera; what the RenderProduct authors; the
                         RenderSettings prim and its schema's fallbacks. Products of the prim that
                         -rs or -rp names, or the stage's renderSettingsPrimPath, are written beside
                         the image that is named here; those that agree with it share its render.
  purposes               --purposes; includedPurposes of the RenderSettings prim; proxy

"""

EXIT_CODES = f"""exit codes:
  {errors.EXIT_OK}    every frame and product was written
  {errors.EXIT_RENDER}    the scene cannot be rendered as asked, or the renderer failed;
       --backend gpu where the CPU rendered all or the rest (the image is written)
  {errors.EXIT_USAGE}    the command is wrong
  {errors.EXIT_IO}    a file is missing, cannot be read or cannot be written
  {errors.EXIT_INTERRUPTED}  interrupted (Ctrl-C)
  {errors.EXIT_TERMINATED}  terminated (SIGTERM)
What an interrupted render had is kept beside the output as NAME.partial.exr or .png; the output
itself is only ever a complete frame.
"""


COMMANDS = ("record", "dump", "devices")


def see_help(arguments: list[str]) -> str:
    """Where the flags of the command that these arguments begin are told."""
    command = next((word for word in arguments if word in COMMANDS), COMMANDS[0])
    return f"See `hdtrapeze {command} --help`."


class _Parser(argparse.ArgumentParser):
    """Names the flag that was probably meant, and where to read on."""

    _see_help = see_help([])

    def parse_args(self, args=None, namespace=None):
        """As argparse does."""
        _Parser._see_help = see_help(sys.argv[1:] if args is None else args)
        return super().parse_args(args, namespace)

    def error(self, message):
        hints = []
        for word in re.findall(r"--?[A-Za-z][\w-]*", message):
            if "unrecognized arguments" not in message:
                break
            near = difflib.get_close_matches(word, self._known_flags(), 1, 0.6)
            if near and near[0] != word:
                hints.append(f"Did you mean {near[0]}?")
        found = re.search(r"argument (--?[A-Za-z]\w*)\S*: expected one argument", message)
        if found:
            # argparse takes -2:0 for a flag.
            text = f"A value that begins with a minus needs an equals sign: {found[1]}=-2"
            hints.append(text.replace("-2", "-2:0") if "frames" in found[1] else text)
        self.print_usage(sys.stderr)
        text = " ".join([message.rstrip(".") + ".", *hints]) if hints else message
        self.exit(errors.EXIT_USAGE, f"error: {text}\n{self._see_help}\n")

    def _known_flags(self) -> list[str]:
        """Flags of this parser and of its commands."""
        flags = list(self._option_string_actions)
        for action in self._actions:
            if isinstance(action, argparse._SubParsersAction):
                for command in action.choices.values():
                    flags += command._option_string_actions
        return flags


def _number(text: str) -> int | float:
    """An int where it is written as one (pixels), else a float (a fraction)."""
    try:
        return int(text)
    except ValueError:
        return float(text)


def make_parser(version: str) -> argparse.ArgumentParser:
    """The parser of the whole command line."""
    parser = _Parser(
        prog="hdtrapeze",
        description="Renders USD stages with defocus and motion blur.",
        allow_abbrev=False,
    )
    parser.add_argument("--version", action="version", version=f"hdtrapeze {version}")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    record = commands.add_parser(
        "record",
        help="render a USD file to an EXR or PNG, with usdrecord's flags",
        description="Renders frames of a USD file to OpenEXR or PNG. Takes usdrecord's flags.",
        epilog=PRECEDENCE + EXIT_CODES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    add_record_flags(record)
    dump = commands.add_parser(
        "dump",
        help="print the scene of a USD file as the renderer understands it",
        description="Prints prims, motion keys, instances, camera, settings and products as text.",
        epilog="The flags that choose what is rendered are those of `hdtrapeze record`.",
        allow_abbrev=False,
    )
    add_dump_flags(dump)
    commands.add_parser(
        "devices",
        help="list GPUs, and say what --backend makes of them",
        description="Lists GPUs with their limits, and says what each --backend uses, and why.",
        allow_abbrev=False,
    )
    return parser


def add_dump_flags(parser: argparse.ArgumentParser) -> None:
    """Adds every flag of `dump`."""
    parser.add_argument("usdFilePath", help="the USD file to read")
    parser.add_argument("--output", "-o", metavar="FILE", help="write to a file, not to stdout")
    _add_usdrecord_flags(parser.add_argument_group("as usdrecord"))
    _add_render_flags(parser.add_argument_group("rendering"))
    _add_output_flags(parser.add_argument_group("messages"))


def add_record_flags(parser: argparse.ArgumentParser) -> None:
    """Adds every flag of `record`."""
    parser.add_argument("usdFilePath", help="the USD file to render")
    parser.add_argument(
        "outputImagePath",
        help="the image to write, .exr or .png; ### (or ###.##) in it is the frame of --frames",
    )
    _add_usdrecord_flags(parser.add_argument_group("as usdrecord"))
    _add_render_flags(parser.add_argument_group("rendering"))
    _add_output_flags(parser.add_argument_group("output and messages"))


def _add_usdrecord_flags(group) -> None:
    add = group.add_argument
    add("--mask", metavar="PRIMPATH[,...]", help="only these prims, their children and parents")
    add(
        "--purposes",
        metavar="PURPOSE[,...]",
        help="purposes rendered besides default: proxy, render, guide (default: the render "
        "settings' includedPurposes, else proxy)",
    )
    add("--sessionLayer", metavar="FILE", help="session layer in place of an empty one")
    add(
        "--resolverContext",
        choices=("root", "inherit"),
        default="root",
        help="asset resolver context: the root layer's, or the environment's (default: root)",
    )
    add("--camera", "-cam", metavar="CAMERA", help="path or name of the camera")
    times = group.add_mutually_exclusive_group()
    times.add_argument("--defaultTime", "-d", action="store_true", help="render the default time")
    times.add_argument(
        "--frames",
        "-f",
        metavar="FRAMESPEC[,...]",
        help="frames to render: 12, 1:10, 10:1, 1:10x2, 1:2x0.5 (default: the stage's first)",
    )
    add(
        "--complexity",
        "-c",
        choices=tuple(COMPLEXITIES),
        default="low",
        help="medium, high and veryhigh refine the shading rate; surfaces are smooth at each (low)",
    )
    add(
        "--colorCorrectionMode",
        "-color",
        choices=("disabled", "sRGB", "openColorIO"),
        help="encoding of color (default: sRGB for PNG, disabled, that is linear, for EXR)",
    )
    add("--renderer", "-r", metavar="NAME", help="only Trapeze (default: Trapeze)")
    add("--imageWidth", "-w", type=int, metavar="PIXELS", help="width of the image (960)")
    add(
        "--renderPassPrimPath",
        "-rp",
        metavar="PATH",
        help="RenderPass prim: its collections, and the RenderSettings of its renderSource",
    )
    add(
        "--renderSettingsPrimPath",
        "-rs",
        metavar="PATH",
        help="RenderSettings prim to render with (default: the stage's renderSettingsPrimPath)",
    )
    add("--disableCameraLight", action="store_true", help="no light at the camera")
    add("--disableDrawMode", action="store_true", help="ignore draw modes of models")
    add("--disableGpu", action="store_true", help="never use the GPU")
    add("--enableDomeLightVisibility", action="store_true", help="accepted; lights come later")
    add("--traceToFile", metavar="FILE", help="write how long each phase took")
    add("--traceFormat", choices=("chrome", "trace"), default="chrome", help="default: chrome")
    add("--memstats", action="store_true", help="print the memory that was used")
    add(
        "--abortOnError",
        action="store_true",
        help="stop at the first warning about the scene, and at a frame that fails",
    )


def _add_setting(group, flag: str, name: str, **more) -> None:
    """A flag of one of the renderer's settings."""
    setting = settings()[name]
    default = setting.default
    if setting.kind is bool:
        group.add_argument(flag, action="store_true", help=setting.doc)
        return
    if setting.kind is tuple:
        more |= {"type": float, "nargs": 2}
    elif setting.words:
        more["choices"] = setting.words
    else:
        more["type"] = setting.kind
    shown = default if isinstance(default, str | None) else f"{default:g}"
    group.add_argument(flag, help=setting.doc + (f" ({shown})" if shown else ""), **more)


def _add_render_flags(group) -> None:
    add = group.add_argument
    _add_setting(group, "--samples", "samples", metavar="N")
    _add_setting(group, "--shading-rate", "shadingRate", metavar="PIXELS")
    _add_setting(group, "--shutter", "shutter", metavar=("OPEN", "CLOSE"))
    _add_setting(group, "--curves", "curves")
    _add_setting(group, "--cull", "cull")
    _add_setting(group, "--no-motion-blur", "disableMotionBlur")
    _add_setting(group, "--no-defocus", "disableDepthOfField")
    add(
        "--no-occlusion-culling",
        action="store_true",
        help="dice hidden surfaces too; the image is the same",
    )
    _add_setting(group, "--filter", "filter")
    _add_setting(group, "--filter-width", "filterWidth", metavar="PIXELS")
    _add_setting(group, "--seed", "seed", metavar="N")
    add(
        "--crop",
        type=_number,
        nargs=4,
        metavar=("X0", "Y0", "X1", "Y1"),
        help="render only this part: whole numbers are pixels, 0.0 to 1.0 fractions; y down",
    )
    add(
        "--overscan",
        type=_number,
        metavar="PIXELS",
        help="also render so much on each side of the image: whole numbers are pixels, others "
        "fractions of its size; in an EXR, as its data window",
    )
    _add_setting(group, "--threads", "threads", metavar="N")
    _add_setting(group, "--backend", "backend")


def _add_output_flags(group) -> None:
    add = group.add_argument
    add(
        "--aov",
        action="append",
        default=[],
        metavar="NAME",
        help=f"also write this AOV to the EXR (repeatable): {', '.join(AOVS[1:])}, or "
        "primvars:NAME for a primvar",
    )
    pixels = group.add_mutually_exclusive_group()
    pixels.add_argument("--half", action="store_true", help="16-bit EXR pixels (default)")
    pixels.add_argument("--float", action="store_true", help="32-bit EXR pixels")
    _add_setting(group, "--compression", "compression")
    add("--no-products", action="store_true", help="write only the image that is named here")
    add("--explain", action="store_true", help="print which effects are simulated, and why")
    loudness = group.add_mutually_exclusive_group()
    loudness.add_argument("--quiet", "-q", action="store_true", help="only errors")
    loudness.add_argument("--verbose", "-v", action="store_true", help="statistics and more")
