"""The versions that a result may depend on besides its argument: of this program and of its libraries."""

from __future__ import annotations

import dataclasses
import hashlib
import platform
from dataclasses import dataclass
from functools import cache
from importlib.metadata import version
from pathlib import Path

import brickpilot

_COMPILED = (".so", ".dylib", ".dll")
_DIGITS = 12


@dataclass(frozen=True)
class Versions:
    """The versions of one process. Two processes with equal versions give the same bytes for the same part.

    Attributes:
        brickpilot: the version of the program.
        code: hash of its Python files and tables.
        plant: hash of its compiled libraries.
        python: the version of Python, without its last number.
        numpy, scipy, pyarrow: those of the libraries.
    """

    brickpilot: str
    code: str
    plant: str
    python: str
    numpy: str
    scipy: str
    pyarrow: str

    def differences(self, other: Versions) -> str:
        """Returns the differences as text, this one's first: "brickpilot 0.1.0, not 0.2.0". Nothing if nothing does."""
        pairs = [(one.name, getattr(self, one.name), getattr(other, one.name)) for one in dataclasses.fields(self)]
        return "; ".join(f"{name} {mine}, not {theirs}" for name, mine, theirs in pairs if mine != theirs)


@cache
def here() -> Versions:
    """Returns the versions of this process."""
    files = sorted(path for path in Path(brickpilot.__file__).parent.rglob("*") if path.is_file())
    return Versions(
        brickpilot=brickpilot.__version__,
        code=_hash([path for path in files if path.suffix in (".py", ".toml")]),
        plant=_hash([path for path in files if path.suffix in _COMPILED]),
        python=".".join(platform.python_version_tuple()[:2]),
        numpy=version("numpy"),
        scipy=version("scipy"),
        pyarrow=version("pyarrow"),
    )


def _hash(files: list[Path]) -> str:
    """Returns the hash of files, with their names."""
    found = hashlib.sha256()
    for path in files:
        found.update(path.name.encode() + b"\0" + hashlib.sha256(path.read_bytes()).digest())
    return found.hexdigest()[:_DIGITS]
