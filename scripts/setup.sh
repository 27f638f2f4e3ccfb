#!/usr/bin/env bash
# Prepares a checkout: Debian packages, .venv, the release build, the `hdtrapeze` command.
#
#   scripts/setup.sh             what `make demo` needs
#   scripts/setup.sh --tools     also what `make test` needs (rustfmt, clippy, pytest, ruff, ...)
#   scripts/setup.sh --figures   also what `make figures` needs (matplotlib)
#   scripts/setup.sh --no-build  without the release build
#
# Safe to run again: each step looks first, and a prepared checkout takes about a second. Exits
# non-zero with the exact command to type where something is missing that it may not install.
# PYTHON=/path/to/python3.11 chooses the interpreter, OPENSUBDIV_ROOT=/path an OpenSubdiv.
set -euo pipefail
cd "$(dirname "$0")/.."
root=$PWD

tools=0 figures=0 build=1
for arg in "$@"; do
    case $arg in
    --tools) tools=1 ;;
    --figures) figures=1 ;;
    --no-build) build=0 ;;
    *) echo "setup: unknown option $arg" >&2 && exit 2 ;;
    esac
done

say() { echo "setup: $*"; }
fail() {
    echo "setup: $1" >&2
    shift
    for line in "$@"; do echo "    $line" >&2; done
    exit 1
}

# --- Rust ----------------------------------------------------------------------------------------

if ! command -v cargo >/dev/null && [ -x "$HOME/.cargo/bin/cargo" ]; then
    fail "cargo is installed but not on PATH. Type:" '. "$HOME/.cargo/env"'
fi
command -v cargo >/dev/null || fail "Rust is missing: cargo is not on PATH. Install Rust with rustup."
wanted=$(sed -n 's/^rust-version *= *"\(.*\)"/\1/p' Cargo.toml)
have=$(rustc --version | awk '{print $2}')
if [ "$(printf '%s\n' "$wanted" "${have%%-*}" | sort -V | head -n1)" != "$wanted" ]; then
    fail "Rust $wanted or newer is needed; this is $have. Type:" "rustup update stable"
fi
if [ $tools = 1 ]; then
    missing=()
    cargo fmt --version >/dev/null 2>&1 || missing+=(rustfmt)
    cargo clippy --version >/dev/null 2>&1 || missing+=(clippy)
    if [ ${#missing[@]} -gt 0 ]; then
        command -v rustup >/dev/null || fail "this Rust lacks ${missing[*]}."
        say "adding ${missing[*]} to Rust"
        rustup component add "${missing[@]}"
    fi
fi

# --- Python --------------------------------------------------------------------------------------

is_311() { "$1" -c 'import sys; sys.exit(sys.version_info[:2] != (3, 11))' >/dev/null 2>&1; }
python=
for candidate in ${PYTHON:+"$PYTHON"} python3.11 python3 /usr/bin/python3.11 \
    "${PYENV_ROOT:-$HOME/.pyenv}"/versions/3.11.*/bin/python3; do
    if is_311 "$candidate"; then
        python=$("$candidate" -c 'import sys; print(sys.executable)')
        break
    fi
done
[ -n "$python" ] || fail "Python 3.11 was not found. Name it:" "PYTHON=/path/to/python3.11 make ..."

venv_works() {
    [ -x .venv/bin/python ] && is_311 .venv/bin/python &&
        .venv/bin/python -c "import pip, sys; sys.exit(sys.prefix != '$root/.venv')" 2>/dev/null
}

# --- Debian packages -----------------------------------------------------------------------------
# Each is asked for by what it brings, not by name, so that other sources of it are welcome too.

packages=()
command -v g++ >/dev/null || packages+=(g++)
# OPENSUBDIV_ROOT names an installation of one's own, as the build takes it.
printf '#include <opensubdiv/bfr/refinerSurfaceFactory.h>\n' |
    "${CXX:-c++}" ${OPENSUBDIV_ROOT:+"-I$OPENSUBDIV_ROOT/include"} -x c++ -E - >/dev/null 2>&1 ||
    packages+=(libosd-dev)
# Tests of the GPU's stages run on any device, Mesa's software one at the least.
if [ $tools = 1 ] &&
    ! { compgen -G '/usr/share/vulkan/icd.d/*.json' || compgen -G '/etc/vulkan/icd.d/*.json'; } >/dev/null; then
    packages+=(libvulkan1 mesa-vulkan-drivers)
fi
# The Hydra plugin is built where an OpenUSD is configured, see scripts/hydra.sh.
if [ -n "${OPENUSD_ROOT:-}${OPENUSD_INCLUDE_DIR:-}" ]; then
    command -v cmake >/dev/null || packages+=(cmake)
    command -v ninja >/dev/null || packages+=(ninja-build)
fi
if ! venv_works && ! "$python" -c 'import venv, ensurepip' 2>/dev/null; then
    case $python in
    /usr/bin/*) packages+=(python3.11-venv) ;;
    *) "$python" -c 'import venv, pip' 2>/dev/null ||
        fail "$python has neither ensurepip nor pip, so no virtual environment can be made with it." \
            "Name another Python 3.11: PYTHON=/path/to/python3.11 make ..." ;;
    esac
fi

if [ ${#packages[@]} -gt 0 ]; then
    command -v apt-get >/dev/null ||
        fail "needed, by their names in Debian: ${packages[*]}. This system has no apt-get."
    if [ "$(id -u)" = 0 ]; then
        as_root=()
    elif sudo -n true 2>/dev/null; then
        as_root=(sudo -n)
    else
        fail "Debian packages are missing, and this user may not install them. Type:" \
            "sudo apt-get update && sudo apt-get install -y --no-install-recommends ${packages[*]}" \
            "(without sudo: su -c 'apt-get update && apt-get install -y --no-install-recommends ${packages[*]}')"
    fi
    say "installing ${packages[*]}"
    install=("${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y
        --no-install-recommends "${packages[@]}")
    if ! "${install[@]}" >/dev/null 2>&1; then
        # Most often the package lists are absent or old.
        "${as_root[@]}" apt-get update
        "${install[@]}"
    fi
fi

# --- Virtual environment -------------------------------------------------------------------------

if ! venv_works; then
    say "making .venv with $python"
    rm -rf .venv
    if "$python" -c 'import ensurepip' 2>/dev/null; then
        "$python" -m venv .venv
    else
        "$python" -m venv --without-pip .venv
        "$python" -m pip --python .venv/bin/python install --quiet pip
    fi
fi

# install_once NAME FILE...: pip install -r each FILE, unless done with this very text before.
install_once() {
    local stamp=.venv/.installed-$1 text
    shift
    text=$(cat "$@")
    if [ -f "$stamp" ] && [ "$(cat "$stamp")" = "$text" ]; then return; fi
    say "installing Python packages of $*"
    .venv/bin/python -m pip install --quiet --disable-pip-version-check "${@/#/--requirement=}"
    printf '%s\n' "$text" >"$stamp"
}
install_once run scripts/requirements.txt
if [ $figures = 1 ]; then install_once figures scripts/requirements-figures.txt; fi
if [ $tools = 1 ]; then install_once dev scripts/requirements.txt scripts/requirements-dev.txt; fi

# --- Release build and the command ---------------------------------------------------------------

if [ $build = 1 ]; then
    # The libraries; benches and examples are for those who test.
    packages=(--package hdtrapeze-capi)
    if [ $tools = 1 ]; then packages=(--workspace); fi
    cargo build --release "${packages[@]}" --locked
fi

# `hdtrapeze` runs from the checkout: an editable install, which finds the library in target/release.
stamp=.venv/.installed-command
text=$(cat pyproject.toml setup.py)
if ! { [ -x .venv/bin/hdtrapeze ] && [ -f $stamp ] && [ "$(cat $stamp)" = "$text" ]; }; then
    say "installing the command hdtrapeze into .venv"
    .venv/bin/python -m pip install --quiet --disable-pip-version-check --no-deps \
        --no-build-isolation --editable .
    printf '%s\n' "$text" >$stamp
fi
