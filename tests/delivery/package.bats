# The Debian package, as samples/guide/technical_directors.md has it: made by CPack, unpacked into a folder, run from there; its list of dependencies is complete.

setup_file() {
    build=$(dirname "$NEUPIG")
    grep -q '^NPG_SANITIZE:STRING=.' "$build/CMakeCache.txt" && return 0
    command -v dpkg-shlibdeps >/dev/null && command -v file >/dev/null || return 0
    cd "$BATS_FILE_TMPDIR"
    cpack --config "$build/CPackConfig.cmake" -G DEB -B "$PWD" >cpack.log 2>&1 || { cat cpack.log; return 1; }
    rm -rf _CPack_Packages
    dpkg-deb -x neupig_*.deb root
    export packed=yes
}

setup() {
    [ -n "${packed:-}" ] || skip "needs dpkg-dev and file, and a build without sanitizers"
    cd "$BATS_FILE_TMPDIR"
    libdir=$(dirname "$(find root -name libneupig.so)")
}

@test "it holds command, libraries, header, manual and licence, all below /usr" {
    for file in bin/neupig libexec/neupig/neupig-{devices,poisson} include/neupig.h share/man/man1/neupig.1 \
        share/neupig/view/page.html share/doc/neupig/copyright; do
        [ -s "root/usr/$file" ]
    done
    [ "$(ls root)" = usr ]
    [ "$(PKG_CONFIG_PATH="$libdir/pkgconfig" pkg-config --variable=includedir neupig | xargs realpath)" = "$PWD/root/usr/include" ]
    ! find root -perm /022 ! -type l | grep .
}

@test "unpacked anywhere it runs a capture to its end" {
    root/usr/bin/neupig synth --cell 0.06 --frames 2 --points 600 -o capture >/dev/null
    run root/usr/bin/neupig run capture/points -o out --method '{"epochs": 2}' --faces 300 -q
    echo "$output"
    [ "$status" -eq 0 ] || [ "$status" -eq 7 ]
    [ -s out/done.json ]
    root/usr/bin/neupig view out
    [ -s out/view.html ]
}

@test "the command loads what it uses: PCL and what that brings are for neupig-poisson alone" {
    ldd root/usr/bin/neupig >loaded
    ! grep -i -e pcl -e vtk loaded
    [ "$(wc -l <loaded)" -le 30 ]
}

@test "every library that its programs name belongs to a package it depends on" {
    dpkg-deb -f neupig_*.deb Depends | tr ',|' '\n\n' | awk '{ print $1 }' | sort -u >depends
    grep -qx pocl-opencl-icd depends
    for file in root/usr/bin/neupig root/usr/libexec/neupig/neupig-{devices,poisson} "$libdir/libneupig.so"; do
        objdump -p "$file" | awk '$1 == "NEEDED" { print $2 }' >needed
        [ -s needed ]
        while read -r name; do
            path=$(ldd "$file" | awk -v n="$name" '$1 == n { print $3 }')
            [ -n "$path" ] || path=$(ldd "$file" | awk -v n="$name" 'index($1, n) { print $1 }')
            owner=$(dpkg-query -S "$(realpath "$path")" "$path" 2>/dev/null | head -n 1 | cut -d : -f 1)
            grep -qx "$owner" depends || { echo "$file needs $name ($path), which is of \"$owner\""; return 1; }
        done <needed
    done
}
