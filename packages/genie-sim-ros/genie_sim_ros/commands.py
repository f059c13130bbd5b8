"""The commands for real ROS: ``ros attach``, ``ros detach``, and ``import bag``. What is heavy is
imported late.
"""

from pathlib import Path
from typing import Any

import click

from genie_sim.base.errors import UserError
from genie_sim.base.plugins import allow_own_code
from genie_sim.cli import arguments
from genie_sim.cli.arguments import PATH, accept_option, detector_options, set_option
from genie_sim.cli.terminal import Commands, ProgressBar, tell


@click.group(cls=Commands)
def ros() -> None:
    """Put a Genie in front of a running ROS node, or take it away."""


@ros.command()
@click.argument("node", help="A running ROS node, such as /vision_darknet_detect.")
@click.option("--role", default="car", help="car or edge.")
@click.option("--name", help="What other Genies call this one; default: the node's name.")
@click.option(
    "--request",
    multiple=True,
    help="Input topic that goes through the Genie; default: the one with images.",
)
@click.option("--leave", multiple=True, help="A topic to leave alone. Repeatable.")
@set_option
@click.option("--pose-topic", help="Where the camera is, as geometry_msgs/PoseStamped.")
@click.option(
    "--fov", default="0 deg", help="The camera's horizontal field of view, such as '81 deg'."
)
@click.option("--listen", metavar="HOST:PORT", help="Other Genies connect here.")
@click.option("--car", multiple=True, help="The name of a car that may connect. Repeatable.")
@click.option("--edge", multiple=True, help="The name of an edge that may connect. Repeatable.")
@click.option(
    "--connect", multiple=True, metavar="NAME@HOST:PORT", help="Connect to this edge. Repeatable."
)
@click.option("--keys", type=PATH, help="A folder with ca.pem, NAME.pem and NAME.key.")
@click.option("--record", type=PATH, help="Write every look-up here, as lines of JSON.")
@click.option("--pid", type=int, help="Process of the node, for ROS 2; without it, ROS 1.")
def attach(
    node: str,
    *,
    role: str,
    name: str | None,
    request: tuple[str, ...],
    leave: tuple[str, ...],
    set_: tuple[str, ...],
    pose_topic: str | None,
    fov: str,
    listen: str | None,
    car: tuple[str, ...],
    edge: tuple[str, ...],
    connect: tuple[str, ...],
    keys: Path | None,
    record: Path | None,
    pid: int | None,
) -> None:
    """Put a Genie in front of a running ROS node. It stays until Ctrl-C or 'detach'.

    \b
    genie-sim ros attach /detector --pid 1234 --set genie.method=recommended
    """
    from genie_sim.base import units
    from genie_sim.scenario.overrides import apply_overrides
    from genie_sim.sim.settings import MethodSettings
    from genie_sim_ros.attach import attach as attach_genie

    allow_own_code()
    for assignment in set_:
        if not assignment.startswith("genie."):
            raise UserError(f"--set {assignment}: write --set genie.{assignment}")
    settings, _ = apply_overrides(MethodSettings, {}, set_)
    try:
        fov_rad = units.ANGLE.read(fov)
    except ValueError as error:
        raise UserError(f"--fov: {error}") from error
    attach_genie(
        node,
        role=role,
        name=name,
        settings=settings.get("genie", {}),
        requests=request,
        leave=leave,
        pose_topic=pose_topic,
        horizontal_fov_rad=fov_rad,
        listen=listen,
        cars=car,
        edges=edge,
        connect=connect,
        keys=keys,
        record=record,
        pid=pid,
        say=click.echo,
    )


@ros.command()
@click.argument("node", help="The node in front of which a Genie stands.")
@click.option("--network", help="localhost:11311, or domain-0 in ROS 2.")
def detach(node: str, network: str | None) -> None:
    """Take a node's Genie away; the node runs again as it was."""
    from genie_sim_ros.attach import detach as detach_genie

    detach_genie(node, network)
    click.echo(f"{node}: back as it was")


@click.command("bag")
@click.argument("file", type=PATH, help="A ROS 1 bag, a ROS 2 bag's folder, an MCAP file.")
@click.option("--out", type=PATH, required=True, help="The trace, such as street.parquet.")
@click.option(
    "--topic", "topics", multiple=True, metavar="[NAME=]TOPIC", help="These images, or all."
)
@click.option("--detections", metavar="TOPIC", help="The bag's own, not a detector's.")
@click.option("--imu", metavar="TOPIC", help="Of several IMUs this one.")
@click.option("--fix", metavar="TOPIC", help="Of several receivers' positions these.")
@click.option("--lidar", metavar="TOPIC", help="Of several lidars this one.")
@click.option(
    "--laser-height",
    default="1.73 m",
    show_default=True,
    help="How high it is above the road, to half a metre.",
)
@detector_options
@click.option(
    "--min-score",
    type=click.FloatRange(0.0, 1.0),
    default=0.3,
    help="Keep detections from this score on.",
)
@click.option(
    "--origin", metavar="LAT,LON,ALT", help="The world's origin; default: the bag's first fix."
)
@accept_option
def import_bag(
    *,
    file: Path,
    out: Path,
    topics: tuple[str, ...],
    detections: str | None,
    imu: str | None,
    fix: str | None,
    lidar: str | None,
    laser_height: str,
    min_score: float,
    origin: str | None,
    accept: bool,
    **network: Any,
) -> None:
    """Turn a bag into a trace: a detector looks at its pictures, or it has detections of its own.

    \b
    genie-sim import bag street.bag --out street.parquet
    genie-sim import bag street.mcap --detections /objects --out street.parquet
    """
    from genie_sim.base.import_report import ImportReport
    from genie_sim.base.units import length_m
    from genie_sim.data.intake import write_told
    from genie_sim.data.trace import check_replaceable
    from genie_sim_ros.bags import BagTopics, perceive_bag

    allow_own_code()
    check_replaceable(out)  # before the detector runs
    place = arguments.geodetic("--origin", origin)
    laser_height_m = arguments.quantity("--laser-height", laser_height, length_m)
    settings = arguments.detector_settings(**network, min_score=min_score)
    report = ImportReport(file, accept)
    with ProgressBar(unit="frames") as progress:
        trace = perceive_bag(
            file,
            detector=None if detections else settings.opened(),
            cameras=topics,
            detections=detections,
            origin=place,
            min_score=min_score,
            progress=progress,
            sensors=BagTopics(imu, fix, lidar),
            laser_height_m=laser_height_m,
            classes=settings.classes,
            report=report,
        )
    click.echo(write_told(out, trace))
    tell(report)
