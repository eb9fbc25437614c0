#!/bin/sh
# Install the Debian packages that optional parts use, and those named as arguments, where that is
# possible; never fail.
set -u
wanted="libegl1 libgl1-mesa-dri pocl-opencl-icd clang-15 libllvm19 chromium $*"
command -v dpkg-query >/dev/null 2>&1 || exit 0
# Debian's own Python makes virtual environments only with this package.
"${PYTHON:-python3}" -c 'import ensurepip' 2>/dev/null || wanted="python3-venv $wanted"
missing=""
for package in $wanted; do
    dpkg-query -W -f='${Status}' "$package" 2>/dev/null | grep -q 'ok installed' ||
        missing="$missing $package"
done
[ -z "$missing" ] && exit 0
if [ "$(id -u)" -ne 0 ]; then
    echo "Optional but for python3-venv, and faster with them:  sudo apt-get install$missing"
    exit 0
fi
echo "installing$missing"
# shellcheck disable=SC2086  # a list of words
{ apt-get -qq update && DEBIAN_FRONTEND=noninteractive apt-get -qq install -y $missing; } \
    >/dev/null 2>&1 || echo "could not install$missing; going on without"
exit 0
