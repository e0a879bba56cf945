"""With NUMBA_DISABLE_JIT=1 nothing is compiled, and everything is what it is with the compiler, only slower."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

from numpy.testing import assert_allclose

import suboctave as so


def results() -> dict[str, list]:
    """Numbers of every kind: bifurcations of one and two DOFs, a tracked curve, trajectories with and without code."""
    stops = so.library.reference_oscillator()
    doubling = so.frequency_response(stops, (0.63, 0.66), harmonics=5)
    fold = so.frequency_response(stops, (0.75, 0.79), harmonics=3)
    tracked = so.track(fold.bifurcations[0], "p", (0.5, 0.6))
    absorber = so.frequency_response(so.library.nltva(), (1.09, 1.12), harmonics=1)
    laws = [
        so.ElasticStop(0, stiffness=2.0, gap=0.3, regularization=20.0),
        so.Callable(0, lambda x, v: x**3),
        so.Expression(0, "exp(x) - 1"),
    ]
    mixed = so.System(1.0, 0.1, 1.0, laws, [so.HarmonicLoad(0, 1.0)])
    state, periods = [0.1, 0.2], {"omega": 1.0, "periods": 2}
    bifurcations = [*doubling.bifurcations, *fold.bifurcations, *absorber.bifurcations]
    return {
        "kinds": [b.kind for b in bifurcations],
        "frequencies": [b.omega for b in bifurcations],
        "tracked": [*tracked.omega[[0, -1]], *tracked.amplitude[[0, -1]]],
        "accurate": so.integrate(mixed, start=state, **periods).end.tolist(),
        "newmark": so.integrate(mixed, start=state, method="newmark", steps_per_period=200, **periods).end.tolist(),
        "exponents": so.lyapunov_exponents(stops, omega=1.0, transient=1, periods=2).exponents.tolist(),
    }


def test_without_the_compiler_results_are_the_same():
    code = "import json, test_interpreted; print(json.dumps(test_interpreted.results()))"
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", code],
        cwd=Path(__file__).parent,
        env=environment,
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    interpreted, compiled = json.loads(done.stdout), results()
    assert interpreted.pop("kinds") == compiled.pop("kinds") == ["PD", "LP", "NS"]
    for name, values in compiled.items():
        assert_allclose(interpreted[name], values, rtol=1e-9, atol=1e-9, err_msg=name)
