"""The JSON Schema of configuration files, for editors."""

from typing import Any

from mjplug.config.settings import Settings
from mjplug.errors import PluginError
from mjplug.plugin import registry

Schema = dict[str, Any]

_DIALECT = "https://json-schema.org/draft/2020-12/schema"


def config_schema() -> Schema:
    """Returns the schema, with the parameters of every installed plugin; one that cannot be imported is left open.

    Conditions stand in place of alternatives: an editor then says what is wrong with a value instead of that no
    alternative fits.
    """
    own = Settings.model_json_schema()
    definitions: Schema = own.pop("$defs")
    # The model may also come from the command line.
    own["required"] = []
    own["properties"]["plugins"]["additionalProperties"] = {"$ref": "#/$defs/PluginEntry"}
    types = registry.registered()
    entry = definitions["PluginEntry"]
    entry["properties"]["type"]["anyOf"] = [{"enum": sorted(types)}, {"pattern": "^[\\w.]+:\\w+$"}]
    entry["allOf"] = [
        {
            "if": {"properties": {"type": {"const": name}}, "required": ["type"]},
            "then": {"$ref": f"#/$defs/plugin.{target}"},
        }
        for name, target in ((name, point.value) for name, point in types.items())
    ]
    for target in {point.value for point in types.values()}:
        definitions |= _plugin(target)
    has_section = {"patternProperties": {"": {"type": "object", "required": ["ros__parameters"]}}, "minProperties": 1}
    return {
        "$schema": _DIALECT,
        "title": "A configuration of mjplug, or a ROS parameter file",
        "type": "object",
        "if": has_section,
        "then": {},
        "else": own,
        "$defs": definitions,
    }


def _plugin(target: str) -> dict[str, Schema]:
    """Returns the definitions of a plugin's entry, by names that no other plugin's have."""
    prefix = f"plugin.{target}"
    try:
        plugin = registry.find(target)
    except PluginError:
        return {prefix: {}}
    schema = plugin.parameters_type.model_json_schema(ref_template=f"#/$defs/{prefix}.{{model}}")
    inner = {f"{prefix}.{name}": definition for name, definition in schema.pop("$defs", {}).items()}
    schema["properties"] = {"type": {}, **schema.get("properties", {})}
    schema["description"] = (plugin.__doc__ or "").strip().partition("\n")[0]
    return {prefix: schema, **inner}
