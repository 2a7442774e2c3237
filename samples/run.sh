#!/bin/bash
# The main job in one command: build what is needed, make a sample capture, turn it into one moving mesh, measure
# it and draw it.  On a fresh Debian 12 it installs what is missing (as root, or through sudo).
#
#   samples/run.sh [OUT]      OUT: folder for capture and results, build/sample by default
set -euo pipefail
cd "$(dirname "$0")/.."
out=${1:-build/sample}
frames=${FRAMES:-12}
epochs=${EPOCHS:-100}

. samples/packages.sh
# shellcheck disable=SC2086
install_packages $packages_to_build

# Without the tests: their libraries are in packages_to_test.  tests/run.sh configures the same folder with them.
echo "== Build"
cmake --preset release -DNPG_TESTS=OFF >/dev/null
cmake --build build --target neupig

echo "== A capture: $frames frames of a walking figure, with noise and outliers, without normals"
build/neupig synth -o "$out/capture" --frames "$frames" --points 5000 --noise 0.1 --outliers 0.5 --no-normals

echo "== The main job"
code=0
build/neupig run "$out/capture/points" -o "$out/result" --method "{\"epochs\": $epochs}" || code=$?
# 7: finished, with frames below the quality bar; the report says which
[ "$code" -eq 0 ] || [ "$code" -eq 7 ] || exit "$code"

echo "== Against the ground truth"
build/neupig eval "$out/result" "$out/capture/truth"

build/neupig render "$out/result/meshes" -o "$out/result/strip.png" --count 6 --columns 6
# The page needs what only Node can bundle; without it there is the picture.
page=$out/result/view.html
build/neupig view "$out/result" -o "$page" >/dev/null 2>&1 || page=""

echo
echo "meshes   $out/result/meshes"
echo "report   $out/result/report.json"
echo "picture  $out/result/strip.png"
[ -z "$page" ] || echo "page     $page (open it in a browser)"
exit "$code"
