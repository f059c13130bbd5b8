"""The commands for real ROS: ``attach``, ``detach``, ``keys``. What is heavy is imported late."""

from pathlib import Path
from typing import Any

import click

from genie_sim.arguments import PATH
from genie_sim.errors import UserError
from genie_sim.terminal import Commands


@click.command()
@click.argument("node", help="A running ROS node, such as /vision_darknet_detect.")
@click.option("--role", default="car", help="car or edge.")
@click.option("--name", help="What other Genies call this one; default: the node's name.")
@click.option(
    "--request",
    multiple=True,
    help="Input topic that goes through the Genie; default: the one with images.",
)
@click.option("--leave", multiple=True, help="A topic to leave alone. Repeatable.")
@click.option(
    "--set",
    "set_",
    multiple=True,
    metavar="FIELD=VALUE",
    help="A field of 'genie:', as in scenarios.",
)
@click.option("--pose-topic", help="Where the camera is, as geometry_msgs/PoseStamped.")
@click.option(
    "--fov", default="0 deg", help="The camera's horizontal field of view, such as '81 deg'."
)
@click.option("--listen", metavar="HOST:PORT", help="Other Genies connect here.")
@click.option(
    "--connect", multiple=True, metavar="NAME@HOST:PORT", help="Connect to this Genie. Repeatable."
)
@click.option("--key", type=PATH, help="This Genie's key file, made by 'genie-sim keys peer'.")
@click.option(
    "--revoked", type=PATH, help="A list of revoked certificates, kept by 'genie-sim keys revoke'."
)
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
    connect: tuple[str, ...],
    key: Path | None,
    revoked: Path | None,
    record: Path | None,
    pid: int | None,
) -> None:
    """Put a Genie in front of a running ROS node. It stays until Ctrl-C or 'detach'."""
    from genie_sim import units
    from genie_sim.ros.attach import attach as attach_genie
    from genie_sim.scenario.overrides import apply_overrides

    settings: dict[str, Any] = {}
    apply_overrides(settings, set_)
    try:
        fov_rad = units.angle_rad(fov)
    except ValueError as error:
        raise UserError(f"--fov: {error}") from error
    attach_genie(
        node,
        role=role,
        name=name,
        settings=settings,
        requests=request,
        leave=leave,
        pose_topic=pose_topic,
        horizontal_fov_rad=fov_rad,
        listen=listen,
        connect=connect,
        key_file=key,
        revoked_file=revoked,
        record=record,
        pid=pid,
        say=click.echo,
    )


@click.command()
@click.argument("node", help="The node in front of which a Genie stands.")
@click.option("--network", help="localhost:11311, or domain-0 in ROS 2.")
def detach(node: str, network: str | None) -> None:
    """Take a node's Genie away; the node runs again as it was."""
    from genie_sim.ros.attach import detach as detach_genie

    detach_genie(node, network)
    click.echo(f"{node}: back as it was")


@click.group(cls=Commands)
def keys() -> None:
    """Make the keys of Genies that are linked over TLS."""


@keys.command("ca")
@click.argument(
    "folder", type=PATH, default="keys", help="A folder for the authority and its peers."
)
@click.option("--days", default=3650, help="How long it is valid.")
def keys_ca(folder: Path, days: int) -> None:
    """Make a certificate authority: the one that all linked Genies trust."""
    from genie_sim.ros.certificates import make_authority

    click.echo(make_authority(folder, days))


@keys.command("peer")
@click.argument("name", help="The Genie's name, as in 'genie-sim attach --name'.")
@click.option("--role", required=True, help="car or edge.")
@click.option("--ca", type=PATH, default="keys", help="The folder of 'genie-sim keys ca'.")
@click.option("--days", default=365, help="How long it is valid.")
def keys_peer(name: str, role: str, ca: Path, days: int) -> None:
    """Make one Genie's key file, to be copied to its machine."""
    from genie_sim.ros.certificates import make_peer

    click.echo(make_peer(ca, name, role, days))


@keys.command("revoke")
@click.argument("key_file", type=PATH, help="The key file that counts no longer.")
@click.option("--ca", type=PATH, default="keys", help="The folder of 'genie-sim keys ca'.")
def keys_revoke(key_file: Path, ca: Path) -> None:
    """Add a certificate to the list of 'genie-sim attach --revoked'."""
    from genie_sim.ros.certificates import revoke

    click.echo(revoke(ca, key_file))
