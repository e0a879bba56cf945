"""Tasks on several processes: nothing depends on their number, and a process that dies costs its task at most."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from suboctave import workers
from suboctave.errors import InputError, SuboctaveError


def dies_at(number, marker=None):
    """The square of a number, by a process that is killed at one of them: always, or until a file is there."""

    def square(value):
        if value == number and not (marker is not None and marker.exists()):
            if marker is not None:
                marker.touch()
            os.kill(os.getpid(), signal.SIGKILL)
        return value * value

    return square


@pytest.mark.parametrize("count", [1, 3])
def test_results_come_with_the_number_of_their_task(count):
    assert sorted(workers.completed(lambda value: value * value, range(7), count)) == [(i, i * i) for i in range(7)]
    assert list(workers.in_order(lambda value: value * value, range(7), count)) == [i * i for i in range(7)]
    assert list(workers.completed(print, [], count)) == []


@pytest.mark.skipif(os.name != "posix", reason="signals")
def test_a_task_whose_process_dies_is_computed_again(tmp_path):
    assert sorted(workers.completed(dies_at(3, tmp_path / "once"), range(6), 2)) == [(i, i * i) for i in range(6)]


@pytest.mark.skipif(os.name != "posix", reason="signals")
def test_a_task_whose_process_always_dies_is_given_up_and_no_other():
    results = dict(workers.completed(dies_at(3), range(6), 2))
    lost = results.pop(3)
    assert results == {i: i * i for i in range(6) if i != 3}
    assert lost.words == f"its process was ended by SIGKILL (too little memory? fewer workers need less), {3} times"
    with pytest.raises(SuboctaveError, match="task 4 of 6 was given up: its process was ended by SIGKILL"):
        list(workers.in_order(dies_at(3), range(6), 2))


def test_what_a_task_raises_is_raised():
    with pytest.raises(ZeroDivisionError, match="division by zero"):
        list(workers.completed(lambda value: 1 / value, [1, 0], 2))


def test_what_a_task_prints_is_no_answer(capfd):
    assert list(workers.completed(lambda value: print("printed") or value, [1, 2], 1)) == [(0, 1), (1, 2)]
    assert "printed" in capfd.readouterr().err


def test_each_process_computes_on_one_thread():
    names = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS")
    ((_, found),) = workers.completed(lambda _: [os.environ[name] for name in names], [None], 1)
    assert found == ["1"] * len(names)


def test_nobody_computes_on_when_the_reader_has_enough(tmp_path):
    late = tmp_path / "late"

    def work(value):
        if value:
            time.sleep(value)
            late.touch()

    for count, _ in enumerate(workers.completed(work, [0, 0, 0, 0.5], 2), 1):
        if count == 3:
            break
    time.sleep(0.7)
    assert not late.exists()


def processes_of(work=lambda _: os.getpid(), **environment):
    """The processes that compute two tasks."""
    with pytest.MonkeyPatch.context() as patch:
        for name, value in environment.items():
            patch.setenv(name, value)
        return {pid for _, pid in workers.completed(work, [0, 1], 1)}


def test_processes_wait_for_the_next_call(tmp_path):
    """But not those that differ from new ones: by their environment, by modules whose files may change."""
    (first,) = processes_of()
    assert processes_of() == {first}
    (other,) = processes_of(ANYTHING="else")
    assert other != first
    assert_gone([first])
    (tmp_path / "own_module.py").write_text("")

    def imports(_):
        sys.path.insert(0, str(tmp_path))
        import own_module  # noqa: F401

        return os.getpid()

    (third,) = processes_of(imports)
    assert_gone([third])
    (fourth,) = processes_of()
    workers._end_idle()
    assert_gone([fourth])


CODE = """
import os, time
from suboctave import workers

def work(value):
    os.write(2, b"%d\\n" % os.getpid())
    time.sleep(60)

list(workers.completed(work, [0, 1], 2))
"""


def test_a_process_that_has_waited_long_enough_ends_without_a_word():
    code = "from suboctave import workers; workers._WAITS = 0.01; workers.main()"
    with subprocess.Popen(
        [sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    ) as process:
        assert process.wait(30.0) == 0
        assert process.stdout.read() + process.stderr.read() == b""


def test_processes_end_with_the_one_that_started_them():
    """Also where that is killed, in the middle of a task. The script has no `__main__` guard."""
    with subprocess.Popen([sys.executable, "-c", CODE], stderr=subprocess.PIPE, text=True) as process:
        pids = [int(process.stderr.readline()) for _ in range(2)]
        process.kill()
    assert_gone(pids)


def assert_gone(pids):
    for pid in pids:
        for _ in range(100):
            try:
                os.kill(pid, 0)
            except ProcessLookupError:
                break
            status = Path(f"/proc/{pid}/stat")
            if status.exists() and status.read_text().rpartition(")")[2].split()[0] == "Z":
                break
            time.sleep(0.05)
        else:
            raise AssertionError(f"{pid} still runs")


@pytest.mark.parametrize(
    ("workers_", "scheduler", "words"),
    [
        (0, None, "workers=0: give a whole number of at least 1"),
        (True, None, "whole number"),
        (2.5, None, "whole number"),
        (None, "localhost", "give the address of a Dask scheduler"),
        (2, "tcp://localhost:8786", "both given"),
    ],
)
def test_wrong_numbers_of_workers(workers_, scheduler, words):
    with pytest.raises(InputError, match=words):
        workers.check_workers(workers_, scheduler)


def test_default_is_a_process_for_each_core(monkeypatch):
    monkeypatch.delenv("SUBOCTAVE_WORKERS", raising=False)
    assert workers.check_workers(None) == workers.processors() >= 1
    # within a task no other process is begun
    assert sorted(workers.completed(lambda _: workers.processors(), [0, 1], 2)) == [(0, 1), (1, 1)]
    monkeypatch.setenv("SUBOCTAVE_WORKERS", "3")
    assert workers.check_workers(None) == 3
    monkeypatch.setenv("SUBOCTAVE_WORKERS", "all")
    with pytest.raises(InputError, match="SUBOCTAVE_WORKERS='all' of the environment"):
        workers.check_workers(None)
