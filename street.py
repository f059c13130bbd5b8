"""A straight street with a parked car every ten metres."""

from dataclasses import dataclass

from genie_sim.extend import CameraPose, Detection, Drive, Drives, FrameSource


@dataclass(frozen=True)
class Frame:
    stamp_ns: int
    pose: CameraPose
    digest: str
    dhash: int
    detections: tuple
    size_bytes: int = 1_400_000
    horizontal_fov_rad: float = 1.4


@dataclass(frozen=True)
class Street(FrameSource, Drives):
    """``seconds`` of driving at ``speed`` metres a second, ten frames a second."""

    seconds: float = 5.0
    speed: float = 8.0

    def open(self, seed, origin, progress=None):
        return self  # there is nothing to read

    def drive(self, car, trace, start_ns):
        return StreetDrive(
            "street", {"front": [self.frame(number) for number in range(round(10 * self.seconds))]}
        )

    def frame(self, number):
        east_m = number * self.speed / 10
        ahead = [10.0 * place for place in range(30) if 5.0 < 10.0 * place - east_m < 40.0]
        seen = tuple(Detection("car", 0.7, None, (east, 4.0, 0.8), 0.7) for east in ahead)
        return Frame(
            number * 100_000_000, CameraPose(east_m, 0.0, 1.6, 0.0), f"front {number}", number, seen
        )

    def digests(self):
        return {
            "street": f"{self.seconds} s at {self.speed} m/s"
        }  # what decides the frames, for the run's id

    def provenance(self):
        return {"street": {"made by": "street.py"}}  # where they come from, for run.json


@dataclass(frozen=True)
class StreetDrive(Drive):
    name: str
    frames: dict
