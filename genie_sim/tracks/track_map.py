"""The map of tracks: it learns looks, each once, and gives the objects that it believes in, where
they are predicted.
"""

import heapq
import itertools
import math
from collections import OrderedDict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

from genie_sim.base.classes import MOVING_MPS
from genie_sim.base.grid import Area, Grid, area_around, widened
from genie_sim.core.messages import Detection, Header, Look, MapChange, ObjectLookups
from genie_sim.core.view import ViewSector
from genie_sim.tracks.coverage import FARTHEST_M, Coverage, Viewer
from genie_sim.tracks.existence import ExistenceFilter
from genie_sim.tracks.track import COAST_NS, NEAR_M, VEHICLE, Track, kind_of, sigma_of

SLOW_CELL_M, FAST_CELL_M = 10.0, 60.0  # sides of the grids' cells, which change speed alone
# A track stays in the cell where it was last updated; this far it may have moved since: as fast as
# a slow one may be, or as ``Track.update`` lets one be, for ``COAST_NS``.
SLOW_DRIFT_M, FAST_DRIFT_M = (
    speed_mps * COAST_NS * 1e-9 for speed_mps in (MOVING_MPS, 2.0 * VEHICLE.v_max_mps)
)
LEARNED_NS = 10_000_000_000  # assumed: how long a look is remembered, lest it be learned again
# assumed: above this a miss brings a track's end no nearer than the time that is noted for it
SOON_GONE = 0.5
MAX_GATE_M = VEHICLE.gate_m  # no kind's gate is wider


class TrackInPlace(NamedTuple):
    """A track, and where it is at some time."""

    east_m: float
    north_m: float
    track: Track


class Pair(NamedTuple):
    """A track and a detection that may show it; the nearest pair sorts first."""

    distance_m: float
    number: int  # of the track
    detection: int  # its index in the look
    track: Track


class TrackMap:
    """A map of tracks: it learns looks, each once, and gives the objects that it believes in, where
    they are predicted. The tracks are in two grids, one of those that hardly move; each track knows
    its grid and cell, and is taken out before it gets into another.

    Parameters
    ----------
    existence : ExistenceFilter
        How likely a track still exists, and when it is forgotten.
    view_range_m : float
        How far away objects in view may be [m].
    view_margin_rad : float
        By how much the sector in view is wider than the camera's, on each side [rad].
    """

    def __init__(
        self,
        existence: ExistenceFilter,
        *,
        view_range_m: float = 50.0,
        view_margin_rad: float = 0.0,
    ) -> None:
        self._existence = existence
        self._view_range_m = view_range_m
        self._view_margin_rad = view_margin_rad
        self._slow: Grid[Track] = Grid(SLOW_CELL_M)
        self._fast: Grid[Track] = Grid(FAST_CELL_M)
        self._count = 0  # of the tracks in both
        self._numbers = itertools.count()  # of tracks
        # a heap: when the track's time may be over, and a tie-breaker
        self._to_forget: list[tuple[int, int, Track]] = []
        self._ties = itertools.count()
        self._learned: OrderedDict[Header, None] = OrderedDict()  # looks
        self._latest: dict[
            tuple[str, str], tuple[int, Coverage]
        ] = {}  # the newest look of each camera

    def __len__(self) -> int:
        return self._count

    def __iter__(self) -> Iterator[Track]:
        return itertools.chain(self._slow, self._fast)

    @property
    def p_min(self) -> float:
        """Lowest probability of existence at which an object is believed in."""
        return self._existence.p_min

    def forget(self, now_ns: int) -> list[Track]:
        """Removes and returns the tracks whose time is over [ns]."""
        gone = []
        waiting = self._to_forget
        while waiting and waiting[0][0] <= now_ns:
            due_ns, _, track = heapq.heappop(waiting)
            if track.grid is None or track.due_ns != due_ns:
                continue  # gone, or noted for another time
            track.due_ns = None
            expires_ns = self._existence.expires_ns(track)
            if expires_ns <= now_ns:
                self._take_out(track)
                gone.append(track)
            else:
                self._plan(track)
        return gone

    def learn(self, look: Look, now_ns: int, *, names_changes: bool = False) -> ObjectLookups:
        """Learns what a look says of the tracks, unless it has come before. Returns what changed,
        for the log, with the objects' names if ``names_changes``.
        """
        tracks, before, gone = self._weigh(look, now_ns)
        remaining = [track for track in tracks if track.grid is not None]
        return ObjectLookups(
            look.header,
            "sighting",
            requests=len(tracks),
            hits=sum(p >= self.p_min for p in before.values()),
            updates=len(before),
            boost_sum=math.fsum(
                self.probability(track, now_ns) - before[track.number]
                for track in remaining
                if track.number in before
            ),
            objects=len(self),
            changes=tuple(map(MapChange.of, remaining)) if names_changes else (),
            forgotten=tuple(map(MapChange.of, gone)) if names_changes else (),
        )

    def in_view(self, viewer: Viewer, now_ns: int) -> list[Detection]:
        """The objects in view that the map believes in, where they are now."""
        sector = self._sector(viewer)
        p_min = self.p_min
        in_view = [
            track
            for track in self._inside(sector.box())
            if track.existence >= p_min and sector.distance_m(*track.place(now_ns)) is not None
        ]
        return self._believed(in_view, now_ns)

    def is_in_view(self, viewer: Viewer, detection: Detection) -> bool:
        """Whether an object is in the sector of ``in_view``."""
        assert detection.location is not None
        east_m, north_m, _ = detection.location
        return self._sector(viewer).distance_m(east_m, north_m) is not None

    def probability(self, track: Track, now_ns: int) -> float:
        """How likely a track exists at a time [ns]."""
        return self._existence.probability(track, now_ns)

    def contradicts(self, label: str, east_m: float, north_m: float, seen_ns: int) -> bool:
        """Whether a look that is newer than ``seen_ns`` covers a place, and the map has no track
        there that an object of this class could be.
        """
        is_covered = any(
            stamp_ns > seen_ns and coverage.range_m(east_m, north_m) is not None
            for stamp_ns, coverage in self._latest.values()
        )
        return is_covered and self.match(label, east_m, north_m, seen_ns) is None

    def believed(self, now_ns: int) -> list[Detection]:
        """Every object that the map believes in, wherever it is now."""
        return self._believed(self, now_ns)

    def match(self, label: str, east_m: float, north_m: float, at_ns: int) -> Track | None:
        """The nearest track of the label's group that a sighting at a place could be."""
        kind = kind_of(label)
        matches: list[tuple[float, int, Track]] = []
        for track in self._inside(area_around(east_m, north_m, kind.gate_m)):
            if track.kind is kind:
                track_east_m, track_north_m = track.place(at_ns)
                distance_m = math.hypot(track_east_m - east_m, track_north_m - north_m)
                if _fits(track, distance_m, at_ns):
                    matches.append((distance_m, track.number, track))
        return min(matches)[2] if matches else None

    def _weigh(self, look: Look, now_ns: int) -> tuple[list[Track], dict[int, float], list[Track]]:
        """Weighs a look. Returns the tracks that it shows, how likely those of them that were there
        existed before it, by number, and the tracks that the map forgot.
        """
        stamp_ns = look.header.stamp_ns
        detections = [detection for detection in look.detections if detection.location is not None]
        if look.header in self._learned:
            return self._tracks_shown(detections, stamp_ns), {}, []
        coverage = Coverage(look)
        self._remember(look, coverage)
        nearby = self._around(look, detections)
        pairs = _pairs(detections, nearby, stamp_ns)
        track_of = _matched(pairs)
        matched = {track.number for track in track_of.values()}
        # of the other tracks in view the look is evidence that they are gone
        misses = [
            (track, range_m)
            for east_m, north_m, track in nearby
            if track.number not in matched
            and track.checked_ns <= stamp_ns
            and (range_m := coverage.range_m(east_m, north_m)) is not None
        ]
        before = {track.number: self.probability(track, now_ns) for track in track_of.values()}
        new_tracks: list[Track] = []
        for index, sighting in enumerate(detections):
            track_of[index] = self._sight(track_of.get(index), sighting, look, new_tracks)
        for track, range_m in misses:
            self._existence.doubt(track, range_m, look.header)
            if track.existence < SOON_GONE:
                self._plan(track)
        rest = [pair for pair in pairs if pair.number not in matched]
        gone = self._take_out_merged(rest, track_of, stamp_ns) + self.forget(now_ns)
        return _without_repeats(track_of.values()), before, gone

    def _sector(self, viewer: Viewer) -> ViewSector:
        """What counts as in view of a viewer."""
        width_rad = viewer.horizontal_fov_rad + 2 * self._view_margin_rad
        return ViewSector(viewer.pose, width_rad, self._view_range_m)

    def _take_out_merged(
        self, pairs: Iterable[Pair], track_of: Mapping[int, Track], at_ns: int
    ) -> list[Track]:
        """Takes out, and returns, the tracks of pairs that are now so near to the one that was seen
        that both are one object.
        """
        gone = []
        for pair in pairs:
            if (
                pair.track.grid is not None
                and _distance_m(pair.track, track_of[pair.detection], at_ns) < NEAR_M
            ):
                self._take_out(pair.track)
                gone.append(pair.track)
        return gone

    def _tracks_shown(self, detections: Iterable[Detection], at_ns: int) -> list[Track]:
        """The tracks that detections of a look that came before show."""
        tracks = []
        for detection in detections:
            assert detection.location is not None
            east_m, north_m, _ = detection.location
            track = self.match(detection.label, east_m, north_m, at_ns)
            if track is not None:
                tracks.append(track)
        return _without_repeats(tracks)

    def _remember(self, look: Look, coverage: Coverage) -> None:
        """Notes that a look was learned, and if it is its camera's newest, what it covers."""
        stamp_ns, stream, car = look.header
        self._learned[look.header] = None
        if stamp_ns >= self._latest.get((car, stream), (0, coverage))[0]:
            self._latest[car, stream] = stamp_ns, coverage
        while next(iter(self._learned)).stamp_ns < stamp_ns - LEARNED_NS:
            self._learned.popitem(last=False)

    def _sight(
        self, track: Track | None, sighting: Detection, look: Look, new_tracks: list[Track]
    ) -> Track:
        """A sighting updates a track, or begins one; two of one object in one look are one.

        Parameters
        ----------
        track : Track or None
            The track that the detection shows; ``None`` for a new one.
        sighting : Detection
            The detection, with its place.
        look : Look
            The look that it belongs to.
        new_tracks : list of Track
            The tracks that begin with this look; a new one is added.
        """
        header = look.header
        assert sighting.location is not None
        east_m, north_m, _ = sighting.location
        range_m = math.hypot(east_m - look.pose.east_m, north_m - look.pose.north_m)
        if track is None:
            kind = kind_of(sighting.label)
            for twin in new_tracks:
                if (
                    twin.kind is kind
                    and math.hypot(twin.east_m - east_m, twin.north_m - north_m) < NEAR_M
                ):
                    return twin
            speed_mps = kind.v_max_mps / 2
            sigma_m = sigma_of(range_m)
            track = Track(
                number=next(self._numbers),
                kind=kind,
                label=sighting.label,
                score=sighting.score,
                east_m=east_m,
                north_m=north_m,
                up_m=sighting.location[2],
                stamp_ns=header.stamp_ns,
                seen_in=header,
                variance=(sigma_m * sigma_m, 0.0, speed_mps * speed_mps),
                seen_by_ns={header.origin: header.stamp_ns},
                range_m=range_m,
            )
            new_tracks.append(track)
        else:
            self._move(track, sighting, range_m, header)
        self._existence.confirm(track, sighting.score, header)
        if track.grid is None:  # new, or moved out of its cell
            self._put(track)
        if track.due_ns is None or track.moving:
            self._plan(track)
        return track

    def _move(self, track: Track, sighting: Detection, range_m: float, header: Header) -> None:
        """Updates a track by a sighting; takes it out of its cell if it belongs into another."""
        track.update(sighting, range_m, header)
        grid = self._grid(track)
        if grid is not track.grid or grid.cell(track.east_m, track.north_m) != track.cell:
            self._take_out(track)

    def _around(self, look: Look, detections: Iterable[Detection]) -> list[TrackInPlace]:
        """The tracks in view of a look, and around all that it shows, each with its place then."""
        range_m = FARTHEST_M
        for detection in detections:
            assert detection.location is not None
            east_m, north_m, _ = detection.location
            away_m = math.hypot(east_m - look.pose.east_m, north_m - look.pose.north_m)
            range_m = max(range_m, away_m)
        sector = ViewSector(look.pose, look.horizontal_fov_rad, range_m)
        area = widened(sector.box(), MAX_GATE_M)
        stamp_ns = look.header.stamp_ns
        return [TrackInPlace(*track.place(stamp_ns), track) for track in self._inside(area)]

    def _inside(self, area: Area) -> Iterator[Track]:
        """The tracks that may be in an upright rectangle."""
        for grid, drift_m in ((self._slow, SLOW_DRIFT_M), (self._fast, FAST_DRIFT_M)):
            yield from grid.inside(widened(area, drift_m))

    def _grid(self, track: Track) -> Grid[Track]:
        """Where a track belongs, as fast as it is now."""
        return self._fast if track.moving else self._slow

    def _put(self, track: Track) -> None:
        """Into the grid."""
        grid = self._grid(track)
        track.grid, track.cell = grid, grid.cell(track.east_m, track.north_m)
        grid.add(track.cell, track)
        self._count += 1

    def _take_out(self, track: Track) -> None:
        """Out of the grid that it is in."""
        assert track.grid is not None
        track.grid.remove(track.cell, track)
        track.grid = None
        self._count -= 1

    def _plan(self, track: Track) -> None:
        """Notes when to look whether the track's time is over, unless that is noted for an earlier
        time.
        """
        expires_ns = self._existence.expires_ns(track)
        if track.due_ns is None or expires_ns < track.due_ns:
            track.due_ns = expires_ns
            heapq.heappush(self._to_forget, (expires_ns, next(self._ties), track))

    def _believed(self, tracks: Iterable[Track], now_ns: int) -> list[Detection]:
        """Those of these tracks that the map believes in, where they are now."""
        likely = ((track, self.probability(track, now_ns)) for track in tracks)
        p_min = self.p_min
        return [track.as_detection(now_ns, p) for track, p in likely if p >= p_min]


def _pairs(
    detections: Sequence[Detection], nearby: Iterable[TrackInPlace], at_ns: int
) -> list[Pair]:
    """The pairs of detections and tracks that may belong together, the nearest first."""
    grid: Grid[TrackInPlace] = Grid(MAX_GATE_M)
    for item in nearby:
        grid.add(grid.cell(item.east_m, item.north_m), item)
    pairs = []
    for index, sighting in enumerate(detections):
        assert sighting.location is not None
        kind, (east_m, north_m, _) = kind_of(sighting.label), sighting.location
        area = area_around(east_m, north_m, MAX_GATE_M)
        for track_east_m, track_north_m, track in grid.inside(area):
            if track.kind is kind:
                distance_m = math.hypot(track_east_m - east_m, track_north_m - north_m)
                if _fits(track, distance_m, at_ns):
                    pairs.append(Pair(distance_m, track.number, index, track))
    pairs.sort()
    return pairs


def _matched(pairs: Iterable[Pair]) -> dict[int, Track]:
    """Each detection's track, by the detection's index: greedily, in the order of the pairs."""
    track_of: dict[int, Track] = {}
    matched: set[int] = set()  # tracks, by number
    for pair in pairs:
        if pair.detection not in track_of and pair.number not in matched:
            track_of[pair.detection] = pair.track
            matched.add(pair.number)
    return track_of


def _fits(track: Track, distance_m: float, at_ns: int) -> bool:
    """Whether a sighting so far from a track's place may be the track's: within its kind's gate and
    two standard deviations.
    """
    return distance_m <= NEAR_M or (
        distance_m <= track.kind.gate_m and distance_m <= NEAR_M + 2.0 * track.sigma_m(at_ns)
    )


def _distance_m(track: Track, twin: Track, at_ns: int) -> float:
    """How far apart two tracks are at a time."""
    (east_m, north_m), (other_east_m, other_north_m) = track.place(at_ns), twin.place(at_ns)
    return math.hypot(east_m - other_east_m, north_m - other_north_m)


def _without_repeats(tracks: Iterable[Track]) -> list[Track]:
    return list({track.number: track for track in tracks}.values())
