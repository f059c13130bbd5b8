"""The ``methods:`` of a scenario: names, or mappings with settings of their own."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any

from genie_sim.base import plugins
from genie_sim.base.contracts import require
from genie_sim.base.marks import Matches, Name
from genie_sim.base.plugins import Choice
from genie_sim.base.setting_errors import SettingError
from genie_sim.base.settings import PlugIn, from_plain, keys_of
from genie_sim.base.text import MAX_LABEL
from genie_sim.sim.method import METHOD_PARTS, METHODS, Method
from genie_sim.sim.settings import MethodSettings

# neither control characters nor what turns the direction of writing round
STEERING = r"[\u0000-\u001f\u007f-\u009f\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff]"
LINE = rf"^(?![\s\S]*{STEERING})[\s\S]*\S\s*$"


@dataclass(frozen=True, kw_only=True)
class MethodNames:
    """What a method of a scenario is called."""

    name: Name
    """What tables call it; by default the name of the method."""

    title: Annotated[str, Matches(LINE, "must be one line of text", MAX_LABEL)] | None = None
    """What figures and pages call it; by default what the method calls itself."""


METHOD = PlugIn("method", METHODS, METHOD_PARTS, key="method", beside=(MethodNames, MethodSettings))


@dataclass(frozen=True, kw_only=True)
class MethodEntry(MethodNames):
    """One method of a scenario. In YAML, a name or a mapping in which the method's own settings and
    those of the scenario stand side by side.
    """

    method: Annotated[Choice, METHOD]
    """The method, or a class of your own."""

    # those of the scenario that this entry has otherwise, as they are written
    settings: Mapping[str, Any] = field(default_factory=dict, metadata={"setting": False})

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
        names = from_plain(
            MethodNames,
            {
                "name": arguments.pop("name", str(method).rpartition(":")[2]),
                "title": arguments.pop("title", None),
            },
        )
        settings = {key: arguments.pop(key) for key in keys_of(MethodSettings) if key in arguments}
        return cls(**vars(names), method=METHOD.read(arguments), settings=settings)

    def shorten(self) -> object:
        """The settings of the method and of the scenario side by side."""
        choice = METHOD.written(self.method)
        arguments = choice if isinstance(choice, dict) else {"method": choice}
        if arguments == {"method": self.name} and self.title is None and not self.settings:
            return self.name
        title = {} if self.title is None else {"title": self.title}
        return {"name": self.name, **arguments, **title, **self.settings}

    def new(self) -> Method:
        """The method itself, for one world: it may keep state. Raises ``UserError``."""
        method: Method = METHOD.make(self.method)
        owner = plugins.own_label("method", self.method.name)
        if owner is not None:
            require(isinstance(method.title, str), f"{owner}: title", method.title, "text")
        return method

    def facts(self, method: Method) -> dict[str, Any]:
        """Its name, what figures call it, and whether others are compared with it."""
        title = self.title
        if title is None:
            own_names = (self.method.name, self.method.name.rpartition(":")[2])
            title = method.title if self.name in own_names else self.name
        return {"name": self.name, "title": title, "baseline": bool(method.baseline)}


def features_of(methods: Mapping[str, Method]) -> dict[str, str | None]:
    """What each method compares frames by; ``None`` for one that does not."""
    return {name: getattr(method, "feature", None) for name, method in methods.items()}
