"""``python -m brickpilot.gen``: writes every generated file; ``--check``: exits 1 where one differs."""

from __future__ import annotations

import argparse
import tomllib
from pathlib import Path

from brickpilot.gen import codecs, controllers_header, model_sets_header, params_header, plant_presets
from brickpilot.gen.banner import banner

VEHICLE = Path("sim_host/models/rcx.toml")
MESSAGES = Path("hal/wire/brickpilot.dbc")


def generate(root: Path) -> dict[Path, str]:
    """Text of each generated file of the checkout at `root`."""
    vehicle = tomllib.loads((root / VEHICLE).read_text(encoding="utf-8"))
    nominal = {name: float(entry["value"]) for name, entry in vehicle["parameters"].items()}
    step = float(vehicle["rates"]["body_step"]["value"])
    codecs_header, of_brick, of_host = codecs.render(root / MESSAGES)
    made = {
        MESSAGES: {
            "hal/wire/codecs_gen.h": codecs_header,
            "hal/wire/codecs_gen.c": of_brick,
            "tests/unit/link/host_codecs_gen.c": of_host,
        },
        VEHICLE: {
            "sim_host/models/rcx_gen.h": plant_presets.render(vehicle),
            "firmware/app/params_gen.h": params_header.render(vehicle),
            "tests/numeric/controllers_gen.h": controllers_header.render(vehicle),
            "tests/numeric/model_sets_gen.h": model_sets_header.render(nominal, step),
        },
    }
    return {
        root / name: banner(Path(name), root, [source]) + text
        for source, files in made.items()
        for name, text in files.items()
    }


def stale(files: dict[Path, str]) -> list[Path]:
    """Those whose committed text differs or is missing."""
    return [path for path, text in files.items() if not path.exists() or path.read_text(encoding="utf-8") != text]


def checkout(start: Path) -> Path | None:
    """The folder at or above `start` that holds the vehicle file."""
    return next((folder for folder in (start, *start.parents) if (folder / VEHICLE).exists()), None)


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m brickpilot.gen", description=__doc__)
    parser.add_argument("--check", action="store_true", help="write nothing; exit 1 if a file differs")
    check = parser.parse_args().check
    root = checkout(Path.cwd())
    if root is None:
        parser.error(f"no {VEHICLE} here or above: run it in a checkout")
    files = generate(root)
    changed = stale(files)
    for path in changed:
        print(f"{path.relative_to(root)}: {'differs from what is generated' if check else 'written'}")
        if not check:
            path.write_text(files[path], encoding="utf-8")
    return 1 if check and changed else 0


if __name__ == "__main__":
    raise SystemExit(main())
