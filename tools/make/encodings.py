"""Bytes and processor time of encoded pictures of drive 0005, colour and grey: a table, one line an
encoding.

    GENIE_SIM_KITTI=... python tools/make/encodings.py

One thread of OpenCV; medians over every fourth picture of camera 02. ``genie_sim/sim/encoding.py``
has the times of colour pictures, per megabyte of their pixels, from a machine that did nothing
else.
"""

from __future__ import annotations

import time

import cv2
import numpy as np

from genie_sim.analysis import renderers
from genie_sim.analysis.result_table import ResultTable
from genie_sim.data.encoding import FORMATS
from genie_sim.data.kitti.drive import open_drive, read_image
from genie_sim.data.kitti.perceive import kitti_folder


def main() -> None:
    cv2.setNumThreads(1)
    frames = open_drive(kitti_folder(None), "2011_09_26/0005", ("02",)).frames["02"][::4]
    colour = [read_image(frame.image_path)[0] for frame in frames]
    grey = [cv2.cvtColor(image, cv2.COLOR_BGR2GRAY) for image in colour]
    heads = ["", "encoding", "bytes", "of the pixels", "encode, ms/MB", "decode, ms/MB"]
    lines = []
    for what, images, flag in (
        ("colour", colour, cv2.IMREAD_COLOR),
        ("grey", grey, cv2.IMREAD_GRAYSCALE),
    ):
        for name, (suffix, settings) in FORMATS.items():
            rows = []
            for image in images:
                begin_s = time.process_time()
                _, data = cv2.imencode(suffix, image, settings)
                middle_s = time.process_time()
                cv2.imdecode(data, flag)
                times_s = middle_s - begin_s, time.process_time() - middle_s
                rows.append(
                    (
                        len(data),
                        len(data) / image.size,
                        *(1e9 * one / image.size for one in times_s),
                    )
                )
            size, share, encode, decode = np.median(rows, axis=0)
            numbers = f"{size:,.0f}", f"{share:.3f}", f"{encode:.2f}", f"{decode:.2f}"
            lines.append([what, name, *numbers])
    print(renderers.markdown(ResultTable.of_texts(heads, lines)), end="")


if __name__ == "__main__":
    main()
