"""What a car's camera sees, frame by frame, made when it is asked for and not kept."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from operator import attrgetter
from typing import TYPE_CHECKING, Protocol, overload

from genie_sim.messages import CameraPose, Detection
from genie_sim.perception.trace import IMAGE_HEADER_BYTES, POSITION_DECIMALS, SCORE_DECIMALS
from genie_sim.town.laws import MIDDLE, STEPS_PER_Z, VIEW_STEP_M, DetectorLaws, Fleeting, quantile
from genie_sim.town.noise import MASK, NORMAL_MASK, SMOOTH_MASK, mix, normals
from genie_sim.town.objects import HEIGHT, HORIZONTAL_FOV_RAD, MIDDLES_M, WIDTH, Seen
from genie_sim.town.rules import TrueObject

if TYPE_CHECKING:
    from genie_sim.town.town import Drive

CAMERA_UP_M = 1.65
BASELINES_M = {"02": 0.27, "03": -0.27}  # to the left of the car's middle
NEAREST_M = 3.5  # KITTI's nearest labelled object is 3 m away: nearer ones leave the picture
MOST_Z = 3.7  # the largest number of the table of normal ones is smaller
ALONG, ACROSS = 21 * 1021, 43 * 1021  # far apart in the gradual numbers: these are not the score's
_score = attrgetter("score")


class TownFrame:
    """One camera frame of the town; stands in for a ``TraceFrame``, except that boxes are ``None``.

    ``digest`` names the town, the car, the camera and the frame: no two frames are byte for byte the same picture.
    ``dhash`` are bits of their own for each frame, so that pictures are never alike by it, however near their poses.
    ``detections`` are made when they are first asked for, from the town's seed, the car and the frame alone.
    """

    __slots__ = ("_detections", "_drive", "_place", "_view", "camera", "dhash", "digest", "index", "pose", "stamp_ns")

    width = WIDTH
    height = HEIGHT
    size_bytes = WIDTH * HEIGHT * 3 + IMAGE_HEADER_BYTES
    horizontal_fov_rad = HORIZONTAL_FOV_RAD

    def __init__(self, drive: Drive, camera: str, index: int) -> None:
        self._drive = drive
        self.camera = camera
        self.index = index
        self.stamp_ns = stamp_ns = index * drive.interval_ns
        self.dhash = mix(drive.car_key ^ (index << 8) ^ int(camera))
        self.digest = f"{drive.picture_prefix}{camera}{index:014x}"
        east_m, north_m, heading, c, s, _ = drive.course.at((drive.start_ns + stamp_ns) * 1e-9)
        left_m = BASELINES_M[camera]
        east_m = round(east_m - left_m * s, POSITION_DECIMALS)
        north_m = round(north_m + left_m * c, POSITION_DECIMALS)
        self.pose = CameraPose(east_m, north_m, CAMERA_UP_M, round(math.remainder(heading, math.tau), 6))
        self._place = (c, s)
        self._view: View | None = None
        self._detections: tuple[Detection, ...] | None = None

    @property
    def detections(self) -> tuple[Detection, ...]:
        """What the detector finds in this frame, best score first."""
        if self._detections is None:
            self._detections = self._drive.town.eye.look(self._in_view(), self.pose, *self._place, self.dhash)
        return self._detections

    def truth(self) -> tuple[TrueObject, ...]:
        """What is really in view: in the field of view, not hidden by houses, within ``TownRules.view_m``, and at least
        25 pixels high in the picture, as KITTI's labels that count."""
        return truth(self._in_view())

    def _in_view(self) -> View:
        if self._view is None:
            drive = self._drive
            t_s = (drive.start_ns + self.stamp_ns) * 1e-9
            self._view = drive.town.eye.view(self.pose, *self._place, t_s)
        return self._view

    def __eq__(self, other: object) -> bool:
        return isinstance(other, TownFrame) and self.digest == other.digest

    def __hash__(self) -> int:
        return hash(self.digest)

    def __repr__(self) -> str:
        return f"<TownFrame {self._drive.name} {self.camera} {self.index}>"


class TownFrames(Sequence[TownFrame]):
    """All frames of one camera of a drive; each look makes them anew."""

    __slots__ = ("_camera", "_count", "_drive")

    def __init__(self, drive: Drive, camera: str, count: int) -> None:
        self._drive, self._camera, self._count = drive, camera, count

    def __len__(self) -> int:
        return self._count

    @overload
    def __getitem__(self, index: int) -> TownFrame: ...

    @overload
    def __getitem__(self, index: slice) -> tuple[TownFrame, ...]: ...

    def __getitem__(self, index: int | slice) -> TownFrame | tuple[TownFrame, ...]:
        if isinstance(index, slice):
            return tuple(TownFrame(self._drive, self._camera, i) for i in range(*index.indices(self._count)))
        if not -self._count <= index < self._count:
            raise IndexError(f"frame {index} of {self._count}")
        return TownFrame(self._drive, self._camera, index % self._count)

    def __iter__(self) -> Iterator[TownFrame]:
        return (TownFrame(self._drive, self._camera, index) for index in range(self._count))


View = list[tuple[Seen, float]]  # everything in view, ghosts too, with its range [m]


class World(Protocol):
    """What a camera looks at."""

    def ahead(self, east_m: float, north_m: float, box: tuple[float, float, float, float], t_s: float) -> list[Seen]:
        """All that is not hidden from a place, in a box (west, south, east, north)."""


class Eye:
    """A camera with its detector, anywhere in the town."""

    def __init__(self, streets: World, laws: DetectorLaws, view_m: float) -> None:
        self._streets, self._view_m = streets, view_m
        self.fleeting = laws.fleeting
        self._normals = normals()
        half = HORIZONTAL_FOV_RAD / 2
        self._half_c, self._half_s, self._slope = math.cos(half), math.sin(half), math.tan(half)

    def look(self, view: View, pose: CameraPose, c: float, s: float, look_key: int) -> tuple[Detection, ...]:
        """What the detector finds in a view, best score first; ``look_key`` is this look's own."""
        table = self._normals
        x, y = pose.east_m, pose.north_m
        # The view changes as the camera goes on and the range shrinks; turning into another street is another view.
        if abs(c) > abs(s):
            gone_m, quarter = (x, 0) if c > 0 else (-x, 16411)
        else:
            gone_m, quarter = (y, 2 * 16411) if s > 0 else (-y, 3 * 16411)
        found = []
        for thing, range_m in view:
            east_m, north_m, up_m, _, label, _, key, offset, score_z, along_z, across_z, laws, _, _ = thing
            row = laws.scores[int(range_m + 0.5)]
            view = int((range_m - gone_m) / VIEW_STEP_M) + offset + quarter
            _, of_view, of_look, views = laws.score
            z = score_z + of_view * views[view & SMOOTH_MASK]
            if row[int((z + MOST_Z * of_look) * STEPS_PER_Z + MIDDLE)] == 0.0:
                continue  # whatever this look's own number is
            bits = ((key ^ look_key) * 0xBF58476D1CE4E5B9) & MASK
            bits ^= bits >> 32
            score = row[int((z + of_look * table[bits & NORMAL_MASK]) * STEPS_PER_Z + MIDDLE)]
            if score == 0.0:
                continue
            _, of_view, of_look, views = laws.along
            z = along_z + of_view * views[view + ALONG & SMOOTH_MASK]
            z += of_look * table[bits >> 12 & NORMAL_MASK]
            along_m = laws.along_m[int(range_m + 0.5)][int(z * STEPS_PER_Z + MIDDLE)] / range_m
            _, of_view, of_look, views = laws.across
            z = across_z + of_view * views[view + ACROSS & SMOOTH_MASK]
            z += of_look * table[bits >> 24 & NORMAL_MASK]
            across_m = laws.across_m[int(range_m + 0.5)][int(z * STEPS_PER_Z + MIDDLE)] / range_m
            dx, dy = east_m - x, north_m - y
            location = (  # rounded to millimetres; round() takes five times as long
                ((east_m + along_m * dx - across_m * dy) * 1000.0 + 0.5) // 1.0 / 1000.0,
                ((north_m + along_m * dy + across_m * dx) * 1000.0 + 0.5) // 1.0 / 1000.0,
                up_m,
            )
            if key >> 52 < laws.prone:
                for share, name in laws.names:
                    if bits >> 40 & 0xFFFF < share:
                        label = name
                        break
            found.append(Detection(label, score, None, location, score, "town"))
        draw = (look_key >> 48) / 0x10000
        for kind in self.fleeting:
            if 0.0 <= draw < kind.a_frame:
                found.append(self._fleeting_ghost(kind, mix(look_key), x, y, c, s))
            draw -= kind.a_frame
        found.sort(key=_score, reverse=True)
        return tuple(found)

    def _fleeting_ghost(self, kind: Fleeting, bits: int, x: float, y: float, c: float, s: float) -> Detection:
        """A detection of nothing, anywhere in view; at most one a frame."""
        range_m = quantile(kind.range_m, (bits >> 16 & 0xFFFF) / 0x10000)
        angle = ((bits >> 32 & 0xFFFF) / 0x10000 - 0.5) * HORIZONTAL_FOV_RAD
        score = round(quantile(kind.scores, (bits >> 48) / 0x10000), SCORE_DECIMALS)
        ahead_m, left_m = range_m * math.cos(angle), range_m * math.sin(angle)
        east_m, north_m = x + ahead_m * c - left_m * s, y + ahead_m * s + left_m * c
        location = (round(east_m, POSITION_DECIMALS), round(north_m, POSITION_DECIMALS), MIDDLES_M[kind.label])
        return Detection(kind.label, score, None, location, score, "town")

    def view(self, pose: CameraPose, c: float, s: float, t_s: float) -> View:
        """What a camera looks at whose heading has this cosine and sine."""
        view_m, slope = self._view_m, self._slope
        x, y = pose.east_m, pose.north_m
        c1, s1 = c * self._half_c - s * self._half_s, s * self._half_c + c * self._half_s
        c2, s2 = c * self._half_c + s * self._half_s, s * self._half_c - c * self._half_s
        box = (
            x + view_m * (-1.0 if -c >= self._half_c else min(0.0, c1, c2)),
            y + view_m * (-1.0 if -s >= self._half_c else min(0.0, s1, s2)),
            x + view_m * (1.0 if c >= self._half_c else max(0.0, c1, c2)),
            y + view_m * (1.0 if s >= self._half_c else max(0.0, s1, s2)),
        )
        found = []
        for thing in self._streets.ahead(x, y, box, t_s):
            dx, dy = thing[0] - x, thing[1] - y
            reach_m = (dx * c + dy * s) * slope
            if -reach_m <= dy * c - dx * s <= reach_m:  # behind the camera no number is
                range_m = math.sqrt(dx * dx + dy * dy)
                if NEAREST_M <= range_m <= thing[3] and range_m <= view_m:
                    found.append((thing, range_m))
        return found


def truth(view: View) -> tuple[TrueObject, ...]:
    """What is really in view."""
    return tuple(
        TrueObject(thing.number, thing.label, (thing.east_m, thing.north_m, thing.up_m), thing.moving)
        for thing, _ in view
        if thing.real
    )
