"""Several threads may compute at once: nothing is shared between them but caches and the compiler."""

from __future__ import annotations

import os
import subprocess
import sys
import warnings
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from numpy.testing import assert_array_equal

import suboctave as so
from suboctave.continuation import linear

CODE = """
import threading
from concurrent.futures import ThreadPoolExecutor
import suboctave as so

together = threading.Barrier(8)

def compute(i):
    together.wait()
    if i < 4:
        return so.frequency_response(so.library.duffing(c=0.1), (0.5, 0.6), harmonics=3)
    if i < 6:
        return so.frequency_response(so.library.reference_oscillator(), (0.5, 0.55), harmonics=3)
    return so.frequency_response(so.library.nltva(), (0.5, 0.55), harmonics=1)

with ThreadPoolExecutor(8) as pool:
    list(pool.map(compute, range(8)))
"""


@pytest.mark.slow
def test_eight_threads_and_nothing_compiled_yet(tmp_path):
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path), "SUBOCTAVE_CACHE": str(tmp_path)}
    done = subprocess.run([sys.executable, "-c", CODE], env=environment, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr


def test_eight_threads_give_what_one_gives():
    stops, absorber = so.library.reference_oscillator(), so.library.nltva()
    curve = so.frequency_response(stops, (0.6, 0.8), harmonics=7)
    doubling, fold = curve.bifurcations[:2]

    def points(branch):
        return [(orbit.omega, orbit.amplitude(), *orbit.values.values()) for orbit in branch.orbits]

    computations = [
        lambda: points(so.frequency_response(stops, (0.6, 0.8), harmonics=7)),
        lambda: points(so.frequency_response(absorber, (0.95, 1.12), harmonics=5)),
        lambda: points(so.track(fold, "p", (0.54, 0.57))),
        lambda: points(so.track(doubling, "p", (0.54, 0.57))),
        lambda: so.integrate(stops, omega=1.0, periods=5).displacement,
        lambda: so.lyapunov_exponents(stops, omega=1.0, transient=5, periods=10).exponents,
    ]
    alone = [compute() for compute in computations]
    interval = sys.getswitchinterval()
    sys.setswitchinterval(1e-5)
    try:
        with ThreadPoolExecutor(8) as pool:
            together = [future.result() for future in [pool.submit(compute) for compute in 2 * computations]]
    finally:
        sys.setswitchinterval(interval)
    for one, other in zip(2 * alone, together, strict=True):
        assert_array_equal(one, other)


class Blas:
    """A library whose number of threads is one for the process, with the interface of threadpoolctl."""

    def __init__(self):
        self.threads = 2

    def limit(self, limits, user_api):
        class Limit:
            def __init__(self, blas):
                self.blas, self.before, blas.threads = blas, blas.threads, limits

            def __enter__(self):
                return self

            def __exit__(self, *_):
                self.blas.threads = self.before

        return Limit(self)


@pytest.mark.parametrize("first_out", [0, 1])
def test_the_limit_of_blas_is_lifted_by_the_last_thread(monkeypatch, first_out):
    """In whatever order two threads leave; each used to restore what it had met."""
    blas = Blas()
    monkeypatch.setattr(linear, "_controller", lambda: blas)
    contexts = [linear.one_thread(), linear.one_thread()]
    for context in contexts:
        context.__enter__()
    contexts[first_out].__exit__(None, None, None)
    assert blas.threads == 1
    contexts[1 - first_out].__exit__(None, None, None)
    assert blas.threads == 2


def test_functions_may_be_examined_in_several_threads():
    before = list(warnings.filters)

    def make(i):
        return so.Callable(0, lambda x, v: np.real(x) ** 3)

    with ThreadPoolExecutor(8) as pool:
        list(pool.map(make, range(100)))
    assert warnings.filters == before
