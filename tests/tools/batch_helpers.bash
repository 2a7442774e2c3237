# What the tests of batches share.

# Options of a manifest with which a capture takes seconds.
tiny='"keyframe": 1, "faces": 200, "poisson-depth": 5, "align-nodes": 20,
    "align-steps": 3, "bars": "residual=100,flipped=100,stretched=100,coverage=0"'
small="\"epochs\": 2, $tiny"

# await PID COMMAND...: until the command succeeds, as long as the process lives
await() {
    until "${@:2}" 2>/dev/null; do
        kill -0 "$1"
        sleep 0.05
    done
}
