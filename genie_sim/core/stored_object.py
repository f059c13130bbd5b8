"""An object of the map of Algorithm 2."""

from genie_sim.core.tracking import PARKED_NS
from genie_sim.messages import Detection, Header, Location


class StoredObject:
    """An object of the map. The location is that of the first sighting.

    ``number`` counts the objects of this map from 0 and is never given twice. ``origins`` belongs
    to the freshness policy; ``counted_ns`` has the stamp of the last sighting that counted, by car.
    ``seen_in`` is the newest frame in which a detector saw it, ``None`` where that is unknown.
    """

    __slots__ = (
        "_detection",
        "confidence",
        "counted_ns",
        "east_m",
        "first_ns",
        "label",
        "location",
        "north_m",
        "number",
        "origins",
        "score",
        "seen_in",
        "seen_ns",
        "sightings",
    )

    def __init__(
        self,
        number: int,
        seen: Detection,
        location: Location,
        now_ns: int,
        *,
        origins: dict[str, int],
        counted_ns: dict[str, int],
    ) -> None:
        self.number = number
        self.label = seen.label
        self.score = seen.score
        self.confidence = seen.confidence
        self.location = location
        self.east_m, self.north_m, _ = location
        self.first_ns = self.seen_ns = now_ns
        self.sightings = 1
        self.origins = origins
        self.counted_ns = counted_ns
        self.seen_in: Header | None = None
        self._detection: Detection | None = None  # as it was asked for last

    @property
    def parked(self) -> bool:
        """Whether it has been seen at its place for a second."""
        return self.seen_ns - self.first_ns >= PARKED_NS

    def as_detection(self) -> Detection:
        """The object as others get it."""
        detection = self._detection
        if (
            detection is None
            or detection.confidence != self.confidence
            or detection.seen_in is not self.seen_in
        ):
            detection = self._detection = Detection(
                self.label,
                self.score,
                box=None,
                location=self.location,
                confidence=self.confidence,
                method="map",
                seen_in=self.seen_in,
            )
        return detection

    def look(self, header: Header | None) -> None:
        """A detector saw it in a frame; ``None``: in one that nobody knows."""
        if header is not None and (
            self.seen_in is None or self.seen_in.stamp_ns <= header.stamp_ns
        ):
            self.seen_in = header
