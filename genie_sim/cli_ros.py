"""The commands for real ROS: ``attach``, ``detach``, ``keys``. What is heavy is imported late."""

from pathlib import Path
from typing import Annotated, Any

import typer

from genie_sim.arguments import path_argument, path_option
from genie_sim.errors import UserError
from genie_sim.terminal import Commands


def attach(
    node: Annotated[str, typer.Argument(help="A running ROS node, such as /vision_darknet_detect.")],
    role: Annotated[str, typer.Option(help="car or edge.")] = "car",
    name: Annotated[str | None, typer.Option(help="What other Genies call this one; default: the node's name.")] = None,
    request: Annotated[
        list[str] | None, typer.Option(help="Input topic that goes through the Genie; default: the one with images.")
    ] = None,
    leave: Annotated[list[str] | None, typer.Option(help="A topic to leave alone. Repeatable.")] = None,
    set_: Annotated[
        list[str] | None, typer.Option("--set", metavar="FIELD=VALUE", help="A field of 'genie:', as in scenarios.")
    ] = None,
    pose_topic: Annotated[str | None, typer.Option(help="Where the camera is, as geometry_msgs/PoseStamped.")] = None,
    fov: Annotated[str, typer.Option(help="The camera's horizontal field of view, such as '81 deg'.")] = "0 deg",
    listen: Annotated[str | None, typer.Option(metavar="HOST:PORT", help="Other Genies connect here.")] = None,
    connect: Annotated[
        list[str] | None, typer.Option(metavar="NAME@HOST:PORT", help="Connect to the Genie of this name. Repeatable.")
    ] = None,
    key: Annotated[Path | None, path_option(help="This Genie's key file, made by 'genie-sim keys peer'.")] = None,
    record: Annotated[Path | None, path_option(help="Write every look-up here, as lines of JSON.")] = None,
    pid: Annotated[int | None, typer.Option(help="Process of the node, for ROS 2; without it, ROS 1.")] = None,
) -> None:
    """Put a Genie in front of a running ROS node. It stays until Ctrl-C or 'detach'."""
    from genie_sim import units
    from genie_sim.ros import attach as real
    from genie_sim.scenario.overrides import apply_overrides

    settings: dict[str, Any] = {}
    apply_overrides(settings, set_ or ())
    try:
        fov_rad = units.angle_rad(fov)
    except ValueError as error:
        raise UserError(f"--fov: {error}") from error
    real.attach(
        node, role=role, name=name, settings=settings, requests=request or (), leave=leave or (), pose_topic=pose_topic,
        horizontal_fov_rad=fov_rad, listen=listen, connect=connect or (), key_file=None if key is None else str(key),
        record=None if record is None else str(record), pid=pid, say=typer.echo,
    )  # fmt: skip


def detach(
    node: Annotated[str, typer.Argument(help="The node in front of which a Genie stands.")],
    network: Annotated[str | None, typer.Option(help="localhost:11311, or domain-0 in ROS 2.")] = None,
) -> None:
    """Take a node's Genie away; the node runs again as it was."""
    from genie_sim.ros import attach as real

    real.detach(node, network)
    typer.echo(f"{node}: back as it was")


keys = typer.Typer(cls=Commands, help="Make the keys of Genies that are linked over TLS.", rich_markup_mode=None)


@keys.command("ca")
def keys_ca(
    folder: Annotated[Path, path_argument(help="A folder for the authority and its peers.")] = Path("keys"),
    days: Annotated[int, typer.Option(help="How long it is valid.")] = 3650,
) -> None:
    """Make a certificate authority: the one that all linked Genies trust."""
    from genie_sim.ros.certificates import make_authority

    typer.echo(make_authority(folder, days))


@keys.command("peer")
def keys_peer(
    name: Annotated[str, typer.Argument(help="The Genie's name, as in 'genie-sim attach --name'.")],
    role: Annotated[str, typer.Option(help="car or edge.")],
    ca: Annotated[Path, path_option(help="The folder of 'genie-sim keys ca'.")] = Path("keys"),
    days: Annotated[int, typer.Option(help="How long it is valid.")] = 365,
) -> None:
    """Make one Genie's key file, to be copied to its machine."""
    from genie_sim.ros.certificates import make_peer

    typer.echo(make_peer(ca, name, role, days))
