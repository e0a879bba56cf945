"""Independent tasks on several processes of this machine, or on the workers of a Dask cluster.

Every process computes one task at a time on one core, and what a task gives depends on that task alone: results are the
same bits for any number of processes and any order. A process that dies takes nothing with it but its task, which
another one computes again; one that dies again and again is given up (`Lost`).

The processes are interpreters of their own, which run this module. They import nothing of the script that started them:
functions travel by value where they cannot be imported (cloudpickle), so that neither a `__main__` guard nor an
installed module is asked for. Their standard input ends with the process that started them, and they end with it.
"""

from __future__ import annotations

import os
import pickle
import queue
import signal
import subprocess
import sys
import threading
import warnings
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, BinaryIO

from suboctave.errors import InputError, SuboctaveError, shortened
from suboctave.interruption import check_time
from suboctave.version import __version__

#: how often a task is begun before it is given up, where the process that computes it dies every time
TRIES = 3
#: seconds between looks at the clock and at Ctrl-C while tasks are computed
_LOOK = 0.2
#: seconds in which a cluster must answer
_CONNECT = 20
#: one thread for whatever computes in a task: BLAS in its versions, OpenMP, Numba
_ONE_THREAD = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS", "NUMBA_NUM_THREADS"), "1"
)

Function = Callable[[Any], Any]


@dataclass(frozen=True)
class Lost:
    """In place of the result of a task whose process died each time: in words how."""

    words: str


#: how many cores a process may use, in its environment
_CORES = "SUBOCTAVE_WORKERS"


def processors() -> int:
    """How many cores this process may use: all, or as many as its environment says."""
    if given := os.environ.get(_CORES):
        if not (given.isdecimal() and int(given) >= 1):
            raise InputError(f"{_CORES}={given!r} of the environment: give a positive whole number")
        return int(given)
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def check_workers(workers: Any, scheduler: Any = None) -> int:
    """The number of processes that a user has given, by default one for each core; InputError for what is none."""
    if scheduler is not None and (not isinstance(scheduler, str) or "://" not in scheduler):
        raise InputError(
            f'scheduler={shortened(scheduler)}: give the address of a Dask scheduler, such as "tcp://10.0.0.7:8786"'
        )
    if workers is None:
        return processors()
    if isinstance(workers, bool) or not isinstance(workers, int) or workers < 1:
        raise InputError(f"workers={shortened(workers)}: give a whole number of at least 1")
    if scheduler is not None:
        raise InputError("workers= and scheduler= are both given: a cluster has its own workers; leave workers out")
    return workers


def completed(
    function: Function, tasks: Sequence[Any], workers: int = 1, scheduler: str | None = None
) -> Iterator[tuple[int, Any]]:
    """The number of each task and `function(task)`, in the order in which they come; a `Lost` for a task given up.

    What the function raises is raised here, and ends all of it.

    workers
        How many processes; not more than there are tasks.
    scheduler
        Address of a Dask scheduler whose workers compute, in place of processes of this machine.
    """
    if not tasks:
        return iter(())
    if scheduler is not None:
        return _on_cluster(function, tasks, scheduler)
    return _on_processes(function, tasks, min(workers, len(tasks)))


def in_order(function: Function, tasks: Sequence[Any], workers: int = 1) -> Iterator[Any]:
    """`function(task)` for each task, in order: in this process for one worker, else on several.

    Raises SuboctaveError where the process of a task died each time.
    """
    if workers == 1 or len(tasks) < 2:
        yield from map(function, tasks)
        return
    early: dict[int, Any] = {}
    due = 0
    for number, result in completed(function, tasks, workers):
        if isinstance(result, Lost):
            raise SuboctaveError(f"task {number + 1} of {len(tasks)} was given up: {result.words}")
        early[number] = result
        while due in early:
            yield early.pop(due)
            due += 1


# ------------------------------------------------------------------------------------------------------ this machine
def _on_processes(function: Function, tasks: Sequence[Any], workers: int) -> Iterator[tuple[int, Any]]:
    """As `completed`; a thread for each process hands it task after task."""
    import cloudpickle

    payload, blocks = cloudpickle.dumps(function), [cloudpickle.dumps(task) for task in tasks]
    waiting = deque(range(len(tasks)))
    answers: queue.SimpleQueue[tuple[int, Any, BaseException | None]] = queue.SimpleQueue()
    seats = [_Seat(payload, blocks, waiting, answers) for _ in range(workers)]
    try:
        for seat in seats:
            seat.start()
        for _ in tasks:
            while True:
                check_time()
                with suppress(queue.Empty):
                    number, result, error = answers.get(timeout=_LOOK)
                    break
            if error is not None:
                raise error
            yield number, result
    finally:
        waiting.clear()
        for seat in seats:
            seat.stop()


class _Seat(threading.Thread):
    """One process, renewed where it dies, and the thread that hands it tasks."""

    def __init__(
        self, payload: bytes, tasks: Sequence[bytes], waiting: deque[int], answers: queue.SimpleQueue[Any]
    ) -> None:
        super().__init__(daemon=True)
        self.payload, self.tasks, self.waiting, self.answers = payload, tasks, waiting, answers
        self._process: subprocess.Popen[bytes] | None = None
        self._stopped = False
        #: a process is not begun while all of them are ended
        self._changing = threading.Lock()

    def run(self) -> None:
        """Task after task, until none is left."""
        while not self._stopped:
            try:
                number = self.waiting.popleft()
            except IndexError:
                break
            try:
                answer = self._computed(number)
            except Exception as error:  # no process can be begun
                answer = None, error
            self.answers.put((number, *answer))
        self.stop()

    def stop(self) -> None:
        """End the process, whatever it does."""
        with self._changing:
            self._stopped = True
            if self._process is not None:
                self._end(self._process)
                self._process = None

    def _computed(self, number: int) -> tuple[Any, BaseException | None]:
        """The result of a task, or what it raised."""
        how = ""
        for _ in range(TRIES):
            with self._changing:
                if self._stopped:
                    break
                if self._process is None:
                    self._process = _process(self.payload)
                process = self._process
            try:
                _send(process.stdin, self.tasks[number])
                block = _receive(process.stdout)
            except (OSError, EOFError, ValueError):  # it is no more, its pipes are closed
                with self._changing:
                    if self._process is process:
                        how = _words(self._end(process))
                        self._process = None
                continue
            try:
                answer: tuple[Any, BaseException | None] = pickle.loads(block)
            except Exception as error:  # what only a worker can make
                return None, error
            return answer
        return Lost(f"its process {how}, {TRIES} times"), None

    @staticmethod
    def _end(process: subprocess.Popen[bytes]) -> int:
        """End a process; its exit status."""
        with suppress(OSError):
            process.kill()
        status = process.wait()
        for stream in (process.stdin, process.stdout):
            if stream is not None:
                with suppress(OSError):
                    stream.close()
        return status


def _words(status: int) -> str:
    """How a process ended."""
    if status >= 0:
        return f"ended with the exit status {status}"
    try:
        name = signal.Signals(-status).name
    except ValueError:
        name = f"signal {-status}"
    memory = " (too little memory? fewer workers need less)" if name == "SIGKILL" else ""
    return f"was ended by {name}{memory}"


def _process(payload: bytes) -> subprocess.Popen[bytes]:
    """A process that computes tasks: it finds modules where this one does."""
    places = os.pathsep.join(os.path.abspath(place) for place in sys.path)
    process = subprocess.Popen(
        [sys.executable, "-m", "suboctave.workers"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        env={**os.environ, **_ONE_THREAD, _CORES: "1", "PYTHONPATH": places, "PYTHONSAFEPATH": "1"},
    )
    with suppress(OSError):  # it has died already: noticed when a task is sent
        _send(process.stdin, payload)
    return process


def _send(stream: Any, block: bytes) -> None:
    """A block of bytes behind its length."""
    stream.write(len(block).to_bytes(8, "little") + block)
    stream.flush()


def _receive(stream: Any) -> bytes:
    """The block that was sent; EOFError where the other side is gone."""
    head = stream.read(8)
    block: bytes = stream.read(int.from_bytes(head, "little")) if len(head) == 8 else b""
    if len(head) < 8 or len(block) < int.from_bytes(head, "little"):
        raise EOFError
    return block


def main() -> None:
    """What such a process runs: first the function, then task after task from standard input."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the process that hands out tasks
    given, answers = sys.stdin.buffer, os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what a task prints must not lie among the answers
    arrived: queue.SimpleQueue[bytes] = queue.SimpleQueue()
    threading.Thread(target=_listen, args=(given, arrived), daemon=True).start()
    warnings.simplefilter("ignore")  # the process that hands out tasks has said what is to be said
    function: Function | None = None
    failure: BaseException | None = None
    try:
        function = pickle.loads(arrived.get())
    except Exception as error:
        failure = InputError(f"what is to be computed cannot be loaded by a worker: {type(error).__name__}: {error}")
    while True:
        task = arrived.get()
        result = None
        if function is not None:
            failure = None
            try:
                result = function(pickle.loads(task))
            except Exception as error:
                failure = error
        _send(answers, _packed(result, failure))


def _packed(result: Any, error: BaseException | None) -> bytes:
    try:
        return pickle.dumps((result, error), pickle.HIGHEST_PROTOCOL)
    except Exception as failure:
        what = failure if error is None else error
        return pickle.dumps((None, SuboctaveError(f"{type(what).__name__}: {what}")))


def _listen(stream: BinaryIO, arrived: queue.SimpleQueue[bytes]) -> None:
    """Pass on what comes; end the process, even in the middle of a task, when whoever sends it is gone."""
    while True:
        try:
            arrived.put(_receive(stream))
        except (OSError, EOFError):
            os._exit(0)


# --------------------------------------------------------------------------------------------------------- a cluster
def _on_cluster(function: Function, tasks: Sequence[Any], address: str) -> Iterator[tuple[int, Any]]:
    """As `completed`, by the workers of a Dask cluster, which begin a task anew where one of them dies."""
    try:
        import distributed
    except ImportError:
        raise InputError('scheduler= needs Dask: pip install "suboctave[cluster]"') from None
    import cloudpickle

    try:
        client = distributed.Client(address, timeout=_CONNECT, set_as_default=False)
    except (OSError, ValueError) as error:
        raise InputError(f"no Dask scheduler answers at {address}: {error}") from None
    with client:
        try:
            versions = client.run(_version)
        except ImportError as error:
            raise InputError(f"the workers of {address} cannot import suboctave: {error}") from None
        for worker, version in versions.items():
            if version != __version__:
                raise InputError(f"{worker} has suboctave {version}, this is {__version__}: install the same on both")
        payload = client.scatter(cloudpickle.dumps(function), broadcast=True, hash=False)
        futures = {
            client.submit(_on_one_thread, payload, task, pure=False): number for number, task in enumerate(tasks)
        }
        try:
            done: queue.SimpleQueue[Any] = queue.SimpleQueue()
            for future in futures:
                future.add_done_callback(done.put)
            for _ in tasks:
                while True:
                    check_time()
                    with suppress(queue.Empty):
                        future = done.get(timeout=_LOOK)
                        break
                failure = future.exception()
                if isinstance(failure, distributed.KilledWorker):
                    yield futures[future], Lost("every worker of the cluster that computed it died")
                elif failure is not None:
                    raise failure
                else:
                    yield futures[future], future.result()
                future.release()
        finally:
            client.cancel(list(futures))


def _version() -> str:
    return __version__


def _on_one_thread(payload: bytes, task: Any) -> Any:
    """A task on a worker of a cluster."""
    from threadpoolctl import threadpool_limits

    with threadpool_limits(1):
        return pickle.loads(payload)(task)


if __name__ == "__main__":
    # by its own name: what is pickled here is unpickled as of this module
    from suboctave.workers import main as run

    run()
