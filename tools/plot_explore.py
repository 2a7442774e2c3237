#!/usr/bin/env python3
"""Draws results of tools/explore.py as an SVG picture: accuracy against time.

    tools/plot_explore.py explored/results.jsonl -o accuracy.svg [--x cpu_s] [--y Corr]

One colour a capture; the line joins the settings that no other setting beats in both.  Both axes are logarithmic.
Needs Python 3 alone.
"""
import argparse
import json
import math
import os
import sys
from xml.sax.saxutils import escape

COLOURS = ("#1b6ca8", "#c8553d", "#3b8f5a", "#8a5fa8", "#b8862b", "#4f5d75")
LABELS = {"wall_s": "seconds for the whole command", "cpu_s": "processor seconds", "CD": "Chamfer distance x 1e5",
          "Corr": "correspondence error", "NC": "normal consistency", "F": "F-score at 0.5 %"}
LARGER_IS_BETTER = ("NC", "F")
WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM = 760, 470, 70, 190, 24, 52


def parse_arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("results", metavar="RESULTS.jsonl")
    parser.add_argument("-o", "--output", required=True, metavar="FILE.svg")
    parser.add_argument("--x", default="wall_s", choices=("wall_s", "cpu_s"))
    parser.add_argument("--y", default="CD", choices=("CD", "NC", "F", "Corr"))
    return parser.parse_args()


def points_of(results, x, y):
    """{capture: [(x, y, setting)]} in order of x."""
    captures = {}
    for r in results:
        if r.get(x) and r.get(y):
            captures.setdefault(r["capture"], []).append((r[x], r[y], r["setting"]))
    return {name: sorted(points) for name, points in sorted(captures.items())}


def front(points, larger):
    """Those that no cheaper one beats."""
    best, kept = None, []
    for point in points:
        if best is None or (point[1] > best if larger else point[1] < best):
            best = point[1]
            kept.append(point)
    return kept


def ticks(low, high):
    """1, 2, 5 times powers of ten within the range."""
    found = []
    for power in range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1):
        found += [m * 10.0**power for m in (1, 2, 5) if low <= m * 10.0**power <= high]
    return found


class Axis:
    """A logarithmic scale from values to pixels."""

    def __init__(self, values, start, end):
        self.low, self.high = min(values) / 1.15, max(values) * 1.15
        self.start, self.end = start, end

    def at(self, value):
        share = math.log(value / self.low) / math.log(self.high / self.low)
        return self.start + share * (self.end - self.start)


def draw_axes(x, y, labels):
    bottom, right = HEIGHT - BOTTOM, WIDTH - RIGHT
    parts = [f'<path d="M{LEFT} {TOP}V{bottom}H{right}" fill="none" stroke="#333"/>']
    for value in ticks(x.low, x.high):
        parts.append(f'<path d="M{x.at(value):.1f} {TOP}V{bottom}" stroke="#e4e4e4"/>'
                     f'<text x="{x.at(value):.1f}" y="{bottom + 17}" text-anchor="middle">{value:g}</text>')
    for value in ticks(y.low, y.high):
        parts.append(f'<path d="M{LEFT} {y.at(value):.1f}H{right}" stroke="#e4e4e4"/>'
                     f'<text x="{LEFT - 6}" y="{y.at(value) + 4:.1f}" text-anchor="end">{value:g}</text>')
    parts.append(f'<text x="{(LEFT + right) / 2}" y="{HEIGHT - 12}" text-anchor="middle">{labels[0]}</text>')
    parts.append(f'<text transform="translate(16 {(TOP + bottom) / 2}) rotate(-90)" text-anchor="middle">'
                 f'{labels[1]}</text>')
    return parts


def draw_capture(name, points, colour, place, x, y, larger):
    best = front(points, larger)
    path = "L".join(f"{x.at(p[0]):.1f} {y.at(p[1]):.1f}" for p in best)
    parts = [f'<path d="M{path}" fill="none" stroke="{colour}"/>']
    for px, py, setting in points:
        on_front = (px, py, setting) in best
        title = escape(f"{name}, {setting}: {px:g} s, {py:g}")
        parts.append(f'<circle cx="{x.at(px):.1f}" cy="{y.at(py):.1f}" r="{4 if on_front else 3}" fill="{colour}" '
                     f'fill-opacity="{1 if on_front else 0.35}"><title>{title}</title></circle>')
    height = TOP + 14 + 18 * place
    parts.append(f'<circle cx="{WIDTH - RIGHT + 18}" cy="{height - 4}" r="4" fill="{colour}"/>'
                 f'<text x="{WIDTH - RIGHT + 28}" y="{height}">{escape(name)}</text>')
    return parts


def draw(results, x_key, y_key, names=None):
    """The picture as text; names are what captures are called in it."""
    captures = points_of(results, x_key, y_key)
    every = [point for points in captures.values() for point in points]
    if not every:
        sys.exit(f"plot_explore: no result has {x_key} and {y_key}")
    x = Axis([p[0] for p in every], LEFT, WIDTH - RIGHT)
    y = Axis([p[1] for p in every], HEIGHT - BOTTOM, TOP)
    parts = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" '
             f'height="{HEIGHT}" font-family="sans-serif" font-size="12">',
             f'<rect width="{WIDTH}" height="{HEIGHT}" fill="#fff"/>']
    parts += draw_axes(x, y, (LABELS[x_key], LABELS[y_key]))
    for i, (name, points) in enumerate(captures.items()):
        parts += draw_capture((names or {}).get(name, name), points, COLOURS[i % len(COLOURS)], i, x, y,
                              y_key in LARGER_IS_BETTER)
    return "\n".join(parts + ["</svg>", ""])


def main():
    arguments = parse_arguments()
    with open(arguments.results, encoding="utf-8") as lines:
        results = [json.loads(line) for line in lines]
    picture = draw(results, arguments.x, arguments.y)
    with open(arguments.output + ".part", "w", encoding="utf-8") as out:
        out.write(picture)
    os.replace(arguments.output + ".part", arguments.output)


if __name__ == "__main__":
    main()
