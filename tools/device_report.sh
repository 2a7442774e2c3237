#!/usr/bin/env bash
# What an OpenCL device is worth, in one command: self-test, bench, and the paper's fit at 17 and 120 frames.
#
#   tools/device_report.sh DEVICE [OUT]
#
# DEVICE: part of the device's name, its number, cpu, gpu or auto.  Environment: NEUPIG (the command), FRAMES ("17 120"),
# POINTS (5000), EPOCHS (the preset's), BENCH_OPTIONS, RUN_OPTIONS, PEAK ("FLOPS BYTES" a second, of its data sheet).
# All output lies in OUT (device_report/); the table comes last, and in OUT/report.md.  Exit code: that of the first part
# that failed, 7 where the decoder takes longer than PEAK lets expect; without a device it says which platforms there are.
set -euo pipefail

device=${1:?usage: tools/device_report.sh DEVICE [OUT]}
out=${2:-device_report}
neupig=${NEUPIG:-build/neupig}
frames=${FRAMES:-17 120}
read -ra bench_options <<<"${BENCH_OPTIONS:-}"
read -ra run_options <<<"${RUN_OPTIONS:-}"
mkdir -p "$out"

echo "1 self-test: every kernel on every device, beside known answers"
if ! "$neupig" doctor >"$out/doctor.txt" 2>&1; then
    cat "$out/doctor.txt"
    echo "no device is right; the drivers that OpenCL was told of:"
    ls /etc/OpenCL/vendors 2>/dev/null || echo "none: there is no folder /etc/OpenCL/vendors"
    exit 4
fi
cat "$out/doctor.txt"

echo "2 bench: the kernels, and the parts of a run"
"$neupig" bench --device "$device" "${bench_options[@]}" --json >"$out/bench.json"
cat "$out/bench.json"

echo "3 the paper's fit"
{
    grep -E '"(name|tuning)":' "$out/bench.json"
    echo
    echo "| frames | points | epochs | seconds | processor s | CD | NC | Corr |"
    echo "|---|---|---|---|---|---|---|---|"
} >"$out/report.md"
for count in $frames; do
    capture=$out/capture_$count result=$out/paper_$count
    [ -d "$capture" ] || "$neupig" synth --frames "$count" --points "${POINTS:-5000}" -o "$capture" >"$out/synth_$count.txt"
    method=paper
    [ -z "${EPOCHS:-}" ] || method="{\"preset\": \"paper\", \"epochs\": $EPOCHS}"
    code=0
    "$neupig" run "$capture/points" -o "$result" --method "$method" --device "$device" --restart --quiet \
        "${run_options[@]}" || code=$?
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
echo >>"$out/report.md"
held=0
reports=()
for count in $frames; do reports+=("$out/paper_$count/report.json"); done
"$(dirname "$0")/device_expectations.py" "$out/bench.json" "${reports[@]}" >>"$out/report.md" || held=$?
cat "$out/report.md"
exit "$held"
