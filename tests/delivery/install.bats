# The installed package: a program outside the project builds against it and runs.

setup_file() {
    build=$(dirname "$NEUPIG")
    grep -q '^NPG_SANITIZE:STRING=.' "$build/CMakeCache.txt" && return 0
    prefix="$BATS_FILE_TMPDIR/prefix"
    cmake --install "$build" --prefix "$prefix" >/dev/null
    export prefix
}

setup() {
    [ -n "${prefix:-}" ] || skip "a build with a sanitizer is not for installing"
    consumer="$BATS_TEST_DIRNAME/consumer"
    build=$(dirname "$NEUPIG")
    libdir=$(dirname "$(find "$prefix" -name libneupig.so)")
    export LD_LIBRARY_PATH="$libdir" PKG_CONFIG_PATH="$libdir/pkgconfig"
    cd "$BATS_TEST_TMPDIR" || return 1
}

@test "with pkg-config" {
    # shellcheck disable=SC2046
    cc -std=c11 -Wall -Werror "$consumer/consumer.c" -o consumer \
        $(pkg-config --cflags --libs neupig)
    run ./consumer
    [ "$status" -eq 0 ]
    [[ "$output" == "neupig "* ]]
}

@test "with pkg-config, statically" {
    # shellcheck disable=SC2046
    cc -std=c11 "$consumer/consumer.c" -o consumer \
        $(pkg-config --static --cflags --libs neupig | sed 's/-lneupig/-l:libneupig.a/')
    unset LD_LIBRARY_PATH
    run ./consumer
    [ "$status" -eq 0 ]
}

@test "with CMake" {
    cmake -S "$consumer" -B build -DCMAKE_PREFIX_PATH="$prefix" >/dev/null
    cmake --build build >/dev/null
    run build/consumer
    [ "$status" -eq 0 ]
}

@test "the installed command runs, with its manual beside it" {
    run "$prefix/bin/neupig" version
    [ "$status" -eq 0 ]
    [ -s "$prefix/share/man/man1/neupig.1" ]
    [ -s "$prefix/share/neupig/view/page.html" ]
}

@test "the installed library finds its helper program and runs, from a program that lies elsewhere" {
    "$prefix/bin/neupig" synth --cell 0.06 --frames 2 --points 600 -o capture >/dev/null
    # shellcheck disable=SC2046
    cc -std=c11 -Wall -Werror "$(dirname "$(dirname "$BATS_TEST_DIRNAME")")/samples/run_folder.c" -o run_folder \
        $(pkg-config --cflags --libs neupig)
    run ./run_folder capture/points out epochs=2 faces=300
    echo "$output"
    [ "$status" -eq 0 ] || [ "$status" -eq 7 ]
    [ -s out/done.json ]
    # shellcheck disable=SC2046
    cc -std=c11 -Wall -Werror "$consumer/results.c" -o results $(pkg-config --cflags --libs neupig)
    ./results capture out
    [ -s carried/done.json ]
    [ -s two.png ]
}

@test "nothing that is installed names the folder it was built in" {
    run grep -rlF "$build" "$prefix/bin" "$prefix/include" "$prefix/share" "$libdir/cmake" "$libdir/pkgconfig"
    [ -z "$output" ]
}
