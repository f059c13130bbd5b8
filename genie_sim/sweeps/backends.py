"""Where tasks are done: in processes on this machine, or on a Dask cluster."""

from __future__ import annotations

import functools
from collections.abc import Generator, Sequence

from genie_sim.errors import UserError
from genie_sim.parallel import in_processes
from genie_sim.sweeps.tasks import Finished, Shared, Task, run_task

SCHEDULER_TIMEOUT_S = 10
WORKERS_TIMEOUT_S = 120


class Local:
    """Processes on this machine (joblib)."""

    def __init__(self, jobs: int) -> None:
        self.workers = jobs

    def run(self, tasks: Sequence[Task], shared: Shared) -> Generator[Finished, None, None]:
        """What became of each task, as it is done."""
        return in_processes(functools.partial(run_task, packed=shared.packed()), tasks, self.workers, ordered=False)

    def close(self) -> None:
        """Nothing is left open."""


class Dask:
    """The workers of a running Dask scheduler; they and this process share a file system."""

    def __init__(self, scheduler: str) -> None:
        try:
            from distributed import Client
        except ImportError:
            raise UserError("--backend dask: Dask is not installed: pip install 'genie-sim[dask]'") from None
        self._where = f"--scheduler {scheduler}"
        try:
            self._client = Client(scheduler, timeout=SCHEDULER_TIMEOUT_S)
        except (OSError, ValueError, TypeError) as error:
            raise UserError(f"{self._where}: no Dask scheduler answers there") from error
        try:
            self._client.wait_for_workers(1, timeout=WORKERS_TIMEOUT_S)
        except TimeoutError:
            self.close()
            raise UserError(f"{self._where}: has no workers, and got none in {WORKERS_TIMEOUT_S} s") from None
        self.workers: int = max(1, sum(self._client.nthreads().values()))

    def run(self, tasks: Sequence[Task], shared: Shared) -> Generator[Finished, None, None]:
        """What became of each task, as it is done. Dask gives the tasks of a lost worker to the others.

        What the tasks share is itself the result of a task: each worker fetches it once, and it cannot get lost.
        """
        from distributed import CancelledError, KilledWorker, as_completed

        packed = self._client.submit(_same, shared.packed())
        futures = [self._client.submit(run_task, task, packed, key=f"genie-sim-{task.part.stem}") for task in tasks]
        try:
            for future in as_completed(futures):
                yield future.result()
        except KilledWorker as error:
            raise UserError(f"{self._where}: a task was lost with several workers, for want of memory?") from error
        except (CancelledError, OSError) as error:
            raise UserError(f"{self._where}: the connection to the scheduler was lost") from error
        finally:
            self._client.cancel([*futures, packed])

    def close(self) -> None:
        """Says good-bye to the scheduler."""
        self._client.close()


def _same(packed: bytes) -> bytes:
    return packed
