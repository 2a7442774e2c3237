#!/usr/bin/env python3
"""Prints the method (--method FILE) that a configuration of the paper's published code asks for.

    method_json.py CONFIG.json >method.json

What has no counterpart is named on standard error.  That code solves (I + lambda L) u = z by conjugate gradients and names
the choice and its neighbourhood; the solve is exact here, so these keys have none.
"""

import json
import sys

# Section and key there; keys of the method that take the number, times the factor.
NUMBERS = {
    ("optimization", "epochs"): (("epochs",), 1),
    ("optimization", "edgeloss"): (("isometry",), 1),
    ("grid", "base_res"): (("grid-base",), 1),
    ("grid", "increase_per_level"): (("grid-step",), 1),
    ("grid", "n_level"): (("grid-levels",), 1),
    ("grid", "lr_adapt"): (("grid-rate-growth",), 1),
    ("grid", "local_lambda_adapt"): (("lambda-growth",), 1),
    ("grid", "smoothness"): (("lambda",), 1),
    ("grid", "lr"): (("grid-rate",), 1),
    ("mlp", "hidden"): (("width-1", "width-2"), 1),
    ("mlp", "point_dim"): (("position-channels",), 1),
    ("mlp", "normal_dim"): (("normal-channels",), 1),
    ("mlp", "time_dim"): (("time-frequencies",), 0.5),
}
# What there is one way of here, and words that choose the confidence: "none" leaves every frame its full weight.
WORDS = {
    (None, "descriptor"): {"surface": {}},
    (None, "time_encoding"): {"fourier_features2": {}},
    (None, "rotation_method"): {"quaternions": {}},
    ("mlp", "layers"): {3: {}},
    ("optimization", "time_smoothing"): {"pdg": {"confidence": "cumulative"}, "constant": {"confidence": "constant"}},
    ("optimization", "catchup_scaling"): {"pdg": {}, "none": {"confidence": "constant"}},
}


def convert(config):
    method, unmatched = {"preset": "paper"}, []
    for name, value in config.items():
        is_section = name in ("optimization", "grid", "mlp")
        for (section, key), item in {(name, k): v for k, v in value.items()}.items() if is_section else [((None, name), value)]:
            if (section, key) in NUMBERS:
                names, factor = NUMBERS[section, key]
                method |= {own: item if factor == 1 else int(factor * item) for own in names}
            elif not isinstance(item, (dict, list)) and item in WORDS.get((section, key), {}):
                method |= WORDS[section, key][item]
            else:
                unmatched.append(f"{section}.{key}" if section else key)
    return method, unmatched


def main():
    if len(sys.argv) != 2 or sys.argv[1].startswith("-"):
        sys.exit(__doc__)
    with open(sys.argv[1], encoding="utf-8") as file:
        method, unmatched = convert(json.load(file))
    print(json.dumps(method, indent=1))
    if unmatched:
        print("no counterpart, so without effect: " + ", ".join(unmatched), file=sys.stderr)


if __name__ == "__main__":
    main()
