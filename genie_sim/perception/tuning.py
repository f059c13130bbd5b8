"""How many threads a network gets, and how many pictures at a time: what is fastest here, by
measurement.

What is measured is what counts, frames a second from file to placed detections: a thread of the
network's is one less for reading and placing. Of settings that differ by less than ``NOT_WORTH_IT``
the simplest is taken.
"""

import os
import statistics
import time
from collections.abc import Callable, Mapping, Sequence

from genie_sim.errors import UserError
from genie_sim.perception.detector import ImageDetector
from genie_sim.perception.kitti import CameraFrame, KittiDrive
from genie_sim.perception.pipeline import trace_frames

BATCHES = (1, 2, 4)
FRAMES = 24
ROUNDS = 3
NOT_WORTH_IT = 0.05

Setting = tuple[int, int]  # threads, pictures at a time


def fastest(
    drive: KittiDrive,
    frames: Sequence[CameraFrame],
    open_detector: Callable[[int, int], ImageDetector],
    *,
    threads: int | None,
    batch: int | None,
    report: Callable[[str], None],
) -> Setting:
    """The fastest setting, of 1, 2, 4 ... to all processors and a few batches, with which the first
    frames are tried. Raises UserError where the detector can be opened with none.

    Parameters
    ----------
    drive, frames : what a detector looks at
    open_detector : opens the detector with so many threads and so large a batch
    threads, batch : are not varied where they are given
    report : gets a line with the setting, and the frames a second that each of the others reached
    """
    counts = thread_counts(os.cpu_count() or 1) if threads is None else [threads]
    detectors: dict[Setting, ImageDetector] = {}
    problems: list[str] = []
    batches = BATCHES if batch is None else [batch]
    for setting in [(count, size) for size in batches for count in counts]:
        try:
            detectors[setting] = open_detector(*setting)
        except UserError as error:
            if setting[1] == 1:
                raise
            problems.append(str(error))
    if not detectors:
        raise UserError(problems[0])
    first = list(frames[:FRAMES])
    seconds: dict[Setting, list[float]] = {setting: [] for setting in detectors}
    for _ in range(ROUNDS):  # in turns: the machine may be faster now than then
        for setting, detector in detectors.items():
            begin = time.perf_counter()
            for _row in trace_frames(drive, first, detector):
                pass
            seconds[setting].append(time.perf_counter() - begin)
    rates_fps = {
        setting: len(first) / statistics.median(rounds) for setting, rounds in seconds.items()
    }
    threads, batch = simplest(rates_fps)
    rates = ", ".join(f"{count} x {size}: {rate:.0f}" for (count, size), rate in rates_fps.items())
    text = (
        f"auto: --threads {threads} --batch {batch}, "
        f"the simplest within {NOT_WORTH_IT:.0%} of the fastest; "
    )
    report("\n".join([f"{text}frames/s of threads x batch: {rates}", *dict.fromkeys(problems)]))
    return threads, batch


def thread_counts(processors: int) -> list[int]:
    """1, 2, 4 ... and as many as there are: each count would take long on a large machine, and say
    little more.
    """
    powers = (2**power for power in range(processors.bit_length()))
    return sorted({*powers, processors})


def simplest(rates_fps: Mapping[Setting, float]) -> Setting:
    """Of the settings that are nearly as fast as the fastest, the one with the smallest batch, then
    fewest threads.
    """
    enough = (1 - NOT_WORTH_IT) * max(rates_fps.values())
    return min(
        (setting for setting, rate in rates_fps.items() if rate >= enough),
        key=lambda s: (s[1], s[0]),
    )
