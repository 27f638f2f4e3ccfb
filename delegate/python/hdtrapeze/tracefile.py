"""--traceToFile: how long each phase took, for chrome://tracing and Perfetto or as a text."""

import contextlib
import json
import os
import time
from pathlib import Path

from .errors import OutputError


class Trace:
    """Collects phases; `write` saves them."""

    def __init__(self):
        self._start = time.perf_counter()
        self._spans: list[tuple[str, float, float, int, dict]] = []
        self._depth = 0

    @contextlib.contextmanager
    def span(self, name: str, **details):
        """Times a block; `details` may be filled by the caller through the dict that it gets."""
        begin = time.perf_counter()
        depth, self._depth = self._depth, self._depth + 1
        try:
            yield details
        finally:
            self._depth = depth
            end = time.perf_counter()
            self._spans.append((name, begin - self._start, end - begin, depth, details))

    def seconds(self, name: str) -> float:
        """Seconds of all phases of this name."""
        return sum(duration for span, _, duration, _, _ in self._spans if span == name)

    def write(self, path: str, form: str) -> None:
        """Writes the phases, `form` being chrome or trace."""
        spans = sorted(self._spans, key=lambda span: span[1])
        if form == "chrome":
            events = [
                {
                    "name": name,
                    "cat": "hdtrapeze",
                    "ph": "X",
                    "ts": begin * 1e6,
                    "dur": duration * 1e6,
                    "pid": os.getpid(),
                    "tid": 1,
                    "args": details,
                }
                for name, begin, duration, _, details in spans
            ]
            text = json.dumps({"traceEvents": events, "displayTimeUnit": "ms"}, indent=1)
        else:
            lines = [f"{d * 1e3:12.3f} ms  {'  ' * depth}{n}" for n, _, d, depth, _ in spans]
            text = "\n".join(lines)
        try:
            Path(path).write_text(text + "\n", encoding="utf-8")
        except OSError as error:
            raise OutputError(f"{path} cannot be written: {error.strerror}.") from None
