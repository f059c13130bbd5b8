"""The object map of the policies that track: looks go in, each once, and tracks come out where they are predicted."""

import heapq
import itertools
import math
from collections import OrderedDict
from collections.abc import Iterable, Iterator, Sequence

from genie_sim.core.confidence import CONFIDENCE_RULES, ConfidenceRule
from genie_sim.core.freshness.never import Never
from genie_sim.core.maps import Boosted, Learned, Map, Viewer, as_change
from genie_sim.core.object_map import ORIGIN_NS, fixed_threshold
from genie_sim.core.rules import ObjectMapRules, Percentile
from genie_sim.core.tracking import COAST_NS, NEAR_M, Track, kind_of, sigma_of
from genie_sim.core.view import FARTHEST_M, View, rectangle
from genie_sim.errors import UserError
from genie_sim.messages import Answer, Detection, Header, Look, ObjectLookups

SLOW_CELL_M, FAST_CELL_M = 10.0, 60.0
DRIFT_M, DRIVE_M = (
    0.5,
    34.0,
)  # how far a slow, and any other track is at most from where it was updated
ROW = 1 << 26  # cells from one row to the next
COUNTED_NS = 10_000_000_000  # so long a look is remembered, lest it be counted again
UNCERTAIN = (1.0, 0.0, 1.0)
WIDEST_M = 5.0  # no gate is wider
NEXT_CELLS = tuple(i + j * ROW for i in (-1, 0, 1) for j in (-1, 0, 1))
Placed = tuple[float, float, Track]  # where a track is at some time


class TrackMap(Map):
    """Tracks in two grids, one of those that hardly move: see ``maps.Map``. ``shares``: what an answer of the own
    node's that leaves holds, the tracks of its ``look`` or all of the ``map`` in view."""

    def __init__(
        self,
        rules: ObjectMapRules,
        freshness: Never,
        confidence_rule: ConfidenceRule | None = None,
        shares: str = "map",
        view_range_m: float = 50.0,
    ) -> None:
        self._rules, self._policy, self._shares = rules, freshness, shares
        self._boosted = CONFIDENCE_RULES[rules.rule] if confidence_rule is None else confidence_rule
        self.threshold = (
            freshness.p_min if freshness.by_existence else fixed_threshold(rules.threshold)
        )
        self._view_range_m = view_range_m
        self._slow: dict[int, list[Track]] = {}
        self._fast: dict[int, list[Track]] = {}
        self._count = 0
        self._numbers = itertools.count()
        self._to_forget: list[tuple[int, int, Track]] = []  # a heap: when to look at it
        self._counted: OrderedDict[Header, None] = OrderedDict()
        self._latest: dict[tuple[str, str], tuple[int, View]] = {}  # the newest look of each camera
        if not freshness.by_existence and (
            rules.threshold == "empirical" or isinstance(rules.threshold, Percentile)
        ):
            raise UserError(
                "genie.object_map.threshold: a percentile needs a freshness policy that does not track"
            )

    def __len__(self) -> int:
        return self._count

    def __iter__(self) -> Iterator[Track]:
        return (one for grid in (self._slow, self._fast) for cell in grid.values() for one in cell)

    def forget(self, now_ns: int) -> list[Track]:
        forgotten, waiting = [], self._to_forget
        while waiting and waiting[0][0] <= now_ns:
            due_ns, _, track = heapq.heappop(waiting)
            if track.cell is None or track.due_ns != due_ns:
                continue
            track.due_ns, expires_ns = None, self._policy.expires_ns(track)
            if expires_ns is not None and expires_ns <= now_ns:
                self._take_out(track, track.moving)
                forgotten.append(track)
            else:
                self._plan(track)
        return forgotten

    def learn(
        self,
        answer: Answer,
        viewer: Viewer | None,
        now_ns: int,
        own: bool,
        tells_changes: bool,
        leaves: bool = True,
    ) -> Learned:
        """Counts the look behind an answer, or takes over the tracks of one that has none."""
        if answer.objects is None:
            return Learned(answer, answer, answer, None)
        look = answer.look
        if own and look is None and answer.source == "detector" and viewer is not None:
            found = tuple(one for one in answer.objects if one.location is not None)
            look = Look(answer.header, viewer.pose, viewer.horizontal_fov_rad, found)
        before: dict[int, float] = {}
        if look is not None:
            tracks, before = self.look(look, now_ns)
        else:
            at_ns = now_ns if answer.valid_ns is None else answer.valid_ns
            tracks = [
                one
                for one in (self._take_over(one, at_ns) for one in answer.objects)
                if one is not None
            ]
        shown = [one for one in tracks if one.cell is not None]
        requests = len(tracks)
        hits = sum(was >= self.threshold for was in before.values())
        boost = sum(
            self._worth(one, now_ns) - before[one.number] for one in shown if one.number in before
        )
        changes = tuple(map(as_change, shown)) if tells_changes else ()
        facts = ObjectLookups(
            answer.header, "sighting", requests, hits, len(before), boost, len(self), changes
        )
        answer = answer.with_look(look, None)
        served = answer.with_objects(
            self._served(shown, "" if look else answer.header.origin, now_ns)
        )
        if look is None or self._shares == "look":
            return Learned(answer, served, served, facts)
        viewer = Viewer(look.header, look.pose, look.horizontal_fov_rad)
        objects, valid_ns = self.visible(viewer, self._view_range_m, now_ns)
        return Learned(
            answer, served.with_objects(objects).with_look(look, valid_ns), served, facts
        )

    def boost(
        self, answer: Answer, header: Header, viewer: Viewer | None, now_ns: int
    ) -> Boosted | None:
        """What the map shows at the requester's pose, in the place of what was stored."""
        if answer.objects is None:
            return None
        requests = hits = 0
        for one in answer.objects:
            if one.location is not None:
                requests += 1
                stored = self.match(one.label, one.location[0], one.location[1], now_ns)
                hits += stored is not None and len(self._served((stored,), header.origin, now_ns))
        answer = answer.with_look(None, None)
        if viewer is not None:
            objects, valid_ns = self.visible(viewer, self._view_range_m, now_ns)
            answer = answer.with_objects(objects).with_look(None, valid_ns)
        return Boosted(answer, answer, requests, hits)

    def visible(
        self, viewer: Viewer, range_m: float, now_ns: int
    ) -> tuple[tuple[Detection, ...], int | None]:
        half_rad = min(viewer.horizontal_fov_rad / 2, math.pi)
        least_ahead, p_min = math.cos(half_rad), self._policy.p_min
        (east_m, north_m, _, heading_rad), near = viewer.pose, []
        ahead_east, ahead_north = math.cos(heading_rad), math.sin(heading_rad)
        for track in self._inside(rectangle(viewer.pose, half_rad, range_m)):
            if track.existence >= p_min:
                there_east_m, there_north_m = track.place(now_ns)
                away_east_m, away_north_m = there_east_m - east_m, there_north_m - north_m
                away_m = math.hypot(away_east_m, away_north_m)
                if (
                    away_m <= range_m
                    and away_east_m * ahead_east + away_north_m * ahead_north
                    >= least_ahead * away_m
                ):
                    near.append(track)
        return tuple(self._served(near, viewer.header.origin, now_ns)), now_ns

    def served(self, now_ns: int) -> list[Detection]:
        """Every object that may leave, wherever it is."""
        return self._served(self, "", now_ns)

    def match(self, label: str, east_m: float, north_m: float, at_ns: int) -> Track | None:
        """The nearest track of the label's group that a sighting there could be."""
        found = (
            (away_m, one.number, one) for away_m, one in self._near(label, east_m, north_m, at_ns)
        )
        return min(found, default=(0.0, 0, None))[2]

    def look(self, look: Look, now_ns: int) -> tuple[list[Track], dict[int, float]]:
        """Counts a look, unless it was counted before. Returns the tracks that it shows, and what those that were there
        before were worth, by number."""
        stamp_ns = look.header.stamp_ns
        if look.header in self._counted:
            places = [
                (one.label, one.location) for one in look.detections if one.location is not None
            ]
            known = [self.match(label, at[0], at[1], stamp_ns) for label, at in places]
            return list({one.number: one for one in known if one is not None}.values()), {}
        view = View(look)
        self._remember(look, view)
        placed = [one for one in look.detections if one.location is not None]
        around = self._around(look, placed)
        pairs = _pairs(placed, around, stamp_ns)
        of: dict[int, Track] = {}
        matched: set[int] = set()
        for _, number, j, track in pairs:
            if j not in of and number not in matched:
                of[j] = track
                matched.add(number)
        unseen = [
            (one, range_m)
            for east_m, north_m, one in around
            if one.number not in matched and one.checked_ns <= stamp_ns
            if (range_m := view.range_m(east_m, north_m)) is not None
        ]
        before = {one.number: self._worth(one, now_ns) for one in of.values()}
        born: list[Track] = []
        for j, seen in enumerate(placed):
            of[j] = self._sight(of.get(j), seen, look, born)
        for track, range_m in unseen:
            self._policy.unseen(track, range_m, look.header)
            if track.existence < 0.5:  # before that it has time
                self._plan(track)
        for _, number, j, track in pairs:
            if (
                number not in matched
                and track.cell is not None
                and _apart_m(track, of[j], stamp_ns) < NEAR_M
            ):
                self._take_out(track, track.moving)
        self.forget(now_ns)
        return list({one.number: one for one in of.values()}.values()), before

    def _remember(self, look: Look, view: View) -> None:
        stamp_ns, stream, car = look.header
        self._counted[look.header] = None
        if stamp_ns >= self._latest.get((car, stream), (0, view))[0]:
            self._latest[car, stream] = stamp_ns, view
        while next(iter(self._counted)).stamp_ns < stamp_ns - COUNTED_NS:
            self._counted.popitem(last=False)

    def _sight(self, track: Track | None, seen: Detection, look: Look, born: list[Track]) -> Track:
        """A track is seen, or begins; two detections of one object in one look are one."""
        header, at = look.header, seen.location
        assert at is not None
        if track is None:
            kind = kind_of(seen.label)
            for one in born:
                if (
                    one.kind.group == kind.group
                    and math.hypot(one.east_m - at[0], one.north_m - at[1]) < NEAR_M
                ):
                    return one
        range_m = math.hypot(at[0] - look.pose.east_m, at[1] - look.pose.north_m)
        sigma_m = sigma_of(range_m)
        if track is None:
            speed = kind.v_max_mps / 2
            variance = sigma_m * sigma_m, 0.0, speed * speed
            known = seen.label, seen.score, seen.confidence, *at, header.stamp_ns, header, variance
            track = Track(next(self._numbers), kind, *known)
            track.spoke_ns[header.origin] = header.stamp_ns
            born.append(track)
        else:
            self._move(track, seen, sigma_m, header)
            if self._speaks(track, header):
                track.confidence = self._boosted(
                    track.confidence, seen.confidence, self._rules.rate
                )
        track.range_m = range_m
        self._policy.seen(track, seen.score, header)
        if track.cell is None:
            self._put(track)
        if track.due_ns is None or track.moving:
            self._plan(track)
        return track

    def _move(self, track: Track, seen: Detection, sigma_m: float, header: Header) -> None:
        """Updates a track by a sighting, and takes it out of the grid if it is in another cell now."""
        was_moving, cell = track.moving, track.cell
        track.update(seen, sigma_m, header)
        if track.moving != was_moving or _cell(track) != cell:
            self._take_out(track, was_moving)

    def _speaks(self, track: Track, header: Header) -> bool:
        """Looks are counted once, so sightings are no echoes; ``origins`` also wants a second between a car's."""
        last_ns = track.spoke_ns.get(header.origin)
        if (
            self._rules.confidence_source == "origins"
            and last_ns is not None
            and header.stamp_ns - last_ns < ORIGIN_NS
        ):
            return False
        track.spoke_ns[header.origin] = header.stamp_ns
        return True

    def _take_over(self, one: Detection, at_ns: int) -> Track | None:
        """The track of another map's, which counted other looks: taken over where no camera that this map knows looked
        within the last second, and unless ours was seen later."""
        motion, at = one.motion, one.location
        if motion is None or at is None:
            return None
        track = self.match(one.label, at[0], at[1], at_ns)
        looked = any(
            stamp_ns > at_ns - COAST_NS and view.range_m(at[0], at[1]) is not None
            for stamp_ns, view in self._latest.values()
        )
        if looked or (track is not None and motion.seen.stamp_ns <= track.seen.stamp_ns):
            return track
        if track is None:
            number, kind = next(self._numbers), kind_of(one.label)
            track = Track(
                number,
                kind,
                one.label,
                one.score,
                one.confidence,
                *at,
                at_ns,
                motion.seen,
                UNCERTAIN,
            )
        else:
            self._take_out(track, track.moving)
        track.east_m, track.north_m, track.up_m = at
        track.stamp_ns, track.seen, track.velocity_mps = at_ns, motion.seen, motion.velocity_mps
        track.variance = motion.sigma_m**2, 0.0, 1.0
        self._policy.seen(track, one.score, motion.seen)
        track.existence = motion.existence
        self._put(track)
        self._plan(track)
        return track

    def _near(
        self, label: str, east_m: float, north_m: float, at_ns: int
    ) -> list[tuple[float, Track]]:
        """The tracks that a detection may show, with their distances."""
        kind = kind_of(label)
        reach_m = kind.gate_m
        found = []
        for track in self._inside(
            (east_m - reach_m, east_m + reach_m, north_m - reach_m, north_m + reach_m)
        ):
            if track.kind is kind and abs(track.north_m - north_m) <= reach_m + DRIVE_M:
                there_east_m, there_north_m = track.place(at_ns)
                away_m = math.hypot(there_east_m - east_m, there_north_m - north_m)
                if _fits(track, away_m, at_ns):
                    found.append((away_m, track))
        return found

    def _around(self, look: Look, placed: Iterable[Detection]) -> list[Placed]:
        """The tracks in view of a look, and around all that it shows, each with its place then."""
        reach_m, half_rad, stamp_ns = (
            FARTHEST_M,
            min(look.horizontal_fov_rad / 2, math.pi),
            look.header.stamp_ns,
        )
        for one in placed:
            if one.location is not None:
                away_m = math.hypot(
                    one.location[0] - look.pose.east_m, one.location[1] - look.pose.north_m
                )
                reach_m = max(reach_m, away_m)
        west, east, south, north = rectangle(look.pose, half_rad, reach_m)
        area = west - WIDEST_M, east + WIDEST_M, south - WIDEST_M, north + WIDEST_M
        return [(*track.place(stamp_ns), track) for track in self._inside(area)]

    def _inside(self, area: tuple[float, float, float, float]) -> Iterator[Track]:
        """The tracks that may be in an upright rectangle: west, east, south, north."""
        west, east, south, north = area
        for grid, side_m, reach_m in (
            (self._slow, SLOW_CELL_M, DRIFT_M),
            (self._fast, FAST_CELL_M, DRIVE_M),
        ):
            if not grid:
                continue
            rows = range(int((south - reach_m) // side_m), int((north + reach_m) // side_m) + 1)
            for i in range(int((west - reach_m) // side_m), int((east + reach_m) // side_m) + 1):
                for j in rows:
                    if (held := grid.get(i + j * ROW)) is not None:
                        yield from held

    def _put(self, track: Track) -> None:
        """Into the grid."""
        track.cell = cell = _cell(track)
        (self._fast if track.moving else self._slow).setdefault(cell, []).append(track)
        self._count += 1

    def _take_out(self, track: Track, moving: bool) -> None:
        assert track.cell is not None
        grid = self._fast if moving else self._slow
        held = grid[track.cell]
        held.remove(track)
        if not held:
            del grid[track.cell]
        track.cell = None
        self._count -= 1

    def _plan(self, track: Track) -> None:
        """Notes when to look whether the track's time is over, unless that is noted for an earlier time."""
        expires_ns = self._policy.expires_ns(track)
        if expires_ns is not None and (track.due_ns is None or expires_ns < track.due_ns):
            track.due_ns = expires_ns
            heapq.heappush(self._to_forget, (expires_ns, next(self._numbers), track))

    def _served(self, tracks: Iterable[Track], to: str, now_ns: int) -> list[Detection]:
        """Those that may leave, where they are now."""
        policy, by_existence, threshold = self._policy, self._policy.by_existence, self.threshold
        always = type(policy).serves is Never.serves
        found = []
        for one in tracks:
            if by_existence or one.confidence >= threshold:
                existence = policy.existence(one, now_ns)
                if existence >= policy.p_min and (always or policy.serves(one, to, now_ns)):
                    found.append(
                        one.as_detection(
                            now_ns, existence if by_existence else one.confidence, existence
                        )
                    )
        return found

    def _worth(self, track: Track, now_ns: int) -> float:
        """The confidence that others are told: that the object exists, where this decides, else C."""
        return (
            self._policy.existence(track, now_ns) if self._policy.by_existence else track.confidence
        )


def _pairs(
    placed: Sequence[Detection], around: Iterable[Placed], at_ns: int
) -> list[tuple[float, int, int, Track]]:
    """What may belong together, nearest first: distance, the track's number, the detection's place in its list."""
    cells: dict[int, list[Placed]] = {}
    for one in around:
        cells.setdefault(int(one[0] // WIDEST_M) + int(one[1] // WIDEST_M) * ROW, []).append(one)
    found = []
    for j, seen in enumerate(placed):
        assert seen.location is not None
        kind, (east_m, north_m, _) = kind_of(seen.label), seen.location
        middle = int(east_m // WIDEST_M) + int(north_m // WIDEST_M) * ROW
        for cell in NEXT_CELLS:
            for there_east_m, there_north_m, track in cells.get(middle + cell, ()):
                if track.kind is kind:
                    away_m = math.hypot(there_east_m - east_m, there_north_m - north_m)
                    if _fits(track, away_m, at_ns):
                        found.append((away_m, track.number, j, track))
    return sorted(found)


def _fits(track: Track, away_m: float, at_ns: int) -> bool:
    """Whether a sighting so far from a track's place may be the track's."""
    return away_m <= NEAR_M or (
        away_m <= track.kind.gate_m and away_m <= NEAR_M + 2.0 * track.sigma_m(at_ns)
    )


def _cell(track: Track) -> int:
    side_m = FAST_CELL_M if track.moving else SLOW_CELL_M
    return int(track.east_m // side_m) + int(track.north_m // side_m) * ROW


def _apart_m(one: Track, other: Track, at_ns: int) -> float:
    (east_m, north_m), (other_east_m, other_north_m) = one.place(at_ns), other.place(at_ns)
    return math.hypot(east_m - other_east_m, north_m - other_north_m)
