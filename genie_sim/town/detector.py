"""The town's detector: what a camera has in view, and what the laws let a detector find of it."""

import math
from operator import attrgetter

from genie_sim.messages import CameraPose, Detection
from genie_sim.perception.trace import POSITION_DECIMALS, SCORE_DECIMALS
from genie_sim.town.laws import MIDDLE, STEPS_PER_Z, VIEW_STEP_M, DetectorLaws, TransientLaw, quantile
from genie_sim.town.noise import MASK, NORMAL_MASK, SMOOTH_MASK, mix, normals
from genie_sim.town.objects import HORIZONTAL_FOV_RAD, MIDDLES_M, TownObject
from genie_sim.town.streets import Streets

NEAREST_M = 3.5  # KITTI's nearest labelled object is 3 m away: nearer ones leave the picture
MOST_Z = 3.7  # the largest number of the table of normal ones is smaller
ALONG, ACROSS = 21 * 1021, 43 * 1021  # far apart in the gradual numbers: these are not the score's
_score = attrgetter("score")

View = list[tuple[TownObject, float]]  # everything in view, ghosts too, with its range [m]


class SyntheticDetector:
    """Finds, misses and imagines objects as the laws say, for a camera that stands anywhere in a scene."""

    def __init__(self, scene: Streets, laws: DetectorLaws, view_m: float) -> None:
        """``view_m`` is how far it looks [m]."""
        self._scene, self._view_m = scene, view_m
        self.transient = laws.transient
        self._normals = normals()
        half = HORIZONTAL_FOV_RAD / 2
        self._half_c, self._half_s, self._slope = math.cos(half), math.sin(half), math.tan(half)

    def detect(self, view: View, pose: CameraPose, c: float, s: float, look_key: int) -> tuple[Detection, ...]:
        """What the detector finds in a view, best score first.

        ``c`` and ``s`` are cosine and sine of the heading; ``look_key`` (64 bits) is this look's own.
        """
        table = self._normals
        x, y = pose.east_m, pose.north_m
        gone_m, quarter = _gone(x, y, c, s)
        found = []
        for one, range_m in view:
            east_m, north_m, up_m, _, label, _, key, offset, score_z, along_z, across_z, laws, _, _ = one
            row = laws.scores[int(range_m + 0.5)]
            step = int((range_m - gone_m) / VIEW_STEP_M) + offset + quarter
            _, of_view, of_look, views = laws.score
            z = score_z + of_view * views[step & SMOOTH_MASK]
            if row[int((z + MOST_Z * of_look) * STEPS_PER_Z + MIDDLE)] == 0.0:
                continue  # whatever this look's own number is
            bits = ((key ^ look_key) * 0xBF58476D1CE4E5B9) & MASK
            bits ^= bits >> 32
            score = row[int((z + of_look * table[bits & NORMAL_MASK]) * STEPS_PER_Z + MIDDLE)]
            if score == 0.0:
                continue
            _, of_view, of_look, views = laws.along
            z = along_z + of_view * views[step + ALONG & SMOOTH_MASK]
            z += of_look * table[bits >> 12 & NORMAL_MASK]
            along_m = laws.along_m[int(range_m + 0.5)][int(z * STEPS_PER_Z + MIDDLE)] / range_m
            _, of_view, of_look, views = laws.across
            z = across_z + of_view * views[step + ACROSS & SMOOTH_MASK]
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
        for law in self.transient:
            if 0.0 <= draw < law.per_frame:
                found.append(_transient(law, mix(look_key), x, y, c, s))
            draw -= law.per_frame
        found.sort(key=_score, reverse=True)
        return tuple(found)

    def view(self, pose: CameraPose, c: float, s: float, t_s: float) -> View:
        """What a camera has in view at a time [s], whose heading has the cosine ``c`` and the sine ``s``."""
        view_m, slope = self._view_m, self._slope
        x, y = pose.east_m, pose.north_m
        c1, s1 = c * self._half_c - s * self._half_s, s * self._half_c + c * self._half_s
        c2, s2 = c * self._half_c + s * self._half_s, s * self._half_c - c * self._half_s
        area = (
            x + view_m * (-1.0 if -c >= self._half_c else min(0.0, c1, c2)),
            y + view_m * (-1.0 if -s >= self._half_c else min(0.0, s1, s2)),
            x + view_m * (1.0 if c >= self._half_c else max(0.0, c1, c2)),
            y + view_m * (1.0 if s >= self._half_c else max(0.0, s1, s2)),
        )
        found: View = []
        for one in self._scene.ahead(x, y, area, t_s):
            dx, dy = one[0] - x, one[1] - y
            reach_m = (dx * c + dy * s) * slope
            if -reach_m <= dy * c - dx * s <= reach_m:  # behind the camera no number is
                range_m = math.sqrt(dx * dx + dy * dy)
                if NEAREST_M <= range_m <= one[3] and range_m <= view_m:
                    found.append((one, range_m))
        return found


def _gone(x: float, y: float, c: float, s: float) -> tuple[float, int]:
    """How far [m] a camera has gone along its street, and where the gradual numbers of its direction begin.

    The view changes as the camera goes on and the range shrinks; turning into another street is another view.
    """
    if abs(c) > abs(s):
        return (x, 0) if c > 0 else (-x, 16411)
    return (y, 2 * 16411) if s > 0 else (-y, 3 * 16411)


def _transient(law: TransientLaw, bits: int, x: float, y: float, c: float, s: float) -> Detection:
    """A false positive that is seen once, anywhere in view of a camera at (x, y) [m]."""
    range_m = quantile(law.range_m, (bits >> 16 & 0xFFFF) / 0x10000)
    angle = ((bits >> 32 & 0xFFFF) / 0x10000 - 0.5) * HORIZONTAL_FOV_RAD
    score = round(quantile(law.scores, (bits >> 48) / 0x10000), SCORE_DECIMALS)
    ahead_m, left_m = range_m * math.cos(angle), range_m * math.sin(angle)
    east_m, north_m = x + ahead_m * c - left_m * s, y + ahead_m * s + left_m * c
    location = (round(east_m, POSITION_DECIMALS), round(north_m, POSITION_DECIMALS), MIDDLES_M[law.label])
    return Detection(law.label, score, None, location, score, "town")
