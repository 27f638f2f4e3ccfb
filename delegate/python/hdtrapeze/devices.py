"""`hdtrapeze devices`: GPUs, their limits, and what each backend makes of them."""

from dataclasses import dataclass

from . import native
from .errors import NativeError

KINDS = ("software", "other", "integrated", "discrete")


@dataclass
class Device:
    """What a driver says of a device."""

    name: str
    kind: str
    """One of KINDS."""
    api: str
    driver: str
    largest_buffer: int
    """Bytes."""
    largest_binding: int
    """Bytes of a buffer that a stage sees at once."""
    workgroups: int
    """Along one side of a launch."""
    timestamps: bool
    subgroups: bool
    chosen: bool
    """True for the one that the backend gpu uses."""


def devices() -> list[Device]:
    """All devices there are, the best first."""
    found = []
    while True:
        device = native.new("trz_device")
        try:
            native.check(native.lib().trz_device_describe(len(found), device))
        except NativeError as error:
            if error.code != native.constants().TRZ_ERROR_NOT_FOUND:
                raise
            return found
        text = [_text(field) for field in (device.name, device.api, device.driver)]
        found.append(
            Device(
                name=text[0],
                kind=KINDS[device.kind],
                api=text[1],
                driver=text[2],
                largest_buffer=device.largest_buffer,
                largest_binding=device.largest_binding,
                workgroups=device.workgroups,
                timestamps=bool(device.timestamps),
                subgroups=bool(device.subgroups),
                chosen=bool(device.chosen),
            )
        )


def auto() -> str:
    """What the backend auto is, and why; a GPU that was not tried yet is tried."""
    describe, needed = native.lib().trz_auto_describe, native.ffi.new("size_t *")
    native.check(describe(native.ffi.NULL, 0, needed))
    buffer = native.ffi.new("char[]", int(needed[0]))
    native.check(describe(buffer, len(buffer), needed))
    return _text(buffer)


def print_devices() -> None:
    """Runs the command."""
    found = devices()
    for number, device in enumerate(found):
        print(f"{number}: {device.name} ({device.kind}, {device.api})")
        print(f"   driver {device.driver}")
        sizes = f"{_size(device.largest_buffer)}, {_size(device.largest_binding)} at once"
        print(f"   buffers to {sizes}; {device.workgroups} workgroups a side")
        print(f"   timestamps {_yes(device.timestamps)}, subgroups {_yes(device.subgroups)}")
    if not found:
        print("No GPU is found: there is no Vulkan, Metal or DX12 driver with a device.")
    print(f"--backend auto: {auto()}")
    print("--backend cpu: the CPU")
    chosen = next((device for device in found if device.chosen), None)
    if chosen is None:
        print("--backend gpu: an error")
    elif chosen.kind == "software":
        print(f"--backend gpu: {chosen.name}, which computes on the CPU: for tests only")
    else:
        print(f"--backend gpu: {chosen.name}")


def _text(field) -> str:
    return native.ffi.string(field).decode("utf-8", "replace")


def _size(count: int) -> str:
    return f"{count / 2**30:.4g} GiB" if count >= 2**30 else f"{count / 2**20:.4g} MiB"


def _yes(is_so: bool) -> str:
    return "yes" if is_so else "no"
