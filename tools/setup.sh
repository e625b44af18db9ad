# Sourced by tools/fly and tests/run from the root of the checkout: installs brickpilot in .venv. `extras` is "[all]" or "[test]".
python=${PYTHON:-python3}
"$python" -c 'import sys; sys.exit(sys.version_info < (3, 11))' || {
    echo "brickpilot needs Python 3.11 or newer; PYTHON=/path/to/python names another one" >&2
    exit 1
}
if ! [ -x .venv/bin/pip ]; then
    if ! "$python" -c 'import ensurepip, venv' 2>/dev/null && [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null; then
        apt-get update -qq && apt-get install -y -qq --no-install-recommends python3-venv >/dev/null
    fi
    rm -rf .venv
    "$python" -m venv .venv || {
        echo "brickpilot needs Python's venv module: sudo apt-get install python3-venv" >&2
        exit 1
    }
fi
.venv/bin/pip install --quiet --disable-pip-version-check "./tools$extras"
