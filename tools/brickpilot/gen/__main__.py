"""``python -m brickpilot.gen``: writes every generated file; ``--check``: exits 1 where one differs."""

from __future__ import annotations

import argparse
import tomllib
from importlib import metadata
from pathlib import Path

from brickpilot.errors import InputError
from brickpilot.firmware import params_header
from brickpilot.gen import (
    codecs,
    controllers_header,
    h8_states_header,
    model_sets_header,
    plant_presets,
    settings_header,
)
from brickpilot.gen.banner import banner
from brickpilot.vehicle.quantise import QuantisationError
from brickpilot.vehicle.settings import load

VEHICLE = Path("sim_host/models/rcx.toml")
MESSAGES = Path("hal/wire/brickpilot.dbc")
SETTINGS = Path("hal/wire/settings.toml")
STATES = Path("hal/h8sim/states.toml")


def generate(root: Path) -> dict[Path, str]:
    """Returns the text of each generated file of the checkout at `root`, and of the DBC with the settings' names."""
    settings = load(root / SETTINGS)
    inputs = {path: (root / path).read_bytes().decode("utf-8") for path in (VEHICLE, SETTINGS, MESSAGES, STATES)}
    inputs[MESSAGES] = settings_header.name_in(inputs[MESSAGES], settings)
    vehicle = tomllib.loads(inputs[VEHICLE].replace("\r\n", "\n"))
    nominal = {name: float(entry["value"]) for name, entry in vehicle["parameters"].items()}
    step = float(vehicle["rates"]["body_step"]["value"])
    codecs_header, of_brick, of_host = codecs.render(inputs[MESSAGES])
    made = [
        ("hal/wire/codecs_gen.h", [MESSAGES], codecs_header),
        ("hal/wire/codecs_gen.c", [MESSAGES], of_brick),
        ("tests/unit/link/host_codecs_gen.c", [MESSAGES], of_host),
        ("hal/h8sim/states_gen.h", [STATES], h8_states_header.render(inputs[STATES])),
        ("firmware/app/settings_gen.h", [SETTINGS], settings_header.render(settings)),
        ("firmware/app/params_gen.h", [VEHICLE, SETTINGS], params_header.render(vehicle, settings)),
        ("sim_host/models/rcx_gen.h", [VEHICLE], plant_presets.render(vehicle)),
        ("tests/numeric/controllers_gen.h", [VEHICLE], controllers_header.render(vehicle)),
        ("tests/numeric/model_sets_gen.h", [VEHICLE], model_sets_header.render(nominal, step)),
    ]
    files = {root / MESSAGES: inputs[MESSAGES]}
    for name, sources, text in made:
        files[root / name] = banner(Path(name).name, {path: inputs[path] for path in sources}) + text
    return files


def stale(files: dict[Path, str]) -> list[Path]:
    """Returns the files whose text differs or is missing. Line endings do not count."""
    return [
        path
        for path, text in files.items()
        if not path.exists() or path.read_text(encoding="utf-8") != text.replace("\r\n", "\n")
    ]


def checkout(start: Path) -> Path | None:
    """The folder at or above `start` that holds the vehicle file."""
    return next((folder for folder in (start, *start.parents) if (folder / VEHICLE).exists()), None)


def wrong_generator() -> str | None:
    """Returns what to install where cantools is not that of the extra `gen`; another one would write other codecs."""
    asked = next(one for one in metadata.requires("brickpilot") or () if one.startswith("cantools=="))
    wanted, found = asked.partition(";")[0].strip(), metadata.version("cantools")
    if wanted == f"cantools=={found}":
        return None
    return f"needs {wanted}, and {found} is installed: .venv/bin/pip install {wanted}"


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m brickpilot.gen", description=__doc__)
    parser.add_argument("--check", action="store_true", help="write nothing; exit 1 if a file differs")
    check = parser.parse_args().check
    root = checkout(Path.cwd())
    if root is None:
        parser.error(f"no {VEHICLE} here or above: run it in a checkout")
    if wrong := wrong_generator():
        parser.exit(1, f"{wrong}\n")
    try:
        files = generate(root)
    except (InputError, QuantisationError) as error:
        parser.exit(1, f"{error}\n")
    changed = stale(files)
    for path in changed:
        print(f"{path.relative_to(root)}: {'differs from what is generated' if check else 'written'}")
        if not check:
            path.write_text(files[path], encoding="utf-8")
    return 1 if check and changed else 0


if __name__ == "__main__":
    raise SystemExit(main())
