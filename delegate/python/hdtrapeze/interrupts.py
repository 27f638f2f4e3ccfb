"""Ctrl-C and SIGTERM while the command runs.

The first one raises KeyboardInterrupt, or its subclass Terminated, in the main thread; while
`held`, once that ends. What follows cleans up, so a second one is ignored and only the third ends
the process at once.
"""

import os
import signal
import threading
from contextlib import contextmanager

SIGNALS = (signal.SIGINT, signal.SIGTERM)
DEADLY = 3
"""The signal that is no longer kept from ending the process."""


class Terminated(KeyboardInterrupt):
    """SIGTERM."""

    terminated = True


class Interrupts:
    """Hears the signals from its creation on, in the main thread; elsewhere it does nothing."""

    def __init__(self):
        self._count = 0
        self._first = signal.SIGINT
        self._is_held = False
        self._before = {}
        try:
            for number in SIGNALS:
                before = signal.getsignal(number)
                if before is not signal.SIG_IGN:  # a shell's background jobs: as they are
                    self._before[number] = signal.signal(number, self._hear)
        except ValueError:  # not in the main thread: signals are someone else's
            pass

    def restore(self, ends: bool) -> None:
        """Handlers as they were before. Where the process `ends` because of a signal, the next one
        is ignored: it would end it without the exit code."""
        for number, before in self._before.items():
            signal.signal(number, signal.SIG_IGN if ends and self._count else before)

    @contextmanager
    def held(self):
        """While it lasts nothing is raised: for what would swallow an exception, as imports of
        extension modules do."""
        self._is_held = True
        yield
        self._is_held = False
        if self._count:
            self._raise()

    def _hear(self, number, _frame) -> None:
        self._count += 1
        if self._count == 1:
            self._first = number
            if not self._is_held:
                self._raise()
        elif self._count >= DEADLY:
            signal.signal(number, signal.SIG_DFL)
            os.kill(os.getpid(), number)

    def _raise(self) -> None:
        raise Terminated if self._first == signal.SIGTERM else KeyboardInterrupt


@contextmanager
def ignored():
    """Ignores Ctrl-C, so that cleaning up after the first is not cut short by the next.

    Only where Python's own handler is in place: `Interrupts` ignores the second by itself.
    """
    before = None
    main = threading.current_thread() is threading.main_thread()
    if main and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        if before is not None:
            signal.signal(signal.SIGINT, before)
