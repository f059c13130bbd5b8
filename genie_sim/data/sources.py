"""Frame sources: where the frames of a scenario come from. The ``perception:`` section names one
and its arguments.

To add one, write a subclass of ``frame_source.FrameSource`` and name it in ``SOURCES`` (or in a
scenario as ``source: package.module:Class``). Its arguments are its settings in YAML.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from genie_sim.base import files
from genie_sim.base.errors import UserError
from genie_sim.base.geometry import Geodetic
from genie_sim.base.progress import Progress
from genie_sim.core.messages import Encoding
from genie_sim.data.frame_source import Drives, FrameSource

if TYPE_CHECKING:
    from genie_sim.data.trace import Trace
    from genie_sim.data.truth import RecordedTruth, TruthTable

SOURCES: dict[str, str] = {
    "recorded": "genie_sim.data.sources:Recorded",
    "town": "genie_sim.worlds.town.source:InTown",
    "traffic": "genie_sim.worlds.traffic.source:RecordedTraffic",
}


@dataclass(frozen=True)
class Recorded(FrameSource):
    """What the cameras show comes from a perception trace: a name or a path."""

    trace: str = "kitti_0005"
    """A trace by name or path. The shipped one is KITTI's drive 2011_09_26/0005."""

    def open(
        self, seed: int, origin: Geodetic | None, progress: Progress | None = None
    ) -> "RecordedDrives":
        from genie_sim.data.trace import read_trace

        path = files.find(files.TRACE, self.trace)
        return RecordedDrives(read_trace(path), origin, path)


@dataclass
class RecordedDrives(Drives):
    """Traces around one origin: the scenario's, and those that single routes name. Beside the file
    of a trace (``path`` is the main one's) there may be a truth table; ``truth`` is the main one's
    if it has no file.
    """

    main: "Trace"
    origin: Geodetic | None = None
    path: Path | None = None
    truth: "TruthTable | None" = None
    _read: "dict[str | None, Trace]" = field(default_factory=dict)
    _truths: "dict[str, TruthTable]" = field(default_factory=dict)  # by the trace's digest
    _known: "dict[str, RecordedTruth]" = field(default_factory=dict)  # of the same
    _of_cars: dict[str, str | None] = field(default_factory=dict)
    _encoded: "dict[tuple[str | None, Encoding], Trace]" = field(default_factory=dict)

    def drive(self, car: str, trace: str | None, start_ns: int) -> "Trace":
        from genie_sim.data.trace import read_trace
        from genie_sim.data.truth import truth_beside

        if trace not in self._read:
            path = self.path if trace is None else files.find(files.TRACE, trace)
            recording = self.main if trace is None or path is None else read_trace(path)
            origin = self.main.origin if self.origin is None else self.origin
            self._read[trace] = recording.rebased(origin)
            truth = self.truth if trace is None else None
            if path is not None:
                truth = truth_beside(path, recording)
            if truth is not None:
                self._truths[self._read[trace].digest] = truth.rebased(origin)
        self._of_cars[car] = trace
        return self._read[trace]

    def truth_of(self, drive: "Trace") -> "RecordedTruth | None":
        from genie_sim.data.truth import RecordedTruth

        digest = drive.digest
        if digest in self._truths and digest not in self._known:
            self._known[digest] = RecordedTruth(self._truths[digest])
        return self._known.get(digest)

    def encoded(self, car: str, encoding: Encoding) -> "Trace":
        """A car's drive with its pictures encoded and decoded. Raises ``UserError``."""
        trace = self._of_cars[car]
        if (trace, encoding) not in self._encoded:
            path = self.path if trace is None else files.find(files.TRACE, trace)
            self._encoded[trace, encoding] = encoded_beside(path, self._read[trace], encoding)
        return self._encoded[trace, encoding]

    def digests(self) -> Mapping[str, str]:
        digests = {car: self._read[trace].digest for car, trace in self._of_cars.items()}
        truths = {
            f"truth of {car}": self._truths[digest].digest
            for car, digest in digests.items()
            if digest in self._truths
        }
        return digests | truths

    def provenance(self) -> Mapping[str, Mapping[str, Any]]:
        about = {}
        for name in self._of_cars.values():
            trace = self._read[name]
            about[trace.name] = dict(trace.provenance)
        for table in self._truths.values():
            about[f"truth of {table.provenance['trace']}"] = dict(table.provenance)
        return about


def encoded_beside(path: Path | None, trace: "Trace", encoding: Encoding) -> "Trace":
    """The trace of the same pictures, encoded: the file ``NAME.jpeg80.parquet`` beside
    ``NAME.parquet``.

    Raises UserError where there is none, or where it is of other pictures.
    """
    if path is None:
        raise UserError(f"image_encoding: {encoding} needs a trace in a file, {trace.name} is none")
    beside = path.with_suffix(f".{encoding}{path.suffix}")
    if not beside.is_file():
        raise UserError(
            f"image_encoding: {encoding}: {path.name} has no {beside.name} beside it; "
            f"'genie-sim perceive --encoding {encoding} --out {beside}' makes it"
        )
    from genie_sim.data.trace import read_trace

    encoded = read_trace(beside)
    if encoded.provenance.get("parameters", {}).get("encoding") != encoding:
        raise UserError(f"{beside}: is not of pictures encoded as {encoding}")
    if _pictures(encoded) != _pictures(trace):
        raise UserError(
            f"{beside}: is not of the pictures of {path.name}; make it again, or take it away"
        )
    return encoded.rebased(trace.origin)


def _pictures(trace: "Trace") -> list[tuple[str, int, str]]:
    return [
        (frame.camera, frame.stamp_ns, frame.digest)
        for camera in sorted(trace.frames)
        for frame in trace.frames[camera]
    ]
