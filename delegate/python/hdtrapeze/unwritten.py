"""What a command was asked for and did not write, for its exit code.

Everything else is rendered and written first; of each there has been a warning with the reason.
"""

from dataclasses import dataclass, field

from . import native
from .errors import HdTrapezeError, OutputError, SceneError
from .planned import Planned


@dataclass
class Unwritten:
    """Paths of render products; the command's own image is "the image that is named"."""

    refused: list[str] = field(default_factory=list)
    """They cannot be rendered as asked: without a name, a camera, a file of their own..."""
    failed: list[str] = field(default_factory=list)
    """A file could not be written."""

    def add(self, path: str, file: Planned) -> None:
        """Counts a file that the library has planned not to write; it has told why."""
        constants = native.constants()
        if file.result == constants.TRZ_ERROR_IO:
            self.failed.append(path)
        elif file.result != constants.TRZ_ERROR_UNSUPPORTED:
            self.refused.append(path)

    def error(self) -> HdTrapezeError | None:
        """What the command ends with: the disk's faults before the scene's."""
        names = list(dict.fromkeys(name or "the image that is named" for name in self._all()))
        if not names:
            return None
        text = f"Not everything was written: {', '.join(names)}."
        return OutputError(text) if self.failed else SceneError(text)

    def _all(self) -> list[str]:
        return [*self.failed, *self.refused]
