"""Independent readers of what `neupig run --export` writes: NumPy and plain parsing here, VTK and Blender where
they are installed.

    python3 check_exports.py {numpy|vtk|vat|usda|obj} RUN
    blender -b --python-exit-code 3 -P check_exports.py -- blender RUN

RUN is the output folder of a run with npz, pc2, mdd, glb, usda, vdb; exits with a word on the first difference."""
import glob
import json
import re
import struct
import sys
import zlib

import numpy as np


def fail(text):
    print(text)
    sys.exit(1)


def same(name, a, b, tolerance=0.0):
    a, b = np.asarray(a), np.asarray(b)
    if a.shape != b.shape:
        fail(f"{name}: shape {a.shape}, expected {b.shape}")
    worst = np.abs(a.astype(float) - b.astype(float)).max() if a.size else 0
    if not worst <= tolerance:
        fail(f"{name}: differs by {worst}")
    print(f"{name}: {a.shape}, worst difference {worst:.3g}")


def read_ply(path):
    """Positions and faces of a binary little-endian PLY with triangles."""
    data = open(path, "rb").read()
    head, body = data.split(b"end_header\n", 1)
    lines, fields, count, where = head.decode().split("\n"), {}, {}, None
    for words in (line.split() for line in lines):
        if words[:1] == ["element"]:
            where = words[1]
            count[where], fields[where] = int(words[2]), []
        if words[:1] == ["property"] and words[1] != "list":
            kind = {"float": "<f4", "double": "<f8", "uchar": "u1"}[words[1]]
            fields[where].append((words[2], kind))
    row = np.dtype(fields["vertex"])
    vertices = np.frombuffer(body, row, count["vertex"])
    faces = np.frombuffer(body, np.dtype([("n", "u1"), ("v", "<i4", 3)]), count["face"], row.itemsize * count["vertex"])
    if (faces["n"] != 3).any():
        fail(f"{path}: not triangles")
    return np.stack([vertices[a] for a in "xyz"], 1), faces["v"], vertices


def frames_of(run):
    lines = [json.loads(line) for line in open(f"{run}/frames.jsonl")]
    return [line for line in lines if line["file"]]


def truth(run):
    """The PLY sequence, which every other form must agree with."""
    frames = frames_of(run)
    meshes = [read_ply(f"{run}/{frame['file']}") for frame in frames]
    for _, faces, _ in meshes:
        same("faces of the sequence", faces, meshes[0][1]) if (faces != meshes[0][1]).any() else None
    return frames, np.array([mesh[0] for mesh in meshes]), meshes[0][1]


def held(frames, vertices):
    """What forms without times show: a frame without a mesh repeats the one before it."""
    shown, at = [], 0
    for index in range(frames[0]["index"], frames[-1]["index"] + 1):
        at += at + 1 < len(frames) and frames[at + 1]["index"] == index
        shown.append(vertices[at])
    return np.array(shown)


def check_caches(run, frames, vertices, fps):
    shown = held(frames, vertices)
    data = open(f"{run}/motion.pc2", "rb").read()
    magic, version, points, start, step, samples = struct.unpack("<12siiffi", data[:32])
    if (magic, version, step) != (b"POINTCACHE2\0", 1, 1.0) or start != frames[0]["index"]:
        fail(f"pc2: header {magic} {version} {start} {step}")
    same("pc2", np.frombuffer(data, "<f4", offset=32).reshape(samples, points, 3), shown)
    data = open(f"{run}/motion.mdd", "rb").read()
    samples, points = struct.unpack(">ii", data[:8])
    times = np.frombuffer(data, ">f4", samples, 8)
    same("mdd times", times, (frames[0]["index"] + np.arange(samples)) / fps, 1e-5)
    same("mdd", np.frombuffer(data, ">f4", offset=8 + 4 * samples).reshape(samples, points, 3), shown)
    rows = [line.split()[1:4] for line in open(f"{run}/reference.obj") if line.startswith("v ")]
    box = np.ptp(vertices.reshape(-1, 3), 0).max()
    same("reference.obj", np.array(rows, float), read_ply(f"{run}/reference.ply")[0], 1e-6 * box)


def check_rigid(arrays):
    """Best rotation and translation, found another way (Kabsch, by singular values)."""
    rest = arrays["reference"].astype(float)
    for at, pose in enumerate(arrays["vertices"].astype(float)):
        u, _, v = np.linalg.svd((rest - rest.mean(0)).T @ (pose - pose.mean(0)))
        flip = np.diag([1, 1, np.sign(np.linalg.det(v.T @ u.T))])
        best = v.T @ flip @ u.T
        if np.abs(best - arrays["rotation"][at]).max() > 1e-6:
            fail(f"rotation {at}: {arrays['rotation'][at]}, expected {best}")
        if np.abs(pose.mean(0) - best @ rest.mean(0) - arrays["translation"][at]).max() > 1e-5:
            fail(f"translation {at}: {arrays['translation'][at]}")
    print(f"rotation and translation of {len(arrays['vertices'])} frames agree with Kabsch's")


def check_numpy(run):
    frames, vertices, faces = truth(run)
    done = json.load(open(f"{run}/done.json"))
    arrays = np.load(f"{run}/motion.npz")
    same("npz vertices", arrays["vertices"], vertices)
    same("npz faces", arrays["faces"], faces)
    same("npz reference", arrays["reference"], read_ply(f"{run}/reference.ply")[0])
    same("npz index", arrays["index"], [frame["index"] for frame in frames])
    same("npz number", arrays["number"], [frame["number"] for frame in frames])
    same("npz time", arrays["time"], [frame["index"] / done["fps"] for frame in frames], 1e-12)
    if (arrays["up"], arrays["fps"], arrays["metres_per_unit"]) != (done["up"], done["fps"], done["metres_per_unit"]):
        fail("npz: up, fps or unit is not that of done.json")
    check_rigid(arrays)
    check_caches(run, frames, vertices, done["fps"])


def normals_of(pose, faces):
    """Of each vertex: the sum of its faces' normals weighted by area, as unit vectors."""
    corners = pose[faces].astype(float)
    of_faces = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    sums = np.zeros(pose.shape)
    for k in range(3):
        np.add.at(sums, faces[:, k], of_faces)
    return sums / np.linalg.norm(sums, axis=1, keepdims=True)


def read_png16(path):
    """An RGB picture of 16 bits, rows unfiltered (PNG, ISO/IEC 15948)."""
    data, at, packed, size = open(path, "rb").read(), 8, b"", None
    while at < len(data):
        length, kind = struct.unpack(">I4s", data[at:at + 8])
        body = data[at + 8:at + 8 + length]
        if zlib.crc32(kind + body) != struct.unpack(">I", data[at + 8 + length:at + 12 + length])[0]:
            fail(f"{path}: checksum of {kind}")
        if kind == b"IHDR":
            size = struct.unpack(">IIBBBBB", body)
        packed += body if kind == b"IDAT" else b""
        at += 12 + length
    if size[2:] != (16, 2, 0, 0, 0):
        fail(f"{path}: not RGB of 16 bits: {size}")
    rows = np.frombuffer(zlib.decompress(packed), np.uint8).reshape(size[1], 1 + 6 * size[0])
    if (rows[:, 0] != 2).any():
        fail(f"{path}: another filter than differences from the row above")
    return np.cumsum(rows[:, 1:], 0, np.uint8).view(">u2").reshape(size[1], size[0], 3).astype(float)


def check_vat(run):
    """The mesh's second texture coordinates find each vertex's texel, and that has its place and normal in every frame."""
    frames, vertices, faces = truth(run)
    about = json.load(open(f"{run}/motion_vat.json"))
    lo, hi = np.array(about["box"]["lo"]), np.array(about["box"]["hi"])
    positions, normals = (read_png16(f"{run}/{about[kind]}") for kind in ("positions", "normals"))
    glb = open(f"{run}/{about['mesh']}", "rb").read()
    length = struct.unpack("<I", glb[12:16])[0]
    root = json.loads(glb[20:20 + length])
    part = root["meshes"][0]["primitives"][0]

    def values(accessor, kind, width):
        view = root["bufferViews"][root["accessors"][accessor]["bufferView"]]
        return np.frombuffer(glb, kind, view["byteLength"] // 4, 28 + length + view["byteOffset"]).reshape(-1, width)

    uv = values(part["attributes"]["TEXCOORD_1"], "<f4", 2)
    base = values(part["attributes"]["POSITION"], "<f4", 3)
    step = (hi - lo).max() / 65535
    shown = held(frames, vertices)
    if about["frames"] != len(shown):
        fail(f"vat: {about['frames']} frames, expected {len(shown)}")
    if values(part["indices"], "<u4", 3).tolist() != faces.tolist():
        fail("vat: other faces")
    same("vat mesh", base, shown[0])
    for at, pose in enumerate(shown):
        row = np.floor((uv[:, 1] + at * about["step_v"]) * about["height"]).astype(int)
        column = np.floor(uv[:, 0] * about["width"]).astype(int)
        same(f"vat frame {at}", lo + positions[row, column] / 65535 * (hi - lo), pose, 0.51 * step + 1e-7)
        same(f"vat normals {at}", 2 * normals[row, column] / 65535 - 1, normals_of(pose, faces), 1e-4)


def samples_of(text, name):
    block = text[text.index(f" {name}.timeSamples = {{") + 1:]
    block = block[block.index("\n") + 1:block.index("\n        }")]
    return {int(line.split(":")[0]): np.array(re.findall(r"-?[0-9][-0-9.e+]*", line.split(":")[1]), float).reshape(-1, 3)
            for line in block.split("\n")}


def check_usda(run):
    """Normals are the surface's, velocities the change from the frame before to the one behind over the time between."""
    frames, vertices, faces = truth(run)
    text, done = open(f"{run}/motion.usda").read(), json.load(open(f"{run}/done.json"))
    normals, velocities = samples_of(text, "normals"), samples_of(text, "velocities")
    size = np.ptp(vertices.reshape(-1, 3), 0).max()
    for at, frame in enumerate(frames):
        a, b = max(at - 1, 0), min(at + 1, len(frames) - 1)
        seconds = (frames[b]["index"] - frames[a]["index"]) / done["fps"]
        same(f"usda normals {at}", normals[frame["index"]], normals_of(vertices[at], faces), 2e-4)
        same(f"usda velocities {at}", velocities[frame["index"]], (vertices[b].astype(float) - vertices[a]) / seconds,
             1e-5 * size / seconds)


def check_vtk(run):
    import vtk
    from vtk.util.numpy_support import vtk_to_numpy

    arrays = np.load(f"{run}/motion.npz")
    reader = vtk.vtkGLTFReader()
    reader.SetFileName(f"{run}/motion.glb")
    reader.ApplyDeformationsToGeometryOn()
    reader.UpdateInformation()
    reader.EnableAnimation(0)
    reader.UpdateInformation()
    for at, time in enumerate(arrays["time"] - arrays["time"][0]):
        step = vtk.vtkStreamingDemandDrivenPipeline.UPDATE_TIME_STEP()
        reader.GetOutputInformation(0).Set(step, time)
        reader.Modified()
        reader.Update()
        walk = reader.GetOutput().NewIterator()
        walk.InitTraversal()
        points = vtk_to_numpy(walk.GetCurrentDataObject().GetPoints().GetData())
        pose, unit = arrays["vertices"][at], float(arrays["metres_per_unit"])
        if arrays["up"] == "z":
            pose = np.stack([pose[:, 0], pose[:, 2], -pose[:, 1]], 1)
        size = np.ptp(pose, 0).max() * unit
        same(f"glb in VTK, frame {at}", points, pose * unit, 1e-6 * size)


def check_obj(run, like):
    """An OBJ sequence keeps all lines of the user's mesh but its positions."""
    names = sorted(glob.glob(f"{run}/obj/*.obj")) or sorted(glob.glob(f"{run}/meshes/*.obj"))
    kept = [line.split() for line in open(like) if not line.startswith(("v ", "vn"))]
    colours = [line.split()[4:] for line in open(like) if line.startswith("v ")]
    for name in names:
        if [line.split() for line in open(name) if not line.startswith(("v ", "vn"))] != kept:
            fail(f"{name}: its faces or texture coordinates are not those of {like}")
        if [line.split()[4:] for line in open(name) if line.startswith("v ")] != colours:
            fail(f"{name}: its colours are not those of {like}")
    print(f"{len(names)} OBJ files keep the lines of {like}")


def check_blender(run):
    import bpy

    if not hasattr(np, "bool"):
        np.bool = bool  # Debian's glTF add-on still uses the old name
    arrays = np.load(f"{run}/motion.npz")
    vertices, unit = arrays["vertices"], float(arrays["metres_per_unit"])
    size = np.ptp(vertices.reshape(-1, 3), 0).max()

    def start():
        bpy.ops.wm.read_factory_settings(use_empty=True)
        bpy.context.scene.render.fps = int(arrays["fps"])

    def look(thing, frame):
        bpy.context.scene.frame_set(frame)
        seen = thing.evaluated_get(bpy.context.evaluated_depsgraph_get())
        mesh = seen.to_mesh()
        points = np.empty(3 * len(mesh.vertices), "f4")
        mesh.vertices.foreach_get("co", points)
        turn = np.array(seen.matrix_world)
        return points.reshape(-1, 3) @ turn[:3, :3].T + turn[:3, 3]

    for form in ("PC2", "MDD"):
        start()
        bpy.ops.wm.obj_import(filepath=f"{run}/reference.obj", forward_axis="Y", up_axis="Z")
        thing = bpy.context.selected_objects[0]
        cache = thing.modifiers.new("cache", "MESH_CACHE")
        cache.cache_format, cache.filepath = form, f"{run}/motion.{form.lower()}"
        cache.forward_axis, cache.up_axis, cache.frame_start = "POS_Y", "POS_Z", 0
        for at, pose in enumerate(vertices):
            same(f"{form} in Blender, frame {at}", look(thing, at), pose, 1e-6 * size)
    start()
    bpy.ops.import_scene.gltf(filepath=f"{run}/motion.glb")
    thing = [thing for thing in bpy.data.objects if thing.type == "MESH"][0]
    for at, pose in enumerate(vertices):
        if arrays["up"] == "y":
            pose = np.stack([pose[:, 0], -pose[:, 2], pose[:, 1]], 1)
        same(f"glb in Blender, frame {at}", look(thing, at), pose * unit, 2e-6 * size * unit)
    for name in sorted(glob.glob(f"{run}/volumes/*.vdb"))[:2] + sorted(glob.glob(f"{run}/job/*.vdb"))[:1]:
        start()
        bpy.ops.object.volume_import(filepath=name)
        grids = bpy.data.volumes[0].grids
        if not grids.load() or not len(grids):
            fail(f"{name}: Blender can't load it")
        print(f"{name} in Blender: {[grid.name for grid in grids][:4]}")


if __name__ == "__main__":
    what, *rest = sys.argv[sys.argv.index("--") + 1:] if "--" in sys.argv else sys.argv[1:]
    {"numpy": check_numpy, "vtk": check_vtk, "vat": check_vat, "usda": check_usda, "obj": check_obj, "blender": check_blender}[what](*rest)
