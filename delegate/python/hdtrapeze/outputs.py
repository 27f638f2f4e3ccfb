"""The files of a render: where they are, and what is in them.

A file is either the one that the command names, or a render product's, whose place the library
plans.
"""

import json
import os
from dataclasses import dataclass, field
from pathlib import Path

from .errors import NativeError, OutputError, UsageError
from .frames import OutputPath
from .native import version
from .options import Options
from .products import RenderVar

FORMATS = {".exr": "EXR", ".png": "PNG"}


@dataclass
class Output:
    """One file a frame."""

    options: Options
    """The compression, the pixel type, and without vars the AOVs."""
    path: str
    owner: str = ""
    """Path of the product, empty for the command's own file."""
    vars: list[RenderVar] = field(default_factory=list)
    """What a product holds; without any, the AOVs of the options."""
    color: str | None = None
    """sRGB, disabled, or as the kind of file asks for."""
    metadata: dict[str, str] = field(default_factory=dict)

    def write(self, renderer, facts: dict[str, str], partial: bool = False) -> None:
        """Writes what was rendered; raises OutputError and leaves what was there."""
        kind = FORMATS[Path(self.path).suffix.lower()]
        color = self.color or ("sRGB" if kind == "PNG" else "disabled")
        aovs = [] if self.vars else self.options.aovs
        facts = facts | self.metadata | {"hdtrapeze/complete": "true"}
        try:
            renderer.session.write_image(
                self.path,
                kind,
                aovs if kind == "EXR" or self.vars else ["color"],
                facts if kind == "EXR" else {},
                self.options.named(),
                color="SRGB" if color == "sRGB" else "LINEAR",
                render_vars=self.vars,
                partial=partial,
            )
        except NativeError as error:
            raise OutputError(f"{self.path} cannot be written: {error}") from None

    def write_partial(self, renderer, facts: dict[str, str]) -> str:
        """Keeps what an interrupted render had, beside the place of the complete frame; gives the
        file."""
        self.write(renderer, facts, partial=True)
        whole = Path(self.path)
        return str(whole.with_name(f"{whole.stem}.partial{whole.suffix}"))


def own_kind(output: OutputPath, has_aovs: bool) -> str:
    """EXR or PNG of the command's own file; raises where it cannot be written."""
    path = Path(output.path)
    kind = FORMATS.get(path.suffix.lower())
    if not output.path:
        raise UsageError("The output has no name.")
    if kind is None:
        raise UsageError(
            f"{output.path}: the output must be a name that ends in .exr or .png"
            + (f", not {path.suffix}." if path.suffix else ".")
        )
    if kind == "PNG" and has_aovs:
        raise UsageError("A PNG holds only color: write an .exr for --aov.")
    check_writable(path)
    return kind


def check_writable(path: Path) -> None:
    """Raises OutputError where no file can be written at `path`."""
    folder = path.parent
    try:
        found, taken = folder.is_dir(), path.is_dir()
    except OSError as error:
        raise OutputError(f"{path} cannot be written: {error.strerror}.") from None
    if not found:
        raise OutputError(f"The folder {folder} does not exist.")
    if taken:
        raise OutputError(f"{path} is a folder.")
    if not os.access(folder, os.W_OK):
        raise OutputError(f"The folder {folder} is not writable.")


def metadata(renderer, stage_file: str, frame: float | None) -> dict[str, str]:
    """What an EXR says about its making, besides what the renderer adds (samples, shutter...)."""
    options = vars(renderer.options)
    statistics = renderer.statistics()
    timings = {k: round(v, 6) for k, v in statistics.items() if k.endswith("_seconds")}
    return {
        "hdtrapeze/version": version(),
        "hdtrapeze/stage": str(Path(stage_file).resolve()),
        "hdtrapeze/camera": renderer.camera.path or "framing the bounds",
        "hdtrapeze/frame": "default" if frame is None else f"{frame:.10g}",
        "hdtrapeze/settings": json.dumps(options),
        "hdtrapeze/timings": json.dumps(timings),
    }
