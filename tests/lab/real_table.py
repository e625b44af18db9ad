"""The table of the benchmark on real logs, and its summary, made only from the stored results."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from statistics import median
from typing import Any

from brickpilot.errors import InputError

from lab import measured
from lab.peers import PEERS
from lab.real_logs import RealLog
from lab.real_results import judged_on, models, pooled
from lab.real_score import FIGURE

BEGIN, END = "<!-- real logs -->", "<!-- end of real logs -->"

VERDICT_HEAD = ("log", "machine, what is known", "by physics", "verdict", "s")
MODELS = ("before", "after", "predictor")
FIT_HEAD = ("log", *MODELS, "attainable", *(peer.name for peer in PEERS))

_DELAYED = PEERS[0].name

Result = Mapping[str, Any]


def lines(results: Mapping[str, Result], known: Mapping[str, RealLog]) -> Iterator[str]:
    """Yields the lines of the table and of its summary, as Markdown."""
    among = ordered(results, known)
    yield from _table(VERDICT_HEAD, [verdict_cells(one, known) for one in among])
    yield ""
    yield from _table(FIT_HEAD, [fit_cells(one) for one in among])
    yield ""
    yield from (f"- {line}" for line in remarks(among, known))


def ordered(results: Mapping[str, Result], known: Mapping[str, RealLog]) -> list[Result]:
    """Returns the results of the known logs in their order, then the results of other logs by name."""
    names = [*(name for name in known if name in results), *(name for name in sorted(results) if name not in known)]
    return [results[name] for name in names]


def remarks(results: Sequence[Result], known: Mapping[str, RealLog]) -> list[str]:
    """Returns, as sentences, the table's summary and the results of logs that have their own protocol."""
    return [*summary(results, known), *(_test(one, known) for one in results if "test" in one)]


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> Iterator[str]:
    yield f"| {' | '.join(head)} |"
    yield "|---" * len(head) + "|"
    yield from (f"| {' | '.join(cells)} |" for cells in rows)


def verdict_cells(one: Result, known: Mapping[str, RealLog]) -> list[str]:
    """Returns a log's cells under `VERDICT_HEAD`, as Markdown."""
    log = known.get(one["name"])
    about = ("", "") if log is None else (f"{log.machine}; {log.known}", log.physics)
    cells = [_linked(one["name"], log), *about, _verdict(one), f"{one.get('discover', {}).get('seconds', 0):.0f}"]
    return [_cell(cell) for cell in cells]


def _linked(name: str, log: RealLog | None) -> str:
    return f"`{name}`" if log is None or not log.repository else f"`{name}` ({log.repository})"


def _verdict(result: Result) -> str:
    said = result.get("discover", {})
    if "error" in said:
        return f"error: {said['error']}"
    if not said:
        return "not run"
    claimed = [one for one in said["effects"] if one["claimed"]]
    others = [one for one in said["effects"] if not one["claimed"]]
    text = f"`{said['verdict']}`"
    if claimed:
        text += " " + ", ".join(_effect(one) for one in claimed)
    if others:
        text += "; likely " + ", ".join(_effect(one) for one in others)
    if said["term"]:
        text += f"; term {said['term'].split('. Δ')[0]}"  # the rest of the text explains the symbols
    return text


def _effect(effect: Mapping[str, Any]) -> str:
    rivals = f" or {', '.join(f'`{name}`' for name in effect['equivalents'])}" if effect["equivalents"] else ""
    return f"{effect['mechanism']}: `{effect['name']}`{rivals}"


def _cell(text: str) -> str:
    return " ".join(text.replace("|", "/").split())


def fit_cells(one: Result) -> list[str]:
    """Returns a log's cells under `FIT_HEAD`, as Markdown."""
    found = models(one)
    cells = [f"`{one['name']}`", *(_both(found.get(model)) for model in MODELS), _one(attainable(one))]
    return cells + [_both(one.get("peers", {}).get(peer.name)) for peer in PEERS]


def _both(entry: Mapping[str, Any] | None) -> str:
    """Returns the fit percent of held-out runs, and in brackets the fit percent of fit runs."""
    if entry is None or "missing" in entry:
        return "-"
    if "error" in entry:
        return "fails"
    held, fitted = pooled(entry, "held_out"), pooled(entry, "fit")
    return f"({_one(fitted)})" if held is None else f"{_one(held)} ({_one(fitted)})"


def _one(value: float | None) -> str:
    if value is None:
        return "-"
    return f"{value:.1f}" if value > -100 else "< -100"


def attainable(result: Result) -> float | None:
    """Returns the mean attainable fit percent on the scored runs, as discovery states it; None: unknown."""
    limits = _limits(result)
    return sum(limits.values()) / len(limits) if limits else None


def _limits(result: Result) -> dict[str, float]:
    """Returns signal -> the attainable fit percent on the scored runs."""
    role = judged_on(result)
    found = (result.get("discover", {}).get("attainable") or {}).get(role) or {}
    scored = models(result).get("after", {}).get(role) or {}
    return {signal: float(value) for signal, value in found.items() if signal in scored}


def removed(result: Result) -> float | None:
    """Returns the share of the predictable error that the explanation removes on the scored runs; None: unknown.

    The predictable error is the squared error of the calibrated nominal model minus the attainable squared error. The
    error of each signal is divided by the signal's norm.
    """
    role, limits = judged_on(result), _limits(result)
    before, after = (models(result).get(model, {}).get(role) or {} for model in ("before", "after"))
    if not limits or not limits.keys() <= before.keys() & after.keys():
        return None
    first, last, least = (
        sum((1 - float(one[signal]) / 100) ** 2 for signal in limits) for one in (before, after, limits)
    )
    return (first - last) / (first - least) if first > least else None


def summary(results: Sequence[Result], known: Mapping[str, RealLog]) -> list[str]:
    """Returns the table's summary, as sentences."""
    ran = [one for one in results if "after" in models(one)]
    said = [f"{len(results)} logs; fit percent over {_roles(ran)}."]
    kept = [one.get("measured", {}) for one in results]
    said.append(f"Discovery: {measured.told((one.get('discover') for one in kept), 'logs')}.")
    peers = [state for one in kept for name, state in sorted(one.items()) if name != "discover"]
    said.append(f"Peers: {measured.told(peers, 'results')}.")
    if about_the_mean := [one for one in results if one.get("figure") != FIGURE]:
        said.append(f"The figures of {len(about_the_mean)} logs are still of an older kind: about the signal's mean.")
    best = tuple(peer.name for peer in PEERS)
    said.append(f"The explanation of `discover` is better than {_DELAYED} on {_wins(ran, (_DELAYED,), 'after')}.")
    said.append(f"It is better than the best peer on {_wins(ran, best, 'after')}.")
    said.append(f"The predictor of `discover` is better than the best peer on {_wins(ran, best, 'predictor')}.")
    for peer in PEERS:
        if any(pooled(one.get("peers", {}).get(peer.name), judged_on(one)) is not None for one in ran):
            said.append(f"Than {peer.name} it is better on {_wins(ran, (peer.name,), 'predictor')}.")
    gained = [one for one in ran if (_after(one) or 0) >= (_before(one) or 0)]
    said.append(f"The explanation is no worse than the calibrated nominal model on {len(gained)} of {len(ran)}.")
    named = [one for one in ran if one["discover"]["verdict"] == "named"]
    shares = [share for share in map(removed, named) if share is not None]
    if shares:
        share = f"median {100 * median(shares):.0f} %, least {100 * min(shares):.0f} %, of {len(shares)} logs"
        said.append(
            f"Share of the predictable error that it removes on held-out runs where the verdict is `named`: {share}."
        )
    else:
        said.append(f"The verdict is `named` on {len(named)} of {len(ran)}, without a figure of the predictable error.")
    hits = [one for one in ran if _mechanisms(one) & set(known[one["name"]].mechanisms if one["name"] in known else ())]
    told = [one for one in ran if _mechanisms(one)]
    said.append(f"A mechanism is told on {len(told)} of {len(ran)}; it is one that physics suggests on {len(hits)}.")
    return said


def _roles(results: Sequence[Result]) -> str:
    none = sum(judged_on(one) == "fit" for one in results)
    return "held-out runs, in brackets over fit runs" + (f"; {none} have no held-out run" if none else "")


def _wins(results: Sequence[Result], peers: Sequence[str], model: str) -> str:
    """Returns "N of M": of the M logs with results of both, on N a model of discovery beats all these peers."""
    both = []
    for one in results:
        role = judged_on(one)
        others = [value for name in peers if (value := pooled(one.get("peers", {}).get(name), role)) is not None]
        if others and (own := pooled(models(one).get(model), role)) is not None:
            both.append(own > max(others))
    return f"{sum(both)} of {len(both)}"


def _after(result: Result) -> float | None:
    return pooled(models(result).get("after"), judged_on(result))


def _before(result: Result) -> float | None:
    return pooled(models(result).get("before"), judged_on(result))


def _mechanisms(result: Result) -> set[str]:
    said = result.get("discover", {})
    return {one["mechanism"] for one in said.get("effects", ())} | (
        {said["mechanism"]} if said.get("mechanism") else set()
    )


def _test(result: Result, known: Mapping[str, RealLog]) -> str:
    log = known.get(result["name"])
    test = None if log is None else log.test
    scale, unit = (1.0, "in SI") if test is None else (test.scale, test.unit)
    parts = [
        f"{name} {scale * one['rmse']:.3g} {unit}"
        for name, one in result["test"].items()
        if isinstance(one, Mapping) and one.get("rmse") is not None
    ]
    source = (
        ""
        if test is None
        else f" ({test.source}; fitted without `{test.run}`, {test.signal} after {test.skip} samples)"
    )
    published = "" if test is None else f" Published: {test.published}."
    return f"`{result['name']}` by the benchmark's own protocol{source}: {', '.join(parts) or 'not run'}.{published}"


def write_between_marks(path: Path, text: Sequence[str], marks: tuple[str, str] = (BEGIN, END)) -> None:
    """Replaces the text between the marks of a file.

    Raises:
        InputError: the file does not contain each mark exactly once.
    """
    content = path.read_text(encoding="utf-8")
    begin, end = marks
    if content.count(begin) != 1 or content.count(end) != 1:
        raise InputError(f"needs {begin} and {end} once each", file=path)
    head, rest = content.split(begin)
    _, tail = rest.split(end)
    path.write_text(f"{head}{begin}\n" + "\n".join(text) + f"\n{end}{tail}", encoding="utf-8")


def between_marks(path: Path) -> list[str]:
    """Returns the lines between the marks of a file."""
    content = path.read_text(encoding="utf-8")
    return content.split(BEGIN)[1].split(END)[0].strip("\n").split("\n")
