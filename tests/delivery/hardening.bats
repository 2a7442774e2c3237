# What a release build has against files of strangers, read from its binaries.

setup() {
    build=$(dirname "$NEUPIG")
    grep -q '^CMAKE_BUILD_TYPE:[A-Z]*=Release' "$build/CMakeCache.txt" || skip "no release build"
    programs=("$NEUPIG" "$build/neupig-poisson" "$build/neupig-devices")
}

has() { # FILE WHAT OPTIONS OF READELF
    readelf -W "${@:3}" "$1" | grep -q -E "$2" || { echo "$1 has no $2"; return 1; }
}

@test "addresses can't be written after the start: full RELRO, and no stack that runs" {
    for file in "${programs[@]}" "$build/libneupig.so"; do
        has "$file" GNU_RELRO --segments
        has "$file" '\((FLAGS|FLAGS_1)\).*NOW' --dynamic
        has "$file" 'GNU_STACK .* RW ' --segments
    done
}

@test "programs lie at another place in each run" {
    for file in "${programs[@]}"; do
        has "$file" 'Type: *DYN' --file-header
        has "$file" 'FLAGS_1.*PIE' --dynamic
    done
}

@test "writes past the end of an array end the program" {
    # neupig-devices has arrays in main alone, which never returns
    for file in "$NEUPIG" "$build/neupig-poisson" "$build/libneupig.so"; do has "$file" __stack_chk_fail --dyn-syms; done
    for file in "$NEUPIG" "$build/libneupig.so"; do has "$file" '__(memcpy|snprintf|read)_chk' --dyn-syms; done
}
