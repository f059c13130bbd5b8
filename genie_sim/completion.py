"""Shell completion: candidates and installation."""

from collections.abc import Callable
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


def searches(_: object, __: object, incomplete: str) -> list[str]:
    """Searches and scenarios that a shell may complete."""
    from genie_sim import files

    names = {**files.available(files.SEARCH), **files.available(files.SCENARIO)}
    return [name for name in names if name.startswith(incomplete)]


def kinds(_: object, __: object, incomplete: str) -> list[str]:
    """What ``genie-sim list`` can list."""
    from genie_sim.catalogue import KINDS

    return [kind for kind in KINDS if kind.startswith(incomplete)]


def sweeps(_: object, __: object, incomplete: str) -> list[str]:
    """Sweeps by name; paths a shell completes itself."""
    from genie_sim import files

    return [name for name in files.available(files.SWEEP) if name.startswith(incomplete)]


def files_by_name(_: object, __: object, incomplete: str) -> list[str]:
    """What ``genie-sim show`` shows."""
    from genie_sim import files

    kinds = (files.SCENARIO, files.SWEEP, files.DEVICE, files.SEARCH, files.SPACE)
    names = sorted({name for kind in kinds for name in files.available(kind)})
    return [name for name in names if name.startswith(incomplete)]


def fixed(*words: str) -> Callable[[object, object, str], list[str]]:
    """Returns what completes one of these words, also behind a comma."""

    def complete(_: object, __: object, incomplete: str) -> list[str]:
        before, comma, last = incomplete.rpartition(",")
        return [f"{before}{comma}{word}" for word in words if word.startswith(last)]

    return complete


def setting_paths(_: object, __: object, incomplete: str) -> list[str]:
    """``PATH=`` of every field that ``--set`` takes, of lists the first entry's; behind the sign
    the names that the field may be given.
    """
    from genie_sim.scenario import setting_paths as settings
    from genie_sim.scenario.scenario import Scenario

    path, equals, value = incomplete.partition("=")
    if equals:
        names = [*_names_for(path), *settings.choices_of(Scenario, path)]
        return [f"{path}={name}" for name in names if name.startswith(value)]
    return [f"{name}=" for name in settings.setting_paths(Scenario) if name.startswith(path)]


def _names_for(path: str) -> list[str]:
    """The files and models that a setting may name."""
    from genie_sim import files

    match path.rpartition(".")[2]:
        case "device":
            return list(files.available(files.DEVICE))
        case "trace":
            return list(files.available(files.TRACE))
        case "model":
            from genie_sim.catalogue import KINDS

            return [name for name, _ in KINDS["models"]()]
    return []


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
        f"{shell} completion installed in {path}\n"
        "Completion will take effect once you restart the terminal"
    )
    context.exit()


def _shell() -> str:
    """The shell that this process was started from. Raises ``UserError``."""
    import shellingham

    try:
        return str(shellingham.detect_shell()[0])
    except shellingham.ShellDetectionFailure:
        raise UserError("cannot detect the shell") from None


def _script(context: click.Context, shell: str) -> str:
    """Returns what a shell reads to complete. Raises ``UserError`` for one without support."""
    from click.shell_completion import get_completion_class

    completion = get_completion_class(shell.replace("pwsh", "powershell"))
    if completion is None:
        raise UserError(f"completion supports bash, zsh, fish and PowerShell, not {shell}")
    return completion(
        context.command, {}, NAME, f"_{NAME}_COMPLETE".replace("-", "_").upper()
    ).source()


def _profile(shell: str) -> Path:
    """What PowerShell reads when it starts."""
    import subprocess

    shown = subprocess.run(
        [shell, "-NoProfile", "-Command", "$PROFILE"], stdout=subprocess.PIPE, text=True, check=True
    )
    return Path(shown.stdout.strip())


install_option = click.option(
    "--install-completion",
    is_flag=True,
    expose_value=False,
    callback=_install,
    help="Install completion for the current shell.",
)
show_option = click.option(
    "--show-completion",
    is_flag=True,
    expose_value=False,
    callback=_show,
    help="Show completion for the current shell, to copy it or customize the installation.",
)
