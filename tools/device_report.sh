#!/usr/bin/env bash
# What an OpenCL device is worth, in one command: self-test, tune, bench, and the paper's fit at 17 and 120 frames.
#
#   tools/device_report.sh DEVICE [OUT]
#
# DEVICE: part of the device's name, its number, cpu, gpu or auto.  Environment: NEUPIG (the command), FRAMES ("17 120"),
# POINTS (5000), EPOCHS (the preset's), TUNING (a set of the program's instead of tuning: wide, narrow, gpu), SIZES (of
# tune and bench), BENCH_OPTIONS, RUN_OPTIONS.
# All output lies in OUT (device_report/); the table comes last, and in OUT/report.md.  Exit code: that of the first part
# that failed; without a device it says which platforms there are.
set -euo pipefail

device=${1:?usage: tools/device_report.sh DEVICE [OUT]}
out=${2:-device_report}
neupig=${NEUPIG:-build/neupig}
frames=${FRAMES:-17 120}
read -ra sizes <<<"${SIZES:-}"
read -ra bench_options <<<"${BENCH_OPTIONS:-}"
read -ra run_options <<<"${RUN_OPTIONS:-}"
mkdir -p "$out"

echo "1 self-test: every kernel on every device, beside its plain twin"
if ! "$neupig" doctor >"$out/doctor.txt" 2>&1; then
    cat "$out/doctor.txt"
    echo "no device is right; the drivers that OpenCL was told of:"
    ls /etc/OpenCL/vendors 2>/dev/null || echo "none: there is no folder /etc/OpenCL/vendors"
    exit 4
fi
cat "$out/doctor.txt"

tuning=${TUNING:-}
if [ -z "$tuning" ]; then
    echo "2 tune: the fastest right set of parameters"
    "$neupig" tune --device "$device" "${sizes[@]}" --output "$out/tuning.json" | tee "$out/tune.txt"
    tuning=$out/tuning.json
else
    echo "2 tune: left out, the set is $tuning"
fi

echo "3 bench: every kernel beside the device's peaks"
"$neupig" bench --device "$device" --tuning "$tuning" "${sizes[@]}" "${bench_options[@]}" \
    --output "$out/bench.json" | tee "$out/bench.txt"

echo "4 the paper's fit"
{
    head -n 2 "$out/bench.txt"
    echo
    echo "| frames | points | epochs | seconds | processor s | CD | NC | Corr |"
    echo "|---|---|---|---|---|---|---|---|"
} >"$out/report.md"
for count in $frames; do
    capture=$out/capture_$count result=$out/paper_$count
    [ -d "$capture" ] || "$neupig" synth --frames "$count" --points "${POINTS:-5000}" -o "$capture" >"$out/synth_$count.txt"
    epochs=()
    [ -z "${EPOCHS:-}" ] || epochs=(--method "{\"epochs\": $EPOCHS}")
    code=0
    "$neupig" run "$capture/points" -o "$result" --method "{\"preset\": \"paper\", \"tuning\": \"$tuning\"}" --device "$device" --restart --quiet \
        "${epochs[@]}" "${run_options[@]}" || code=$?
    [ "$code" -eq 0 ] || [ "$code" -eq 7 ] || exit "$code" # 7: below the bar of quality, which the figures show
    "$neupig" eval "$result/meshes" "$capture/truth" --json >"$out/eval_$count.json"
    python3 - "$result/report.json" "$out/eval_$count.json" "$count" "${POINTS:-5000}" "${EPOCHS:-preset}" >>"$out/report.md" <<'PY'
import json, sys
report, figures = json.load(open(sys.argv[1])), json.load(open(sys.argv[2]))
cells = sys.argv[3:6] + [f"{report['wall_s']:.1f}", f"{report['process_cpu_s']:.1f}"]
cells += [f"{figures[key]:.4g}" if figures.get(key) is not None else "-" for key in ("CD", "NC", "Corr")]
print("| " + " | ".join(cells) + " |")
PY
done
cat "$out/report.md"
