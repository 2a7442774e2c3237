# The Debian packages, as samples/guide/technical_directors.md has it: made by CPack, unpacked into a folder, run from there; their lists of dependencies are complete.

setup_file() {
    build=$(dirname "$NEUPIG")
    grep -q '^NPG_SANITIZE:STRING=.' "$build/CMakeCache.txt" && return 0
    command -v dpkg-shlibdeps >/dev/null && command -v file >/dev/null || return 0
    cd "$BATS_FILE_TMPDIR"
    cpack --config "$build/CPackConfig.cmake" -G DEB -B "$PWD" >cpack.log 2>&1 || { cat cpack.log; return 1; }
    rm -rf _CPack_Packages
    for package in *.deb; do dpkg-deb -x "$package" root; done
    export packed=yes
}

setup() {
    [ -n "${packed:-}" ] || skip "needs dpkg-dev and file, and a build without sanitizers"
    cd "$BATS_FILE_TMPDIR"
    libdir=$(dirname "$(find root -name libneupig.so)")
}

@test "program, library and development files are packages of their own, all below /usr, by architecture" {
    [ "$(ls *.deb | cut -d _ -f 1 | xargs)" = "libneupig-dev libneupig0 neupig" ]
    [ "$libdir" = "root/usr/lib/$(gcc -print-multiarch)" ]
    holds() { # PACKAGE FILES...
        dpkg-deb -c "$1"_*.deb | awk '{ print $6 }' >list
        for file in "${@:2}" "share/doc/$1/copyright"; do
            grep -qx "./usr/$file" list || { echo "$1 has no $file"; return 1; }
            [ -s "root/usr/$file" ]
        done
    }
    holds neupig bin/neupig share/man/man1/neupig.1 share/neupig/view/page.html share/doc/neupig/README.md \
        share/doc/neupig/samples/guide/{README,artists,results}.md share/doc/neupig/samples/run_folder.c
    holds libneupig0 "${libdir#root/usr/}/libneupig.so.0" libexec/neupig/neupig-{devices,poisson}
    ! grep -E '\.so$|\.a$|\.h$' list
    holds libneupig-dev include/neupig.h "${libdir#root/usr/}"/{libneupig.so,libneupig.a,pkgconfig/neupig.pc,cmake/neupig/neupigConfig.cmake}
    # who wants to run it does not download the static library
    [ "$(cat neupig_*.deb libneupig0_*.deb | wc -c)" -lt 6000000 ]
    [ "$(ls root)" = usr ]
    [ "$(PKG_CONFIG_PATH="$libdir/pkgconfig" pkg-config --variable=includedir neupig | xargs realpath)" = "$PWD/root/usr/include" ]
    ! find root -perm /022 ! -type l | grep .
}

@test "links of the pages it brings lead to pages it brings" {
    cd root/usr/share/doc/neupig
    for page in README.md samples/guide/*.md; do
        grep -oE '\]\([^)#:]+[)#]' "$page" | sed 's/^](//; s/[)#]$//' | while read -r link; do
            [ -e "$(dirname "$page")/$link" ] || { echo "$page: $link"; return 1; }
        done
    done
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
    check() { # PACKAGE FILES...
        dpkg-deb -f "$1"_*.deb Depends | tr ',|' '\n\n' | awk '{ print $1 }' | sort -u >depends
        for file in "${@:2}"; do
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
    check neupig root/usr/bin/neupig
    grep -qx libneupig0 depends
    check libneupig0 root/usr/libexec/neupig/neupig-{devices,poisson} "$libdir/libneupig.so.0"
    grep -qx pocl-opencl-icd depends
    [ "$(dpkg-deb -f libneupig-dev_*.deb Depends)" = "libneupig0 (= $("$NEUPIG" version | cut -d ' ' -f 2))" ]
}
