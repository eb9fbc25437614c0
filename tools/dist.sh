#!/bin/sh
# Build wheel and sdist to dist/, check them, and try both in a clean environment, from an empty folder.
set -eu
python="${PYTHON:-python3}"
bin="$(pwd)/${VENV:-.venv}/bin"
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# From a copy of what git tracks: a build leaves folders in its source, and takes up what lies about there.
rm -rf dist
mkdir -p "$work/source" dist
git ls-files -z | tar --null -T - -cf - | tar -xf - -C "$work/source"
"$bin/python" -m build --outdir dist "$work/source" >"$work/log" 2>&1 || { cat "$work/log"; exit 1; }
"$bin/python" -m twine check --strict dist/*

version=$("$bin/python" -c 'from ssgi_cl.version import __version__; print(__version__)')
grep -q "^## $version" CHANGELOG.md || { echo "CHANGELOG.md has no heading '## $version'"; exit 1; }
grep -q "^version: $version$" CITATION.cff || { echo "CITATION.cff is not of version $version"; exit 1; }

for built in dist/*.whl dist/*.tar.gz; do
    echo "$built in a clean environment"
    rm -rf "$work/venv" "$work/empty"
    "$python" -m venv "$work/venv"
    "$work/venv/bin/python" -m pip install --quiet "$(pwd)/$built[pocl]"
    mkdir "$work/empty"
    (
        cd "$work/empty"
        "$work/venv/bin/ssgi" --version | grep -q "$version"
        "$work/venv/bin/ssgi" render cornell_box --width 160 --height 120 -o box.exr
        "$work/venv/bin/ssgi" apply gtao box.exr -o ao.exr --set radius=0.1
        test -s ao.exr
    )
done
ls -l dist
