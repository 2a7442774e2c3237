#!/usr/bin/env python3
"""What the decoder and a window must cost on a device, beside what they took.

  tools/device_expectations.py BENCH.json [REPORT.json...]

Environment: PEAK, "FLOPS BYTES" a second of the device's data sheet (float32 without tensor cores; memory).
A decoder call cannot take less than the longer of operations / FLOPS and bytes / BYTES; it holds where this is at
least 30 % of the time it took.  Exit code: 7 where one does not hold; without PEAK nothing is judged."""
import json
import os
import sys

W1, W2 = 512, 512  # the paper's decoder, which bench times
BATCH = 4          # frames of a call
SHARE = 0.3


def flops(w1, w2):
    """Multiply-adds x 2 of a vertex and a frame, forward (pipeline/cost.h)."""
    return 2 * (40 * w1 + w1 * w2 + 7 * w2)


def launches(frames):
    """Of one epoch: 23 for the field, and 9 for each batch of frames."""
    return 23 + 9 * -(-frames // BATCH)


def row(name, calls, operations, moved, wall, peak):
    """A line of the table, and whether it holds (None: not judged)."""
    share = max(operations / peak[0], moved / peak[1]) / wall if peak else None
    said = "-" if share is None else f"{share:.2f} {'holds' if share >= SHARE else 'MISSES'}"
    print(f"| {name} | {operations / 1e9:.4g} | {moved / 1e6:.4g} | {calls} | {wall:.4g} | "
          f"{operations / wall / 1e9:.4g} | {said} |")
    return share is None or share >= SHARE


def main():
    bench = json.load(open(sys.argv[1], encoding="utf-8"))
    peak = [float(x) for x in os.environ.get("PEAK", "").split()]
    vertices, count = bench["sizes"]["vertices"], min(bench["sizes"]["frames"], BATCH)
    once = 4 * vertices * (W1 + count * (W2 + 8))  # the input's part, the second layer that is kept, the output
    print("| part | GFLOP | MB at least | launches | s | GFLOP/s | share of the bound |\n|---|---|---|---|---|---|---|")
    good = True
    for name, times in (("mlp_forward", 1), ("mlp_backward", 2)):
        if name in bench["rows"]:
            wall = bench["rows"][name]["wall_s"]
            good &= row(name, 1, times * vertices * count * flops(W1, W2), once, wall, peak)
    for path in sys.argv[2:]:
        report = json.load(open(path, encoding="utf-8"))
        fit, frames = report["stages"]["optimize"], report["stages"]["ingest"]["frames"]
        if fit["windows"] != 1:
            continue
        slots = report["stages"]["mesh"]["vertices"] * frames * fit["epochs"]
        moved = 2 * 4 * slots * (W1 / BATCH + W2 + 8)
        row(f"window of {frames} frames", fit["epochs"] * launches(frames), 3 * slots * flops(W1, W2), moved,
            fit["wall_s"] - fit["waited_for_previous_s"], None)
    sys.exit(0 if good else 7)


main()
