#!/usr/bin/env bash
# Builds the Hydra plugin into build/hydra/plugin/hdTrapeze, against the OpenUSD that the environment names:
#
#   OPENUSD_ROOT                an installation, with pxrConfig.cmake
# or
#   OPENUSD_INCLUDE_DIR         its headers (holds pxr/)
#   OPENUSD_LIBRARY             its library, such as .../libusd_ms.so
#   OPENUSD_EXTRA_INCLUDE_DIRS  what its headers need, semicolons between: TBB, Python
#
# HDTRAPEZE_LIBRARY=/path/libhdtrapeze.so takes another renderer than target/release's.
#
# The tests in tests/hydra run the plugin in a host of that OpenUSD, which these describe; where
# OPENUSD_ROOT is set, the first two have defaults:
#
#   OPENUSD_PYTHONPATH          what holds its Python package pxr (lib/python)
#   OPENUSD_LD_LIBRARY_PATH     what holds its libraries (lib)
#   OPENUSD_PYTHON              the Python that it was built for (the one that .venv was made with)
#   OPENUSD_USDRECORD           its usdrecord.py, where that is to be run as well
#   OPENUSD_BLENDER             the folder that holds bpy, where the OpenUSD is Blender's
set -euo pipefail
cd "$(dirname "$0")/.."

if [ -n "${OPENUSD_ROOT:-}" ]; then
    usd=("-DCMAKE_PREFIX_PATH=$OPENUSD_ROOT" -DOPENUSD_INCLUDE_DIR= -DOPENUSD_LIBRARY= -Upxr_DIR)
elif [ -n "${OPENUSD_INCLUDE_DIR:-}" ] && [ -n "${OPENUSD_LIBRARY:-}" ]; then
    usd=("-DOPENUSD_INCLUDE_DIR=$OPENUSD_INCLUDE_DIR" "-DOPENUSD_LIBRARY=$OPENUSD_LIBRARY"
        "-DOPENUSD_EXTRA_INCLUDE_DIRS=${OPENUSD_EXTRA_INCLUDE_DIRS:-}")
else
    echo "hydra: no OpenUSD is configured: set OPENUSD_ROOT, or OPENUSD_INCLUDE_DIR and OPENUSD_LIBRARY" >&2
    sed -n 's/^#   /    /p' "$0" >&2
    exit 1
fi

library=${HDTRAPEZE_LIBRARY:-$PWD/target/release/libhdtrapeze.so}
cmake -S delegate/hydra -B build/hydra -G Ninja "${usd[@]}" -DHDTRAPEZE_BUILD_PROBE=ON "-DHDTRAPEZE_LIBRARY=$library" >/dev/null
cmake --build build/hydra
echo "hydra: PXR_PLUGINPATH_NAME=$PWD/build/hydra/plugin/hdTrapeze"
