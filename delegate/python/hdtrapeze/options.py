"""What a render is asked for, whoever asks: the command line, a script, a test."""

from dataclasses import dataclass, field, replace

import numpy as np

from . import native
from .errors import NativeError, SceneError, UsageError
from .named import settings
from .planned import Planned

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


def _own(name: str):
    """A field with the default of the renderer's setting of that name."""
    return field(default_factory=lambda: settings()[name].default)


@dataclass
class Options:
    """Everything but the stage and the frame. Checked by `validate`.

    Fields that are settings of the renderer (see named) have its defaults, and its ranges.
    """

    width: int = 960
    height: int | None = None
    """None: from the camera's aspect, as usdrecord does."""
    samples: int = _own("samples")
    shading_rate: float = _own("shadingRate")
    """Micropolygon edge in pixels."""
    shutter: tuple[float, float] | None = _own("shutter")
    """In place of the camera's, in time codes relative to the frame."""
    motion_blur: bool = True
    defocus: bool = True
    aovs: list[str] = field(default_factory=lambda: ["color"])
    filter: str = _own("filter")
    filter_width: float = _own("filterWidth")
    """Pixels; 0 for the filter's own."""
    seed: int = _own("seed")
    threads: int = _own("threads")
    crop: tuple[float, float, float, float] | None = None
    """x0, y0, x1, y1, half open, y down: pixels (all int), or fractions (float)."""
    overscan: float = 0
    """Rendered around the image on each side: pixels (int), or a fraction of the image's width to
    the left and right and of its height above and below (float)."""
    data_window_ndc: tuple[float, float, float, float] | None = None
    """UsdRender's dataWindowNDC: xmin, ymin, xmax, ymax, y up, 0 to 1 is the image. A pixel whose
    centre is inside is rendered. Crop and overscan take its place."""
    planned_window: tuple[int, int, int, int] | None = None
    """The same as `data_window` gives it: of an image that the library planned."""
    backend: str = _own("backend")
    camera: str | None = None
    purposes: list[str] = field(default_factory=lambda: ["proxy"])
    camera_light: bool = _own("cameraLight")
    draw_modes: bool = True
    window_policy: str = "matchVertically"
    """usdrecord's: heights that follow the camera's aspect are rounded down, and kept."""
    pixel_aspect: float = 1.0
    time_window: tuple[float, float] = (0.0, 1.0)
    """Part of the shutter that is sampled; dicing still sees all of it."""
    lens_point: tuple[float, float] | None = None
    """One point of the unit lens disk for every sample."""
    max_micropolygons: int = _own("maxMicropolygons")
    """0 for the renderer's own."""
    curves: str = _own("curves")
    """What curves without normals are rendered as."""
    cull: str = _own("cull")
    """Sides of surfaces that rays pass through."""
    occlusion_culling: bool = True
    """Dice what may be hidden when a ray first comes near it; the image is the same without."""
    compression: str = _own("compression")
    """Of EXR files."""
    pixel_type: str = _own("pixelType")
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
        require(
            self.window_policy in WINDOW_POLICIES,
            f"The window policy must be one of {', '.join(WINDOW_POLICIES)}.",
        )
        require(
            0.001 <= self.pixel_aspect <= 1000.0,
            "The pixel aspect ratio must be from 0.001 to 1000.",
        )
        for name, value in self.named().items():
            setting = settings()[name]
            try:
                setting.value(value)
            except (TypeError, ValueError) as error:
                what = f"{setting.title} cannot be {_shown(value)}"
                raise UsageError(f"{what}: {error}.") from None
        require(bool(self.aovs), "At least one AOV must be asked for.")
        known = ("default", "proxy", "render", "guide")
        for purpose in self.purposes:
            require(purpose in known, f"{purpose!r} is no purpose: they are {', '.join(known)}.")
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
            try:
                self._pixels_of_ndc(self.width, self.height or self.width)
            except NativeError as error:
                cannot_be = error.code == native.constants().TRZ_ERROR_INVALID_ARGUMENT
                require(not cannot_be, _sentence(error))

    @property
    def is_windowed(self) -> bool:
        """Whether a crop or overscan takes the place of data windows."""
        return self.crop is not None or bool(self.overscan)

    def named(self) -> dict:
        """Values of the renderer's settings by name, but for those without one."""
        values = {name: getattr(self, own.field, None) for name, own in settings().items()}
        values |= {
            "disableMotionBlur": not self.motion_blur,
            "disableDepthOfField": not self.defocus,
        }
        return {name: value for name, value in values.items() if value is not None}

    def image(self, aspect: float) -> dict:
        """The other fields of trz_settings, for a camera of this aspect."""
        window = self.data_window(*self.resolution(aspect))
        return self.whole_image(aspect) | {"data_window": window}

    def whole_image(self, aspect: float) -> dict:
        """Those fields without the data window."""
        width, height = self.resolution(aspect)
        policy = WINDOW_POLICIES[self.window_policy]
        return self.of_no_shape() | {
            "width": width,
            "height": height,
            "pixel_aspect": self.shape_of_pixels(aspect, width, height),
            "window_policy": getattr(native.constants(), f"TRZ_WINDOW_{policy}"),
        }

    def of_no_shape(self) -> dict:
        """Those that the image's shape has no part in."""
        return {
            "time_window": self.time_window,
            "fix_lens": self.lens_point is not None,
            "lens_point": self.lens_point or (0.0, 0.0),
            "occlusion_culling": self.occlusion_culling,
        }

    def planned(self, planned: Planned) -> "Options":
        """These options with the shape and the AOVs of an image that the library planned."""
        constants = native.constants()
        policies = {
            getattr(constants, f"TRZ_WINDOW_{word}"): name for name, word in WINDOW_POLICIES.items()
        }
        return replace(
            self,
            width=planned.width,
            height=planned.height,
            planned_window=planned.data_window,
            pixel_aspect=planned.pixel_aspect,
            window_policy=policies[planned.window_policy],
            aovs=planned.aovs,
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
        elif self.planned_window is not None:
            return self.planned_window
        elif self.data_window_ndc is not None:
            try:
                return self._pixels_of_ndc(width, height)
            except NativeError as error:
                raise SceneError(_sentence(error)) from None
        else:
            return 0, 0, 0, 0
        x0, y0, x1, y1 = window
        if x0 >= x1 or y0 >= y1:
            raise UsageError(f"The crop holds no pixel of an image of {width} x {height}.")
        if max(x1, width) - min(x0, 0) > 1 << 16 or max(y1, height) - min(y0, 0) > 1 << 16:
            raise UsageError("The image and its overscan span more than 65536 pixels.")
        return window

    def _pixels_of_ndc(self, width: int, height: int) -> tuple[int, int, int, int]:
        ndc, out = native.ffi.new("float[4]", self.data_window_ndc), native.ffi.new("int32_t[4]")
        native.check(native.lib().trz_data_window(ndc, width, height, out))
        return tuple(out)

    def _crop_pixels(self, width: int, height: int) -> tuple[int, int, int, int]:
        x0, y0, x1, y1 = self.crop
        if any(isinstance(value, float) for value in self.crop):
            x0, x1 = round(x0 * width), round(x1 * width)
            y0, y1 = round(y0 * height), round(y1 * height)
        return x0, y0, min(x1, width), min(y1, height)


def _sentence(error: Exception) -> str:
    text = str(error)
    return f"{text[:1].upper()}{text[1:]}."


def _shown(value) -> str:
    if isinstance(value, tuple | list):
        return " ".join(map(_shown, value))
    return f"{value:g}" if isinstance(value, float) else str(value)
