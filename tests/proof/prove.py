"""Proves with CBMC what proofs.toml lists, and shows that no proof is empty and that the proofs find planted faults.

prove.py [--full] [NAME...] all proofs, or those named; exits with 1 if a proof fails. --full: also the long proofs
prove.py --plants [NAME...] plants each fault of plants.toml in a copy of the sources; the fault's proof has to fail
prove.py --write            writes the times of the last run into the table of README.md
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import ranges

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
BUILD = ROOT / "build/proof"
LONGEST_S = 300  # longest time of one proof
HELD, FAILED = 0, 10  # statuses of cbmc
MARKS = "<!-- proofs -->\n", "<!-- end of proofs -->"

Table = dict[str, dict[str, Any]]


def table(name: str) -> Table:
    """Returns the rows of a TOML file of this folder, with the defaults of the file filled in."""
    rows: Table = tomllib.loads((HERE / name).read_text(encoding="utf-8"))
    defaults = rows.pop("defaults", {})
    return {key: {**defaults, **row} for key, row in rows.items()}


def checker() -> Path:
    """Returns the folder with cbmc and kissat; fetches them first."""
    done = subprocess.run([HERE / "checker"], check=True, stdout=subprocess.PIPE, text=True)
    return Path(done.stdout.strip())


def command(programs: Path, name: str, row: dict[str, Any], bits: int, root: Path, *more: str) -> list[str]:
    """Returns the command line of cbmc for a proof of the sources below `root`."""
    headers = [f"-I{root / folder}" for folder in ("firmware", "hal", "hal/include")]
    if bits == 16:
        headers.insert(0, f"-I{root / 'hal/h8/include'}")
    solver = ["--external-sat-solver", str(programs / "kissat")] if row.get("solver") == "kissat" else []
    return [
        str(programs / "cbmc"), f"--{bits}", str(HERE / "harness" / f"{row['file']}.c"),
        *(str(root / one) for one in row["with"]), *headers, f"-I{HERE / 'harness'}", f"-I{BUILD}",
        "--function", name, "--unwind", str(row["unwind"]), "--unwinding-assertions", "--signed-overflow-check",
        "--undefined-shift-check", "--div-by-zero-check", "--bounds-check", "--pointer-check",
        "--slice-formula", "--drop-unused-functions", "--verbosity", "4", *solver, *more,
    ]  # fmt: skip


def run(call: list[str]) -> tuple[int, float, str]:
    """Returns the status, the seconds and the output of a call; status -1 if it takes too long."""
    began = time.monotonic()
    try:
        done = subprocess.run(call, capture_output=True, text=True, timeout=LONGEST_S, check=False)
    except subprocess.TimeoutExpired:
        return -1, time.monotonic() - began, f"no answer in {LONGEST_S} s"
    return done.returncode, time.monotonic() - began, done.stdout + done.stderr


def failures(text: str) -> str:
    """Returns the first properties that failed, or the end of the checker's output."""
    failed = [line for line in text.splitlines() if line.endswith(": FAILURE")]
    return "\n  ".join(failed[:5] or text.splitlines()[-5:])


def prove(programs: Path, name: str, row: dict[str, Any], bits: int) -> dict[str, Any]:
    """Proves one row with one width of int, and checks that the end of the proof can be reached."""
    status, seconds, text = run(command(programs, name, row, bits, ROOT))
    result = {"name": name, "bits": bits, "seconds": seconds, "held": status == HELD, "why": failures(text)}
    if status == HELD:
        reached = command(programs, name, row, bits, ROOT, "-DREACHED", "--no-standard-checks", "--stop-on-fail")
        status, _, text = run([one for one in reached if not one.endswith("-check")])
        if status != FAILED or "the end is reached" not in text:
            result.update(held=False, why="nothing is left to prove: no input fulfils the assumptions")
    return result


def shown(rows: Table, full: bool) -> list[str]:
    """Returns the names of the rows that a run proves."""
    return [name for name, row in rows.items() if full or not row.get("full")]


def prove_all(names: list[str], jobs: int, full: bool) -> bool:
    """Proves the rows of these names, or all rows; prints a line for each. Returns whether all proofs hold."""
    programs, rows = checker(), table("proofs.toml")
    BUILD.mkdir(parents=True, exist_ok=True)
    (BUILD / "ranges_gen.h").write_text(ranges.header(), encoding="utf-8")
    chosen = [(name, bits) for name in names or shown(rows, full) for bits in rows[name]["int"]]
    results = []
    with ThreadPoolExecutor(jobs) as pool:
        for result in pool.map(lambda one: prove(programs, one[0], rows[one[0]], one[1]), chosen):
            results.append(result)
            verdict = "proved" if result["held"] else f"NOT PROVED\n  {result['why']}"
            width = f"int of {min(result['bits'], 32)}"
            print(f"{result['name']}, {width}: {result['seconds']:.1f} s, {verdict}", flush=True)
    if not names:
        (BUILD / "results.json").write_text(json.dumps(results), encoding="utf-8")
    held = sum(result["held"] for result in results)
    print(f"{held} passed, {len(results) - held} failed")
    return held == len(results)


def plant(programs: Path, name: str, row: dict[str, Any], proof: dict[str, Any]) -> str:
    """Plants a fault in a copy of the sources. Returns what went wrong, or "" if the proof fails, as it should."""
    with tempfile.TemporaryDirectory(dir=BUILD) as folder:
        root = Path(folder)
        for one in ("firmware", "hal"):
            shutil.copytree(ROOT / one, root / one, ignore=shutil.ignore_patterns("*.svg", "README.md"))
        path = root / row["source"]
        text = path.read_text(encoding="utf-8")
        if text.count(row["old"]) != 1:
            return f"{row['source']} has {text.count(row['old'])} times: {row['old']}"
        path.write_text(text.replace(row["old"], row["new"]), encoding="utf-8")
        status, seconds, output = run(command(programs, row["proof"], proof, 16, root))
    if status == FAILED:
        found = [line for line in output.splitlines() if line.endswith(": FAILURE")]
        print(f"{name}: found by {row['proof']} in {seconds:.1f} s: {found[0].removesuffix(': FAILURE')}", flush=True)
        return ""
    return f"{row['proof']} ends with status {status}: {failures(output)}"


def plant_all(names: list[str], jobs: int, _full: bool) -> bool:
    """Plants the faults with these names, or all faults. Returns whether the proofs find all."""
    programs, rows, proofs = checker(), table("plants.toml"), table("proofs.toml")
    BUILD.mkdir(parents=True, exist_ok=True)
    (BUILD / "ranges_gen.h").write_text(ranges.header(), encoding="utf-8")
    chosen = names or list(rows)
    with ThreadPoolExecutor(jobs) as pool:
        missed = list(pool.map(lambda name: plant(programs, name, rows[name], proofs[rows[name]["proof"]]), chosen))
    for name, why in zip(chosen, missed, strict=True):
        if why:
            print(f"{name}: NOT FOUND: {why}")
    print(f"{missed.count('')} passed, {len(missed) - missed.count('')} failed")
    return not any(missed)


def write() -> None:
    """Writes the table of README.md from the results of the last whole run."""
    rows, results = table("proofs.toml"), json.loads((BUILD / "results.json").read_text(encoding="utf-8"))
    lines = ["| proof | property | domain | s, int of 16 | s, int of 32 |", "|---|---|---|---|---|"]
    for name, row in rows.items():
        seconds = {
            one["bits"]: f"{one['seconds']:.1f}" if one["held"] else "not proved"
            for one in results
            if one["name"] == name
        }
        lines.append(
            f"| `{name}` | {row['property']} | {row['domain']} | {seconds.get(16, '-')} | {seconds.get(64, '-')} |"
        )
    readme = HERE / "README.md"
    before, _, rest = readme.read_text(encoding="utf-8").partition(MARKS[0])
    _, _, after = rest.partition(MARKS[1])
    readme.write_text(before + MARKS[0] + "\n".join(lines) + "\n" + MARKS[1] + after, encoding="utf-8")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*")
    parser.add_argument("--plants", action="store_true")
    parser.add_argument("--write", action="store_true")
    parser.add_argument("--full", action="store_true")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    options = parser.parse_args()
    if options.write:
        write()
        return 0
    return 0 if (plant_all if options.plants else prove_all)(options.names, options.jobs, options.full) else 1


if __name__ == "__main__":
    sys.exit(main())
