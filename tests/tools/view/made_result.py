#!/usr/bin/env python3
"""What a run would leave, from the truth of a made capture: known meshes, and one of everything a page shows.

    made_result.py CAPTURE OUT [FRAMES]

CAPTURE is what neupig synth has written.  OUT gets reference.ply, meshes/, frames.jsonl, report.json, done.json
and job/job.json.  Of the FRAMES (all) the fourth is below the bar, the last but one was skipped and has no mesh,
the last two are not explained, and an alarm dates from there.  The keyframe is the middle one.
"""

import json
import pathlib
import shutil
import sys

capture, out = map(pathlib.Path, sys.argv[1:3])
meshes = sorted((capture / "truth").glob("frame_*.ply"))
count = int(sys.argv[3]) if len(sys.argv) > 3 else len(meshes)
key = count // 2
(out / "meshes").mkdir(parents=True)
(out / "job").mkdir()
shutil.copy(meshes[key], out / "reference.ply")


def line_of(i):
    error = 0.0005 + 0.0001 * (i % 7) / 3
    figures = {"point_dist_median": 0.0061 if i == 3 else error, "point_dist_mean": 1.3 * error,
               "point_dist_p95": 3 * error, "vertex_dist_mean": 0.004, "coverage": 0.97, "flipped_share": 0.0, "stretched_share": 0.0,
               "edge_change": 0.02, "chamfer": 1.8}
    line = {"index": i, "number": i, "source": str(capture / "points" / meshes[i].name), "key": i == key,
            "skipped": i == count - 2, "held": False, "points": 600, "good": i not in (3, count - 2),
            "figures": figures, "file": f"meshes/{meshes[i].name}"}
    if i == count - 2:
        line["file"] = None
    else:
        shutil.copy(meshes[i], out / "meshes")
    if i >= count - 2:
        line["unexplained"] = True
    return line


lines = [line_of(i) for i in range(count)]
(out / "frames.jsonl").write_text("".join(json.dumps(line) + "\n" for line in lines))
alarm = {"from_frame": count - 2, "from_index": count - 2, "figure": "far", "value": 0.125, "usual": 0,
         "bound": 0.02, "frame": count - 1, "at": [0, 1, 0],
         "cause": "12.5 % of the points are far from the surface <b>in one place</b>"}
report = {"warnings": [{"text": "below the bar: </script><script>document.title = 'broken'</script>"}],
          "stages": {"keyframe": {"box_diagonal": 4.6, "figure_diagonal": 2.3},
                     "evaluate": {"topology": {"forward": alarm, "backward": None}}}}
options = {"window": "6", "overlap": "2", "bars.residual": "0.5", "bars.cover": "1", "fps": "25", "up": "y"}
done = {"neupig": "0.1.0", "status": "partial", "exit_code": 7, "frames": count, "axes": "xyz", "scale": 1.0,
        "options": options}
job = {"input": str(capture / "points"), "options": options,
       "frames": [{"number": i} for i in range(count)]}
(out / "report.json").write_text(json.dumps(report))
(out / "job" / "job.json").write_text(json.dumps(job))
(out / "done.json").write_text(json.dumps(done))
