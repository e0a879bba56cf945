"""Reference numbers for a chain of ten masses with a stop at its end, by shooting alone: `tests/data/chain.json`.

Unit masses on a line, unit springs between neighbours and from the first one to the ground, damping
`0.01 M + 0.02 K`, a force `0.15 cos(omega t)` on the first mass, and an exact elastic stop (stiffness 1, gap 1) on the
right of the last one. Between omega = 0.40 and 0.60, around the second natural frequency 0.445, its response is
unstable from one period doubling to the next, folds back twice, and has a complex pair of multipliers outside the unit
circle from a Neimark-Sacker point between the folds to one just after the second.

The curve of periodic motions is followed in short steps (least-norm shooting with free omega, tolerance 1e-9), the
events are read from the multipliers and from the direction of the curve, and each is located at full accuracy. No
harmonic balance is involved. Every event is located twice, with relative tolerances 1e-12 and 1e-13 and different
starts; the difference in omega is stored with it.

    python benchmarks/chain_by_shooting.py [file]          (about 20 s)
"""

from __future__ import annotations

import itertools
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

import suboctave as so
from suboctave.timedomain import locate_by_shooting, shoot
from suboctave.timedomain.field import scaled_field
from suboctave.timedomain.locate import Curve, CurvePoint

MASSES, STOP, GAP, FORCE, RANGE = 10, 1.0, 1.0, 0.15, (0.40, 0.60)
DAMPING_OF_MASS, DAMPING_OF_STIFFNESS = 0.01, 0.02
LONGEST_STEP = 0.03  # in units of twice the gap
POINTS_KEPT = 8  # every so many points of the curve go into the file


def chain() -> so.System:
    n = MASSES
    stiffness = 2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    stiffness[-1, -1] = 1.0
    return so.System(
        np.eye(n),
        DAMPING_OF_MASS * np.eye(n) + DAMPING_OF_STIFFNESS * stiffness,
        stiffness,
        [so.ElasticStop(dof=n - 1, stiffness=STOP, gap=GAP)],
        [so.HarmonicLoad(dof=0, amplitude=FORCE)],
        name="chain of ten masses with a stop",
    )


def unstable(point: CurvePoint) -> tuple[int, int, int]:
    """Multipliers outside the unit circle: real beyond +1, real beyond -1, complex pairs."""
    mu = np.linalg.eigvals(point.transition)
    mu = mu[np.abs(mu) > 1.0]
    real = mu.imag == 0.0
    return int(np.sum(real & (mu.real > 0))), int(np.sum(real & (mu.real < 0))), int(np.sum(~real)) // 2


def events_between(before: CurvePoint, after: CurvePoint) -> list[str]:
    _, minus_before, pairs_before = unstable(before)
    _, minus_after, pairs_after = unstable(after)
    kinds = []
    if before.tangent[-1] * after.tangent[-1] < 0.0:
        kinds.append("LP")
    if minus_before != minus_after:
        kinds.append("PD")
    if pairs_before != pairs_after:
        kinds.append("NS")
    return kinds


def follow(system: so.System) -> tuple[Curve, list[CurvePoint]]:
    """The curve from the lower to the upper end of the range, one step beyond it."""
    start = shoot(system, np.zeros(2 * MASSES), RANGE[0])
    model = scaled_field(system, start.state, RANGE[0])
    model.rescale(np.full(MASSES, 2.0 * GAP))
    curve = Curve(model, periods=1, rtol=1e-10, tol=1e-9, branch_point=False)
    onward = np.append(np.zeros(2 * MASSES), 1.0)
    points = [curve.onto(np.append(start.state / model.scale, 1.0), onward)]
    step = LONGEST_STEP
    while points[-1].u[-1] * RANGE[0] < RANGE[1]:
        last = points[-1]
        used = curve.evaluations
        following = curve.onto(last.u + step * last.tangent, last.tangent)
        if following.tangent @ last.tangent < 0.95 and step > 1e-4:
            step *= 0.5
            continue
        points.append(following)
        step = min(LONGEST_STEP, step * (1.3 if curve.evaluations - used <= 4 else 0.8))
    return curve, points


def solution_entry(solution: Any) -> dict[str, Any]:
    return {
        "omega": solution.omega,
        "amplitude_last_mass": solution.amplitude,
        "multipliers": [[mu.real, mu.imag] for mu in solution.multipliers],
        "state": solution.state.tolist(),
    }


def main(target: Path) -> None:
    system = chain()
    curve, points = follow(system)
    scale = curve.model.scale
    last = MASSES - 1

    bifurcations = []
    for before, after in itertools.pairwise(points):
        for kind in events_between(before, after):
            found, again = (
                locate_by_shooting(system, kind, p.u[:-1] * scale, p.u[-1] * RANGE[0], observe=last, rtol=rtol)
                for p, rtol in ((before, 1e-12), (after, 1e-13))
            )
            spread = abs(found.omega - again.omega)
            bifurcations.append({"kind": kind, **solution_entry(found), "spread": spread})
            print(f"{kind}  omega {found.omega:.12f}  max|x_9| {found.amplitude:.10f}  spread {spread:.1e}")

    response = []
    for point in points[::POINTS_KEPT]:
        omega = float(point.u[-1] * RANGE[0])
        if omega > RANGE[1]:
            continue
        motion = shoot(system, point.u[:-1] * scale, omega, observe=last)
        entry = solution_entry(motion)
        del entry["state"], entry["multipliers"]
        entry["unstable_multipliers"] = int(np.sum(np.abs(motion.multipliers) > 1.0))
        entry["largest_multiplier"] = float(np.max(np.abs(motion.multipliers)))
        response.append(entry)

    data = {
        "about": " ".join((__doc__ or "").split("\n\n")[1].split())
        + " Obtained by shooting alone: DOP853 at rtol 1e-12 with contact instants as events, variational equations; "
        "no harmonic balance. Positions good to about 1e-10 in omega (spread: two locations compared), amplitudes "
        "(max |x_9| over a period) to 1e-9. In the order in which the curve from omega = 0.40 meets them. Produced by "
        "benchmarks/chain_by_shooting.py.",
        "masses": MASSES,
        "damping": {"of_mass": DAMPING_OF_MASS, "of_stiffness": DAMPING_OF_STIFFNESS},
        "stop": {"stiffness": STOP, "gap": GAP},
        "force": FORCE,
        "omega": list(RANGE),
        "bifurcations": bifurcations,
        "response": response,
    }
    target.write_text(json.dumps(data, indent=1) + "\n")
    print(f"{len(points)} points, {curve.evaluations} integrations, {len(bifurcations)} bifurcations: {target}")


if __name__ == "__main__":
    default = Path(__file__).resolve().parents[1] / "tests" / "data" / "chain.json"
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else default)
