"""The commands ``perceive`` and ``truth``. Everything heavy is imported after the arguments are parsed."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, get_args

import click

from genie_sim import arguments
from genie_sim.arguments import PATH
from genie_sim.errors import UserError
from genie_sim.messages import Encoding
from genie_sim.terminal import Progress

if TYPE_CHECKING:
    from genie_sim.core.geometry import Geodetic
    from genie_sim.perception.detector import ImageDetector
    from genie_sim.perception.trace import Trace


@click.command()
@click.option("--drive", help="A drive, such as 2011_09_26/0005 or tracking/0005.")
@click.option("--bag", type=PATH, help="Instead: a ROS 1 bag, a ROS 2 bag's folder, an MCAP file.")
@click.option(
    "--topic", "topics", multiple=True, metavar="[NAME=]TOPIC", help="Images of the bag, or all."
)
@click.option("--detections", metavar="TOPIC", help="The bag's own, not a detector's.")
@click.option("--out", type=PATH, help="The trace file to write.")
@click.option("--kitti", type=PATH, help="KITTI's root folder; default: $GENIE_SIM_KITTI.")
@click.option("--cameras", default="02,03", help="Colour cameras, separated by commas.")
@click.option(
    "--detector",
    default="yolox_nano",
    help="A detector ('list detectors'), your own module:Class; for sequences pointrcnn or rrc.",
)
@click.option(
    "--weights", type=PATH, help="The ONNX file, or its folder; default: $GENIE_SIM_WEIGHTS."
)
@click.option("--size", metavar="WxH", help="The network's input, such as 832x256.")
@click.option(
    "--providers",
    default="CPUExecutionProvider",
    help="ONNX Runtime's execution providers, best first, such as CUDAExecutionProvider.",
)
@click.option(
    "--threads", default="1", metavar="N|auto", help="The network's; auto: what is fastest here."
)
@click.option(
    "--batch", default="1", metavar="N|auto", help="Pictures at a time; auto: what is fastest here."
)
@click.option(
    "--min-score",
    type=click.FloatRange(0.0, 1.0),
    default=0.3,
    help="Keep detections from this score on.",
)
@click.option(
    "--origin", metavar="LAT,LON,ALT", help="The world's origin; default: the drive's first fix."
)
@click.option(
    "--allow-missing-scans", is_flag=True, help="Place by the ground alone where there is no scan."
)
@click.option("--evaluate", is_flag=True, help="Judge the trace by KITTI's labels.")
@click.option(
    "--labels", help="Labels of another layout, such as tracking/0000 for 2011_09_26/0005."
)
@click.option(
    "--encoding",
    type=click.Choice(get_args(Encoding)),
    default="raw",
    help="How pictures reach the detector.",
)
@click.option("--frames", type=PATH, help="A folder for the frames with what was found drawn in.")
@click.option("--video", type=PATH, help="The same as a video (.mp4).")
def perceive(
    drive: str | None, bag: Path | None, topics: tuple[str, ...], detections: str | None, out: Path | None,
    kitti: Path | None, cameras: str, detector: str, weights: Path | None, size: str | None, providers: str,
    threads: str, batch: str, min_score: float, origin: str | None, allow_missing_scans: bool, evaluate: bool,
    labels: str | None, encoding: Encoding, frames: Path | None, video: Path | None,
) -> None:  # fmt: skip
    """Run a detector over a drive or a bag; write a trace."""
    from genie_sim.perception import perceive as perception
    from genie_sim.perception.detector import make_detector

    _check(
        drive, bag, encoding, out is not None, evaluate or frames is not None or video is not None
    )
    network, world = arguments.width_height("--size", size), arguments.geodetic("--origin", origin)
    at_once = (
        arguments.count_or_auto("--threads", threads),
        arguments.count_or_auto("--batch", batch),
    )
    cameras_, providers_ = cameras.split(","), providers.split(",")
    if drive is None:
        assert bag is not None
        make = (
            None
            if detections
            else partial(make_detector, detector, weights, network, min_score, providers_)
        )
        _write(out, _of_bag(bag, topics, detections, make, at_once, world, min_score))
        return
    root = perception.kitti_folder(kitti)
    lowest = min(min_score, perception.LOWEST_SCORE) if evaluate else min_score
    with Progress(unit="frames") as progress:
        everything = perception.perceive(
            root, drive, cameras_, detector, weights, lowest, network, world, progress, None,
            allow_missing_scans, providers_, min_score, *at_once, click.echo, encoding,
        )  # fmt: skip
    trace = everything.at_least(min_score)
    _write(out, trace)
    if evaluate:
        from genie_sim.perception import evaluation, truth

        labelled = truth.read_truth(root, labels or drive, everything)
        click.echo(evaluation.table(evaluation.evaluate(everything, labelled, min_score)), nl=False)
    if frames is not None or video is not None:
        _draw(trace, perception.images(root, drive, cameras_), frames, video)


def _check(
    drive: str | None, bag: Path | None, encoding: Encoding, writes: bool, shows: bool
) -> None:
    if (drive is None) == (bag is None):
        raise UserError("perceive: give either --drive or --bag")
    if not (writes or shows):
        raise UserError("perceive: say what you want: --out, --evaluate, --frames or --video")
    if bag is not None and encoding != "raw":
        raise UserError(
            "perceive: --encoding is for drives: a bag's pictures are looked at as they were recorded"
        )
    if bag is not None and shows:
        raise UserError(
            "perceive: a bag has neither KITTI's labels nor its pictures: give --out alone"
        )


def _of_bag(
    bag: Path,
    topics: Sequence[str],
    detections: str | None,
    make: "Callable[[int], ImageDetector] | None",
    at_once: tuple[int | None, int | None],
    world: "Geodetic | None",
    min_score: float,
) -> "Trace":
    """The trace of a bag, by a detector that gets so many threads, or by the bag's own detections."""
    from genie_sim.ros.bags import perceive_bag

    threads, batch = at_once
    if threads is None or batch != 1:
        raise UserError(
            "perceive: a bag's pictures go one at a time: give --threads a number, and no --batch"
        )
    with Progress(unit="frames") as progress:
        detector = None if make is None else make(threads)
        return perceive_bag(bag, detector, topics, detections, world, min_score, progress).at_least(
            min_score
        )


def _write(out: Path | None, trace: "Trace") -> None:
    from genie_sim.perception.trace import write_trace

    if out is not None:
        write_trace(out, trace)
        found = sum(
            len(frame.detections) for sequence in trace.frames.values() for frame in sequence
        )
        count = sum(map(len, trace.frames.values()))
        click.echo(f"{out}: {count} frames, {found} detections, content {trace.digest[:12]}")


def _draw(
    trace: "Trace", images: Mapping[tuple[str, int], Path], frames: Path | None, video: Path | None
) -> None:
    from genie_sim.perception import pictures

    with Progress(unit="frames") as progress:
        if frames is not None:
            pictures.write_frames(frames, trace, images, progress)
        if video is not None:
            pictures.write_video(video, trace, images, progress)
    click.echo("\n".join(f"Pictures: {place}" for place in (frames, video) if place is not None))


@click.command()
@click.option(
    "--drive", required=True, help="The labelled drive, such as 2011_09_26/0005 or tracking/0000."
)
@click.option("--trace", required=True, help="The trace of that drive: a name or a file.")
@click.option("--kitti", type=PATH, help="KITTI's root folder; default: $GENIE_SIM_KITTI.")
@click.option(
    "--out",
    type=PATH,
    help="The file; default: NAME.truth.parquet beside the trace, where runs find it.",
)
def truth(drive: str, trace: str, kitti: Path | None, out: Path | None) -> None:
    """Compute what really is there on a trace's drive.

    It comes from KITTI's labels of the drive, and lets runs on the trace tell how right their answers are.
    """
    from genie_sim import files
    from genie_sim.perception import perceive, truth_table
    from genie_sim.perception.trace import read_trace

    path = files.find(files.TRACE, trace)
    table = truth_table.make_truth(perceive.kitti_folder(kitti), drive, read_trace(path))
    out = truth_table.path_beside(path) if out is None else out
    truth_table.write_truth(out, table)
    objects = {row.object: row.moving for row in table.rows}
    seen = sum(row.visible for row in table.rows)
    click.echo(
        f"{out}: {len(objects)} objects, {sum(objects.values())} of them moving, visible {seen:,} times, "
        f"content {table.digest[:12]}"
    )
