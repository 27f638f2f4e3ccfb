"""Messages to people: Python's logging, one line each, and no line twice.

Everything goes to the logger `hdtrapeze`. A message about a prim carries its path and a stable
code; per run it is shown once per prim, code and text, whichever side (this package or the
renderer) says it, and however many frames repeat it. On the command line the lines go to stderr as
`warning: /prim/path: text`, above the progress bar.
"""

import logging
import sys

logger = logging.getLogger("hdtrapeze")

FALLBACK = "backend"
"""The code of the library's warning that the CPU renders what a GPU was to, or the rest of it."""


class SceneLog:
    """Collects what is said about one scene, and says it once."""

    def __init__(self):
        self._seen: set[tuple[str, str, str, int]] = set()
        self.warnings: list[tuple[str, str, str]] = []
        """(prim path, code, text) of every warning or error said, in order."""
        self.frame: float | None = None
        """The frame that is rendered; it is named where the CPU steps in for a GPU."""

    def say(self, level: int, path: str, code: str, text: str) -> None:
        """Logs `text` about the prim at `path`, unless that was said before."""
        if code == FALLBACK and self.frame is not None:
            text = f"frame {self.frame:g}: {text}"
        if level >= logging.WARNING:
            key = (path, code, text, level)
            if key in self._seen:
                return
            self._seen.add(key)
            self.warnings.append((path, code, text))
        logger.log(level, "%s: %s" if path else "%s%s", path, text)

    def warn(self, path, code: str, text: str) -> None:
        """A warning about a prim."""
        self.say(logging.WARNING, str(path), code, text)


class CommandHandler(logging.Handler):
    """Writes records to stderr as `level: text` without breaking a progress bar."""

    def emit(self, record):
        try:
            from tqdm import tqdm

            name = "info" if record.levelno < logging.WARNING else record.levelname.lower()
            tqdm.write(f"{name}: {record.getMessage()}", file=sys.stderr)
        except Exception:  # logging must never end a render
            self.handleError(record)


def set_up_command(quiet: bool, verbose: bool) -> None:
    """Sends the package's messages to stderr: warnings, or errors only, or all."""
    level = logging.INFO if verbose else logging.ERROR if quiet else logging.WARNING
    logger.handlers = [CommandHandler()]
    logger.propagate = False
    logger.setLevel(level)
