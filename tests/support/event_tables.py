"""What a computation lists as a table of plain numbers, recorded once and compared ever after.

A table says of every curve: its events in their order (kind, free parameters, amplitude, criticality, how far they may
lie off), how it ended and whether it closed; of a search what it lists. Tables of the examples and of systems that
nobody chose are kept in tests/data/event_tables.json. They came out of the code, after they had been held against
shooting, and serve one purpose: whatever is rebuilt must give them again.

    python tests/support/event_tables.py              # compare all with the recorded ones
    python tests/support/event_tables.py --record     # record them anew; the difference is shown by git
"""

from __future__ import annotations

import io
import json
import runpy
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterator
from contextlib import chdir, contextmanager, redirect_stdout
from pathlib import Path
from typing import Any

import suboctave as so

ROOT = Path(__file__).parents[2]
TABLES = ROOT / "tests" / "data" / "event_tables.json"
EXAMPLES = sorted((ROOT / "examples").glob("ex*.py"))
GALLERY = sorted((ROOT / "examples" / "gallery").glob("fig*.py"))
VERBS = (
    "bifurcation_diagram",
    "continue_branch",
    "equilibria",
    "find_isolas",
    "find_subharmonics",
    "frequency_response",
    "limit_cycles",
    "locate_extremum",
    "nonlinear_mode",
    "phase_resonance",
    "regime_map",
    "switch_branch",
    "track",
    "track_peak",
)
#: seeds of random systems whose tables are kept, and of those with strong loads
RANDOM, STRONG = range(300, 340), range(330, 340)
#: relative difference of free parameters, and of amplitudes, up to which they are the same
PARAMETERS, AMPLITUDES = 1e-8, 1e-6

Table = dict[str, Any]


def table_of(item: Any) -> Any:
    """What a verb gave, as plain data."""
    if isinstance(item, so.BifurcationDiagram):
        return [table_of(branch) for branch in item.branches]
    if isinstance(item, so.Isolas):
        return [_isola(isola) for isola in item]
    if isinstance(item, so.RegimeMap):
        # cells of the plane: borders have their own tables
        low, high = item.bounds
        first, last = item.omega
        shares = [(k + 0.5) / 12 for k in range(12)]
        cells = [[str(item.label(first + a * (last - first), low + b * (high - low))) for a in shares] for b in shares]
        return {"regimes": cells, "curves": [table_of(curve) for curve in item.curves]}
    if isinstance(item, so.Bifurcation):
        return _event(item)
    if isinstance(item, list | tuple):
        return [table_of(part) for part in item]
    if not isinstance(item, so.Branch):
        raise TypeError(f"no table of a {type(item).__name__}")
    return {
        "ended": item.ended,
        "closed": item.closed,
        "events": [_event(event) for event in item.bifurcations],
    }


def _event(event: Any) -> Table:
    values = {name: _digits(event.parameter(name)) for name in event.free_names}
    row: Table = {"kind": event.kind, **values, "amplitude": _digits(event.amplitude), "criticality": event.criticality}
    if event.uncertainty:
        row["uncertainty"] = _digits(event.uncertainty)
    return row


def _isola(isola: Any) -> Table:
    def end(value: Any) -> float | None:
        return None if value is None else _digits(value)

    return {
        "nu": isola.nu,
        "range": [_digits(v) for v in isola.range],
        "born": end(isola.born),
        "merges": end(isola.merges),
    }


def _digits(value: float) -> float:
    return float(f"{float(value):.12g}")


def differences(recorded: Any, now: Any, where: str = "") -> Iterator[str]:
    """What differs between two tables, a line each; nothing if they are the same."""
    if isinstance(recorded, dict) and isinstance(now, dict) and "kind" in recorded:
        if not _same_event(recorded, now):
            yield f"{where}: {recorded} became {now}"
    elif isinstance(recorded, dict) and isinstance(now, dict):
        for key in sorted({*recorded, *now}):
            yield from differences(recorded.get(key), now.get(key), f"{where}.{key}")
    elif isinstance(recorded, list) and isinstance(now, list):
        if len(recorded) != len(now):
            yield f"{where}: {len(recorded)} became {len(now)}: {_kinds(recorded)} became {_kinds(now)}"
        for at, (old, new) in enumerate(zip(recorded, now, strict=False)):
            yield from differences(old, new, f"{where}[{at}]")
    elif isinstance(recorded, float) and isinstance(now, float):
        if abs(recorded - now) > PARAMETERS * max(1.0, abs(recorded)):
            yield f"{where}: {recorded} became {now}"
    elif recorded != now:
        yield f"{where}: {recorded!r} became {now!r}"


def against_recorded(name: str, now: Any) -> list[str]:
    """What differs between a table and the recorded one of that name."""
    return list(differences(json.loads(TABLES.read_text())[name], json.loads(json.dumps(now)), name))


def _kinds(items: list[Any]) -> str:
    return " ".join(str(item["kind"]) if isinstance(item, dict) and "kind" in item else "." for item in items)


def _same_event(old: Table, new: Table) -> bool:
    slack = old.get("uncertainty", 0.0) + new.get("uncertainty", 0.0)
    for key in {*old, *new} - {"uncertainty"}:
        a, b = old.get(key), new.get(key)
        if not (isinstance(a, float) and isinstance(b, float)):
            if a != b:
                return False
        elif key == "amplitude":
            # where the place is uncertain the amplitude is, too
            if slack == 0.0 and abs(a - b) > AMPLITUDES * max(abs(a), 1e-6):
                return False
        elif abs(a - b) > PARAMETERS * max(1.0, abs(a)) + slack:
            return False
    return True


@contextmanager
def recording() -> Iterator[list[Any]]:
    """While this lasts, what the public verbs give is put into a list, in the order of the calls."""
    tables: list[Any] = []

    def recorded(verb: Callable[..., Any]) -> Callable[..., Any]:
        def call(*positional: Any, **named: Any) -> Any:
            result = verb(*positional, **named)
            tables.append({verb.__name__: table_of(result)})
            return result

        return call

    originals = {name: getattr(so, name) for name in VERBS}
    try:
        for name, verb in originals.items():
            setattr(so, name, recorded(verb))
        yield tables
    finally:
        for name, verb in originals.items():
            setattr(so, name, verb)


def of_script(script: Path) -> list[Any]:
    """The tables of what a script computes; with figures some compute more."""
    argv = sys.argv
    quiet = redirect_stdout(io.StringIO())
    with tempfile.TemporaryDirectory() as folder, chdir(folder), quiet, recording() as tables:
        sys.argv = [str(script), "figure.png", *(["space.png"] if "space.png]" in script.read_text() else [])]
        try:
            runpy.run_path(str(script), run_name="__main__")
        finally:
            sys.argv = argv
    return tables


def of_completeness() -> dict[str, Callable[[], Any]]:
    """The reference curves of benchmarks/completeness.py, downwards and upwards with the default steps."""
    curves = runpy.run_path(str(ROOT / "benchmarks" / "completeness.py"))["curves"]()
    return {
        f"completeness: {title}": lambda s=system, w=omega: [
            table_of(so.frequency_response(s, ends)) for ends in (w, w[::-1])
        ]
        for title, (system, omega) in curves.items()
    }


def of_random_systems() -> dict[str, Callable[[], Any]]:
    """Systems drawn by benchmarks/random_systems.py beyond those that a judge was asked about: the response and, of up
    to two masses, the branch of twice the period, and the first limit point and period doubling tracked over the load.
    """
    drawn = runpy.run_path(str(ROOT / "benchmarks" / "random_systems.py"))

    def tables(seed: int) -> list[Any]:
        description = drawn["describe"](seed, strong=seed in STRONG)
        load = description["loads"][0]["amplitude"]
        description["loads"][0]["amplitude"] = "F"
        system = drawn["system_of"](description, {"F": load})
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", so.NegativeDampingWarning)
            curve = so.frequency_response(system, description["omega"])
            found = [table_of(curve)]
            for kind in ("PD", "LP") if len(description["mass"]) <= 2 else ():
                for event in curve.bifurcations[kind][:1]:
                    found.append(_attempt(lambda e=event: so.track(e, "F", (0.7 * load, 1.3 * load))))
                    if kind == "PD":
                        found.append(_attempt(lambda e=event: so.switch_branch(e)))
        return found

    return {f"random system {seed}": lambda s=seed: tables(s) for seed in RANDOM}


def _attempt(verb: Callable[[], Any]) -> Any:
    """The table of what a verb gives, or its refusal."""
    try:
        return table_of(verb())
    except so.SuboctaveError as refusal:
        return type(refusal).__name__


def cases() -> dict[str, Callable[[], Any]]:
    """All of them by name, and how each is computed."""
    scripts = {path.stem: lambda p=path: of_script(p) for path in [*EXAMPLES, *GALLERY]}
    return {**scripts, **of_completeness(), **of_random_systems()}


def main(arguments: list[str]) -> int:
    record = "--record" in arguments
    only = [name for name in arguments if not name.startswith("--")]
    known = json.loads(TABLES.read_text()) if TABLES.exists() else {}
    changed = 0
    for name, compute in cases().items():
        if (only and name not in only) or not (record or name in known):
            continue
        # as it is read from the file
        now = json.loads(json.dumps(compute()))
        lines = list(differences(known.get(name), now))
        changed += bool(lines)
        print(f"{name}: {f'{len(lines)} differences' if lines else 'the same'}", *lines[:20], sep="\n    ", flush=True)
        if record:
            known[name] = now
            TABLES.write_text(json.dumps(dict(sorted(known.items())), indent=1) + "\n")
    return 0 if record else changed


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
