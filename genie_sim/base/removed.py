"""Old names of commands, options and settings, each with what to write instead.

An entry is one sentence that says what to write now, with a capital and a full stop. It is shown in
place of the choices where somebody still writes the old name. The tables are valid until 0.2.0,
which drops them.
"""

import re
from fnmatch import fnmatchcase

NAMES: dict[str, str] = {
    "command article": (
        "Write 'genie-sim table FOLDER --format latex' and 'genie-sim figures FOLDER --format pdf' "
        "for an article of your own."
    ),
    "command keys": "Make keys with the openssl commands of docs/how-to/keys.md.",
    "command attach": "Write 'genie-sim ros attach NODE'.",
    "command detach": "Write 'genie-sim ros detach NODE'.",
    "command copy": "Write 'genie-sim show NAME --copy-to FILE'.",
    "command fetch": "Write 'genie-sim import fetch {model|drive} NAME'.",
    "command links": "Write 'genie-sim import link FILE --out FILE'.",
    "command schema": "Write 'genie-sim show --schema {scenario|device}'.",
    "command truth": "Write 'genie-sim import truth --drive DRIVE --trace TRACE'.",
    "scenario fleet_10000": (
        "Run fleet_1000 with --set fleet.cars=10000 --set perception.duration='60 s' "
        "--set perception.town.blocks=[70,70] --set perception.town.destinations=120 "
        "--set record=[resources]."
    ),
    "metric bytes_down_rate": "Multiply bytes_down_per_frame by the frames per second.",
    "metric energy_active_per_frame": (
        "Subtract the idle power times the time of a run, both in the tables hosts and power."
    ),
    **{
        f"metric {name}": f"Compute it from the table {table}."
        for table, names in {
            "frames": (
                "look_age_p50",
                "look_age_p99",
                "under_deadline_share_of_answered",
            ),
            "lookups": ("object_reuse_pooled", "object_reuse_sighting", "object_reuse_boost"),
            "answers": (
                "first_proxy_precision",
                "first_proxy_recall",
                "result_proxy_precision",
                "result_proxy_recall",
            ),
        }.items()
        for name in names
    },
}
"""What a name stands for and the name, as the error line says them: ``command article``,
``record held_objects``, ``metric car_load``, ``scenario fleet_10000``.
"""

MODULES: dict[str, str] = {
    **{name: f"genie_sim.core.{name}" for name in ("messages", "header", "monitor", "classes")},
    **{name: f"genie_sim.base.{name}" for name in ("errors", "units", "settings", "seeds")},
    **{name: f"genie_sim.runs.{name}" for name in ("build", "fleet")},
    "runner": "genie_sim.runs.folder",
    "perception": "genie_sim.data",
    "recording": "genie_sim.record",
    "town": "genie_sim.worlds.town",
    "traffic": "genie_sim.worlds.traffic",
    "base.custom_sources": "genie_sim.base.own_sources",
}
"""Modules of ``genie_sim`` that code of the user's own may import by an old name."""

_PICTURES = "Run the trace and see its frames in the page of 'genie-sim report --pictures DIR'."
_COMPLETION = "Put 'eval \"$(_GENIE_SIM_COMPLETE=bash_source genie-sim)\"' in your ~/.bashrc."
OPTIONS: dict[str, str] = {
    "import tables --size": "Write --frame-size SIZE.",
    "perceive --frames": _PICTURES,
    "perceive --video": _PICTURES,
    "perceive --batch": "Leave it out; pictures go through the network one at a time.",
    "profile --empirical": "Leave it out; the profile has the fitted law and how well it fits.",
    "reproduce --explore": "Write 'python studies/contradictions.py' in a clone of the repository.",
    "reproduce --drives": "Write 'python studies/drives.py' in a clone of the repository.",
    "compare --labels": "Write --label A --label B, one for each result.",
    "run --workers": "Write --jobs N.",
    "search --shard": "Write --scheduler ADDRESS for many machines.",
    **dict.fromkeys(
        ("search --backend", "sweep --backend"), "Write --scheduler ADDRESS for Dask, or neither."
    ),
    "search --storage": "Leave it out; nothing is stored but runs, and points.csv has every point.",
    "ros attach --revoked": (
        "Attach the others again without that name in --car, --edge and --connect."
    ),
    "ros attach --key": "Write --keys FOLDER, with the files of docs/how-to/keys.md.",
    "--install-completion": _COMPLETION,
    "--show-completion": _COMPLETION,
}
"""The command and the option, ``run --workers``; those of ``genie-sim`` itself alone, ``--colour``.
"""

SETTINGS: dict[str, str] = {
    "early": "Leave it out; every point of a search runs all tuning seeds.",
    "sampler": "Leave it out; Optuna's TPE draws the points of a search.",
    "models.*.quantiles": "Leave it out; times follow the law of 'median' and 'spreads'.",
}
"""The path of a setting in its file, without the indexes of lists and with ``*`` for a name of the
user's own: ``genie.looks.edge``, ``cars.link.rate``, ``axes.*.field``. Settings of one method
(``methods[0].genie.looks.edge``) are found by the same path.
"""


def instead_of_name(what: str, name: object) -> str | None:
    """What to write instead of a name that no longer exists, ``None`` if it never did.

    Parameters
    ----------
    what : str
        What the name stands for, such as ``command`` or ``record``.
    name : object
        The name as it was written.
    """
    return NAMES.get(f"{what} {name}")


def instead_of_module(name: str | None) -> str | None:
    """What to import instead of a module that has moved, ``None`` if there never was one.

    Parameters
    ----------
    name : str, optional
        The module that is not there: ``genie_sim.messages``.
    """
    package, _, path = (name or "").partition(".")
    for old, new in MODULES.items() if package == "genie_sim" else ():
        if path == old or path.startswith(f"{old}."):
            return f"{name} is {new}{path.removeprefix(old)} now."
    return None


def instead_of_option(command: str, option: str) -> str | None:
    """What to write instead of an option that no longer exists, ``None`` if it never did.

    Parameters
    ----------
    command : str
        The command as it was written: ``genie-sim run``, or ``genie-sim`` alone.
    option : str
        The option with its dashes.
    """
    return OPTIONS.get(f"{command.partition(' ')[2]} {option}".strip())


def instead_of_setting(path: str) -> str | None:
    """What to write instead of a setting that no longer exists, ``None`` if it never did.

    Parameters
    ----------
    path : str
        The path in its file, such as ``cars[1].link.rate``.
    """
    path = re.sub(r"\[\d+\]", "", path)
    for setting, sentence in SETTINGS.items():
        if fnmatchcase(path, setting) or fnmatchcase(path, f"methods.{setting}"):
            return sentence
    return None
