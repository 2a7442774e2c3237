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
    libdir=$(dirname "$(find "$prefix" -name libneupig.so)")
    export LD_LIBRARY_PATH="$libdir" PKG_CONFIG_PATH="$libdir/pkgconfig"
    cd "$BATS_TEST_TMPDIR" || return 1
}

@test "with pkg-config" {
    # shellcheck disable=SC2046
    cc -std=c11 -Wall -Werror "$consumer/consumer.c" -o consumer \
        $(pkg-config --define-variable=prefix="$prefix" --cflags --libs neupig)
    run ./consumer
    [ "$status" -eq 0 ]
    [[ "$output" == "neupig "* ]]
}

@test "with pkg-config, statically" {
    # shellcheck disable=SC2046
    cc -std=c11 "$consumer/consumer.c" -o consumer \
        $(pkg-config --define-variable=prefix="$prefix" --static --cflags --libs neupig | sed 's/-lneupig/-l:libneupig.a/')
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

@test "the installed command runs, with its manual and completion beside it" {
    run "$prefix/bin/neupig" version
    [ "$status" -eq 0 ]
    [ -s "$prefix/share/man/man1/neupig.1" ]
    bash -n "$prefix/share/bash-completion/completions/neupig"
}

@test "the shared library shows nothing but npg_ names" {
    run bash -c "nm -D --defined-only '$libdir/libneupig.so' | awk '{ print \$3 }' | grep -v '^npg_'"
    [ -z "$output" ]
}

@test "the public header compiles alone as C and as C++" {
    echo '#include <neupig.h>' >alone.c
    cc -std=c11 -pedantic -Wall -Wextra -Werror -I"$prefix/include" -c alone.c -o /dev/null
    cp alone.c alone.cpp
    c++ -std=c++17 -pedantic -Wall -Wextra -Werror -I"$prefix/include" -c alone.cpp -o /dev/null
}
