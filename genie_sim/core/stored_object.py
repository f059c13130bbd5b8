"""An object of the map of Algorithm 2."""

from genie_sim.core.messages import Detection, Header, Location


class StoredObject:
    """An object of the map. The location is that of the first sighting.

    ``number`` is its own, from 0 on. ``seen_in`` is the newest frame in which a detector found it,
    ``None`` where that is unknown.
    """

    __slots__ = (
        "_detection",
        "confidence",
        "label",
        "location",
        "number",
        "score",
        "seen_in",
    )

    def __init__(self, number: int, sighting: Detection, location: Location) -> None:
        self.number = number
        self.label = sighting.label
        self.score = sighting.score
        self.confidence = sighting.confidence
        self.location = location
        self.seen_in: Header | None = None
        self._detection: Detection | None = None  # as others get it, once they ask

    def set_confidence(self, confidence: float) -> None:
        """A sighting changes its confidence."""
        if confidence != self.confidence:
            self.confidence = confidence
            self._detection = None

    def as_detection(self) -> Detection:
        """The object as others get it."""
        if self._detection is None:
            self._detection = Detection(
                self.label,
                self.score,
                box=None,
                location=self.location,
                confidence=self.confidence,
                placed_by="map",
                seen_in=self.seen_in,
            )
        return self._detection

    def note_frame(self, header: Header | None) -> None:
        """A detector found it in a frame; ``None``: in one that nobody knows."""
        if header is not None and (
            self.seen_in is None or self.seen_in.stamp_ns <= header.stamp_ns
        ):
            self.seen_in = header
            self._detection = None
