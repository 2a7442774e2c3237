# The Python module, installed as its README.md says (without the network, into an environment of its own), then its tests.

python=/usr/bin/python3

setup_file() {
    build=$(dirname "$NEUPIG")
    grep -q '^NPG_SANITIZE:STRING=.' "$build/CMakeCache.txt" && return 0
    "$python" -c 'import numpy, venv, ensurepip' 2>/dev/null || return 0
    cd "$BATS_FILE_TMPDIR"
    "$python" -m venv --system-site-packages env
    # a copy: pip leaves nothing in the tree
    cp -r "$(dirname "$(dirname "$BATS_TEST_DIRNAME")")/tools/python" source
    env/bin/pip install --no-index --disable-pip-version-check ./source >pip.log 2>&1
    export installed=yes
}

setup() {
    [ -n "${installed:-}" ] || skip "needs python3-numpy and python3-venv, and a build without sanitizers"
    cd "$BATS_FILE_TMPDIR"
    root=$(dirname "$(dirname "$BATS_TEST_DIRNAME")") build=$(dirname "$NEUPIG")
    export NEUPIG_LIBRARY="$build/libneupig.so" PYTHONDONTWRITEBYTECODE=1
}

@test "pip installs it without the network, typed and with its data" {
    env/bin/pip show -f neupig >shown
    grep -q '^Version: 0.1.0' shown
    grep -q 'neupig/py.typed' shown
    [ "$(sed -n 's/^version = "\(.*\)"/\1/p' source/pyproject.toml)" = "$("$NEUPIG" version | cut -d ' ' -f 2)" ]
}

@test "an archive of the source installs as well, and an editable installation points into the tree" {
    "$python" - <<'EOF'
import sys
sys.path.insert(0, "source")
import backend
print(backend.build_sdist("."), backend.build_editable("."))
EOF
    tar -tzf neupig-0.1.0.tar.gz | grep -q 'neupig-0.1.0/neupig/__init__.py'
    unzip -p neupig-0.1.0-py3-none-any.whl neupig.pth 2>/dev/null | grep -q source || "$python" -m zipfile -l neupig-0.1.0-py3-none-any.whl | grep -q neupig.pth
}

@test "a wheel that carries library and command needs nothing of the system, nor of the tree" {
    command -v patchelf >/dev/null || skip "needs patchelf"
    "$root/tools/python/make_wheel.py" "$build" -o wheels
    unset NEUPIG_LIBRARY
    "$python" -m venv --system-site-packages carried
    carried/bin/pip install --no-index --disable-pip-version-check wheels/*.whl >pip.log 2>&1
    inside=$(echo "$PWD"/carried/lib/python3*/site-packages/neupig/lib)
    # every library that is not of the C and C++ runtime comes from the wheel
    for file in "$inside"/libneupig.so.0 "$inside"/neupig{,-poisson,-devices}; do
        ldd "$file" | awk '$2 == "=>" { print $3 }' | grep -v "^$inside/" >outside || true
        ! grep -vE '/(libc|libm|libdl|libpthread|librt|libstdc\+\+|libgcc_s)\.so' outside
    done
    ls "$inside/licences" | grep -q openvdb
    carried/bin/neupig version | grep -qx "$("$NEUPIG" version)"
    carried/bin/neupig synth --cell 0.06 --frames 2 --points 600 -o of-wheel >/dev/null
    carried/bin/python -c 'import neupig, sys; assert str(neupig.library_path).startswith(sys.argv[1]); neupig.run("of-wheel/points", "out-of-wheel", faces=300)' "$inside"
    [ -s out-of-wheel/done.json ]
    carried/bin/neupig view out-of-wheel
}

@test "its tests pass" {
    cat >sizes.c <<'EOF'
#include <neupig.h>
#include <stdio.h>
#define SIZE(name, type) printf(name "Struct=%zu ", sizeof(type))
int main(int argc, char **argv)
{
    (void)argv;
    if (argc > 1) {
        printf("OK=%d END=%d STOPPED=%d PARTIAL=%d FAILED=%d USAGE=%d BAD_INPUT=%d DEVICE=%d DISK=%d MEMORY=%d DIVERGED=%d ABORTED=%d",
               NPG_OK, NPG_END, NPG_STOPPED, NPG_PARTIAL, NPG_FAILED, NPG_USAGE, NPG_BAD_INPUT, NPG_DEVICE, NPG_DISK, NPG_MEMORY,
               NPG_DIVERGED, NPG_ABORTED);
        return 0;
    }
    SIZE("OptionInfo", npg_option_info), SIZE("FrameView", npg_frame_view), SIZE("CustomStage", npg_custom_stage);
    SIZE("LogRecord", npg_log_record), SIZE("Progress", npg_progress), SIZE("Hooks", npg_hooks);
    SIZE("Cloud", npg_cloud), SIZE("Result", npg_result), SIZE("Hit", npg_surface_hit);
    SIZE("CaptureFacts", npg_capture_facts), SIZE("EvalFigures", npg_eval_figures), SIZE("EvalSettings", npg_eval_settings);
    SIZE("ApplySettings", npg_apply_settings), SIZE("Applied", npg_applied), SIZE("Exported", npg_exported);
    return 0;
}
EOF
    cc -I"$root/pipeline" sizes.c -o sizes
    NEUPIG_SIZES="$(./sizes)" NEUPIG_STATUS="$(./sizes status)"
    export NEUPIG_SIZES NEUPIG_STATUS
    mkdir work
    env/bin/python "$BATS_TEST_DIRNAME/test_python.py" work
}

@test "it says what to build and where it looked when there is no library" {
    NEUPIG_LIBRARY=/nowhere/libneupig.so run env/bin/python -c 'import neupig'
    [ "$status" -ne 0 ]
    [[ "$output" == *"cmake --build build --target neupig_shared"*"NEUPIG_LIBRARY"*"/nowhere/libneupig.so"* ]]
}

@test "installed from a tree it finds that tree's build, and names the tree while nothing is built there" {
    mkdir -p tree/tools tree/pipeline elsewhere
    cp -r source tree/tools/python
    cp "$root/pipeline/neupig.h" tree/pipeline/
    "$python" -m venv --system-site-packages tree-env
    tree-env/bin/pip install --no-index --disable-pip-version-check tree/tools/python >tree.log 2>&1
    unset NEUPIG_LIBRARY
    cd elsewhere
    run ../tree-env/bin/python -c 'import neupig'
    [ "$status" -ne 0 ] || [ "$(ldconfig -p | grep -c libneupig)" -gt 0 ]
    [ "$status" -eq 0 ] || [[ "$output" == *"/tree with: cmake --build build --target neupig_shared"* ]]
    ln -s "$build" ../tree/build
    run ../tree-env/bin/python -c 'import neupig; print(neupig.library_path)'
    echo "$output"
    [ "$output" = "$(realpath "$build/libneupig.so")" ]
}

@test "mypy finds nothing to say" {
    "$python" -c 'import mypy' 2>/dev/null || skip "mypy is not installed"
    "$python" -m mypy --strict --cache-dir "$PWD/mypy" source/neupig
}
