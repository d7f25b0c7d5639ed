"""The JSON Schema of configuration files, for editors."""

from typing import Any, Final

from mjplug.config.load import MAY_BE_EMPTY
from mjplug.config.settings import PluginEntry, Settings
from mjplug.errors import PluginError
from mjplug.plugin import registry

Schema = dict[str, Any]

_DIALECT: Final = "https://json-schema.org/draft/2020-12/schema"

_MAPPING: Final[Schema] = {"type": "object"}
_SECTION: Final = "#/$defs/RosSection"


def config_schema() -> Schema:
    """Returns the schema, with the parameters of every installed plugin.

    It accepts any parameters of a plugin that cannot be imported.

    The schema uses conditions instead of alternatives: an editor then reports what is wrong with a value, instead of
    "no alternative matches".
    """
    own = Settings.model_json_schema()
    definitions: Schema = own.pop("$defs")
    # The model may also come from the command line.
    own["required"] = []
    own["properties"]["plugins"]["additionalProperties"] = {"$ref": "#/$defs/PluginEntry"}
    for name in MAY_BE_EMPTY:
        own["properties"][name] = _or_nothing(own["properties"][name])
    # One of the listed files may set the type of an entry, and this file only some of its parameters.
    overlay = {"properties": {"ros_params": {"type": "array", "minItems": 1}}, "required": ["ros_params"]}
    typed = {"properties": {"plugins": {"additionalProperties": {"required": ["type"]}}}}
    own |= {"if": overlay, "else": typed}
    definitions |= _plugin_entry(definitions["PluginEntry"])
    return {
        "$schema": _DIALECT,
        "title": "A configuration of mjplug, or a ROS parameter file",
        "type": "object",
        "if": {"additionalProperties": {"not": {"$ref": "#/$defs/HasRosParameters"}}},
        "then": own,
        "else": _ros_file(definitions),
        "$defs": definitions,
    }


def _plugin_entry(entry: Schema) -> dict[str, Schema]:
    """Returns the definitions of an entry of `plugins` and of the parameters of each plugin, which its type selects."""
    types = registry.registered()
    entry.pop("required")
    entry["properties"]["type"]["anyOf"] = [{"enum": sorted(types)}, {"pattern": "^[\\w.]+:\\w+$"}]
    entry["allOf"] = [
        {
            "if": {"properties": {"type": {"const": name}}, "required": ["type"]},
            "then": {"$ref": f"#/$defs/plugin.{point.value}"},
        }
        for name, point in types.items()
    ]
    definitions = {"PluginEntry": entry}
    for target in {point.value for point in types.values()}:
        definitions |= _plugin(target)
    return definitions


def _plugin(target: str) -> dict[str, Schema]:
    """Returns the definitions of a plugin's entry, under names that no other plugin uses."""
    prefix = f"plugin.{target}"
    try:
        plugin = registry.find(target)
    except PluginError:
        return {prefix: {}}
    schema = plugin.parameters_type.model_json_schema(ref_template=f"#/$defs/{prefix}.{{model}}")
    inner = {f"{prefix}.{name}": definition for name, definition in schema.pop("$defs", {}).items()}
    schema["properties"] = {name: {} for name in PluginEntry.model_fields} | schema.get("properties", {})
    schema["description"] = (plugin.__doc__ or "").strip().partition("\n")[0]
    return {prefix: schema, **inner}


def _ros_file(definitions: Schema) -> Schema:
    """Returns the schema of a ROS parameter file, and adds its definitions.

    Namespaces may be nested mappings around `ros__parameters`, and a parameter may be dotted
    (`mujoco_plugins.cam.type`). Other parameters than `mujoco_plugins` belong to other software.
    """
    plugins = _or_nothing({**_MAPPING, "additionalProperties": {"$ref": "#/$defs/PluginEntry"}})
    parameters = {
        **_MAPPING,
        "properties": {"mujoco_plugins": plugins, "use_sim_time": {"type": "boolean"}},
        # A dotted parameter may set the type of an entry without `type`.
        "if": {"patternProperties": {"^mujoco_plugins\\.": False}},
        "then": {"properties": {"mujoco_plugins": {"additionalProperties": {"required": ["type"]}}}},
    }
    definitions["HasRosParameters"] = {
        **_MAPPING,
        "anyOf": [
            {"required": ["ros__parameters"]},
            {"not": {"additionalProperties": {"not": {"$ref": "#/$defs/HasRosParameters"}}}},
        ],
    }
    definitions["RosSection"] = {
        **_MAPPING,
        "if": {"required": ["ros__parameters"]},
        "then": {"properties": {"ros__parameters": _or_nothing(parameters)}},
        "else": {"minProperties": 1, "additionalProperties": {"$ref": _SECTION}},
    }
    return {"additionalProperties": {"$ref": _SECTION}}


def _or_nothing(schema: Schema) -> Schema:
    """Returns a schema that also accepts a key without a value."""
    return {"anyOf": [schema, {"type": "null"}]}
