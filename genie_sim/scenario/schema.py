"""JSON Schemas of scenarios and device profiles, so that an editor completes settings and marks
mistakes.
"""

from typing import Any

from genie_sim.base.settings import Schema, class_schema
from genie_sim.scenario.profiles import DeviceProfile
from genie_sim.scenario.scenario import Scenario

SCHEMAS: dict[str, type[Any]] = {"scenario": Scenario, "device": DeviceProfile}
DIALECT = "https://json-schema.org/draft/2020-12/schema"


def json_schema(what: str) -> Schema:
    """The JSON Schema of a ``scenario`` or a ``device`` file.

    It knows names, types and choices. Only ``genie-sim run`` checks whether settings fit together:
    a car's edge exists, a device knows the model.
    """
    classes: dict[str, Schema] = {}
    schema = class_schema(SCHEMAS[what], classes)
    if what == "scenario":
        del schema["required"]  # the file's name stands for that of the scenario
        schema["anyOf"] = [{"required": [who]} for who in ("cars", "fleet")]
    return {"$schema": DIALECT, "$defs": dict(sorted(classes.items())), **schema}
