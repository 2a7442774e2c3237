"""The first sensor of a rig in the layouts of other programs: foreign_rigs.py RIG OUT makes OUT/tum, redwood and opencv."""

import json
import pathlib
import shutil
import sys

rig, out = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2])
root = json.loads((rig / "rig.json").read_text())
sensor = root["sensors"][0]
camera, m = sensor["camera"], sensor["pose"]
depth = sorted(rig.glob(sensor["depth"].replace("%04d", "*")))
colour = sorted(rig.glob(sensor["colour"].replace("%04d", "*")))
intrinsic = {"width": camera["width"], "height": camera["height"],
             "intrinsic_matrix": [camera["fx"], 0, 0, 0, camera["fy"], 0, camera["cx"], camera["cy"], 1]}
for layout in ("tum", "redwood", "opencv"):
    for folder in ("depth", "color"):
        (out / layout / folder).mkdir(parents=True)
for at, (d, c) in enumerate(zip(depth, colour)):
    for layout in ("tum", "redwood"):
        shutil.copy(d, out / layout / f"depth/{at:06d}.png")
        shutil.copy(c, out / layout / f"color/{at:06d}{c.suffix}")
    shutil.copy(d, out / f"opencv/{at:04d}_depth.png")
    shutil.copy(c, out / f"opencv/{at:04d}{c.suffix}")
    data = {"intrinsic": [camera["fx"], 0, camera["cx"], 0, camera["fy"], camera["cy"], 0, 0, 1],
            "R": m[0:3] + m[4:7] + m[8:11], "t": [m[3], m[7], m[11]]}
    body = "".join(f'<{key} type_id="opencv-matrix"><rows>3</rows><data>\n{" ".join(map(repr, values))}</data></{key}>\n'
                   for key, values in data.items())
    yaml = "".join(f"{key}: !!opencv-matrix\n   rows: 3\n   data: [ {', '.join(map(repr, values))} ]\n" for key, values in data.items())
    if at % 2:
        (out / f"opencv/{at:04d}_camera.xml").write_text(f'<?xml version="1.0"?>\n<opencv_storage>\n{body}</opencv_storage>\n')
    else:
        (out / f"opencv/{at:04d}_camera.yml").write_text("%YAML:1.0\n---\n" + yaml)
for layout in ("tum", "redwood"):
    (out / layout / "intrinsic.json").write_text(json.dumps(intrinsic))
(out / "tum/depth.txt").write_text("# depth\n" + "".join(f"{at / 30:.6f} depth/{at:06d}.png\n" for at in range(len(depth))))
(out / "tum/rgb.txt").write_text("".join(f"{at / 30 + 0.004:.6f} color/{at:06d}{colour[0].suffix}\n" for at in range(len(depth))))
rows = "".join(" ".join(map(repr, m[4 * k:4 * k + 4])) + "\n" for k in range(4))
(out / "redwood/trajectory.log").write_text("".join(f"{at} {at} {at + 1}\n{rows}" for at in range(len(depth))))
