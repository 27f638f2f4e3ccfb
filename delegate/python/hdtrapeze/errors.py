"""Errors and the exit codes that they become on the command line.

One class for each way in which a farm may want to react: try again, fix the scene, fix the
command, or look at the disk.
"""

EXIT_OK = 0
EXIT_RENDER = 1
EXIT_USAGE = 2
EXIT_IO = 3
EXIT_INTERRUPTED = 130
EXIT_TERMINATED = 143


class HdTrapezeError(Exception):
    """Anything that the package reports to its user; the message is one or more full sentences."""

    exit_code = EXIT_RENDER


class SceneError(HdTrapezeError):
    """The stage cannot be rendered as asked, or the renderer failed."""


class NativeError(SceneError):
    """A call through the C ABI failed; `code` is its TRZ_ERROR_ number."""

    def __init__(self, code: int, name: str, message: str):
        super().__init__(message or name)
        self.code = code
        self.name = name


class UsageError(HdTrapezeError):
    """The command or the arguments are wrong."""

    exit_code = EXIT_USAGE


class InputError(HdTrapezeError):
    """A file is missing or cannot be read."""

    exit_code = EXIT_IO


class OutputError(HdTrapezeError):
    """A file cannot be written."""

    exit_code = EXIT_IO


class Interrupted(HdTrapezeError):
    """The user or the farm stopped the render."""

    exit_code = EXIT_INTERRUPTED

    def __init__(self, message: str, terminated: bool = False):
        super().__init__(message)
        if terminated:
            self.exit_code = EXIT_TERMINATED
