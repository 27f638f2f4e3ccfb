"""Readers of just so much EXR and PNG as the tests need."""

import struct
import zlib
from pathlib import Path

import numpy as np

COMPRESSIONS = ("none", "rle", "zips", "zip", "piz")
PIXEL_TYPES = ("uint", "half", "float")


def exr_header(path):
    """Attributes of a single-part EXR's header; channels as {name: pixel type}."""
    data = Path(path).read_bytes()
    magic, version = struct.unpack_from("<II", data)
    assert magic == 20000630, "not an EXR"
    assert version & 0xFF == 2
    at = 8
    parts = [{}]
    while True:
        if data[at] == 0:
            at += 1
            if version & 0x1000 and data[at] != 0:
                parts.append({})
                continue
            break
        name, at = _text(data, at)
        kind, at = _text(data, at)
        (size,) = struct.unpack_from("<I", data, at)
        value = data[at + 4 : at + 4 + size]
        at += 4 + size
        parts[-1][name] = _value(kind, value)
    parts[0]["end"] = at
    return parts[0] if len(parts) == 1 else parts


def _text(data, at):
    end = data.index(0, at)
    return data[at:end].decode(), end + 1


def _value(kind, value):
    if kind == "string":
        return value.decode()
    if kind == "compression":
        return COMPRESSIONS[value[0]]
    if kind == "box2i":
        return struct.unpack("<4i", value)
    if kind == "float":
        return struct.unpack("<f", value)[0]
    if kind == "int":
        return struct.unpack("<i", value)[0]
    if kind == "chlist":
        channels, at = {}, 0
        while value[at]:
            name, at = _text(value, at)
            (pixel_type,) = struct.unpack_from("<I", value, at)
            channels[name] = PIXEL_TYPES[pixel_type]
            at += 16
        return channels
    return value


def read_exr(path):
    """Pixels of each channel of an EXR of scan lines (none, zips or zip): {name: (h, w) array}."""
    header = exr_header(path)
    data = Path(path).read_bytes()
    x0, y0, x1, y1 = header["dataWindow"]
    width, height = x1 - x0 + 1, y1 - y0 + 1
    kinds = {"half": "<f2", "float": "<f4", "uint": "<u4"}
    types = {name: np.dtype(kinds[kind]) for name, kind in header["channels"].items()}
    lines = {"none": 1, "zips": 1, "zip": 16}[header["compression"]]
    at = header["end"]
    offsets = struct.unpack_from(f"<{-(-height // lines)}Q", data, at)
    images = {name: np.empty((height, width), kind) for name, kind in types.items()}
    line_bytes = width * sum(kind.itemsize for kind in types.values())
    for offset in offsets:
        y, size = struct.unpack_from("<iI", data, offset)
        count = min(lines, y1 - y + 1)
        chunk = data[offset + 8 : offset + 8 + size]
        if size < count * line_bytes:
            chunk = _unzip(chunk)
        begin = 0
        for row in range(y - y0, y - y0 + count):
            for name in sorted(types):
                values = np.frombuffer(chunk, types[name], width, begin)
                images[name][row] = values
                begin += values.nbytes
    return images


def _unzip(chunk):
    """OpenEXR's zip: deflated, differences, even and odd bytes apart."""
    packed = np.frombuffer(zlib.decompress(chunk), np.uint8).astype(np.int64)
    packed[1:] -= 128
    packed = (np.cumsum(packed) & 255).astype(np.uint8)
    half = (len(packed) + 1) // 2
    out = np.empty_like(packed)
    out[0::2], out[1::2] = packed[:half], packed[half:]
    return out.tobytes()


def read_png(path):
    """Pixels of an 8 or 16 bit PNG without interlace, (height, width, channels)."""
    data = Path(path).read_bytes()
    assert data[:8] == b"\x89PNG\r\n\x1a\n", "not a PNG"
    at, packed = 8, b""
    while at < len(data):
        (size,) = struct.unpack_from(">I", data, at)
        kind, chunk = data[at + 4 : at + 8], data[at + 8 : at + 8 + size]
        if kind == b"IHDR":
            width, height, depth, color, *_ = struct.unpack(">IIBBBBB", chunk)
        elif kind == b"IDAT":
            packed += chunk
        at += 12 + size
    channels = {0: 1, 2: 3, 4: 2, 6: 4}[color]
    pixel = channels * depth // 8
    raw = np.frombuffer(zlib.decompress(packed), dtype=np.uint8).reshape(height, -1)
    rows = np.zeros((height, width * pixel), dtype=np.uint8)
    above = np.zeros(width * pixel, dtype=int)
    for y in range(height):
        line = raw[y, 1:].astype(int)
        rule = raw[y, 0]
        for x in range(len(line)):
            a = line[x - pixel] if x >= pixel else 0
            b, c = above[x], above[x - pixel] if x >= pixel else 0
            p = a + b - c
            nearest = min((abs(p - a), 0, a), (abs(p - b), 1, b), (abs(p - c), 2, c))[2]
            line[x] = (line[x] + (0, a, b, (a + b) // 2, nearest)[rule]) & 255
        rows[y] = line
        above = line
    if depth == 16:
        return rows.view(">u2").astype(np.uint16).reshape(height, width, channels)
    return rows.reshape(height, width, channels)
