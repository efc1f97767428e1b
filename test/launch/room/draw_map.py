#!/usr/bin/python3
"""Draws map.pgm, the map_server map of room.yaml, beside this file."""
import pathlib

RESOLUTION, ORIGIN, WIDTH, HEIGHT = 0.05, (-2.0, -2.5), 140, 100
OCCUPIED, FREE, UNKNOWN = 0, 254, 205


def value(x, y):
    if (1.2 <= x <= 2.0 and -1.7 <= y <= -1.1) or (4.0 <= x <= 4.4 and 0.4 <= y <= 1.6):
        return OCCUPIED
    if -1.44 < x < 4.44 and -1.94 < y < 1.94:
        return FREE
    return OCCUPIED if -1.56 <= x <= 4.56 and -2.06 <= y <= 2.06 else UNKNOWN


rows = [bytes(value(ORIGIN[0] + (i + 0.5) * RESOLUTION, ORIGIN[1] + (j + 0.5) * RESOLUTION) for i in range(WIDTH))
        for j in reversed(range(HEIGHT))]
(pathlib.Path(__file__).parent / "map.pgm").write_bytes(f"P5\n{WIDTH} {HEIGHT}\n255\n".encode() + b"".join(rows))
