"""Prints what this machine's processor is, for the head of a figure."""

import platform
import re
from pathlib import Path


def processor() -> str:
    """What this machine calls its processor, its model where that names none, and its vectors."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        lines = []
    pairs = [line.split(":", 1) for line in lines if ":" in line]
    # Those of the first core.
    told: dict[str, str] = {}
    for key, value in pairs:
        told.setdefault(key.strip(), value.strip())
    name = told.get("model name") or platform.processor() or "unknown processor"
    more = []
    if not re.search(r"\d", name) and {"cpu family", "model"} <= told.keys():
        more.append(f"family {told['cpu family']}, model {told['model']}")
    flags = told.get("flags", "").split()
    more += [text for flag, text in (("avx512f", "AVX-512"), ("avx2", "AVX2")) if flag in flags][:1]
    return f"{name} ({'; '.join(more)})" if more else name


if __name__ == "__main__":
    print(processor())
