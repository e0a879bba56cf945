"""Independent tasks on several processes of this machine, or on the workers of a Dask cluster.

Every process computes one task at a time on one core, and what a task gives depends on that task alone: results are the
same bits for any number of processes and any order. A process that dies takes nothing with it but its task, which
another one computes again; one that dies again and again is given up (`Lost`).

The processes are interpreters of their own, which run this module. They import nothing of the script that started them:
functions travel by value where they cannot be imported (cloudpickle), so that neither a `__main__` guard nor an
installed module is asked for. Their standard input ends with the process that started them, and they end with it.

A process that has come to the end of its tasks waits for those of the next call, for a minute: to begin one costs some
seconds. It waits only if it has imported nothing but installed packages, since a user's own modules may change.
"""

from __future__ import annotations

import atexit
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
from typing import Any, BinaryIO, NoReturn

from suboctave.errors import InputError, SuboctaveError, shortened
from suboctave.interruption import check_time, time_to_wait
from suboctave.version import __version__

#: how often a task is begun before it is given up, where the process that computes it dies every time
TRIES = 3
#: seconds between looks at Ctrl-C, at most, while tasks are computed
_LOOK = 0.2
#: seconds that a process waits for its next task
_WAITS = 60.0
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
                    number, result, error = answers.get(timeout=time_to_wait(_LOOK))
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
        self._begun_in: _Surroundings = {}, "", None
        self._stopped = False
        #: the process computes, or has imported what may change: the next call cannot have it
        self._taken = False
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
        """End the process, whatever it does; one that has nothing to do waits for the next call."""
        with self._changing:
            self._stopped = True
            if self._process is not None:
                if self._taken:
                    _end(self._process)
                else:
                    _idle.append((self._begun_in, self._process))
                self._process = None

    def _computed(self, number: int) -> tuple[Any, BaseException | None]:
        """The result of a task, or what it raised."""
        how = ""
        for _ in range(TRIES):
            with self._changing:
                if self._stopped:
                    break
                if self._process is None:
                    self._begun_in = _surroundings()
                    self._process = _process(self.payload, self._begun_in)
                process, self._taken = self._process, True
            try:
                _send(process.stdin, _TASK, self.tasks[number])
                _, block = _receive(process.stdout)
            except (OSError, EOFError, ValueError):  # it is no more, its pipes are closed
                with self._changing:
                    if self._process is process:
                        how = _words(_end(process))
                        self._process = None
                continue
            try:
                result, error, self._taken = pickle.loads(block)
            except Exception as failure:  # what only a worker can make
                return None, failure
            return result, error
        return Lost(f"its process {how}, {TRIES} times"), None


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


#: environment, folder, and file that errors are printed to: what a process has from its beginning
_Surroundings = tuple[dict[str, str], str, tuple[int, int] | None]
#: processes that wait for tasks
_idle: deque[tuple[_Surroundings, subprocess.Popen[bytes]]] = deque()


def _surroundings() -> _Surroundings:
    """What a process that is begun here and now has: it finds modules where this one does."""
    places = os.pathsep.join(os.path.abspath(place) for place in sys.path)
    environment = {**os.environ, **_ONE_THREAD, _CORES: "1", "PYTHONPATH": places, "PYTHONSAFEPATH": "1"}
    errors = None
    with suppress(OSError):
        status = os.fstat(2)
        errors = status.st_dev, status.st_ino
    return environment, os.getcwd(), errors


def _process(payload: bytes, surroundings: _Surroundings) -> subprocess.Popen[bytes]:
    """A process that computes tasks: one that waits, or a new one."""
    process = None
    with suppress(IndexError):
        while process is None:
            known, waiting = _idle.pop()
            if known == surroundings and waiting.poll() is None:
                process = waiting
            else:
                _end(waiting)
    if process is None:
        process = subprocess.Popen(
            [sys.executable, "-m", "suboctave.workers"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env=surroundings[0],
        )
    with suppress(OSError):  # it has died already: noticed when a task is sent
        _send(process.stdin, _FUNCTION, payload)
    return process


@atexit.register
def _end_idle() -> None:
    """No process waits for one that is over."""
    while _idle:
        _end(_idle.pop()[1])


#: what a block of bytes is
_FUNCTION, _TASK, _ANSWER = b"F", b"T", b"A"


def _send(stream: Any, kind: bytes, block: bytes) -> None:
    """A block of bytes behind its kind and its length."""
    stream.write(kind + len(block).to_bytes(8, "little") + block)
    stream.flush()


def _receive(stream: Any) -> tuple[bytes, bytes]:
    """The kind and the block that were sent; EOFError where the other side is gone."""
    head = stream.read(9)
    length = int.from_bytes(head[1:], "little")
    block: bytes = stream.read(length) if len(head) == 9 else b""
    if len(head) < 9 or len(block) < length:
        raise EOFError
    return head[:1], block


def main() -> NoReturn:
    """What such a process runs: a function, and task after task for it, from standard input."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the process that hands out tasks
    given, answers = sys.stdin.buffer, os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what a task prints must not lie among the answers
    arrived: queue.SimpleQueue[tuple[bytes, bytes]] = queue.SimpleQueue()
    threading.Thread(target=_listen, args=(given, arrived), daemon=True).start()
    warnings.simplefilter("ignore")  # the process that hands out tasks has said what is to be said
    function: Function | None = None
    failure: BaseException | None = None
    with suppress(queue.Empty):
        while True:
            kind, block = arrived.get(timeout=_WAITS)
            result = None
            try:
                if kind == _FUNCTION:
                    function, failure = None, None
                    function = pickle.loads(block)
                elif function is not None:
                    failure = None
                    result = function(pickle.loads(block))
            except Exception as error:
                failure = error
                if kind == _FUNCTION:
                    words = f"{type(error).__name__}: {error}"
                    failure = InputError(f"what is to be computed cannot be loaded by a worker: {words}")
            if kind == _TASK:
                _send(answers, _ANSWER, _packed(result, failure))
    # an ordinary end of the interpreter waits in vain for the thread that listens
    sys.stderr.flush()
    os._exit(0)


def _own_modules() -> bool:
    """Whether modules are loaded that belong to no installed package: their files may change."""
    installed = tuple({sys.prefix, sys.base_prefix, sys.exec_prefix, os.path.dirname(__file__)})
    files = (getattr(module, "__file__", None) for module in list(sys.modules.values()))
    return any(file is not None and not os.path.abspath(file).startswith(installed) for file in files)


def _packed(result: Any, error: BaseException | None) -> bytes:
    try:
        return pickle.dumps((result, error, _own_modules()), pickle.HIGHEST_PROTOCOL)
    except Exception as failure:
        what = failure if error is None else error
        return pickle.dumps((None, SuboctaveError(f"{type(what).__name__}: {what}"), True))


def _listen(stream: BinaryIO, arrived: queue.SimpleQueue[tuple[bytes, bytes]]) -> None:
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
                        future = done.get(timeout=time_to_wait(_LOOK))
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
