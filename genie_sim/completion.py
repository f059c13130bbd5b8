"""What the shell may complete, and how it comes to do so."""

from pathlib import Path

import click

from genie_sim.errors import UserError

NAME = "genie-sim"
# Where the script goes, and what reads it when a shell starts; both in the user's home.
STARTS = {
    "fish": (f".config/fish/completions/{NAME}.fish", "", ""),
    "bash": (f".{NAME}-complete.bash", ".bashrc", ". {}"),
    "zsh": (f".{NAME}-complete.zsh", ".zshrc", "autoload -Uz compinit; compinit; . {}"),
    "powershell": (f".{NAME}-complete.ps1", "", ". {}"),
}


def scenarios(_: object, __: object, incomplete: str) -> list[str]:
    """Scenarios that a shell may complete; paths it completes itself."""
    from genie_sim import files

    return [name for name in files.available(files.SCENARIO) if name.startswith(incomplete)]


def kinds(_: object, __: object, incomplete: str) -> list[str]:
    """What ``genie-sim list`` can list."""
    from genie_sim.catalogue import KINDS

    return [kind for kind in KINDS if kind.startswith(incomplete)]


def setting_paths(_: object, __: object, incomplete: str) -> list[str]:
    """``PATH=`` of every field that ``--set`` takes; of lists, the first entry's."""
    from genie_sim.core.rules import GenieRules, ObjectMapRules
    from genie_sim.scenario.fields import Model
    from genie_sim.scenario.parts import Car, Edge, Route
    from genie_sim.scenario.plain import model_of
    from genie_sim.scenario.scenario import Scenario

    places: dict[str, type[Model]] = {
        "": Scenario,
        "cars[0].": Car,
        "cars[0].route.": Route,
        "edges[0].": Edge,
        "genie.": model_of(GenieRules),
        "genie.object_map.": model_of(ObjectMapRules),
    }
    paths = [f"{place}{name}=" for place, model in places.items() for name in model.yaml_names()]
    return [path for path in paths if path.startswith(incomplete)]


def methods(_: object, __: object, incomplete: str) -> list[str]:
    """Names of methods, after those that are there already."""
    from genie_sim.methods import METHODS

    before, comma, last = incomplete.rpartition(",")
    return [f"{before}{comma}{name}" for name in METHODS if name.startswith(last)]


def _show(context: click.Context, _: object, wanted: bool) -> None:
    if wanted and not context.resilient_parsing:
        click.echo(_script(context, _shell()))
        context.exit()


def _install(context: click.Context, _: object, wanted: bool) -> None:
    if not wanted or context.resilient_parsing:
        return
    shell, home = _shell(), Path.home()
    script = _script(context, shell)
    name, startup, line = STARTS[shell.replace("pwsh", "powershell")]
    path = home / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(script + "\n", encoding="utf-8")
    if line:
        begins = home / startup if startup else _profile(shell)
        begins.parent.mkdir(parents=True, exist_ok=True)
        before = begins.read_text(encoding="utf-8") if begins.is_file() else ""
        if (added := line.format(f"'{path}'")) not in before:
            begins.write_text(f"{before.rstrip()}\n{added}\n".lstrip(), encoding="utf-8")
    click.echo(
        f"{shell} completion installed in {path}\nCompletion will take effect once you restart the terminal"
    )
    context.exit()


def _shell() -> str:
    """The shell that this process was started from. Raises ``UserError``."""
    import shellingham

    try:
        return str(shellingham.detect_shell()[0])
    except shellingham.ShellDetectionFailure:
        raise UserError("there is no telling which shell this is") from None


def _script(context: click.Context, shell: str) -> str:
    """What a shell must read to complete. Raises ``UserError`` for one that nobody has written it for."""
    from click.shell_completion import get_completion_class

    made = get_completion_class(shell.replace("pwsh", "powershell"))
    if made is None:
        raise UserError(
            f"no completion for {shell}; there is one for bash, zsh, fish and PowerShell"
        )
    return made(context.command, {}, NAME, f"_{NAME}_COMPLETE".replace("-", "_").upper()).source()


def _profile(shell: str) -> Path:
    """What PowerShell reads when it starts."""
    import subprocess

    told = subprocess.run(
        [shell, "-NoProfile", "-Command", "$PROFILE"], stdout=subprocess.PIPE, text=True, check=True
    )
    return Path(told.stdout.strip())


install_option = click.option(
    "--install-completion", is_flag=True, expose_value=False, callback=_install,
    help="Install completion for the current shell.",
)  # fmt: skip
show_option = click.option(
    "--show-completion", is_flag=True, expose_value=False, callback=_show,
    help="Show completion for the current shell, to copy it or customize the installation.",
)  # fmt: skip
