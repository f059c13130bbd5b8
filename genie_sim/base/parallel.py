"""One pool of processes for everything that simulates many runs on one machine."""

import contextlib
import functools
import os
import signal
import sys
import threading
import time
import warnings
from collections.abc import Callable, Generator, Sequence
from pathlib import Path
from typing import TypeVar

from genie_sim.base.errors import UserError
from genie_sim.base.plugins import own_faults_told

Job = TypeVar("Job")
Done = TypeVar("Done")


def workers_here() -> int:
    """How many processes have a core of their own: what the machine, its container and its batch
    system allow.
    """
    import joblib

    return int(joblib.cpu_count())


@contextlib.contextmanager
def limited_memory(more_bytes: int) -> Generator[None, None, None]:
    """Within it this process gets no more than so many bytes beside those that it has; on Linux
    alone.
    """
    if not sys.platform.startswith("linux"):
        yield
        return
    import resource

    pages = int(Path("/proc/self/statm").read_text(encoding="utf-8").split()[5])
    limit = pages * resource.getpagesize() + more_bytes
    soft, hard = resource.getrlimit(resource.RLIMIT_DATA)
    if soft != resource.RLIM_INFINITY:
        limit = min(limit, soft)
    resource.setrlimit(resource.RLIMIT_DATA, (limit, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_DATA, (soft, hard))


def in_processes(
    run: Callable[[Job], Done], jobs: Sequence[Job], workers: int, ordered: bool = True
) -> Generator[Done, None, None]:
    """``run`` of each job as it is finished, in the order of the jobs if ``ordered``. One worker is
    this process.

    Leaving the iteration early, by Ctrl-C for instance, ends all processes. Raises what ``run``
    raised, and ``UserError`` where a process was killed.
    """
    workers = min(workers, len(jobs))
    if workers <= 1:
        yield from map(run, jobs)
        return
    import joblib
    from joblib.externals.loky.process_executor import TerminatedWorkerError

    # Leaving early asks for pending work to be cancelled; joblib would warn of it beside our one
    # line.
    warnings.filterwarnings("ignore", message=r"\d+ tasks ", module=r"joblib\.")
    pool = joblib.Parallel(
        workers, batch_size=1, return_as="generator" if ordered else "generator_unordered"
    )
    with _deaf_to_ctrl_c():
        here = os.getpid(), Path.cwd(), list(sys.path)
        results = pool(joblib.delayed(_run)(run, job, *here) for job in jobs)
    try:
        yield from results
    except TerminatedWorkerError as error:
        raise UserError(
            "a worker process was killed, perhaps for want of memory; try fewer workers"
        ) from error
    finally:
        results.close()


@contextlib.contextmanager
def _deaf_to_ctrl_c() -> Generator[None]:
    """Ctrl-C waits until this ends, and for ever in the processes that begin here: they may still
    be importing.
    """
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    from multiprocessing import resource_tracker

    from joblib.externals.loky.backend import resource_tracker as tracker_of_loky

    for tracker in (resource_tracker, tracker_of_loky):
        tracker.ensure_running()  # its start would unblock the signal
    before = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _run(
    run: Callable[[Job], Done], job: Job, parent: int, folder: Path, module_folders: list[str]
) -> Done:
    _become_worker(parent)
    os.chdir(folder)  # workers outlive a call, and their parent may have gone elsewhere since
    sys.path[:] = module_folders
    with own_faults_told():  # the traceback stays in this process
        return run(job)


@functools.cache
def _become_worker(parent: int) -> None:
    """Workers ignore Ctrl-C; the main process handles it. If that is killed, its workers end at
    once instead of waiting for minutes.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(0.5)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
