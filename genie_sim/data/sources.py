"""Frame sources: where the frames of a scenario come from. The ``perception:`` section names one
and its arguments.

To add one, write a subclass of ``frame_source.FrameSource`` and name it in ``SOURCES`` (or in a
scenario as ``source: package.module:Class``). Its arguments are its settings in YAML.
"""

import shlex
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from genie_sim.base import files
from genie_sim.base.errors import UserError, short_repr
from genie_sim.base.geometry import Geodetic
from genie_sim.base.progress import Progress
from genie_sim.core.messages import Encoding
from genie_sim.data.frame_source import Drives, FrameSource

if TYPE_CHECKING:
    from genie_sim.data.trace import Trace
    from genie_sim.data.truth import RecordedTruth, TruthTable

NAMED_DIGITS = 8  # of a digest that tells two traces of one name apart

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
class Recording:
    """One trace around the origin of a scenario, and what belongs to it.

    ``path`` is its file, beside which encoded pictures may be; ``truth`` what was really there.
    """

    trace: "Trace"
    path: Path | None
    truth: "TruthTable | None"
    encoded: "dict[Encoding, Trace]" = field(default_factory=dict)

    @cached_property
    def judged(self) -> "RecordedTruth | None":
        """The truth, for whoever judges."""
        from genie_sim.data.truth import RecordedTruth

        return None if self.truth is None else RecordedTruth(self.truth)


@dataclass
class RecordedDrives(Drives):
    """Traces around one origin: the scenario's, and those that single routes name. Beside the file
    of a trace (``path`` is the main one's) there may be a truth table. Of two traces of one name
    the later has the beginning of its digest in it.
    """

    main: "Trace"
    origin: Geodetic | None = None
    path: Path | None = None
    _recordings: dict[str | None, Recording] = field(default_factory=dict)  # by the route's trace
    _of_cars: dict[str, Recording] = field(default_factory=dict)

    def drive(self, car: str, trace: str | None, start_ns: int) -> "Trace":
        from genie_sim.data.trace import read_trace

        if trace not in self._recordings:
            if trace is None:
                recorded, path = self.main, self.path
            else:
                path = files.find(files.TRACE, trace)
                recorded = read_trace(path)
            self._recordings[trace] = self._placed(recorded, path)
        self._of_cars[car] = self._recordings[trace]
        return self._of_cars[car].trace

    def _placed(self, trace: "Trace", path: Path | None) -> Recording:
        """Around the origin, with a name of its own, and the truth beside its file."""
        from genie_sim.data.truth import truth_beside

        truth = None if path is None else truth_beside(path, trace)
        origin = self.main.origin if self.origin is None else self.origin
        trace = trace.rebased(origin)
        truth = None if truth is None else truth.rebased(origin)
        for other in self._recordings.values():
            if truth and other.truth and truth.trace == other.truth.trace and truth != other.truth:
                raise UserError(
                    f"{path}: is the trace in {other.path}, whose truth table is another; take "
                    "one of them away"
                )
        namesakes = (other for other in self._recordings.values() if other.trace.name == trace.name)
        if any(other.trace.digest != trace.digest for other in namesakes):
            trace = replace(trace, name=f"{trace.name} ({trace.digest[:NAMED_DIGITS]})")
        return Recording(trace, path, truth)

    def truth_of(self, drive: "Trace") -> "RecordedTruth | None":
        recordings = self._recordings.values()
        same = (recording for recording in recordings if recording.trace.digest == drive.digest)
        return next((recording.judged for recording in same if recording.truth), None)

    def encoded(self, car: str, encoding: Encoding) -> "Trace":
        """A car's drive with its pictures encoded and decoded. Raises ``UserError``."""
        recording = self._of_cars[car]
        if encoding not in recording.encoded:
            recording.encoded[encoding] = encoded_beside(recording.path, recording.trace, encoding)
        return recording.encoded[encoding]

    def digests(self) -> Mapping[str, str]:
        digests = {car: recording.trace.digest for car, recording in self._of_cars.items()}
        truths = {
            f"truth of {car}": recording.truth.digest
            for car, recording in self._of_cars.items()
            if recording.truth is not None
        }
        return digests | truths

    def provenance(self) -> Mapping[str, Mapping[str, Any]]:
        about = {}
        for trace, truth in ((of_car.trace, of_car.truth) for of_car in self._of_cars.values()):
            about[trace.name] = dict(trace.provenance)
            if truth is not None:
                about[f"truth of {trace.name}"] = dict(truth.provenance)
        return about


def encoded_beside(path: Path | None, trace: "Trace", encoding: Encoding) -> "Trace":
    """The trace of the same pictures, encoded: the file ``NAME.jpeg80.parquet`` beside
    ``NAME.parquet``.

    Raises UserError where there is none, or where it is of other pictures.
    """
    if path is None:
        raise UserError(f"image_encoding: {encoding} needs a trace in a file, {trace.name} is none")
    beside = path.with_suffix(f".{encoding}{path.suffix}")
    about = _perceived(trace)
    if not beside.is_file():
        way = "nor pictures to make it of"
        if about["drive"]:
            words = ["genie-sim", "perceive", "--drive", str(about["drive"])]
            words += ["--encoding", encoding, "--out", str(beside)]
            way = f"'{shlex.join(words)}', with the options that made {path.name}, makes it"
        raise UserError(
            f"image_encoding: {encoding}: {path.name} has no {beside.name} beside it; {way}"
        )
    from genie_sim.data.trace import read_trace

    encoded = read_trace(beside)
    if encoded.provenance.get("parameters", {}).get("encoding") != encoding:
        raise UserError(f"{beside}: is not of pictures encoded as {encoding}")
    for fact, value in _perceived(encoded).items():
        if value != about[fact]:
            raise UserError(
                f"{beside}: {fact}: is not that of {path.name}, {short_repr(about[fact])}; "
                "make it again, or take it away"
            )
    return encoded.rebased(trace.origin)


def _perceived(trace: "Trace") -> dict[str, Any]:
    """Pictures, and what decides what a detector finds in them."""
    pictures = [
        (frame.camera, frame.stamp_ns, frame.digest)
        for camera in sorted(trace.frames)
        for frame in trace.frames[camera]
    ]
    about = {fact: trace.provenance.get(fact) for fact in ("drive", "detector", "weights_sha256")}
    parameters = dict(trace.provenance.get("parameters", {}))
    parameters.pop("encoding", None)
    return {"pictures": pictures, **about, "parameters": parameters}
