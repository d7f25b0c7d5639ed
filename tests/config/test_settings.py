import subprocess
import sys

import pytest
from pydantic import ValidationError

from mjplug.config.section import Section
from mjplug.config.settings import Settings
from mjplug.wire.encoding import MAX_JSON, MAX_PAYLOAD


def test_defaults_are_those_of_the_documentation():
    settings = Settings(model="scene.xml")
    assert settings.model_dump() == {
        "model": "scene.xml",
        "model_options": {
            "raw": False,
            "arguments": {},
            "packages": {},
            "base": "auto",
            "actuators": "auto",
            "collision": "urdf",
            "decompose": "none",
            "self_collision": "auto",
            "srdf": "",
            "gravcomp": "auto",
            "scene": "",
            "mujoco_inputs": (),
            "fuse": False,
            "sites": False,
            "up_axis": "ignore",
            "max_faces": 20_000,
            "strict": False,
        },
        "model_timeout": 120.0,
        "node_name": "mjplug",
        "namespace": "",
        "frame_prefix": "",
        "remap": {},
        "sim": {
            "speed": 1.0,
            "paused": False,
            "keyframe": "",
            "start_position_file": "",
            "initial_positions": {},
            "hold_initial_pose": True,
            "plugin_libraries": (),
            "seed": 0,
            "clock_rate": 100.0,
            "on_divergence": "pause",
        },
        "zenoh": {
            "mode": "auto",
            "listen": None,
            "connect": (),
            "config": None,
            "max_payload_bytes": MAX_PAYLOAD,
            "max_json_bytes": MAX_JSON,
        },
        "snapshots": {"max_states": 64, "max_bytes": 256 << 20, "folder": ""},
        "ros2": {"enabled": True, "domain_id": 0, "distro": "jazzy"},
        "simulation_interfaces": {
            "enabled": True,
            "namespace": None,
            "allow_quit": False,
            "spawnables": (),
            "spawn_wait": False,
            "entities": {},
            "named_poses": {},
        },
        "plugins": {},
        "ros_params": (),
        "on_plugin_error": "stop",
    }


def test_settings_cannot_be_changed():
    with pytest.raises(ValidationError, match="frozen"):
        Settings(model="scene.xml").sim.speed = 2.0


@pytest.mark.parametrize(
    "change",
    [
        {"sim": {"speed": "max"}},
        {"sim": {"speed": 2}},
        {"sim": {"speed": 0.001}},
        {"namespace": "/robot1/arm"},
        {"namespace": "/"},
        {"remap": {"/scan": "/robot1/scan"}},
        {"ros2": {"domain_id": 232}},
        {"zenoh": {"listen": [], "connect": ["tls/host.example:7447#iface=eth0", "unixsock-stream//tmp/a.sock"]}},
        {"zenoh": {"listen": ["tcp/[::]:0", "udp/10.0.0.1:65535", "serial//dev/ttyUSB0#baudrate=9600"]}},
        {"plugins": {"_hb2": {"type": "heartbeat", "anything": [1, {"at": "all"}]}}},
    ],
)
def test_what_is_allowed(change):
    Settings.model_validate({"model": "a.xml", **change})


@pytest.mark.parametrize(
    "change",
    [
        {"model": ""},
        {"model": 3},
        {"node_name": "a/b"},
        {"node_name": ""},
        {"namespace": "a b"},
        {"remap": {"scan": "/x"}},
        {"remap": {"/scan": "x"}},
        {"sim": {"speed": 0}},
        {"sim": {"speed": float("inf")}},
        {"sim": {"speed": float("nan")}},
        {"sim": {"speed": "1.0"}},
        {"sim": {"speed": True}},
        {"sim": {"paused": 1}},
        {"sim": {"paused": "true"}},
        {"sim": {"seed": True}},
        {"sim": {"seed": -1}},
        {"sim": {"seed": 1.0}},
        {"sim": {"clock_rate": 0}},
        {"sim": {"on_divergence": "ignore"}},
        {"zenoh": {"listen": "tcp/127.0.0.1:7447"}},
        {"zenoh": {"connect": ["tcp/host"]}},
        {"zenoh": {"connect": ["tcp/host:70000"]}},
        {"zenoh": {"connect": [1]}},
        {"ros2": {"domain_id": 233}},
        {"ros2": {"distro": "foxy"}},
        {"plugins": {"2d": {"type": "x"}}},
        {"plugins": {"a": {}}},
        {"plugins": {"a": {"type": ""}}},
        {"plugins": {"a": "heartbeat"}},
        {"ros_params": "a.yaml"},
        {"on_plugin_error": "ignore"},
        {"unknown": 1},
    ],
)
def test_what_is_refused(change):
    with pytest.raises(ValidationError):
        Settings.model_validate({"model": "a.xml", **change})


def test_a_namespace_has_one_form():
    assert [Settings(model="m", namespace=text).namespace for text in ("", "/", "r1", "/r1", "a/b")] == [
        "",
        "",
        "/r1",
        "/r1",
        "/a/b",
    ]


def test_a_plugin_entry_keeps_its_parameters_apart_from_its_type():
    entry = Settings.model_validate({"model": "m", "plugins": {"a": {"type": "t", "x": 1, "model_config": 2}}}).plugins[
        "a"
    ]
    assert entry.type == "t"
    assert entry.parameters == {"x": 1, "model_config": 2}


def test_every_field_says_what_it_is():
    schema = Settings.model_json_schema()
    models = [schema, *schema["$defs"].values()]
    assert len(models) == 11
    for model in models:
        for name, field in model["properties"].items():
            described = schema["$defs"][field["$ref"].rpartition("/")[2]] if "$ref" in field else field
            assert described["description"].endswith("."), name
    assert schema["required"] == ["model"]
    assert schema["$defs"]["Sim"]["properties"]["speed"]["anyOf"] == [
        {"maximum": 1000.0, "minimum": 0.001, "type": "number"},
        {"const": "max", "type": "string"},
    ]


def test_every_section_refuses_unknown_keys_and_conversions():
    for section in Section.__subclasses__():
        assert section.model_config["extra"] == "forbid"
        assert section.model_config["strict"] is True


def test_the_import_brings_neither_mujoco_nor_zenoh():
    heavy = ["mujoco", "zenoh", "numpy", "cv2", "typer"]
    code = f"import sys, mjplug.config; print([m for m in {heavy} if m in sys.modules])"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout == "[]\n"
