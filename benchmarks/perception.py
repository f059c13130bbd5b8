"""How much of the network's own speed is left when frames are read, decoded and placed as well.

    GENIE_SIM_KITTI=... GENIE_SIM_WEIGHTS=... python benchmarks/perception.py [--detector
    yolox_nano] [--threads 1]

Bare: ``InferenceSession.run`` alone, on the same frames, already prepared, with the same threads.
Pipeline: what ``genie-sim perceive`` does with them, from files to placed detections. The two take
turns, and each turn gives a share, because both are as fast as the machine happens to be. Processor
time says what the wall clock cannot where others use the machine: the pipeline can be as fast as
the network if everything else takes less of it than the network does, for each processor that the
network leaves free.
"""

from __future__ import annotations

import argparse
import os
import statistics
import time
from collections.abc import Callable, Iterable

from genie_sim.perception.detector import make_detector
from genie_sim.perception.kitti import open_drive, read_image
from genie_sim.perception.onnx_detector import OnnxDetector
from genie_sim.perception.perceive import in_turn, kitti_folder
from genie_sim.perception.pipeline import trace_frames


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--detector", default="yolox_nano")
    parser.add_argument("--drive", default="2011_09_26/0005")
    parser.add_argument("--cameras", default="02,03")
    parser.add_argument("--size", help="the network's input, such as 832x256")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--batch", type=int, default=1, help="pictures at a time")
    parser.add_argument("--frames", type=int, default=200, help="of all cameras together")
    parser.add_argument("--rounds", type=int, default=9)
    arguments = parser.parse_args()

    width_height = arguments.size and tuple(map(int, arguments.size.split("x")))
    detector = make_detector(
        arguments.detector, None, width_height, threads=arguments.threads, batch=arguments.batch
    )
    assert isinstance(detector, OnnxDetector)
    drive = open_drive(kitti_folder(None), arguments.drive, arguments.cameras.split(","))
    frames = in_turn(drive)[: arguments.frames]
    blobs = [detector.prepare(read_image(frame.image_path))[0] for frame in frames]
    together = [blobs[i : i + detector.batch] for i in range(0, len(blobs), detector.batch)]
    bare, pipeline = [], []
    for _ in range(arguments.rounds):
        bare.append(_timed(lambda: map(detector.infer_many, together)))
        pipeline.append(_timed(lambda: trace_frames(drive, frames, detector)))
    shares = [one[0] / other[0] for one, other in zip(bare, pipeline, strict=True)]
    size = "x".join(map(str, detector.size))
    print(f"{detector.name} {size}, {len(frames)} frames, {detector.batch} at a time", end=", ")
    print(f"{arguments.threads} threads, {os.cpu_count()} processors")
    (bare_s, bare_processor_s), (pipeline_s, pipeline_processor_s) = (
        [statistics.median(column) / len(frames) for column in zip(*rows, strict=True)]
        for rows in (bare, pipeline)
    )
    rest_s = pipeline_processor_s - bare_processor_s
    print(f"bare network  {1 / bare_s:7.1f} frames/s")
    print(f"pipeline      {1 / pipeline_s:7.1f} frames/s")
    print(
        f"share         {statistics.median(shares):7.0%} "
        f"(rounds: {', '.join(f'{s:.0%}' for s in sorted(shares))})"
    )
    print(
        f"processor time of a frame: network {1e3 * bare_processor_s:.1f} ms, "
        f"all else {1e3 * rest_s:.1f} ms"
    )


def _timed(run: Callable[[], Iterable[object]]) -> tuple[float, float]:
    """Seconds on the clock and of all processors."""
    begin, processor = time.perf_counter(), time.process_time()
    for _ in run():
        pass
    return time.perf_counter() - begin, time.process_time() - processor


if __name__ == "__main__":
    main()
