#!/bin/bash
# A release: the version in every file that names it, the changes of CHANGELOG.md under it, a commit, a tag, the packages.
#
#   tools/release.sh [--no-packages] VERSION      X.Y.Z; on a clean tree whose tests pass
#
# Packages (three .deb, a wheel that carries the library, the sources) and their SHA256SUMS lie in build/release.
# Nothing is pushed: look at the commit first.
set -euo pipefail
cd "$(dirname "$0")/.."
packages=yes
[ "${1:-}" != --no-packages ] || { packages=no && shift; }
version=${1:-}

fail()
{
    echo "release.sh: $*" >&2
    exit 2
}

[[ $version =~ ^[0-9]+\.[0-9]+\.[0-9]+$ ]] || fail "usage: tools/release.sh [--no-packages] X.Y.Z"
[ -z "$(git status --porcelain --untracked-files=no)" ] || fail "there are changes that are not committed"
! git rev-parse --quiet --verify "v$version" >/dev/null || fail "there is a tag v$version already"
before=$(sed -n 's/^project(neupig VERSION \([0-9.]*\).*/\1/p' CMakeLists.txt)
[ "$(printf '%s\n' "$before" "$version" | sort -V | tail -n 1)" = "$version" ] || fail "$version comes before $before"
unreleased=$(sed -n '/^## Unreleased/,/^## [0-9]/p' CHANGELOG.md | grep -cv '^##\|^$') || true
[ "$unreleased" -gt 0 ] || fail "CHANGELOG.md has nothing under Unreleased"

IFS=. read -r major minor patch <<<"$version"
escaped=${before//./\\.}
sed -i "s/^project(neupig VERSION $escaped/project(neupig VERSION $version/" CMakeLists.txt
sed -i "s/^\(#define NPG_VERSION_MAJOR\) .*/\1 $major/; s/^\(#define NPG_VERSION_MINOR\) .*/\1 $minor/
    s/^\(#define NPG_VERSION_PATCH\) .*/\1 $patch/; s/\"$escaped\"/\"$version\"/" pipeline/neupig.h
sed -i "s/^version = \"$escaped\"/version = \"$version\"/" tools/python/pyproject.toml
sed -i "s/^VERSION = \"$escaped\"/VERSION = \"$version\"/" tools/python/neupig/_library.py
sed -i "s/^version: $escaped/version: $version/" tools/CITATION.cff
sed -i "s/$escaped/$version/" tests/pipeline/test_status.c
sed -i "s/$escaped/$version/g" tests/delivery/python.bats
sed -i "s/^## Unreleased$/## Unreleased\n\n## $version ($(date +%F))/" CHANGELOG.md
git commit --quiet --all --message "Release $version"
git tag --annotate "v$version" --message "neupig $version"
echo "committed and tagged: v$version"
[ "$packages" = yes ] || exit 0

out=$PWD/build/release
rm -rf "$out"
cmake --preset release -DNPG_VIEW=ON >/dev/null
cmake --build build
cpack --config build/CPackConfig.cmake -G DEB -B "$out" >/dev/null
rm -r "$out/_CPack_Packages"
tools/python/make_wheel.py build -o "$out"
git archive --prefix="neupig-$version/" --output="$out/neupig-$version.tar.gz" "v$version"
(cd "$out" && sha256sum -- * >SHA256SUMS && ls -l)
