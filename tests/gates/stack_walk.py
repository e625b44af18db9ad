"""Finds the largest stack of a program's functions by a walk through the instructions of the linked image.

A walk follows every path from an entry, and keeps the contents of the stack at each instruction. Two paths that meet
must have the same depth. A call costs a return address and the stack of the called function. A jump continues the same
walk, so a call that the compiler turned into a jump is counted. These are errors, because they leave the depth unknown:
recursion, a jump through a register whose targets are not listed, and a change of the stack pointer without a rule.

`avr_stack.py` and `h8_stack.py` describe the instructions of the two processors.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol

REQUESTS = {"commands_take": ("open_session", "command_mode", "parameter", "waypoint", "route")}
"""The firmware's only call through a pointer, with its targets: the table REQUESTS of firmware/app/commands.c."""


class UnboundedError(Exception):
    """No bound can be given. The message says where and why."""


@dataclass(frozen=True)
class State:
    """The known state before an instruction.

    Attributes:
        stack: the values that the walk has pushed, the newest last; None: the value is not known.
        known: register -> its value, if known. Each processor defines the meaning of a value.
    """

    stack: tuple[int | None, ...] = ()
    known: Mapping[str, int] = field(default_factory=dict)

    def pushed(self, count: int, value: int | None = None) -> State:
        """Returns the state with `count` more values on the stack; a negative count removes values."""
        if count >= 0:
            return State(self.stack + (value,) * count, self.known)
        if -count > len(self.stack):
            raise UnboundedError("the stack of the caller is taken off")
        return State(self.stack[:count], self.known)

    def with_known(self, **values: int | None) -> State:
        """Returns the state with these registers known, or not known if the value is None."""
        known = {name: value for name, value in ({**self.known, **values}).items() if value is not None}
        return State(self.stack, known)

    def joined(self, other: State) -> State:
        """Returns the state that holds on both paths."""
        if len(self.stack) != len(other.stack):
            raise UnboundedError(f"paths meet with {len(self.stack)} and {len(other.stack)} on the stack")
        stack = tuple(a if a == b else None for a, b in zip(self.stack, other.stack, strict=True))
        return State(stack, dict(self.known.items() & other.known.items()))


@dataclass(frozen=True)
class Outcome:
    """The result of an instruction.

    Attributes:
        to: the addresses that may follow, all with `state`; empty if the function ends.
        calls: functions of which the instruction calls one, and then continues at `to`. `state` holds at the call, too.
        most: the number of used places on the stack during the instruction, if larger than before and after it.
    """

    to: tuple[int, ...]
    state: State
    calls: tuple[int, ...] = ()
    most: int = 0


class Processor(Protocol):
    """The interface of a processor for a walk, as in `avr_stack.Avr` and `h8_stack.H8`."""

    unit: int
    """Bytes of one place on the stack."""
    return_address: int
    """Bytes that a call pushes."""

    def outcome(self, address: int, state: State) -> Outcome:
        """Returns the result of the instruction at an address. Raises UnboundedError if no rule covers it."""

    def name(self, address: int) -> str:
        """Returns the name of the function at an address, for errors and reports."""


@dataclass(frozen=True)
class Walked:
    """The result of the walk of one function.

    Attributes:
        own: the most bytes that the function itself takes.
        calls: function called -> the most bytes on the stack before a call.
        reached: the addresses of its instructions.
    """

    own: int
    calls: Mapping[int, int]
    reached: frozenset[int]


class Depths:
    """The most bytes of stack that functions take, without their return address."""

    def __init__(self, processor: Processor) -> None:
        self.processor = processor
        self._walked: dict[int, Walked] = {}
        self._most: dict[int, int] = {}

    def walk(self, entry: int) -> Walked:
        """Returns the walk of one function, without the functions that it calls."""
        if entry in self._walked:
            return self._walked[entry]
        processor = self.processor
        states, waiting, own, calls = {entry: State()}, [entry], 0, dict[int, int]()
        while waiting:
            address = waiting.pop()
            state = states[address]
            try:
                found = processor.outcome(address, state)
                own = max(own, processor.unit * max(len(state.stack), len(found.state.stack), found.most))
                for called in found.calls:
                    calls[called] = max(calls.get(called, 0), processor.unit * len(state.stack))
                for to in found.to:
                    joined = states[to].joined(found.state) if to in states else found.state
                    if states.get(to) != joined:
                        states[to] = joined
                        waiting.append(to)
            except UnboundedError as error:
                raise UnboundedError(f"{processor.name(entry)}, at {address:#x}: {error}") from None
        self._walked[entry] = Walked(own, calls, frozenset(states))
        return self._walked[entry]

    def most(self, entry: int, within: tuple[int, ...] = ()) -> int:
        """Returns the most bytes that a function takes together with the functions that it calls."""
        if entry in within:
            names = " -> ".join(self.processor.name(one) for one in (*within[within.index(entry) :], entry))
            raise UnboundedError(f"recursion: {names}")
        if entry not in self._most:
            walked = self.walk(entry)
            deeper = [self._through(walked, called, (*within, entry)) for called in walked.calls]
            self._most[entry] = max(walked.own, *deeper) if deeper else walked.own
        return self._most[entry]

    def _through(self, walked: Walked, called: int, within: tuple[int, ...]) -> int:
        return walked.calls[called] + self.processor.return_address + self.most(called, within)

    def reached(self, entry: int) -> frozenset[int]:
        """Returns the addresses of all instructions of a function and of the functions that it calls."""
        walked = self.walk(entry)
        return walked.reached.union(*(self.reached(one) for one in walked.calls))

    def deepest(self, entry: int) -> list[str]:
        """Returns the chain of calls that takes the most stack, each call as "NAME: bytes before the next call"."""
        walked = self.walk(entry)
        for called, before in walked.calls.items():
            if self._through(walked, called, ()) == self.most(entry):
                return [f"{self.processor.name(entry)}: {before}", *self.deepest(called)]
        return [f"{self.processor.name(entry)}: {walked.own}"]
