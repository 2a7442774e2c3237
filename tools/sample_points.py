"""Point clouds sampled on meshes (PLY, OBJ), with Gaussian noise where asked for.  Needs Python 3 alone.

The same mesh, numbers and seed give the same points.
"""
import itertools
import math
import random
import struct

TYPES = {"char": "b", "int8": "b", "uchar": "B", "uint8": "B", "short": "h", "int16": "h", "ushort": "H", "uint16": "H",
         "int": "i", "int32": "i", "uint": "I", "uint32": "I", "float": "f", "float32": "f", "double": "d", "float64": "d"}


def fan(corners):
    """The triangles of one polygon."""
    return [(corners[0], corners[i], corners[i + 1]) for i in range(1, len(corners) - 1)]


def read_obj(path):
    verts, faces = [], []
    with open(path, encoding="utf-8", errors="replace") as lines:
        for line in lines:
            words = line.split()
            if words[:1] == ["v"]:
                verts.append(tuple(float(word) for word in words[1:4]))
            elif words[:1] == ["f"]:
                corners = [int(word.split("/")[0]) for word in words[1:]]
                faces += fan([c - 1 if c > 0 else len(verts) + c for c in corners])
    return verts, faces


def ply_header(data, path):
    """(format, [[element, count, [(types, property)]]], where the data begin)."""
    end = data.find(b"end_header")
    if not data.startswith(b"ply") or end < 0:
        raise ValueError(f"{path} is no PLY file")
    form, elements = "", []
    for line in data[:end].decode("latin-1").splitlines():
        words = line.split()
        if words[:1] == ["format"]:
            form = words[1]
        elif words[:1] == ["element"]:
            elements.append([words[1], int(words[2]), []])
        elif words[:1] == ["property"]:
            types = words[2:4] if words[1] == "list" else words[1:2]
            elements[-1][2].append(([TYPES[t] for t in types], words[-1]))
    return form, elements, data.index(b"\n", end) + 1


def ply_values(data, form, elements, at):
    """{element: [row]}: a row has a value, or a list of them, for every property."""
    order = ">" if form == "binary_big_endian" else "<"
    words = iter(data[at:].split()) if form == "ascii" else None

    def take(letters):
        nonlocal at
        if words is not None:
            return [float(next(words)) for _ in letters]
        values = struct.unpack_from(order + letters, data, at)
        at += struct.calcsize(order + letters)
        return values

    rows = {}
    for name, count, properties in elements:
        plain = "".join(types[0] for types, _ in properties)
        if all(len(types) == 1 for types, _ in properties):
            rows[name] = [take(plain) for _ in range(count)]
            continue
        rows[name] = [[take(types[1] * int(take(types[0])[0])) if len(types) == 2 else take(types[0])[0]
                       for types, _ in properties] for _ in range(count)]
    return rows


def read_ply(path):
    with open(path, "rb") as file:
        data = file.read()
    form, elements, at = ply_header(data, path)
    names = {name: [prop for _, prop in properties] for name, _, properties in elements}
    rows = ply_values(data, form, elements, at)
    place = [names["vertex"].index(axis) for axis in "xyz"]
    verts = [tuple(row[i] for i in place) for row in rows["vertex"]]
    list_at = next((i for i, name in enumerate(names.get("face", [])) if name in ("vertex_indices", "vertex_index")), None)
    faces = [] if list_at is None else [face for row in rows["face"] for face in fan([int(c) for c in row[list_at]])]
    return verts, faces


def read_mesh(path):
    verts, faces = read_obj(path) if path.endswith(".obj") else read_ply(path)
    if not verts or not faces:
        raise ValueError(f"{path} has no faces to sample points on")
    return verts, faces


def diagonal(verts):
    """Of the box around them."""
    return math.dist([min(axis) for axis in zip(*verts)], [max(axis) for axis in zip(*verts)])


def cross_of(verts, face):
    (ax, ay, az), (bx, by, bz), (cx, cy, cz) = (verts[corner] for corner in face)
    ux, uy, uz, vx, vy, vz = bx - ax, by - ay, bz - az, cx - ax, cy - ay, cz - az
    return uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx


def sample(verts, faces, count, deviation, seed):
    """COUNT points spread evenly over the area: [(x, y, z, nx, ny, nz)], displaced by Gaussian noise of DEVIATION."""
    chance = random.Random(seed)
    crosses = [cross_of(verts, face) for face in faces]
    areas = [math.sqrt(x * x + y * y + z * z) for x, y, z in crosses]
    points = []
    for chosen in chance.choices(range(len(faces)), cum_weights=list(itertools.accumulate(areas)), k=count):
        root, along = math.sqrt(chance.random()), chance.random()
        weights = 1 - root, root * (1 - along), root * along
        corners = [verts[corner] for corner in faces[chosen]]
        place = [sum(w * corner[axis] for w, corner in zip(weights, corners)) for axis in range(3)]
        if deviation > 0:
            place = [value + chance.gauss(0, deviation) for value in place]
        points.append((*place, *(value / areas[chosen] for value in crosses[chosen])))
    return points


def write_points(path, points):
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n"
    header += "".join(f"property float {name}\n" for name in ("x", "y", "z", "nx", "ny", "nz")) + "end_header\n"
    with open(path, "wb") as file:
        file.write(header.encode())
        file.writelines(struct.pack("<6f", *point) for point in points)
