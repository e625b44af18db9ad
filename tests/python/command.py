"""Runs the installed command as a user does: in a separate process, with its exit status and its output.

Loading the package takes longer than most commands. So the process is a copy (a fork) of a process that has only loaded
the package; the copy then runs the installed script to its end. `fresh=True` starts a new interpreter instead, with its
own hash seed.

A copy ends as an interpreter does: it joins threads, calls the functions of atexit, and flushes the output. But unlike
an interpreter, a copy does not delete all modules: this takes as long as a short command, and would copy their memory.
"""

from __future__ import annotations

import atexit
import json
import os
import resource
import runpy
import select
import socket
import subprocess
import sys
import tempfile
import threading
from contextlib import suppress
from pathlib import Path

PROGRAM = Path(sys.executable).with_name("brickpilot")
LAB = Path(__file__).parents[1] / "lab" / "__main__.py"
_loaded: tuple[subprocess.Popen[bytes], Path] | None = None
_starting = threading.Lock()
_exit_status: int | None = None


def brickpilot(
    *arguments: str, cwd: Path, timeout: float = 300.0, fresh: bool = False
) -> subprocess.CompletedProcess[str]:
    """Runs `brickpilot ARGUMENTS` in `cwd`. Raises subprocess.TimeoutExpired after `timeout` seconds."""
    command = [str(PROGRAM), *arguments]
    if fresh:
        return subprocess.run(
            command, cwd=cwd, capture_output=True, text=True, timeout=timeout, stdin=subprocess.DEVNULL
        )
    return _copied(command, cwd, timeout)


def lab(*arguments: str, cwd: Path, timeout: float = 300.0) -> subprocess.CompletedProcess[str]:
    """Runs `sh tests/lab/run ARGUMENTS` in `cwd`. Raises subprocess.TimeoutExpired after `timeout` seconds."""
    return _copied([str(LAB), *arguments], cwd, timeout)


def _copied(command: list[str], cwd: Path, timeout: float) -> subprocess.CompletedProcess[str]:
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
        copy = Copy(command, cwd, out.fileno(), err.fileno())
        try:
            status = copy.wait(timeout)
        except subprocess.TimeoutExpired:
            with suppress(ProcessLookupError):
                os.kill(copy.pid, 9)
            raise
        printed = []
        for file in (out, err):
            file.seek(0)
            printed.append(file.read().decode().replace("\r\n", "\n").replace("\r", "\n"))  # as with text=True
    return subprocess.CompletedProcess(command, status, *printed)


class Copy:
    """A command that runs in the process `pid`, a copy. It prints to the file descriptors `out` and `err`.

    Args:
        room: size of the largest file that the command may write, in bytes; None: no limit.
        in_group: whether the command leads its own process group.
    """

    def __init__(
        self, command: list[str], cwd: Path, out: int, err: int, *, room: int | None = None, in_group: bool = False
    ) -> None:
        self._command, talk = command, socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        talk.connect(str(_address()))
        wanted = {"command": command, "cwd": str(cwd), "environment": dict(os.environ)}
        request = json.dumps(wanted | {"room": room, "in_group": in_group}).encode()
        socket.send_fds(talk, [len(request).to_bytes(4, "big")], [out, err])
        talk.sendall(request)
        self._answers = talk.makefile("rb", buffering=0)
        talk.close()  # `_answers` keeps the connection open
        self.pid = int(self._answers.readline())
        self._status: int | None = None

    def wait(self, timeout: float) -> int:
        """Returns the exit status. Raises subprocess.TimeoutExpired after `timeout` s; then a further call waits on."""
        if self._status is None:
            if not select.select([self._answers], [], [], timeout)[0]:
                raise subprocess.TimeoutExpired(self._command, timeout)
            with self._answers:
                self._status = int(self._answers.readline())
        return self._status


def _address() -> Path:
    """Returns the path of the socket at which the process with the loaded package listens. The first call starts it."""
    global _loaded
    with _starting:
        if _loaded is None:
            address = Path(tempfile.mkdtemp(prefix="brickpilot-")) / "socket"
            ready, told = os.pipe()
            process = subprocess.Popen(
                [sys.executable, __file__, str(address), str(told)], pass_fds=[told],
                stdin=subprocess.PIPE, stdout=subprocess.DEVNULL,
            )  # fmt: skip
            os.close(told)
            with os.fdopen(ready, "rb") as pipe:
                assert pipe.read() == b"ready", "the package does not load"
            _loaded = process, address
            atexit.register(_end)
        return _loaded[1]


def _end() -> None:
    assert _loaded is not None
    process, address = _loaded
    process.terminate()
    process.wait()
    address.unlink()
    address.parent.rmdir()


def _end_without_taking_apart() -> None:
    """Flushes the output and ends the copy with its exit status; it is the last function of atexit in a copy.

    Nothing is ended if the script ended by an exception, so that its status is unknown, or if the output cannot be
    flushed. Then the interpreter ends as usual.
    """
    if _exit_status is not None:
        try:
            sys.stdout.flush()
            sys.stderr.flush()
        except (OSError, ValueError):
            return
        os._exit(_exit_status)


def _run_to_its_end(script: str) -> None:
    """Runs a script, and stores its exit status in `_exit_status`."""
    global _exit_status
    try:
        runpy.run_path(script, run_name="__main__")
    except SystemExit as ended:
        if ended.code is None or isinstance(ended.code, int):
            _exit_status = (ended.code or 0) & 0xFF
        raise
    _exit_status = 0


def _load() -> None:
    """Imports every module of the package that is written in Python, except `brickpilot.gen`."""
    import importlib
    import pkgutil

    import brickpilot

    for module in pkgutil.walk_packages(brickpilot.__path__, "brickpilot."):
        spec = module.module_finder.find_spec(module.name, None)
        is_python = spec is not None and str(spec.origin).endswith(".py")
        if is_python and not module.name.startswith("brickpilot.gen"):
            importlib.import_module(module.name)


def _serve(address: str, told: int) -> list[str]:
    """Makes a copy of this process for each request. In each copy it returns the command that the copy has to run."""
    import gc

    atexit.register(_end_without_taking_apart)  # atexit calls the first registered function last
    _load()
    gc.freeze()  # so that the garbage collector does not write to these objects, and copies share their memory
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as listening:
        listening.bind(address)
        listening.listen(64)
        os.write(told, b"ready")
        os.close(told)
        while True:
            talk, _ = listening.accept()
            with talk:
                if os.fork() == 0:
                    if (command := _watched(talk)) is not None:
                        return command
                    os._exit(0)
            with suppress(ChildProcessError):
                while os.waitpid(-1, os.WNOHANG) != (0, 0):
                    pass


def _watched(talk: socket.socket) -> list[str] | None:
    """Reads one request, forks a process for it and reports the process's end.

    Returns the command in the new process, and None in this process after the new process has ended.
    """
    size, files, _, _ = socket.recv_fds(talk, 4, 2)
    request = json.loads(talk.makefile("rb").read(int.from_bytes(size, "big")))
    process = os.fork()
    if request["in_group"]:
        os.setpgid(process, process)  # both processes do this, because either may run first
    if process == 0:
        talk.close()
        os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
        for place, file in enumerate(files, 1):
            os.dup2(file, place)
            os.close(file)
        sys.stdout = open(1, "w", closefd=False)  # noqa: SIM115
        sys.stderr = open(2, "w", buffering=1, errors="backslashreplace", closefd=False)  # noqa: SIM115
        if request["room"] is not None:
            resource.setrlimit(resource.RLIMIT_FSIZE, (request["room"], request["room"]))
        os.chdir(request["cwd"])
        os.environ.clear()
        os.environ.update(request["environment"])
        command: list[str] = request["command"]
        return command
    talk.sendall(f"{process}\n".encode())
    status = os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])
    talk.sendall(f"{status}\n".encode())
    return None


if __name__ == "__main__":
    sys.argv = _serve(sys.argv[1], int(sys.argv[2]))
    sys.path[0] = str(LAB.parents[1] if sys.argv[0] == str(LAB) else PROGRAM.parent)
    _run_to_its_end(sys.argv[0])
