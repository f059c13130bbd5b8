"""JSON Schemas of scenarios and device profiles, so that an editor completes settings and marks mistakes."""

from typing import Any

from pydantic.json_schema import GenerateJsonSchema, JsonSchemaValue
from pydantic_core import SchemaSerializer, core_schema

from genie_sim.scenario.fields import Model
from genie_sim.scenario.profiles import DeviceProfile
from genie_sim.scenario.scenario import Scenario

SCHEMAS: dict[str, type[Model]] = {"scenario": Scenario, "device": DeviceProfile}


def json_schema(what: str) -> dict[str, Any]:
    """The JSON Schema of a ``scenario`` or a ``device`` file.

    It knows names, types and choices. Only ``genie-sim run`` checks whether settings fit together: a car's edge
    exists, a device knows the model.
    """
    schema = SCHEMAS[what].model_json_schema(by_alias=True, schema_generator=_AsInYaml)
    if what == "scenario":
        schema["required"].remove("name")  # the file's name stands for it
    return {"$schema": GenerateJsonSchema.schema_dialect, **schema}


class _AsInYaml(GenerateJsonSchema):
    """Writes defaults as YAML has them (``2 s``, not nanoseconds), and no titles that only repeat the names."""

    def default_schema(self, schema: core_schema.WithDefaultSchema) -> JsonSchemaValue:
        made = super().default_schema(schema)
        default = schema.get("default")
        if default is not None and not isinstance(default, bool | str):
            made["default"] = SchemaSerializer(schema["schema"]).to_python(
                default, mode="json", by_alias=True
            )
        return made

    def field_title_should_be_set(self, schema: Any) -> bool:
        return False
