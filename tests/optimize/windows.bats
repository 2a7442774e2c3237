# Windows against one joint window over the same short capture: as near the truth, and no seam between them.

small=(--method '{"poisson-depth": 6, "align-nodes": 120}' --faces 1000
    --bars residual=100,coverage=0,flipped=100
    --export obj --quiet)

setup_file() {
    cd "$BATS_FILE_TMPDIR"
    "$NEUPIG" synth --frames 14 --points 2000 --cycles 0.6 -o capture >synth.log
    "$NEUPIG" run capture/points -o joint "${small[@]}" --method '{"window": 0}'
    "$NEUPIG" run capture/points -o windows "${small[@]}" --method '{"window": 5, "overlap": 2}'
}

setup() {
    cd "$BATS_FILE_TMPDIR"
}

# One figure of eval: figure RUN NAME
figure() {
    "$NEUPIG" eval "$1" capture --samples 20000 --json | sed -n "s/.*\"$2\": \([0-9.e-]*\).*/\1/p" | head -1
}

# Mean over vertices of |x(t - 1) - 2 x(t) + x(t + 1)|, a line for each inner frame.
jitter() {
    awk 'FNR == 1 { frame++; v = 0; if (frame > 3) report() }
        function report(   i, k, a, sum) {
            for (i = 0; i < count; i++) {
                a = 0
                for (k = 0; k < 3; k++) a += (x[frame - 3, i, k] - 2 * x[frame - 2, i, k] + x[frame - 1, i, k]) ^ 2
                sum += sqrt(a)
            }
            print sum / count
        }
        $1 == "v" { for (k = 0; k < 3; k++) x[frame, v, k] = $(k + 2); count = ++v }
        END { frame++; report() }' "$1"/meshes/*.obj
}

@test "five frames at a time are as near the truth as all at once" {
    for name in CD Corr; do
        joint=$(figure joint $name)
        windows=$(figure windows $name)
        echo "$name: joint $joint, windows $windows"
        awk -v j="$joint" -v w="$windows" 'BEGIN { exit !(j > 0 && w < 1.1 * j) }'
    done
    grep -q '"windows": [4-9]' windows/report.json
    grep -q '"windows": 1\b' joint/report.json
}

@test "no frame trembles more than without seams" {
    jitter joint >joint.txt
    jitter windows >windows.txt
    [ "$(wc -l <windows.txt)" -eq 12 ]
    paste joint.txt windows.txt
    paste joint.txt windows.txt | awk '{ bad += !($1 > 0 && $2 <= 1.2 * $1) } END { exit bad > 0 }'
}
