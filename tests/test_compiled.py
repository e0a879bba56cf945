"""Kernels run as Python until compiling them is worth it; what an earlier process compiled is used at once."""

from __future__ import annotations

import importlib.util
import sys
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from numba import config
from numba.core.registry import CPUDispatcher

from suboctave import compiled

SOURCE = """
from suboctave.compiled import kernel

@kernel()
def inner(x):
    return x * x

@kernel({options})
def total(values):
    result = 0.0
    for i in range(values.shape[0]):
        result += inner(values[i])
    return result
"""


@pytest.fixture
def made(tmp_path, monkeypatch):
    """Makes the module's kernels as a process of its own would; keyword arguments are the ledger's state."""
    monkeypatch.setattr(config, "CACHE_DIR", str(tmp_path / "cache"))
    path = tmp_path / "kernels_of_a_test.py"

    def make(options="", **state):
        ledger = compiled._Ledger()
        for name, value in state.items():
            setattr(ledger, name, value)
        monkeypatch.setattr(compiled, "_ledger", ledger)
        if not path.exists():
            path.write_text(SOURCE.format(options=options))
        spec = importlib.util.spec_from_file_location("kernels_of_a_test", path)
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        return module.total

    return make


VALUES = np.arange(5.0)


def test_a_cheap_kernel_is_not_compiled_in_the_first_computation(made):
    total = made()
    compiled.computation_begins()
    assert [total(VALUES) for _ in range(3)] == [30.0] * 3
    assert not total.signatures


def test_from_the_second_computation_on_less_patience_is_needed(made):
    total = made()
    many = np.ones(30000)
    compiled.computation_begins()
    total(many)
    assert not total.signatures
    compiled.computation_begins()
    total._spent = 2.0 * compiled.LESS
    # the kernel that it calls is compiled first, while it runs as Python
    for compiled_already in (0, 1):
        assert total(VALUES) == 30.0
        assert len(total.signatures) == compiled_already
    assert isinstance(total, CPUDispatcher)
    assert not isinstance(total, compiled._Patient)


def test_a_quick_one_is_compiled_as_long_as_there_is_credit(made):
    assert made("patience=-1.0")(VALUES) == 30.0
    assert compiled._ledger.credit < compiled.CREDIT
    spent = made("patience=-1.0", credit=-100.0)
    assert spent(np.arange(5)) == 30.0
    assert not spent.signatures


def test_credit_comes_back_with_time_and_is_limited(made):
    made(credit=-0.1, since=time.thread_time())
    assert not compiled._ledger.allows()
    compiled._ledger.since -= 1.0
    assert compiled._ledger.allows()
    compiled._ledger.since -= 1e3
    compiled._ledger.allows()
    assert compiled._ledger.credit == compiled.CREDIT


def test_one_that_takes_long_waits_until_nothing_else_has_been_compiled(made):
    spent = made("patience=-1.0, alone=True", credit=0.5 * compiled.CREDIT)
    assert spent(VALUES) == 30.0
    assert spent(VALUES) == 30.0
    assert not spent.signatures
    # the kernel that it calls comes first
    for compiled_already in (0, 1):
        compiled._ledger.credit = compiled.CREDIT
        assert spent(VALUES) == 30.0
        assert len(spent.signatures) == compiled_already


def test_at_once_if_that_is_asked_for(made):
    total = made(credit=-100.0)
    compiled.compile_at_once()
    assert total(VALUES) == 30.0
    assert len(total.signatures) == 1


def test_what_was_compiled_before_is_used_at_once(made):
    made(eager=True)(VALUES)
    total = made()
    assert total(VALUES) == 30.0
    assert len(total.signatures) == 1
    assert not compiled._ledger.fresh


def test_what_is_at_hand(made):
    assert not compiled.at_hand(made(), VALUES)
    made(eager=True)(VALUES)
    total = made()
    assert compiled.at_hand(total, VALUES)
    assert not compiled.at_hand(total, None)
    compiled.compile_at_once()
    assert compiled.at_hand(total, None)


def test_costly_calls_are_not_interpreted(made):
    total = made()
    assert total(np.ones(compiled.LARGE + 1)) == compiled.LARGE + 1
    assert len(total.signatures) == 1


def test_time_spent_in_other_kernels_is_theirs(made):
    total = made()
    start = time.perf_counter()
    total(np.ones(2000))
    elapsed = time.perf_counter() - start
    inner = total.py_func.__globals__["inner"]
    assert inner._spent > 0.0
    assert 0.0 < total._spent < elapsed - inner._spent


def test_a_failure_is_passed_on(made):
    total = made()
    with pytest.raises(TypeError):
        total(np.array([None]))


@pytest.mark.parametrize("alone", [False, True])
def test_large_arguments_have_a_kernel_compiled_at_once_unless_that_takes_seconds(made, alone):
    total = made(f"alone={alone}")
    compiled.computation_begins()
    total(np.ones(compiled.LARGE + 1))
    assert bool(total.signatures) != alone


@pytest.mark.parametrize("state", [{"credit": 0.0}, {"eager": True}])
def test_several_threads_may_call_a_kernel_while_one_of_them_compiles_it(made, state, monkeypatch):
    """One kernel or several: each compiled once, and nobody meets one that changes under its hands."""
    total = made("patience=0.0", **state)
    inner = total.py_func.__globals__["inner"]
    compilations = []
    compile = compiled._Kernel.compile

    def counted(kernel, sig):
        if kernel.overloads.get(tuple(sig)) is None:
            compilations.append(kernel)
        return compile(kernel, sig)

    monkeypatch.setattr(compiled._Kernel, "compile", counted)
    interval = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        with ThreadPoolExecutor(8) as pool:
            results = list(pool.map(total, [np.arange(5.0)] * 2000))
    finally:
        sys.setswitchinterval(interval)
    assert results == [30.0] * 2000
    assert len(compilations) == len({id(kernel) for kernel in compilations}) <= 2
    assert {id(kernel) for kernel in compilations} <= {id(total), id(inner)}
