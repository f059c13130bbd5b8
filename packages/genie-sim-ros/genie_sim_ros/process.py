"""A node as a process of this machine: read from /proc, stopped, started again with other
arguments.
"""

import contextlib
import os
import signal
import subprocess
import time
from dataclasses import dataclass
from pathlib import Path

from genie_sim.base.errors import UserError

# signals with the time that each of them has [s]; roslaunch sends the same
STOP = ((signal.SIGINT, 10.0), (signal.SIGTERM, 3.0), (signal.SIGKILL, 3.0))


def boot() -> str:
    """Names the time since the machine was switched on; process ids mean nothing beyond it."""
    return Path("/proc/sys/kernel/random/boot_id").read_text().strip()


@dataclass(frozen=True)
class NodeProcess:
    """What is needed to start a node again exactly as it was. ``started`` tells a process from a
    later one with the same id.
    """

    pid: int
    started: int
    argv: tuple[str, ...]
    env: dict[str, str]
    cwd: str

    @classmethod
    def of(cls, pid: int) -> "NodeProcess":
        """The process of an id. Raises UserError if this user may not see it."""
        folder = Path(f"/proc/{pid}")
        try:
            argv = _strings(folder / "cmdline")
            env = dict(
                entry.split("=", 1) for entry in _strings(folder / "environ") if "=" in entry
            )
            started, cwd = start_of(pid), str((folder / "cwd").readlink())
        except OSError as error:
            raise UserError(
                f"process {pid}: {error.strerror}; attach as the user who runs it"
            ) from error
        if not argv or started is None:
            raise UserError(f"process {pid}: has ended")
        return cls(pid=pid, started=started, argv=argv, env=env, cwd=cwd)

    def alive(self) -> bool:
        """Does this very process still run?"""
        return start_of(self.pid) == self.started

    def stop(self) -> None:
        """Stops the process and returns when it has ended: SIGINT, then SIGTERM, then SIGKILL.
        Raises UserError if it does not end.
        """
        for number, patience_s in STOP:
            deadline = time.monotonic() + patience_s
            with contextlib.suppress(ProcessLookupError):
                if self.alive():
                    os.kill(self.pid, number)
            while self.alive() and time.monotonic() < deadline:
                time.sleep(0.02)
            if not self.alive():
                return
        raise UserError(f"process {self.pid}: does not end")

    def start_again(self, argv: tuple[str, ...], log_path: Path) -> "NodeProcess":
        """Starts the same program in the same folder and environment, in a session of its own, so
        that it outlives this process.
        """
        with log_path.open("ab") as output:
            process = subprocess.Popen(
                argv,
                env=self.env,
                cwd=self.cwd,
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=output,
                start_new_session=True,
            )
        started = start_of(process.pid) or 0
        return NodeProcess(process.pid, started, argv=argv, env=self.env, cwd=self.cwd)


def start_of(pid: int) -> int | None:
    """When a process began, in clock ticks since boot; ``None`` if it has ended."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except (FileNotFoundError, ProcessLookupError):
        return None
    return None if fields[0] in "ZX" else int(fields[19])


def listens_on(pid: int, port: int) -> bool:
    """Does this very process listen on a TCP port? A process id of another container may name
    another process here.
    """
    inodes = set()
    for table in ("tcp", "tcp6"):
        with contextlib.suppress(FileNotFoundError):
            for line in Path(f"/proc/{pid}/net/{table}").read_text().splitlines()[1:]:
                fields = line.split()
                if fields[3] == "0A" and int(fields[1].rpartition(":")[2], 16) == port:
                    inodes.add(f"socket:[{fields[9]}]")
    for descriptor in Path(f"/proc/{pid}/fd").iterdir():
        with contextlib.suppress(OSError):
            if str(descriptor.readlink()) in inodes:
                return True
    return False


def _strings(path: Path) -> tuple[str, ...]:
    return tuple(
        part.decode("utf-8", "surrogateescape") for part in path.read_bytes().split(b"\0")[:-1]
    )
