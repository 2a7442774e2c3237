# bench and tune: reports are well formed, compare finds what is slower and nothing else, tuned parameters are taken.
# What is timed here is never judged.

SMALL=(--vertices 200 --points 100 --frames 2 --repeat 1)

setup() { cd "$BATS_TEST_TMPDIR" || return 1; }

@test "bench prints a table and writes a report, and compare judges it" {
    run "$NEUPIG" bench "${SMALL[@]}" --dense 400 --cloud 3000 --epochs 1 -o now.json
    [ "$status" -eq 0 ]
    [[ "$output" == *"share of the limit"*"mlp_forward"*"dense_carry"*"vertex-frames/s"*"an epoch"* ]]
    for word in peak sizes device mlp_backward nearest_and_chamfer share_of_bound seconds_per_epoch \
        outlier_isolated outlier_normals surface_closest poisson align_frame export_ply processor_us_per_point; do
        grep -q "\"$word\":" now.json
    done
    # the same report with one kernel that takes twice its time
    awk '/"mlp_forward"/ { inside = 1 } /"relative"/ { scaled = inside; inside = 0 } /}/ { scaled = 0 }
         scaled && match($0, /[0-9.e+]+,?$/) {
             end = $0 ~ /,$/ ? "," : ""
             $0 = substr($0, 1, RSTART - 1) sprintf("%.1f", 2 * substr($0, RSTART)) end
         } { print }' now.json >slow.json
    sed 's/"frames": 2/"frames": 3/' now.json >other.json
    run "$NEUPIG" bench --compare now.json now.json
    [ "$status" -eq 0 ]
    [ -z "$output" ]
    run "$NEUPIG" bench --compare now.json slow.json
    [ "$status" -eq 7 ]
    [ "${#lines[@]}" -eq 1 ]
    [[ "$output" == "slower: mlp_forward"* ]]
    run "$NEUPIG" bench --compare slow.json now.json # faster is no fault
    [ "$status" -eq 0 ]
    [ -z "$output" ]
    run "$NEUPIG" bench --compare now.json other.json
    [ "$status" -eq 3 ]
    [[ "$output" == *sizes* ]]
    echo '{"kernels": ' >cut.json
    run "$NEUPIG" bench --compare cut.json now.json
    [ "$status" -eq 3 ]
    [[ "$output" == *cut.json* ]]
}

@test "bench times only what is asked for, and says when that is nothing" {
    run "$NEUPIG" bench "${SMALL[@]}" --only adam,sobolev --json
    [ "$status" -eq 0 ]
    [ "$(grep -c '"bound_by"' <<<"$output")" -eq 2 ]
    [[ "$output" == *'"sobolev"'*'"adam"'* ]]
    run "$NEUPIG" bench "${SMALL[@]}" --only nothing
    [ "$status" -eq 2 ]
    [[ "$output" == *nothing* ]]
}

@test "tune writes a set that runs take, and a broken one is left alone with a word" {
    mkdir cache
    export XDG_CACHE_HOME="$PWD/cache"
    "$NEUPIG" synth -o in --frames 3 --points 300 --body bar >/dev/null
    run "$NEUPIG" tune "${SMALL[@]}" --only span
    [ "$status" -eq 0 ]
    file="$(sed -n 's/^written: //p' <<<"$output")"
    [ -f "$file" ]
    settings=(--method '{"align": false, "epochs": 2, "width-1": 64, "width-2": 64, "poisson-depth": 6}' --faces 400 --max-residual 100 --max-flipped 100 --max-stretched 100 --quiet)
    "$NEUPIG" run in/points -o tuned "${settings[@]}"
    grep -qF "$file" tuned/report.json
    echo '{"kind"' >"$file"
    run "$NEUPIG" run in/points -o plain "${settings[@]}"
    [ "$status" -eq 0 ]
    grep -q 'not used' plain/report.json
    cmp tuned/reference.ply plain/reference.ply
    # built programs in the cache that are cut off are built anew
    for program in cache/neupig/*/*.program; do
        head -c 1000 "$program" >cut
        cp cut "$program"
    done
    "$NEUPIG" run in/points -o wide "${settings[@]}" --method '{"tuning": "wide"}'
    cmp wide/meshes/frame_0000.ply plain/meshes/frame_0000.ply
    [ "$(find cache -name '*.program' -size +3 | wc -l)" -gt 5 ]
    run "$NEUPIG" run in/points -o named "${settings[@]}" --method "{\"tuning\": \"$file\"}"
    [ "$status" -eq 3 ]
    [[ "$output" == *"$file"* ]]
}
