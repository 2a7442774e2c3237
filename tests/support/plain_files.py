"""Plain files that tests read and write: the vertices and faces of a binary PLY, a depth image.

From a bats file: PYTHONPATH="$BATS_TEST_DIRNAME/../support" python3 - ...
"""

import re
import struct
import zlib


def read_mesh(path):
    """All vertices of a binary PLY, each as {"x": ..., "y": ...}: what its header names; and its triangles, if it has any."""
    with open(path, "rb") as f:
        head, body = f.read().split(b"end_header\n", 1)
    count = int(re.search(rb"element vertex (\d+)", head).group(1))
    fields = re.findall(rb"property (float|double|uchar) (\w+)", head.split(b"element face")[0])
    row = "<" + "".join({b"float": "f", b"double": "d", b"uchar": "B"}[kind] for kind, _ in fields)
    names = [name.decode() for _, name in fields]
    size = struct.calcsize(row)
    vertices = [dict(zip(names, struct.unpack_from(row, body, size * v))) for v in range(count)]
    faces = re.search(rb"element face (\d+)", head)
    return vertices, [struct.unpack_from("<x3i", body, size * count + 13 * f) for f in range(int(faces.group(1)) if faces else 0)]


def read_vertices(path):
    return read_mesh(path)[0]


def write_depth(path, rows):
    """A 16-bit grey PNG of rows of depths, 0 to 65535."""

    def chunk(name, data):
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))

    data = b"".join(b"\0" + struct.pack(">%dH" % len(row), *row) for row in rows)
    with open(path, "wb") as f:
        f.write(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", len(rows[0]), len(rows), 16, 0, 0, 0, 0)))
        f.write(chunk(b"IDAT", zlib.compress(data)) + chunk(b"IEND", b""))
