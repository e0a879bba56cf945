"""Are the lists of bifurcations right for systems that nobody chose? Held against an independent shooting code.

Systems of one to four degrees of freedom are drawn from a seed: exact and rounded stops on one side or both, plays,
polynomial springs, quadratic dampers, parametric stiffness, gyroscopic damping, static loads and loads of several
harmonics; one in five is symmetric. Each is followed at default options over a range of frequencies, and from its first
period doubling the branch of twice the period as well. `shooting_judge.py` follows the same curves without a line of
the package's; its answers lie in `tests/data/random_systems.json` and are computed where they are missing (minutes).

Printed for each curve: the judge's events, those found, missed without a word, missed but said (an unsettled stretch
names the place), added, verdicts that are wrong at points, unsettled stretches and warnings, and the largest distance
of an event from the judge's, relative to omega.

    python benchmarks/random_systems.py [--seeds 0:200] [--doubled 4] [--verbose] [--stiff]

`--stiff`: systems whose stops are a thousand to ten thousand times as stiff as their springs, where the largest number
of harmonics does not suffice; the judge's answers are in `tests/data/stiff_systems.json`.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import sys
import time
from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

import suboctave as so

DATA = Path(__file__).parents[1] / "tests" / "data"
ANSWERS, STIFF_ANSWERS = DATA / "random_systems.json", DATA / "stiff_systems.json"
#: distance in omega, relative to the width of the range, up to which an event is the judge's, beyond its uncertainty
SAME = 2e-4
#: difference of the motions at two events that are one, relative to the motion
ALIKE = 0.03
#: seeds from which on loads are strong and ranges wide
STRONG = 200
#: share of the largest odd part below which a motion of twice the period is left to its parent (twice the judge's)
JUDGED = 0.02
#: seconds that the judge may take for one curve
PATIENCE = 60.0
Description = dict[str, Any]


# -------------------------------------------------------------------------------------------------------- the systems
def describe(seed: int, strong: bool | None = None) -> Description:
    """A system as plain numbers: matrices, laws, loads, and the range of frequencies.

    `strong`: strong loads and a wide range; by default from the seed `STRONG` on.
    """
    strong = seed >= STRONG if strong is None else strong
    rng = np.random.default_rng([19, seed])
    n = int(rng.choice([1, 2, 3, 4], p=[0.35, 0.35, 0.2, 0.1]))
    symmetric = rng.uniform() < 0.2
    mass = np.diag(rng.uniform(0.5, 2.0, n))
    springs = rng.uniform(0.5, 2.0, n)
    between = np.diag(springs[1:], 1)
    stiffness = np.diag(springs + np.append(springs[1:], 0.0)) - between - between.T
    damping = rng.uniform(0.01, 0.08) * stiffness + rng.uniform(0.0, 0.03) * mass
    if n > 1 and rng.uniform() < 0.25:
        skew = np.triu(rng.uniform(-0.6, 0.6, (n, n)), 1)
        damping = damping + skew - skew.T
    kinds = (
        ["play", "cubic", "damper"] if symmetric else ["stop", "stop", "rounded", "two", "play", "cubic", "polynomial"]
    )
    laws: list[dict[str, Any]] = []
    for _ in range(int(rng.integers(1, 4))):
        dof = int(rng.integers(n))
        direction = np.eye(n)[dof]
        if n > 1 and rng.uniform() < 0.4:
            direction = direction - np.eye(n)[(dof + 1) % n]
        laws += _law(rng, str(rng.choice(kinds)), direction.tolist())
    if symmetric and all(law["kind"] == "damper" for law in laws):
        laws += _law(rng, "cubic", np.eye(n)[0].tolist())
    if not symmetric and rng.uniform() < 0.2:
        laws += _law(rng, "damper", np.eye(n)[int(rng.integers(n))].tolist())
    if rng.uniform() < 0.2:
        harmonic = 2 if symmetric else int(rng.integers(1, 3))
        depth = rng.uniform(0.05, 0.4) * springs[0]
        laws.append(
            {"kind": "parametric", "direction": np.eye(n)[0].tolist(), "stiffness": depth, "harmonic": harmonic}
            | {"phase": rng.uniform(0.0, 2.0 * np.pi)}
        )
        # without it a parametric resonance may grow beyond all bounds
        hardening = [0.0, 0.0, 0.1 * depth, 0.0, 0.0]
        laws.append({"kind": "polynomial", "direction": np.eye(n)[0].tolist(), "coefficients": hardening})
    dof = int(rng.integers(n))
    amplitude = rng.uniform(0.8, 3.0) if strong else rng.uniform(0.1, 0.8)
    loads = [{"dof": dof, "amplitude": amplitude, "harmonic": 1, "phase": 0.0}]
    if rng.uniform() < 0.25:
        harmonic = 3 if symmetric else int(rng.integers(2, 4))
        phase = rng.uniform(0.0, 2.0 * np.pi)
        loads.append({"dof": dof, "amplitude": rng.uniform(0.05, 0.4), "harmonic": harmonic, "phase": phase})
    if not symmetric and rng.uniform() < 0.25:
        loads.append({"dof": int(rng.integers(n)), "amplitude": rng.uniform(0.05, 0.5), "harmonic": 0, "phase": 0.0})
    natural = np.sqrt(np.linalg.eigvals(np.linalg.solve(mass, stiffness)).real)
    low, high = (share * natural.min() for share in ((0.5, 3.0) if strong else (0.7, 2.4)))
    ends = [low, high] if rng.uniform() < 0.5 else [high, low]
    plain = {"mass": mass.tolist(), "damping": damping.tolist(), "stiffness": stiffness.tolist()}
    # plain numbers of Python's, as a file of JSON holds them
    return json.loads(json.dumps({**plain, "laws": laws, "loads": loads, "omega": ends}))


def describe_stiff(seed: int) -> Description:
    """The same with one stop, or one on either side, a thousand to ten thousand times as stiff as the springs."""
    rng = np.random.default_rng([23, seed])
    n = int(rng.choice([1, 2], p=[0.65, 0.35]))
    mass, springs = np.diag(rng.uniform(0.5, 2.0, n)), rng.uniform(0.5, 2.0, n)
    between = np.diag(springs[1:], 1)
    stiffness = np.diag(springs + np.append(springs[1:], 0.0)) - between - between.T
    damping = rng.uniform(0.04, 0.2) * stiffness + rng.uniform(0.0, 0.05) * mass
    dof = int(rng.integers(n))
    direction = np.eye(n)[dof].tolist()
    kind = str(rng.choice(["stop", "two", "rounded"], p=[0.5, 0.25, 0.25]))
    laws = _law(rng, kind, direction)
    for law in laws:
        law["stiffness"] = 10.0 ** rng.uniform(3.0, 4.0) * springs[0]
        law["gap"] = float(np.sign(law["side"]) * rng.uniform(0.2, 1.2))
        law["sharpness"] = None if law["sharpness"] is None else 10.0 ** rng.uniform(2.0, 4.0)
    if rng.uniform() < 0.3:
        laws += _law(rng, "cubic", direction)
    loads = [{"dof": int(rng.integers(n)), "amplitude": rng.uniform(0.2, 0.8), "harmonic": 1, "phase": 0.0}]
    if rng.uniform() < 0.25:
        loads.append({"dof": 0, "amplitude": rng.uniform(0.05, 0.3), "harmonic": 0, "phase": 0.0})
    natural = np.sqrt(np.linalg.eigvals(np.linalg.solve(mass, stiffness)).real)
    low, high = (share * natural.min() for share in (0.6, 1.7))
    plain = {"mass": mass.tolist(), "damping": damping.tolist(), "stiffness": stiffness.tolist()}
    ends = [low, high] if rng.uniform() < 0.5 else [high, low]
    return json.loads(json.dumps({**plain, "laws": laws, "loads": loads, "omega": ends}))


def _law(rng: np.random.Generator, kind: str, direction: list[float]) -> list[dict[str, Any]]:
    """One or two laws of a kind."""

    def stop(side: int, gap: float, stiffness: float, sharpness: float | None) -> dict[str, Any]:
        return {"kind": "stop", "direction": direction, "stiffness": stiffness, "gap": gap, "side": side} | {
            "sharpness": sharpness
        }

    if kind in ("stop", "rounded"):
        side = 1 if rng.uniform() < 0.5 else -1
        gap = side * (rng.uniform(0.05, 1.5) if rng.uniform() < 0.9 else -0.2)
        sharp = 10.0 ** rng.uniform(1.0, 3.3) if kind == "rounded" else None
        return [stop(side, float(gap), rng.uniform(0.5, 6.0), sharp)]
    if kind == "two":
        sharp = 10.0 ** rng.uniform(1.0, 3.0) if rng.uniform() < 0.4 else None
        return [stop(s, s * rng.uniform(0.1, 1.2), rng.uniform(0.5, 6.0), sharp) for s in (-1, 1)]
    if kind == "play":
        numbers = {"stiffness": rng.uniform(0.5, 5.0), "gap": rng.uniform(0.1, 0.8), "offset": 0.0}
        return [{"kind": kind, "direction": direction, **numbers}]
    if kind == "cubic":
        factors = [0.0, 0.0, rng.uniform(0.1, 1.0), 0.0, 0.0]
    elif kind == "polynomial":
        factors = [0.0, rng.uniform(-0.4, 0.4), rng.uniform(0.1, 0.8), 0.0, rng.uniform(0.0, 0.1)]
    else:
        return [{"kind": "damper", "direction": direction, "coefficient": rng.uniform(0.01, 0.15)}]
    return [{"kind": "polynomial", "direction": direction, "coefficients": factors}]


def system_of(description: Description, parameters: Mapping[str, float] | None = None) -> so.System:
    """The same system as the package reads it; `parameters` that its texts name."""
    n = len(description["mass"])
    elements: list[so.Element] = []
    for law in description["laws"]:
        along = {"direction": law["direction"]}
        if law["kind"] == "stop":
            side = "right" if law["side"] > 0 else "left"
            given = {"stiffness": law["stiffness"], "gap": law["gap"], "side": side, "regularization": law["sharpness"]}
            elements.append(so.ElasticStop(**given, **along))
        elif law["kind"] == "play":
            elements.append(so.Freeplay(stiffness=law["stiffness"], gap=law["gap"], **along))
        elif law["kind"] == "polynomial":
            elements.append(so.PolynomialSpring(coefficients=law["coefficients"], **along))
        elif law["kind"] == "damper":
            elements.append(so.QuadraticDamper(coefficient=law["coefficient"], **along))
        else:
            text = f"{law['stiffness']!r}*cos({law['harmonic']}*omega*t + {law['phase']!r})*x"
            elements.append(so.Expression(expression=text, **along))
    loads: list[Any] = []
    for load in description["loads"]:
        if load["harmonic"] == 0:
            loads.append(so.StaticLoad(load["dof"], load["amplitude"]))
        else:
            loads.append(so.HarmonicLoad(load["dof"], load["amplitude"], load["harmonic"], load["phase"]))
    assert n == len(description["damping"])
    matrices = (description[name] for name in ("mass", "damping", "stiffness"))
    return so.System(*matrices, elements, loads, dict(parameters or {}))


def short(description: Description) -> str:
    """A system in a few words."""
    marks = []
    for law in description["laws"]:
        kind = law["kind"]
        if kind == "stop":
            kind = "arctan" if law["sharpness"] else "stop"
        elif kind == "polynomial":
            kind = "cubic" if law["coefficients"][1] == 0.0 else "poly"
        marks.append(kind + "-" * (sum(value != 0.0 for value in law["direction"]) > 1))
    damping = np.array(description["damping"])
    marks += ["gyro"] * bool(np.abs(damping - damping.T).max() > 1e-12)
    marks += ["static" if load["harmonic"] == 0 else f"{load['harmonic']}w" for load in description["loads"][1:]]
    return f"{len(description['mass'])}: {' '.join(marks)}"


# -------------------------------------------------------------------------------------------------- the judge's answers
def digest(*parts: Any) -> str:
    """A name for a question to the judge."""
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()[:16]


class Answers:
    """The judge's answers, kept in a file by seed and curve."""

    def __init__(self, path: Path = ANSWERS) -> None:
        self.path = path
        self.known: dict[str, dict[str, Any]] = json.loads(path.read_text()) if path.exists() else {}

    def of(self, seed: int, description: Description, branch: so.Branch) -> dict[str, Any]:
        """What the judge says of the curve that a branch lies on; from its first motion, of 2T that farthest from T."""
        key, question = f"{seed}:{branch.nu}T", digest(description, branch.nu)
        known = self.known.get(key)
        if (
            known is not None
            and known["question"] == question
            and (branch.nu > 1 or begins_with(branch, known["start"]))
        ):
            return known
        import shooting_judge

        place = 0 if branch.nu == 1 else int(np.argmax([odd_part(orbit) for orbit in branch.orbits]))
        orbit = branch.orbits[place]
        first, last = description["omega"]
        direction = float(np.sign(last - first)) if branch.nu == 1 else 1.0
        answer = shooting_judge.judged(description, orbit.start(), orbit.omega, direction, branch.nu, PATIENCE)
        answer = {"question": question, "system": description, **answer}
        self.known[key] = answer
        keys = sorted(self.known, key=lambda key: (int(key.split(":")[0]), key))
        lines = ",\n".join(f'"{key}": {json.dumps(self.known[key])}' for key in keys)
        self.path.write_text("{\n" + lines + "\n}\n")
        return answer


def begins_with(branch: so.Branch, state: list[float]) -> bool:
    """Whether a branch begins with a motion: several may lie at one end of the range."""
    own = branch.orbits[0].start()
    return bool(np.abs(own - state).max() < ALIKE * np.abs(own).max())


# --------------------------------------------------------------------------------------------------------- comparison
class Row:
    """What became of one curve."""

    def __init__(self) -> None:
        self.missed: list[str] = []
        self.said: list[str] = []
        self.added: list[str] = []
        self.wrong: list[str] = []
        self.found = self.events = self.unsettled = self.warnings = 0
        self.worst = 0.0


def compare(answer: dict[str, Any], branch: so.Branch, width: float) -> Row:
    """A branch beside the judge's answer; what lies behind an end that the branch calls early is said to be missing."""
    row = Row()
    mine = [item for item in branch.bifurcations if item.kind != "grazing"]
    theirs, counts = answer["events"], answer["unstable"]
    if branch.nu == 2:
        theirs, counts = in_order_of(branch, answer)
    row.events, row.found = len(theirs), len(mine)
    row.unsettled, row.warnings = len(branch.audit.unsettled), len(branch.warnings)
    pairs = aligned(theirs, mine, width)
    for i, j in pairs:
        row.worst = max(row.worst, abs(theirs[i]["omega"] - mine[j].omega) / theirs[i]["omega"])
    paired, own = {i for i, _ in pairs}, {j for _, j in pairs}
    # events closer together than harmonics resolve may come in another order, if the branch says so: by a stretch in
    # doubt, or by uncertainties that overlap
    for i, item in enumerate(theirs):
        for j in range(len(mine)):
            doubtful = stated(item["omega"], branch, width) or overlaps(j, mine)
            if i not in paired and j not in own and doubtful and same(item, mine[j], width):
                paired.add(i)
                own.add(j)
    for i, item in enumerate(theirs):
        if i not in paired:
            text = f"{item['kind']} {item['omega']:.9f} (multiplier {complex(*item['multiplier']):.4f})"
            ended = branch.endings[-1].early and i > max(paired, default=-1)
            (row.said if ended or stated(item["omega"], branch, width) else row.missed).append(text)
    # beside its parent the judge leaves a curve to the parent
    least = JUDGED * max(map(odd_part, branch.orbits)) if branch.nu == 2 else -1.0
    more = [item for j, item in enumerate(mine) if j not in own and odd_part(item.orbit) > least]
    row.added = [f"{item.kind} {item.omega:.9f}" for item in more]
    row.wrong = verdicts(counts, pairs, len(theirs), mine, branch)
    return row


def overlaps(j: int, mine: list[so.Bifurcation]) -> bool:
    """Whether an event and one next to it lie within their stated uncertainties of each other."""
    beside = (mine[k] for k in (j - 1, j + 1) if 0 <= k < len(mine))
    return any(abs(mine[j].omega - other.omega) <= mine[j].uncertainty + other.uncertainty for other in beside)


def odd_part(orbit: so.PeriodicOrbit) -> float:
    """Size of the half-odd harmonics of a motion of twice the period."""
    return float(np.linalg.norm(orbit.amplitudes[1::2]))


def in_order_of(branch: so.Branch, answer: dict[str, Any]) -> tuple[list[Any], list[int]]:
    """The judge's events of a 2T curve in the order of the branch, which may run the other way."""
    theirs, counts = answer["events"], answer["unstable"]
    mine = [item for item in branch.bifurcations if item.kind != "grazing"]
    ends, own = np.array(answer["ends"]), branch.omega[[0, -1]]
    back = len(ends) == 2 and np.abs(ends - own).max() > np.abs(ends[::-1] - own).max()
    if branch.closed:
        back = len(aligned(theirs[::-1], mine, 1e9)) > len(aligned(theirs, mine, 1e9))
    return (theirs[::-1], counts[::-1]) if back else (theirs, counts)


def aligned(theirs: list[Any], mine: list[so.Bifurcation], width: float) -> list[tuple[int, int]]:
    """The longest common subsequence of two lists of events, of least distance."""
    n, m = len(theirs), len(mine)
    best = np.zeros((n + 1, m + 1))
    close = np.zeros((n, m), dtype=bool)
    for i in range(n):
        for j in range(m):
            close[i, j] = same(theirs[i], mine[j], width)
    for i in range(n - 1, -1, -1):
        for j in range(m - 1, -1, -1):
            best[i, j] = max(best[i + 1, j], best[i, j + 1])
            if close[i, j]:
                gain = 1.0 - 0.5 * min(1.0, abs(theirs[i]["omega"] - mine[j].omega) / (SAME * width))
                best[i, j] = max(best[i, j], best[i + 1, j + 1] + gain)
    pairs, i, j = [], 0, 0
    while i < n and j < m:
        if best[i, j] == best[i + 1, j]:
            i += 1
        elif best[i, j] == best[i, j + 1]:
            j += 1
        else:
            pairs.append((i, j))
            i, j = i + 1, j + 1
    return pairs


def same(theirs: dict[str, Any], mine: so.Bifurcation, width: float) -> bool:
    """Whether two events are one: kind, frequency, and motion (up to a period of the load)."""
    if theirs["kind"] != mine.kind or abs(theirs["omega"] - mine.omega) > min(SAME * width, 1.0) + mine.uncertainty:
        return False
    state, period = np.array(theirs["state"]), 2.0 * np.pi / mine.omega
    orbit = mine.orbit
    own = [
        np.concatenate((orbit.displacement(k * period), orbit.velocity(k * period) / mine.omega))
        for k in range(orbit.basis.nu)
    ]
    state = np.concatenate((state[: len(state) // 2], state[len(state) // 2 :] / mine.omega))
    size = max(float(np.abs(orbit.amplitudes).max()), float(np.abs(state).max()))
    return min(float(np.abs(state - other).max()) for other in own) < ALIKE * size


def stated(omega: float, branch: so.Branch, width: float) -> bool:
    """Whether a branch says that it may have missed something there."""
    slack = SAME * width
    return any(min(u.first, u.last) - slack <= omega <= max(u.first, u.last) + slack for u in branch.audit.unsettled)


def verdicts(
    counts: list[int], pairs: list[tuple[int, int]], total: int, mine: list[so.Bifurcation], branch: so.Branch
) -> list[str]:
    """Points whose number of unstable multipliers is not the judge's, between events that both know, and beyond what
    these are uncertain by.
    """
    wrong: list[str] = []
    stretches = []
    if not pairs and total == 0 and not mine:
        stretches.append((0, -np.inf, np.inf))
    marks = [(-1, -1), *pairs, (total, len(mine))]
    for (i, j), (k, l) in pairwise(marks):
        if k == i + 1 and l == j + 1 and i + 1 < len(counts):
            low = mine[j].arclength if j >= 0 else -np.inf
            high = mine[l].arclength if l < len(mine) else np.inf
            stretches.append((i + 1, low, high))
    unsure = [(item.omega, item.uncertainty) for item in mine]
    for index, low, high in dict.fromkeys(stretches):
        if counts[index] < 0:
            continue
        for point in branch.points:
            near = min(abs(point.arclength - low), abs(point.arclength - high)) < 1e-4
            near = near or any(abs(point.orbit.omega - omega) <= width for omega, width in unsure)
            said = not point.floquet.decided or point.floquet.clearance < 1e-4
            if low < point.arclength < high and not (near or said) and point.floquet.unstable != counts[index]:
                wrong.append(
                    f"{point.floquet.unstable} unstable at omega = {point.orbit.omega:.7g}, judge {counts[index]}"
                )
    return wrong


# --------------------------------------------------------------------------------------------------------------- table
def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0] if __doc__ else "")
    parser.add_argument("--seeds", default="0:200", help="from:to, or a list 3,17,20")
    parser.add_argument("--stiff", action="store_true", help="stops 1e3 to 1e4 times as stiff as the springs")
    parser.add_argument("--verbose", action="store_true", help="warnings of every curve with a finding")
    parser.add_argument("--doubled", default="4", help="of every how manyth seed the 2T branch is judged, 0 for none")
    options = parser.parse_args(arguments)
    text = options.seeds
    seeds = range(*map(int, text.split(":"))) if ":" in text else [int(value) for value in text.split(",")]
    answers = Answers(STIFF_ANSWERS if options.stiff else ANSWERS)
    total = dict.fromkeys(("curves", "events", "found", "missed", "said", "added", "wrong", "unsettled"), 0)
    worst, unjudged, failed, began = 0.0, [], [], time.perf_counter()
    print(
        f"{'seed':>5}  {'system':<44}{'events':>7}{'found':>7}{'missed':>7}{'said':>6}{'added':>6}{'wrong':>6}", end=""
    )
    print(f"{'unsettled':>10}{'notes':>6}{'distance':>10}{'s':>7}")
    for seed in seeds:
        description = describe_stiff(seed) if options.stiff else describe(seed)
        width = abs(description["omega"][1] - description["omega"][0])
        name = short(description)
        start = time.perf_counter()
        branches: list[so.Branch] = []
        try:
            branches.append(so.frequency_response(system_of(description), tuple(description["omega"])))
            doublings = branches[0].bifurcations["PD"]
            every = int(options.doubled)
            if doublings and every and seed % every == 0:
                branches.append(so.switch_branch(doublings[0]))
        except so.SuboctaveError as failure:
            failed.append(f"{seed}: {failure}")
            print(f"{seed:>5}  {name:<44}  {failure}")
        seconds = time.perf_counter() - start
        for branch in branches:
            answer = answers.of(seed, description, branch)
            label = name if branch.nu == 1 else f"   {branch.nu}T branch"
            if answer["failure"]:
                unjudged.append(f"{seed} ({branch.nu}T): {answer['failure']}")
                print(f"{seed:>5}  {label:<44}  not judged: {answer['failure']}")
                continue
            row = compare(answer, branch, width)
            print(
                f"{seed:>5}  {label:<44}{row.events:>7}{row.found:>7}{len(row.missed):>7}{len(row.said):>6}"
                f"{len(row.added):>6}{len(row.wrong):>6}{row.unsettled:>10}{row.warnings:>6}{row.worst:>10.1e}"
                f"{seconds:>7.1f}"
            )
            for what in ("missed", "said", "added", "wrong"):
                lines = getattr(row, what)
                for line in lines[:3] if what == "wrong" else lines:
                    print(f"         {what}: {line}")
            if options.verbose and (row.missed or row.said or row.added or row.wrong or row.unsettled):
                for warning in branch.warnings:
                    print(f"         note: {warning}")
            counted = {"curves": 1, "events": row.events, "found": row.found, "unsettled": row.unsettled}
            counted |= {what: len(getattr(row, what)) for what in ("missed", "said", "added", "wrong")}
            total = {what: total[what] + counted[what] for what in total}
            worst = max(worst, row.worst)
        sys.stdout.flush()
    print("\nin all: " + ", ".join(f"{value} {what}" for what, value in total.items()), end="")
    print(f", worst distance {worst:.1e} of omega, {time.perf_counter() - began:.0f} s")
    for title, lines in (("not judged", unjudged), ("not computed", failed)):
        for line in lines:
            print(f"{title}: seed {line}")
    return 1 if total["missed"] or total["added"] or total["wrong"] else 0


if __name__ == "__main__":
    with threadpool_limits(1):
        sys.exit(main())
