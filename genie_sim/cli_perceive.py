"""The command ``genie-sim perceive``. Everything heavy is imported after the arguments are parsed."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from genie_sim import arguments
from genie_sim.arguments import path_option
from genie_sim.errors import UserError
from genie_sim.terminal import Progress


def perceive(
    drive: Annotated[str | None, typer.Option(help="A drive, such as 2011_09_26/0005 or tracking/0005.")] = None,
    bag: Annotated[Path | None, path_option(help="Instead: a ROS 1 bag, a ROS 2 bag's folder, an MCAP file.")] = None,
    topic: Annotated[list[str] | None, typer.Option(metavar="[NAME=]TOPIC", help="Images of the bag, or all.")] = None,
    detections: Annotated[str | None, typer.Option(metavar="TOPIC", help="The bag's own, not a detector's.")] = None,
    out: Annotated[Path | None, path_option(help="The trace file to write.")] = None,
    kitti: Annotated[Path | None, path_option(help="KITTI's root folder; default: $GENIE_SIM_KITTI.")] = None,
    cameras: Annotated[str, typer.Option(help="Colour cameras, separated by commas.")] = "02,03",
    detector: Annotated[
        str, typer.Option(help="A detector ('list detectors'), your own module:Class; for sequences pointrcnn or rrc.")
    ] = "yolox_nano",
    weights: Annotated[
        Path | None, path_option(help="The ONNX file, or its folder; default: $GENIE_SIM_WEIGHTS.")
    ] = None,
    size: Annotated[str | None, typer.Option(metavar="WxH", help="The network's input, such as 832x256.")] = None,
    providers: Annotated[
        str, typer.Option(help="ONNX Runtime's execution providers, best first, such as CUDAExecutionProvider.")
    ] = "CPUExecutionProvider",
    threads: Annotated[str, typer.Option(metavar="N|auto", help="The network's; auto: what is fastest here.")] = "1",
    batch: Annotated[str, typer.Option(metavar="N|auto", help="Pictures at a time; auto: what is fastest here.")] = "1",
    min_score: Annotated[float, typer.Option(min=0.0, max=1.0, help="Keep detections from this score on.")] = 0.3,
    origin: Annotated[
        str | None, typer.Option(metavar="LAT,LON,ALT", help="The world's origin; default: the drive's first fix.")
    ] = None,
    allow_missing_scans: Annotated[
        bool, typer.Option("--allow-missing-scans", help="Place by the ground alone where there is no scan.")
    ] = False,
    evaluate: Annotated[bool, typer.Option("--evaluate", help="Judge the trace by KITTI's labels.")] = False,
    labels: Annotated[
        str | None, typer.Option(help="Labels of another layout, such as tracking/0000 for 2011_09_26/0005.")
    ] = None,
    frames: Annotated[Path | None, path_option(help="A folder for the frames with what was found drawn in.")] = None,
    video: Annotated[Path | None, path_option(help="The same as a video (.mp4).")] = None,
) -> None:
    """Run a detector over a drive or a bag; write a trace."""
    from genie_sim.perception import perceive as perception
    from genie_sim.perception.detector import make_detector
    from genie_sim.perception.trace import write_trace

    if (drive is None) == (bag is None):
        raise UserError("perceive: give either --drive or --bag")
    if not (out or evaluate or frames or video):
        raise UserError("perceive: say what you want: --out, --evaluate, --frames or --video")
    if bag is not None and (evaluate or frames or video):
        raise UserError("perceive: a bag has neither KITTI's labels nor its pictures: give --out alone")
    network, world = arguments.width_height("--size", size), arguments.geodetic("--origin", origin)
    threads_, batch_ = arguments.count_or_auto("--threads", threads), arguments.count_or_auto("--batch", batch)
    if bag is not None and (threads_ is None or batch_ != 1):
        raise UserError("perceive: a bag's pictures go one at a time: give --threads a number, and no --batch")
    root = perception.kitti_folder(kitti) if bag is None else Path()
    lowest = min(min_score, perception.LOWEST_SCORE) if evaluate else min_score
    with Progress(unit="frames") as progress:
        if drive is not None:
            everything = perception.perceive(
                root, drive, cameras.split(","), detector, weights, lowest, network, world, progress, None,
                allow_missing_scans, providers.split(","), min_score, threads_, batch_, typer.echo,
            )  # fmt: skip
        else:
            from genie_sim.ros.bags import perceive_bag

            network_is = (detector, weights, network, min_score, providers.split(","), threads_ or 1)
            made = None if detections else make_detector(*network_is)
            everything = perceive_bag(bag, made, topic or (), detections, world, min_score, progress)
    trace = everything.at_least(min_score)
    if out is not None:
        write_trace(out, trace)
        found = sum(len(frame.detections) for sequence in trace.frames.values() for frame in sequence)
        count = sum(map(len, trace.frames.values()))
        typer.echo(f"{out}: {count} frames, {found} detections, content {trace.digest[:12]}")
    if evaluate:
        from genie_sim.perception import evaluation, truth

        judged = evaluation.evaluate(everything, truth.read_truth(root, labels or drive, everything), min_score)
        typer.echo(evaluation.table(judged), nl=False)
    if frames is not None or video is not None:
        from genie_sim.perception import pictures

        images = perception.images(root, drive, cameras.split(","))
        with Progress(unit="frames") as progress:
            if frames is not None:
                pictures.write_frames(frames, trace, images, progress)
            if video is not None:
                pictures.write_video(video, trace, images, progress)
        typer.echo("\n".join(f"Pictures: {place}" for place in (frames, video) if place is not None))
