# Sourced by ./demo and ./check: makes .venv beside this project and sets `root` and `python`.
# Needs Python 3.10 or newer (PYTHON names another than python3) and Rust (https://rustup.rs).

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
host=${PYTHON:-python3}

if ! command -v cargo > /dev/null; then
    echo "cargo not found: install Rust first, see https://rustup.rs" >&2
    exit 2
fi
if ! "$host" -c 'import sys; sys.exit(sys.version_info < (3, 10))'; then
    echo "'$host' is no Python 3.10 or newer: set PYTHON to one" >&2
    exit 2
fi
if [ ! -e "$root/.venv/ready" ]; then
    "$host" -m venv --clear "$root/.venv"
fi
python=$root/.venv/bin/python
[ -e "$python" ] || python=$root/.venv/Scripts/python.exe  # Windows
if [ ! -e "$root/.venv/ready" ]; then
    "$python" -m pip install --quiet --upgrade "pip>=25.1"  # the first with --group
    touch "$root/.venv/ready"
fi
