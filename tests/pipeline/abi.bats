# The border of the library: its symbols are the header's functions, its structs say their size, its header stands
# alone.

setup() {
    cd "$BATS_TEST_TMPDIR" || return 1
    root=$(dirname "$(dirname "$BATS_TEST_DIRNAME")")
    build=$(dirname "$NEUPIG")
    header="$root/pipeline/neupig.h"
}

# The functions that the header declares.
declared() {
    tr '\n' ' ' <"$header" | grep -oE 'NPG_API [^;(]*npg_[a-z0-9_]+\(' | grep -oE 'npg_[a-z0-9_]+\($' | tr -d '(' | sort
}

@test "the shared library shows the header's functions and nothing else" {
    declared >wanted
    [ "$(wc -l <wanted)" -gt 20 ]
    nm -D --defined-only "$build/libneupig.so" | awk '$2 != "A" { sub(/@.*/, "", $3); print $3 }' | sort >shown
    diff wanted shown
}

@test "every symbol carries the version of the interface" {
    run bash -c "nm -D --defined-only --with-symbol-versions '$build/libneupig.so' | grep ' T ' | grep -v '@@NEUPIG_0.1$'"
    [ -z "$output" ]
}

@test "every function of the header is tried with NULL and closed handles" {
    for name in $(declared); do
        grep -q "$name(" "$BATS_TEST_DIRNAME/test_abi.c" || { echo "test_abi.c never calls $name"; return 1; }
    done
}

@test "every public struct begins with its size, but for the element of arrays" {
    awk '/^typedef struct npg_[a-z_]+ \{/ { getline first; print $3, first }' "$header" >structs
    [ "$(wc -l <structs)" -ge 9 ]
    run bash -c "grep -v ' size_t struct_size;' structs | cut -d ' ' -f 1"
    [ "$output" = npg_surface_hit ]
}

@test "the header compiles alone as C11 and as C++, without a warning" {
    printf '#include "neupig.h"\nint alone(void);\nint alone(void) { return NPG_OK; }\n' >alone.c
    cp alone.c alone.cpp
    for compiler in cc clang-14; do
        command -v "$compiler" >/dev/null || continue
        "$compiler" -std=c11 -Wall -Wextra -Wpedantic -Wshadow -Wstrict-prototypes -Werror -I"$root/pipeline" -c alone.c -o alone.o
    done
    for standard in c++11 c++17 c++20; do
        c++ -std="$standard" -Wall -Wextra -Wpedantic -Wshadow -Werror -I"$root/pipeline" -c alone.cpp -o alone.o
    done
}
