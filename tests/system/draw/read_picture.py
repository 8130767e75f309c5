"""What a picture shows, read without the program that drew it."""
import struct
import zlib

import numpy


def read_png(path):
    """An 8-bit RGB picture as (height, width, 3), read by the PNG specification alone."""
    data = path.read_bytes()
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    at, packed = 8, b""
    while at < len(data):
        length, kind = struct.unpack_from(">I4s", data, at)
        if kind == b"IHDR":
            width, height, depth, colour = struct.unpack_from(">IIBB", data, at + 8)
            assert (depth, colour) == (8, 2), "not 8-bit RGB"
        if kind == b"IDAT":
            packed += data[at + 8 : at + 8 + length]
        at += 12 + length
    lines = numpy.frombuffer(zlib.decompress(packed), dtype=numpy.uint8).reshape(height, 1 + 3 * width)
    image = numpy.zeros((height, 3 * width), dtype=numpy.uint8)
    for y, line in enumerate(lines):
        kind, row = line[0], line[1:].reshape(-1, 3).astype(int)
        above = image[y - 1].reshape(-1, 3).astype(int) if y else numpy.zeros_like(row)
        if kind in (0, 2):
            row = row + (above if kind == 2 else 0)
        elif kind == 1:
            row = numpy.cumsum(row, axis=0)
        else:  # each byte needs the one before it: plain integers are thirty times faster here than small arrays
            out, top, packed_row = [0] * 3 + [0] * (3 * width), [0] * 3 + above.ravel().tolist(), line[1:].tolist()
            for i, byte in enumerate(packed_row):
                left, up, corner = out[i], top[i + 3], top[i]
                if kind == 3:
                    guess = (left + up) // 2
                else:
                    to_left, to_up, to_corner = abs(up - corner), abs(left - corner), abs(left + up - 2 * corner)
                    guess = left if to_left <= to_up and to_left <= to_corner else up if to_up <= to_corner else corner
                out[i + 3] = (byte + guess) & 255
            row = numpy.array(out[3:])
        image[y] = (row & 255).astype(numpy.uint8).ravel()
    return image.reshape(height, width, 3)


def count_like(image, colour, reach=0.06):
    """Pixels whose hue is that of `colour`: the direction from grey agrees and is strong."""
    chroma = image.astype(float) - image.mean(axis=2, keepdims=True)
    wanted = numpy.array(colour, float) - numpy.mean(colour)
    strength = numpy.linalg.norm(chroma, axis=2)
    cosine = (chroma @ wanted) / (numpy.maximum(strength, 1e-9) * numpy.linalg.norm(wanted))
    return int(((cosine > 1 - reach) & (strength > 40)).sum())
