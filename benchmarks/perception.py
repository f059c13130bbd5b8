"""How much of the network's own speed is left when frames are read, decoded and placed as well.

    GENIE_SIM_KITTI=... GENIE_SIM_WEIGHTS=... python benchmarks/perception.py [--detector yolox_nano] [--threads 1]

Bare: ``InferenceSession.run`` alone, on the same frames, already prepared, with the same threads. Pipeline: what
``genie-sim perceive`` does with them, from files to placed detections. The two take turns and medians are compared,
because both are as fast as the machine happens to be.
"""

from __future__ import annotations

import argparse
import os
import statistics
import time

from genie_sim.perception.detector import make_detector
from genie_sim.perception.kitti import open_drive, read_image
from genie_sim.perception.onnx_detector import OnnxDetector
from genie_sim.perception.perceive import kitti_folder, trace_frames

ROUNDS = 5


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--detector", default="yolox_nano")
    parser.add_argument("--drive", default="2011_09_26/0005")
    parser.add_argument("--size", help="the network's input, such as 832x256")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--frames", type=int, default=100)
    arguments = parser.parse_args()

    width_height = arguments.size and tuple(map(int, arguments.size.split("x")))
    detector = make_detector(arguments.detector, None, width_height, threads=arguments.threads)
    assert isinstance(detector, OnnxDetector)
    drive = open_drive(kitti_folder(None), arguments.drive, ["02"])
    frames = drive.frames["02"][: arguments.frames]
    blobs = [detector.prepare(read_image(frame.image_path))[0] for frame in frames]
    bare_s, pipeline_s = [], []
    for _ in range(ROUNDS):
        begin = time.perf_counter()
        for blob in blobs:
            detector.infer(blob)
        bare_s.append((time.perf_counter() - begin) / len(frames))
        begin = time.perf_counter()
        for _ in trace_frames(drive, frames, detector):
            pass
        pipeline_s.append((time.perf_counter() - begin) / len(frames))
    bare, pipeline = statistics.median(bare_s), statistics.median(pipeline_s)
    size = "x".join(map(str, detector.size))
    print(f"{detector.name} {size}, {len(frames)} frames, {arguments.threads} threads, {os.cpu_count()} processors")
    print(f"bare network  {1 / bare:7.1f} frames/s")
    print(f"pipeline      {1 / pipeline:7.1f} frames/s, {bare / pipeline:.0%} of it")


if __name__ == "__main__":
    main()
