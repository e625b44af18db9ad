"""Describes how each instruction of an AVR image changes the stack, and bounds the stack of a whole image."""

from __future__ import annotations

import re
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from stack_walk import Depths, Outcome, State, UnboundedError

END_OF_RAM = {"328p": 0x900, "2560": 0x2200}
"""Chip -> the first address behind its RAM."""
CANARY = 2
"""Number of bytes between variables and stack whose change resets the chip: hal/avr/guard.c."""

_LINE = re.compile(r"^ *([0-9a-f]+):\t((?:[0-9a-f]{2} )+) *\t(\S+)(?:\t([^;]*))?(?:; (0x[0-9a-f]+))?")
_LABEL = re.compile(r"^([0-9a-f]+) <([^>]+)>:$")
_SKIPS = {"cpse", "sbrc", "sbrs", "sbic", "sbis"}
_COMPARES = {"cp", "cpc", "cpi", "tst", "sbrc", "sbrs", "push", "out", "st", "std", "sts"}
_Y = ("r28", "r29")


@dataclass(frozen=True)
class _Instruction:
    size: int
    name: str
    operands: tuple[str, ...]
    target: int | None


def _tool(*command: str | Path) -> str:
    return subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout


class Avr:
    """An AVR image.

    The walk follows the frame pointer Y: the compiler copies the stack pointer to Y, changes Y, and moves the stack
    pointer by writing Y back. `known["y"]` is the depth of the stack, in bytes, to which Y points.
    """

    unit = 1

    def __init__(self, elf: Path, indirect: Mapping[str, Sequence[str]]) -> None:
        """Reads an image.

        Args:
            elf: the image that `firmware/targets/avr/build` makes.
            indirect: function that calls through a register -> the functions that it may call.
        """
        symbols = re.findall(r"^(\w+) (\w) (\S+)$", _tool("avr-nm", elf), re.M)
        self.at = {name: int(address, 16) for address, kind, name in symbols if kind in "tTW"}
        # avr-nm adds 0x800000 to addresses of RAM.
        self.end_of_variables = next(int(at, 16) & 0xFFFF for at, _, name in symbols if name == "_end")
        self._names: dict[int, str] = {}
        self._within: dict[int, str] = {}
        self._code: dict[int, _Instruction] = {}
        self._indirect = indirect
        function = ""
        for line in _tool("avr-objdump", "-d", elf).splitlines():
            if label := _LABEL.match(line):
                function = label[2]
                self._names[int(label[1], 16)] = function
            elif found := _LINE.match(line):
                address = int(found[1], 16)
                operands = tuple(one.strip() for one in (found[4] or "").split(",") if one.strip())
                target = int(found[5], 16) if found[5] else None
                if target is None and operands and operands[-1].startswith("0x"):
                    target = int(operands[-1], 16)
                self._code[address] = _Instruction(len(found[2].split()), found[3], operands, target)
                self._within[address] = function
        # Chips of avr:6 have more than 128 KB of flash, so a return address has 3 bytes.
        self.return_address = 3 if "architecture: avr:6" in _tool("avr-objdump", "-f", elf) else 2

    def name(self, address: int) -> str:
        return self._names.get(address, f"{address:#x}")

    def interrupts(self) -> list[int]:
        """Returns the addresses of the interrupt handlers, without the reset handler."""
        first = self.at["__vectors"]
        handlers, address = set[int](), first
        while self._within.get(address) == "__vectors" and self._code[address].name in {"jmp", "rjmp"}:
            target = self._code[address].target
            assert target is not None
            if address != first:
                handlers.add(target)
            address += self._code[address].size
        return sorted(handlers)

    def lets_others_in(self, depths: Depths, handler: int) -> bool:
        """Returns whether an interrupt's handler allows other interrupts before it ends."""
        return any(self._code[address].name == "sei" for address in depths.reached(handler))

    def outcome(self, address: int, state: State) -> Outcome:
        if address not in self._code:
            raise UnboundedError("no instruction")
        code = self._code[address]
        after, name, operands = address + code.size, code.name, code.operands
        if name in {"ret", "reti"}:
            if state.stack:
                raise UnboundedError(f"returns with {len(state.stack)} bytes on the stack")
            return Outcome((), state)
        if name in {"jmp", "rjmp"}:
            assert code.target is not None
            for_ever = code.target in {address, self.at["__vectors"]}  # an endless loop, or a restart of the program
            return Outcome(() if for_ever else (code.target,), state)
        if name in {"call", "rcall"}:
            assert code.target is not None
            if code.target == after:  # by a call to the next instruction, the compiler reserves stack
                return Outcome((after,), state.pushed(self.return_address))
            return Outcome((after,), state, (code.target,))
        if name in {"icall", "eicall"}:
            return Outcome((after,), state, self._listed(address))
        if name in {"ijmp", "eijmp"}:
            return Outcome(self._listed(address), state)
        if name.startswith("br") and name != "break":
            assert code.target is not None
            return Outcome((after, code.target), state)
        if name in _SKIPS:
            return Outcome((after, after + self._code[after].size), state)
        if name == "push":
            return Outcome((after,), state.pushed(1))
        if name == "pop":
            state = state.pushed(-1)
        return Outcome((after,), self._moved(name, operands, state))

    def _listed(self, address: int) -> tuple[int, ...]:
        function = self._within[address]
        if function not in self._indirect:
            raise UnboundedError(f"{function} goes where a register says, and no list says where")
        return tuple(self.at[one] for one in self._indirect[function])

    def _moved(self, name: str, operands: tuple[str, ...], state: State) -> State:
        """Returns the state after an instruction that may change Y or the stack pointer."""
        if not operands:
            return state
        y, low = state.known.get("y"), state.known.get("low")
        if name == "in" and operands == ("r28", "0x3d"):
            return state.with_known(y=len(state.stack))
        if name == "in" and operands == ("r29", "0x3e"):
            return state
        if name == "out" and operands[0] in {"0x3d", "0x3e"}:
            if operands[1] not in _Y or y is None:
                raise UnboundedError("the stack pointer gets a value that is not followed")
            return state.pushed(y - len(state.stack)) if operands[0] == "0x3d" else state
        if operands[0] in _Y and y is not None:
            if name in {"adiw", "sbiw"}:
                step = int(operands[1], 0)
                return state.with_known(y=y + (step if name == "sbiw" else -step))
            if name == "subi" and operands[0] == "r29":  # Y changes by a multiple of 256 bytes
                step = int(operands[1], 0)
                return state.with_known(y=y + ((step - 0x100 if step >= 0x80 else step) << 8))
            if name == "subi":
                return state.with_known(low=int(operands[1], 0))
            if name == "sbci" and operands[0] == "r29" and low is not None:
                step = int(operands[1], 0) << 8 | low
                return state.with_known(y=y + (step - 0x10000 if step >= 0x8000 else step), low=None)
        if (operands[0] in _Y and name not in _COMPARES) or any(one in {"Y+", "-Y"} for one in operands):
            return state.with_known(y=None, low=None)
        return state


@dataclass(frozen=True)
class Bound:
    """Bytes of stack: main with all functions that it calls, the interrupts on top of main, and the available room."""

    main: int
    interrupts: int
    room: int

    @property
    def all(self) -> int:
        return self.main + self.interrupts


def bound(avr: Avr, end_of_ram: int) -> Bound:
    """Returns the largest stack that an image can take, and the room for it.

    A handler blocks other interrupts until it ends, so only the deepest handler counts. If some handler allows other
    interrupts, all handlers count, because they may run on top of each other.

    Args:
        avr: the image.
        end_of_ram: a value of `END_OF_RAM`.
    """
    depths = Depths(avr)
    # The start code calls main, which costs a return address.
    main = avr.return_address + depths.most(avr.at["main"])
    cost = {one: avr.return_address + depths.most(one) for one in avr.interrupts()}
    nesting = [one for one in cost if avr.lets_others_in(depths, one)]
    interrupts = sum(cost.values()) if nesting else max(cost.values())
    return Bound(main, interrupts, end_of_ram - avr.end_of_variables - CANARY)
