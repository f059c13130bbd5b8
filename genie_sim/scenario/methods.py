"""The ``methods:`` of a scenario: names, or mappings with settings of their own."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any

from genie_sim.base.errors import short_repr
from genie_sim.base.plugins import Choice
from genie_sim.base.settings import Beside, Name, PlugIn, SettingError, keys_of
from genie_sim.base.text import MAX_LABEL, is_label
from genie_sim.methods import METHODS, MUST_HAVE
from genie_sim.sim.settings import MethodSettings

METHOD = PlugIn(
    "method", METHODS, MUST_HAVE, key="method", beside=("name", "title", *keys_of(MethodSettings))
)


@dataclass(frozen=True, kw_only=True)
class MethodEntry:
    """One method of a scenario. In YAML, a name or a mapping in which the method's own settings and
    those of the scenario stand side by side.
    """

    name: Name
    """What tables call it; by default the name of the method."""

    method: Annotated[Choice, METHOD]
    """The method, or a class of your own."""

    title: str | None = None
    """What figures and pages call it; by default what the method calls itself."""

    settings: Annotated[Mapping[str, Any], Beside(MethodSettings)] = field(default_factory=dict)
    """Settings of the scenario that this entry has otherwise, as they are written."""

    def __post_init__(self) -> None:
        if self.title is not None and not (is_label(self.title) and self.title.strip()):
            text = f"one line of at most {MAX_LABEL} characters, not {short_repr(self.title)}"
            raise SettingError("title", f"must be {text}")

    @classmethod
    def expand(cls, value: object) -> object:
        """Takes the settings of the method and of the scenario out of ``genie`` or ``{name: wide,
        method: genie, genie: {view_range: 80 m}}``.
        """
        arguments = dict(value) if isinstance(value, Mapping) else {"method": value}
        method = arguments.setdefault("method", arguments.get("name"))
        try:
            METHOD.name(method)
        except SettingError as error:
            named = isinstance(value, Mapping) and "method" in value
            raise error.below("method" if named else "") from error
        # MyMethod of m:MyMethod
        name = arguments.pop("name", str(method).rpartition(":")[2])
        if not isinstance(name, str):
            raise SettingError("name", f"must be text, not {short_repr(name)}")
        entry = {"name": name, "title": arguments.pop("title", None)}
        settings = {key: arguments.pop(key) for key in keys_of(MethodSettings) if key in arguments}
        return {**entry, "method": METHOD.read(arguments), "settings": settings}

    def shorten(self) -> object:
        """The settings of the method and of the scenario side by side."""
        choice = METHOD.plain(self.method)
        arguments = choice if isinstance(choice, dict) else {"method": choice}
        if arguments == {"method": self.name} and self.title is None and not self.settings:
            return self.name
        title = {} if self.title is None else {"title": self.title}
        return {"name": self.name, **arguments, **title, **self.settings}


def method_class(entry: MethodEntry) -> Any:
    """The class of an entry's method. Raises ``UserError``."""
    return METHOD.resolve(entry.method.name)
