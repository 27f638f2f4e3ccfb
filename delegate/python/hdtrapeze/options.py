"""What a render is asked for, whoever asks: the command line, a script, a test."""

import math
from dataclasses import dataclass, field

import numpy as np

from .curves import FORMS
from .errors import SceneError, UsageError

FILTERS = {
    "box": "BOX",
    "gaussian": "GAUSSIAN",
    "mitchell": "MITCHELL",
    "blackman-harris": "BLACKMAN_HARRIS",
}
WINDOW_POLICIES = {
    "matchHorizontally": "MATCH_HORIZONTALLY",
    "matchVertically": "MATCH_VERTICALLY",
    "fit": "FIT",
    "crop": "CROP",
    "dontConform": "DONT_CONFORM",
}
AOVS = (
    "color",
    "depth",
    "cameraDepth",
    "P",
    "normal",
    "Neye",
    "primId",
    "instanceId",
    "elementId",
    "subsetId",
    "motionVectors",
    "sampleCount",
    "cost",
)
"""AOVs that the renderer knows; it warns about others."""

CULLS = {
    "none": "NONE",
    "back": "BACK",
    "front": "FRONT",
    "backUnlessDoubleSided": "BACK_UNLESS_DOUBLE_SIDED",
}
"""Sides of surfaces that rays pass through."""

COMPRESSIONS = ("none", "rle", "zips", "zip", "piz")
PIXEL_TYPES = ("half", "float")
BACKENDS = {"auto": "AUTO", "cpu": "CPU", "gpu": "GPU"}


@dataclass
class Options:
    """Everything but the stage and the frame. Checked by `validate`."""

    width: int = 960
    height: int | None = None
    """None: from the camera's aspect, as usdrecord does."""
    samples: int = 64
    shading_rate: float = 1.0
    """Micropolygon edge in pixels."""
    shutter: tuple[float, float] | None = None
    """In place of the camera's, in time codes relative to the frame."""
    motion_blur: bool = True
    defocus: bool = True
    aovs: list[str] = field(default_factory=lambda: ["color"])
    filter: str = "gaussian"
    filter_width: float = 0.0
    """Pixels; 0 for the filter's own."""
    seed: int = 0
    threads: int = 0
    crop: tuple[float, float, float, float] | None = None
    """x0, y0, x1, y1, half open, y down: pixels (all int), or fractions (float)."""
    overscan: float = 0
    """Rendered around the image on each side: pixels (int), or a fraction of the image's width to
    the left and right and of its height above and below (float)."""
    data_window_ndc: tuple[float, float, float, float] | None = None
    """UsdRender's dataWindowNDC: xmin, ymin, xmax, ymax, y up, 0 to 1 is the image. A pixel whose
    centre is inside is rendered. Crop and overscan take its place."""
    backend: str = "auto"
    camera: str | None = None
    purposes: list[str] = field(default_factory=lambda: ["proxy"])
    camera_light: bool = True
    draw_modes: bool = True
    window_policy: str = "matchVertically"
    """usdrecord's: heights that follow the camera's aspect are rounded down, and kept."""
    pixel_aspect: float = 1.0
    time_window: tuple[float, float] = (0.0, 1.0)
    """Part of the shutter that is sampled; dicing still sees all of it."""
    lens_point: tuple[float, float] | None = None
    """One point of the unit lens disk for every sample."""
    max_micropolygons: int | None = None
    curves: str = "auto"
    """A key of curves.FORMS: what curves without normals are rendered as."""
    cull: str = "none"
    """A key of CULLS."""
    occlusion_culling: bool = True
    """Dice what may be hidden when a ray first comes near it; the image is the same without."""
    compression: str = "zip"
    """Of EXR files."""
    pixel_type: str = "half"
    """Of EXR files: half, or float for 32 bits. Ids and depths have 32 in either."""

    def validate(self) -> None:
        """Raises UsageError where a value makes no sense."""

        def require(good: bool, text: str) -> None:
            if not good:
                raise UsageError(text)

        require(1 <= self.width <= 1 << 16, "The image width must be from 1 to 65536 pixels.")
        require(
            self.height is None or 1 <= self.height <= 1 << 16,
            "The image height must be from 1 to 65536 pixels.",
        )
        require(1 <= self.samples <= 1 << 20, "Samples must be from 1 to 1048576 a pixel.")
        require(
            np.float32(0.01) <= np.float32(self.shading_rate) <= 1000.0,
            "The shading rate must be from 0.01 to 1000 pixels.",
        )
        require(self.filter in FILTERS, f"The filter must be one of {', '.join(FILTERS)}.")
        require(0.0 <= self.filter_width <= 32.0, "The filter width must be from 0 to 32 pixels.")
        require(self.backend in BACKENDS, f"The backend must be one of {', '.join(BACKENDS)}.")
        require(
            self.window_policy in WINDOW_POLICIES,
            f"The window policy must be one of {', '.join(WINDOW_POLICIES)}.",
        )
        require(
            0.001 <= self.pixel_aspect <= 1000.0,
            "The pixel aspect ratio must be from 0.001 to 1000.",
        )
        require(
            self.max_micropolygons is None or 0 < self.max_micropolygons < 1 << 63,
            "The micropolygons must be at least 1.",
        )
        for value, known, what in (
            (self.compression, COMPRESSIONS, "compression"),
            (self.pixel_type, PIXEL_TYPES, "pixel type"),
        ):
            require(value in known, f"The {what} must be one of {', '.join(known)}.")
        require(0 <= self.seed < 1 << 32, "The seed must be from 0 to 4294967295.")
        require(0 <= self.threads <= 4096, "Threads must be from 0 (all) to 4096.")
        require(self.curves in FORMS, f"Curves must be one of {', '.join(FORMS)}.")
        require(self.cull in CULLS, f"Culled sides must be one of {', '.join(CULLS)}.")
        require(bool(self.aovs), "At least one AOV must be asked for.")
        known = ("default", "proxy", "render", "guide")
        for purpose in self.purposes:
            require(purpose in known, f"{purpose!r} is no purpose: they are {', '.join(known)}.")
        if self.shutter is not None:
            opens, closes = self.shutter
            require(
                math.isfinite(opens) and math.isfinite(closes), "The shutter must be two numbers."
            )
            require(
                opens <= closes, f"The shutter closes ({closes:g}) before it opens ({opens:g})."
            )
            require(abs(opens) < 1e6 and abs(closes) < 1e6, "The shutter is absurdly long.")
        if self.crop is not None:
            x0, y0, x1, y1 = self.crop
            require(x0 < x1 and y0 < y1, "The crop must have x0 < x1 and y0 < y1.")
            text = (
                "The crop begins outside of the image, at {:g}, {:g}; overscan is what adds to it."
            )
            require(x0 >= 0 and y0 >= 0, text.format(x0, y0))
            if any(isinstance(value, float) for value in self.crop):
                require(x1 <= 1 and y1 <= 1, "A crop in fractions must lie within 0 to 1.")
            require(not self.overscan, "A crop and overscan contradict each other.")
        most = 1 << 15 if isinstance(self.overscan, int) else 2.0
        require(0 <= self.overscan <= most, f"The overscan must be from 0 to {most:g}.")
        if self.data_window_ndc is not None:
            x0, y0, x1, y1 = self.data_window_ndc
            require(x0 < x1 and y0 < y1, "The data window must have xmin < xmax and ymin < ymax.")
            require(
                max(map(abs, self.data_window_ndc)) <= 100,
                "The data window reaches absurdly far out of the image.",
            )

    def resolution(self, aspect: float) -> tuple[int, int]:
        """Width and height for a camera of this aspect."""
        if self.height is not None:
            return self.width, self.height
        return self.width, max(int(np.float32(self.width) / np.float32(aspect)), 1)

    def shape_of_pixels(self, aspect: float, width: int, height: int) -> float:
        """Pixel width over height: where the window does not conform, what makes up for it."""
        if self.window_policy != "dontConform":
            return self.pixel_aspect
        return aspect * height / width

    def data_window(self, width: int, height: int) -> tuple[int, int, int, int]:
        """Pixels to render, x0, y0, x1, y1, half open, y down; all zero for the whole image.

        Raises UsageError or, for a data window, SceneError where there is none, or too many.
        """
        if self.crop is not None:
            window = self._crop_pixels(width, height)
        elif self.overscan:
            x = y = self.overscan
            if isinstance(x, float):
                x, y = round(x * width), round(y * height)
            window = -x, -y, width + x, height + y
        elif self.data_window_ndc is not None:
            left, bottom, right, top = self.data_window_ndc
            # Pixel i has its centre at i + 1/2. A centre on the left or the bottom edge is inside,
            # one on the right or the top edge is not.
            window = (
                math.ceil(left * width - 0.5),
                height - math.ceil(top * height - 0.5),
                math.ceil(right * width - 0.5),
                height - math.ceil(bottom * height - 0.5),
            )
        else:
            return 0, 0, 0, 0
        x0, y0, x1, y1 = window
        # A data window is the scene's, the others are the command's.
        fault = UsageError if self.crop is not None or self.overscan else SceneError
        if x0 >= x1 or y0 >= y1:
            kind = "crop" if self.crop is not None else "data window"
            raise fault(f"The {kind} holds no pixel of an image of {width} x {height}.")
        if max(x1, width) - min(x0, 0) > 1 << 16 or max(y1, height) - min(y0, 0) > 1 << 16:
            raise fault("The image and its overscan span more than 65536 pixels.")
        return window

    def _crop_pixels(self, width: int, height: int) -> tuple[int, int, int, int]:
        x0, y0, x1, y1 = self.crop
        if any(isinstance(value, float) for value in self.crop):
            x0, x1 = round(x0 * width), round(x1 * width)
            y0, y1 = round(y0 * height), round(y1 * height)
        return x0, y0, min(x1, width), min(y1, height)
