"""A progress bar with the time left, on a terminal; nothing elsewhere."""

import shutil
import sys

from tqdm import tqdm

STATES = {1: "preparing", 2: "rendering", 6: "paused"}


class ProgressBar:
    """Follows one frame. Use it in a `with` block and call it with each trz_progress."""

    def __init__(self, name: str, quiet: bool):
        self._name = name
        self._bar = None
        if not quiet and sys.stderr.isatty():
            self._bar = tqdm(
                total=1.0,
                desc=name,
                file=sys.stderr,
                leave=False,
                # Some terminals do not tell their size, and tqdm then shows nothing.
                ncols=shutil.get_terminal_size().columns,
                nrows=20,
                bar_format="{percentage:3.0f}% |{bar}| {desc}",
            )

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self._bar is not None:
            self._bar.close()

    def __call__(self, progress) -> None:
        if self._bar is None:
            return
        left = progress.seconds_left
        text = STATES.get(progress.state, "")
        if progress.state == 2:
            text = f"{progress.samples_done}/{progress.samples_total} samples"
            if left >= 0.0:
                text += f", {tqdm.format_interval(left)} left"
        self._bar.n = min(max(progress.fraction, 0.0), 1.0)
        self._bar.set_description_str(f"{self._name} {text}", refresh=False)
        self._bar.refresh()
