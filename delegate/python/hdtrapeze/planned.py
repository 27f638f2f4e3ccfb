"""What the library makes of products: which share a render, where they are written, or why not."""

from dataclasses import dataclass, field

from . import native


@dataclass
class Planned:
    """One file of a plan."""

    result: int
    """TRZ_OK, or why it is not written; then there is nothing below but `why`."""
    why: str
    """What the log has been told."""
    path: str = ""
    """Its file; empty for the command's own."""
    render: int = 0
    """Number of its render."""
    aovs: list[str] = field(default_factory=list)
    """AOVs of that render."""
    width: int = 0
    height: int = 0
    pixel_aspect: float = 1.0
    window_policy: int = 0
    """A TRZ_WINDOW constant."""
    data_window: tuple[int, int, int, int] = (0, 0, 0, 0)
    """As Options.data_window has it."""

    @property
    def is_written(self) -> bool:
        """Whether there is to be such a file."""
        return self.result == native.constants().TRZ_OK


def read_planned(plan, number: int) -> Planned:
    """A file of a trz_plan."""
    told = native.new("trz_planned")
    native.check(native.lib().trz_plan_describe(plan, number, told))
    planned = Planned(told.result, _text(told.why))
    if planned.is_written:
        settings = told.settings
        planned.path = _text(told.path)
        planned.render = told.render
        planned.aovs = [_text(told.aovs[i]) for i in range(told.aov_count)]
        planned.width, planned.height = settings.width, settings.height
        planned.pixel_aspect = settings.pixel_aspect
        planned.window_policy = settings.window_policy
        planned.data_window = tuple(settings.data_window)
    return planned


def _text(of_library) -> str:
    return native.ffi.string(of_library).decode("utf-8", "replace")
