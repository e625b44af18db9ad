"""How each instruction of an RCX program and of brickOS's kernel changes the stack, and the largest stack of each task.

An interrupt uses the stack of the running task, on top of the task's own bytes. The kernel's instructions are read from
its image, in which hal/h8sim/rom.s replaces LEGO's ROM.
"""

from __future__ import annotations

import re
import subprocess
from bisect import bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from stack_walk import Depths, Outcome, State, UnboundedError

LINKER_SCRIPT = Path("/usr/lib/brickos/brickOS.lds")
SAVED, SAVED_FRAMED = "begin_saved", "begin_saved_framed"
"""Functions of firmware/core/h8/frames.S: both save r4 to r6; the second first reserves r3l bytes of locals."""
BY_INTERRUPT = 4 + 2 + 2
"""Bytes pushed before a handler begins: the processor pushes condition codes and return address, the ROM r6, and the
ROM's call of the handler a second return address."""
CODES = 2
"""Bytes of condition codes that the instruction RTE pops before the return address."""

WAIT_EVENT, TASK_SWITCH = 0x892A, 0x8512
"""The kernel's function whose callers pass wake-up functions, and the kernel's instruction that loads the stack pointer
of the next task. A task that resumes gets its own stack pointer again."""
VECTORS, NMI = range(0xFD92, 0xFDBF, 2), 0xFD92
"""Addresses at which the ROM reads the pointers to the interrupt handlers. Only NMI interrupts other handlers."""
TABLES = {0x8DD6: (0xA996, 6), 0x94D8: (0xA9AE, 20)}
"""The kernel's jumps through a table of addresses: address of the jump -> (address of the table, number of entries)."""
CALLS = {0x842C: {0x8504}, 0x9458: set[int](), 0x95E0: {0x9760}, 0x97D2: {0x9FCA}, 0x97E8: {0x9FCA}}
"""The kernel's other calls through a register, address of the call -> targets. The targets are the switch of tasks,
no handler of raw packets, and the handlers of the remote control and of its keys. `H8` adds the targets of the calls
of wake-up functions and of the link's handlers."""
WAKE_UP_CALL, PACKET_CALL = 0x868C, 0x949A
PROGRAM_PACKETS = 0x9966
"""The kernel's own handler of packets, which its loader uses."""
COPIED = {0xF000: 0xAB00}
"""The interrupt handler of the motors, which the kernel copies at startup: address of the copy -> address in the
image."""

_LINE = re.compile(r"^ *([0-9a-f]+):\t((?:[0-9a-f]{2} )+) *\t(.*\S)\s*$", re.MULTILINE)
_TARGET = re.compile(r"0x([0-9a-f]+)(?::24|\))")
_IMMEDIATE = re.compile(r"^mov\.[bw]\t#0x([0-9a-f]+),(r[0-6][hl]?)$")
_BRANCH = re.compile(r"^b(ra|t|rn|hi|ls|cc|hs|cs|lo|ne|eq|vc|vs|pl|mi|ge|lt|gt|le)\t")
_ONLY_READ = ("cmp", "btst", "bld", "bild", "band", "bor", "bxor", "ldc", "orc", "andc", "xorc")


def _tool(*command: str | Path) -> str:
    return subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout


def kernel() -> Path:
    """Returns the image of the kernel with the ROM that replaces LEGO's ROM."""
    return Path(_tool(Path(__file__).resolve().parents[2] / "hal/h8sim/kernel").strip())


def _listing(*command: str | Path) -> dict[int, tuple[int, str]]:
    """Returns the listing of objdump: address of an instruction -> (its size in bytes, its text)."""
    return {
        int(at, 16) & 0xFFFF: (len(raw.split()), text)
        for at, raw, text in _LINE.findall(_tool("h8300-hms-objdump", *command))
    }


class H8:
    """An RCX program and the kernel, for `stack_walk`. The keys of `State.known` are halves of registers, as r3l."""

    unit = 2
    return_address = 2

    def __init__(self, coff: Path, kernel: Path, indirect: Mapping[str, Sequence[str]]) -> None:
        """Reads a linked program.

        Args:
            coff: the program.
            kernel: the image that `kernel` returns.
            indirect: function of the program that calls through a register -> the functions that may be called.
        """
        self._code = _listing("-D", "-b", "srec", "-m", "h8300", kernel) | _listing("-d", coff)
        self._memory = b""
        kernel_at = {
            name: int(address, 16) + 0x8000 & 0xFFFF
            for name, address in re.findall(r"^ +_(\w+) = (0x0000\w{4}|0x\w{4}) ;", LINKER_SCRIPT.read_text(), re.M)
        }
        own = re.findall(r"^(\w+) [tT] _(?!_)(\w+)$", _tool("h8300-hms-nm", coff), re.M)
        self.at = kernel_at | {name: int(address, 16) & 0xFFFF for address, name in own}
        self._names: dict[int, str] = {address: name for name, address in self.at.items()}
        self._own = sorted(self.at[name] for _, name in own)
        self._indirect = indirect
        self._kernel = kernel
        self.calls = dict(CALLS)
        self.calls[WAKE_UP_CALL] = self._handed_over(WAIT_EVENT)
        self.calls[PACKET_CALL] = {PROGRAM_PACKETS} | ({self.at["receive"]} if "receive" in self.at else set())

    def name(self, address: int) -> str:
        return self._names.get(address, f"{address:#x}")

    def _handed_over(self, function: int) -> set[int]:
        """Returns the constants that callers of a function pass in r0."""
        found, before = set[int](), ""
        for address in sorted(self._code):
            text = self._code[address][1]
            target = _TARGET.search(text)
            if text.startswith(("jsr", "bsr")) and target and int(target[1], 16) == function:
                constant = re.fullmatch(r"mov\.w\t#0x([0-9a-f]+),r0", before)
                if constant is None:
                    raise UnboundedError(f"{address:#x}: no constant is handed to {self.name(function)}")
                found.add(int(constant[1], 16))
            before = text
        return found

    def interrupts(self) -> dict[int, int]:
        """Returns address of an interrupt vector -> address of the handler that the kernel writes there."""
        found, before = dict[int, int](), ""
        for address in sorted(self._code):
            text = self._code[address][1]
            written = re.fullmatch(r"mov\.w\tr2,@0x(fd[0-9a-f]{2}):16", text)
            if written and int(written[1], 16) in VECTORS:
                constant = re.fullmatch(r"mov\.w\t#0x([0-9a-f]+),r2", before)
                if constant is None:
                    raise UnboundedError(f"{address:#x}: a vector gets no constant")
                found[int(written[1], 16)] = int(constant[1], 16)
            before = text
        return found

    def lets_others_in(self, depths: Depths, handler: int) -> bool:
        """Returns whether an interrupt's handler allows other interrupts before it ends."""
        return any(self._code[address][1].startswith(("andc", "ldc\t#")) for address in depths.reached(handler))

    def _word(self, address: int) -> int:
        if not self._memory:
            records = re.findall(r"^S1(..)(....)(.*)..$", self._kernel.read_text(), re.M)
            memory = bytearray(0x10000)
            for _, at, data in records:
                raw = bytes.fromhex(data)
                memory[int(at, 16) : int(at, 16) + len(raw)] = raw
            self._memory = bytes(memory)
        return int.from_bytes(self._memory[address : address + 2], "big")

    def outcome(self, address: int, state: State) -> Outcome:
        if address not in self._code:
            raise UnboundedError("no instruction")
        size, text = self._code[address]
        after = address + size
        name, _, operands = text.partition("\t")
        target = int(found[1], 16) if (found := _TARGET.search(operands)) else None
        if name in {"rts", "rte"}:
            return self._returned(state, name)
        if _BRANCH.match(text):
            assert target is not None
            always = name in {"bra", "bt"}
            return Outcome((target,) if always else (after, target), state)
        if name == "jmp" and target is not None:
            return Outcome((target,), state)
        if name == "jmp" and address in TABLES:
            table, entries = TABLES[address]
            return Outcome(tuple(self._word(table + 2 * i) for i in range(entries)), state)
        if name in {"jsr", "bsr"} and target is not None:
            if (begun := self._begun(target, state)) is not None:
                return Outcome((after,), begun)
            return Outcome((after,), self._after_call(state), (COPIED.get(target, target),))
        if name == "jsr":
            return Outcome((after,), self._after_call(state), self._listed(address))
        if name == "jmp":
            raise UnboundedError("goes where a register says, and no list says where")
        if address == TASK_SWITCH:
            return Outcome((after,), state)
        return Outcome((after,), self._moved(name, operands, state))

    def _listed(self, address: int) -> tuple[int, ...]:
        if address in self.calls:
            return tuple(sorted(self.calls[address]))
        place = bisect_right(self._own, address)
        function = self.name(self._own[place - 1]) if place else ""
        if function not in self._indirect:
            raise UnboundedError("calls where a register says, and no list says where")
        return tuple(self.at[one] for one in self._indirect[function])

    @staticmethod
    def _returned(state: State, name: str) -> Outcome:
        stack = state.stack
        if name == "rte":
            if not stack:
                raise UnboundedError("no condition codes to return with")
            stack = stack[:-1]
        if not stack:
            return Outcome((), State((), state.known))
        if stack[-1] is None:
            raise UnboundedError(f"returns with {2 * len(stack)} bytes on the stack")
        return Outcome((stack[-1],), State(stack[:-1], state.known))

    def _begun(self, target: int, state: State) -> State | None:
        """Returns the state after a call of `SAVED` or `SAVED_FRAMED`; None: `target` is another function."""
        if target == self.at.get(SAVED):
            return state.pushed(3)
        if target == self.at.get(SAVED_FRAMED):
            locals_ = state.known.get("r3l")
            if locals_ is None:
                raise UnboundedError("locals of a size that is not known")
            return state.pushed(3 + locals_ // 2)
        return None

    @staticmethod
    def _after_call(state: State) -> State:
        lost = {f"r{number}{half}": None for number in range(4) for half in "hl"}
        return state.with_known(**lost)

    def _moved(self, name: str, operands: str, state: State) -> State:
        """Returns the state after an instruction that neither jumps nor calls."""
        first, _, last = operands.rpartition(",")
        if last == "@-r7":
            return state.pushed(1, self._value(first, state))
        if first == "@r7+":
            value = state.stack[-1] if state.stack else None
            return self._set(state.pushed(-1), last, value)
        if last == "r7":
            return self._stack_pointer(name, first, state)
        if last in {"r7h", "r7l"} or re.search(r"@-r7|@r7\+", operands):
            raise UnboundedError(f"{name} {operands}: no rule knows it")
        if constant := _IMMEDIATE.match(f"{name}\t{operands}"):
            return self._set(state, constant[2], int(constant[1], 16))
        if name in {"sub.w", "sub.b", "xor.b"} and first == last:
            return self._set(state, last, 0)
        if name == "mov.w" and re.fullmatch(r"r[0-6]", first) and re.fullmatch(r"r[0-6]", last):
            return self._set(state, last, self._value(first, state))
        for stepped in re.findall(r"@-(r[0-6])|@(r[0-6])\+", operands):
            state = self._set(state, stepped[0] or stepped[1], None)
        if name.startswith("eepmov"):
            raise UnboundedError("no rule knows eepmov")
        if re.fullmatch(r"r[0-6][hl]?", last) and not name.startswith(_ONLY_READ):
            state = self._set(state, last, None)
        return state

    def _stack_pointer(self, name: str, first: str, state: State) -> State:
        if name in {"adds", "subs"} and first == "#2":
            return state.pushed(1 if name == "subs" else -1)
        if name in {"add.w", "sub.w"} and (by := self._value(first, state)) is not None:
            by -= (by & 0x8000) << 1
            return state.pushed((by if name == "sub.w" else -by) // 2)
        if name == "cmp.w":
            return state
        raise UnboundedError(f"{name} {first},r7: the stack pointer gets a value that is not followed")

    @staticmethod
    def _value(register: str, state: State) -> int | None:
        if not re.fullmatch(r"r[0-6]", register):
            return None
        high, low = state.known.get(f"{register}h"), state.known.get(f"{register}l")
        return None if high is None or low is None else high << 8 | low

    @staticmethod
    def _set(state: State, register: str, value: int | None) -> State:
        if len(register) == 3:
            return state.with_known(**{register: value})
        halves = (None, None) if value is None else (value >> 8, value & 0xFF)
        return state.with_known(**{f"{register}h": halves[0], f"{register}l": halves[1]})


@dataclass(frozen=True)
class Bound:
    """The largest stack of a task, in bytes: of the task's functions, and of interrupt handlers on top of them."""

    task: int
    interrupts: int

    @property
    def all(self) -> int:
        return self.task + self.interrupts


def bounds(h8: H8, tasks: Sequence[str]) -> dict[str, Bound]:
    """Returns task -> bound of its stack. `tasks`: names of the functions with which the tasks begin."""
    depths = Depths(h8)
    vectors = h8.interrupts()
    if NMI not in vectors:
        raise UnboundedError("the kernel has no handler of NMI")
    if any(h8.lets_others_in(depths, handler) for handler in vectors.values()):
        raise UnboundedError("a handler allows other interrupts")
    cost = {vector: BY_INTERRUPT + depths.most(handler) for vector, handler in vectors.items()}
    interrupts = cost.pop(NMI) + max(cost.values())
    # A task's function returns to the kernel's exit().
    return {
        task: Bound(max(h8.return_address + depths.most(h8.at[task]), depths.most(h8.at["exit"])), interrupts)
        for task in tasks
    }
