# The bed: a capture is made once and run, rows are kept, and what a change moves is told from what stays.

setup_file() {
    cd "$BATS_FILE_TMPDIR"
    bed() {
        python3 "$BATS_TEST_DIRNAME/bed.py" "$@" --only walker.noise --seeds 1 --frames 6 --points 400 --faces 600 --folder bed
    }
    bed run --variant base
    bed run --variant coarse --args "--faces 100 --method '{\"poisson-depth\": 4}'"
    bed run --variant base >again
}

setup() {
    cd "$BATS_FILE_TMPDIR"
}

@test "one row a run, with figures and exit code; what is there is not run again" {
    [ "$(wc -l <bed/rows/base.jsonl)" -eq 1 ]
    [ ! -s again ]
    grep -q '"capture": "walker.noise", "seed": 1, "exit": [07], "cpu": .*"good": [0-6], "CD": .*"NC": .*"Corr": ' bed/rows/base.jsonl
    ls bed/captures
    [ "$(ls bed/captures)" = walker.noise-6x400-1 ]
    [ "$(ls bed/captures/*/points | wc -l)" -eq 6 ]
}

@test "a variant beside itself has not moved, a coarse surface has" {
    python3 "$BATS_TEST_DIRNAME/bed.py" compare base base --folder bed | tee same
    grep -q "nothing moved" same
    python3 "$BATS_TEST_DIRNAME/bed.py" compare base coarse --folder bed | tee other
    grep -Eq '^walker.noise +CD +[+][0-9.]+ % .* moved' other
}

@test "scaled constants stay whole, and on their side of 1" {
    PYTHONPATH="$BATS_TEST_DIRNAME" python3 -c '
from bed import scaled
for text, scale, wanted in (("12", 0.7, "8"), ("1", 0.7, "1"), ("3", 1.4, "4"), ("2", 0.7, "1"), ("0.5", 1.4, "0.7"), ("0.9", 1.4, "0.95"),
                            ("1.1", 0.7, "1.05"), ("4.0", 0.7, "2.8"), ("10.0", 0.7, "7.0"), ("-5.5", 1.4, "-7.7"), ("1e-3", 0.7, "0.0007")):
    assert scaled(text, scale) == wanted, (text, scale, scaled(text, scale))
'
}
