"""The JSON Schema of configuration files and the server agree on which files are right."""

import textwrap
from pathlib import Path

import pytest
from docs.markdown import PAGES, blocks_of
from jsonschema import Draft202012Validator

from mjplug.cli.config_schema import config_schema
from mjplug.config.document import read_document
from mjplug.config.load import read
from mjplug.config.problem import ConfigError
from mjplug.plugin.selection import select

ROOT = Path(__file__).parents[2]
FILES = sorted([*ROOT.glob("examples/*/*.yaml"), *ROOT.glob("tests/**/*.yaml"), *ROOT.glob("mjplug/**/*.yaml")])


@pytest.fixture(scope="module")
def schema():
    schema = config_schema()
    Draft202012Validator.check_schema(schema)
    return Draft202012Validator(schema)


def errors_of_schema(schema, path):
    """Returns the schema errors of a file, with values converted as the server does."""
    return [f"{error.json_path}: {error.message}" for error in schema.iter_errors(read_document(path).value)]


def errors_of_server(path, model="bundled:arm"):
    """Returns the server's errors for a file."""
    names_model = "model" in (read_document(path).value or {})
    try:
        select(read(path, model=None if names_model else model, environ={}))
    except ConfigError as error:
        return [str(error)]
    return []


def same(schema, path):
    by_schema, by_server = errors_of_schema(schema, path), errors_of_server(path)
    assert bool(by_schema) == bool(by_server), (by_schema, by_server)
    return by_schema


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_the_files_of_examples_and_tests_are_right_for_both(schema, path, monkeypatch):
    monkeypatch.syspath_prepend(path.parent)
    assert same(schema, path) == []


YAML_BLOCKS = [(page, block) for page in PAGES for block in blocks_of(page) if block.language == "yaml"]


@pytest.mark.parametrize(
    ("page", "block"), YAML_BLOCKS, ids=lambda part: part if isinstance(part, str) else f"line_{part.line}"
)
def test_the_files_of_the_pages_are_judged_alike(schema, tmp_path, monkeypatch, page, block):
    # Modules and files that they name stand in other blocks of the page.
    for other in blocks_of(page):
        if other.file and "/" not in other.file:
            (tmp_path / other.file).write_text(other.text, encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    path = tmp_path / (block.file or "block.yaml")
    path.write_text(block.text, encoding="utf-8")
    same(schema, path)


RIGHT = {
    "one value for a list": """
        model: a.xml
        plugins:
          l: {type: lidar, front: {resolution: 360, elevation_range: 0, exclude_body: base}}
          t: {type: transforms, bodies: base, roots: base, exclude: base}
          j: {type: joint_commands, joints: a, command_interfaces: {a: position}, actuators: {a: m}}
          s: {type: joint_state_publisher, joints: a, interfaces: position}
          f: {type: free_joint_state_publisher, body_names: a}
          c: {type: camera, geom_groups: 2}
          n: {type: sensors, discover: imu}
        """,
    "lists": """
        model: a.xml
        plugins:
          l: {type: lidar, front: {resolution: [360, 1], elevation_range: [-0.1, 0.1], exclude_body: [base, arm]}}
        """,
    "sections without a value": """
        model: a.xml
        sim:
        zenoh:
        ros2:
        remap:
        plugins:
          l: {type: lidar, front: }
        """,
    "no plugins": "model: a.xml\nplugins:\nros_params:\n",
    "a namespace": """
        model: a.xml
        namespace: r1
        frame_prefix: "{ns}/"
        remap: {/clock: "{ns}/clock"}
        plugins: {l: {type: odometry, namespace: x, frame_prefix: y/}}
        """,
    "a keyframe by its index": "model: a.xml\nsim: {keyframe: 0, speed: max}",
    "a ROS file": """
        /**:
          ros__parameters:
            use_sim_time: true
            other: {anything: [1, 2]}
            mujoco_plugins:
              beat: {type: mujoco_ros2_control_plugins/HeartbeatPublisherPlugin, update_rate: 1.0}
        """,
    "a ROS file with namespaces, dotted names and other nodes": """
        controller_manager:
          ros__parameters: {update_rate: 100}
        robot1:
          other:
            ros__parameters:
        mujoco_ros2_control_node:
          ros__parameters:
            mujoco_plugins.beat.type: heartbeat
            mujoco_plugins: {beat: {update_rate: 2.0}}
        """,
}


@pytest.mark.parametrize("text", RIGHT.values(), ids=RIGHT)
def test_what_the_server_accepts_is_right_for_the_schema(schema, tmp_path, text):
    path = tmp_path / "c.yaml"
    path.write_text(textwrap.dedent(text))
    assert same(schema, path) == []


def test_a_file_that_changes_plugins_of_a_ros_file_needs_no_type(schema, tmp_path):
    (tmp_path / "ros.yaml").write_text(textwrap.dedent(RIGHT["a ROS file"]))
    path = tmp_path / "c.yaml"
    path.write_text("model: a.xml\nros_params: [ros.yaml]\nplugins: {beat: {update_rate: 2.0}}")
    assert same(schema, path) == []
    path.write_text("model: a.xml\nplugins: {beat: {update_rate: 2.0}}")
    assert same(schema, path) == ["$.plugins.beat: 'type' is a required property"]


WRONG = {
    "an unknown setting": "model: a.xml\nspeeed: 1",
    "an unknown setting of a section": "model: a.xml\nsim: {speeed: 1}",
    "an unknown type": "model: a.xml\nplugins: {a: {type: heartbeet}}",
    "no type": "model: a.xml\nplugins: {a: {rate: 1.0}}",
    "an unknown parameter": "model: a.xml\nplugins: {a: {type: heartbeat, rate: 1.0}}",
    "an unknown parameter below a name": "model: a.xml\nplugins: {a: {type: lidar, front: {site: x, no_retrun: 1}}}",
    "a value for a section": "model: a.xml\nplugins: {a: {type: lidar, thread: 2}}",
    "too large": "model: a.xml\nplugins: {a: {type: lidar, threads: 65}}",
    "an empty list": "model: a.xml\nplugins: {a: {type: lidar, front: {elevation_range: []}}}",
    "too long a list": "model: a.xml\nplugins: {a: {type: lidar, front: {resolution: [1, 2, 3]}}}",
    "zero columns": "model: a.xml\nplugins: {a: {type: lidar, front: {resolution: 0}}}",
    "an empty name": 'model: a.xml\nplugins: {a: {type: transforms, bodies: ""}}',
    "a number for a name": "model: a.xml\nplugins: {a: {type: transforms, bodies: 3}}",
    "a misspelt word in place of a list": "model: a.xml\nplugins: {a: {type: sensors, discover: imuu}}",
    "text for a number": "model: a.xml\nsim: {speed: fast}",
    "a number for a text": "model: a.xml\nnamespace: 9",
    "a misspelt parameter in a ROS file": """
        /**:
          ros__parameters:
            mujoco_plugins:
              beat: {type: mujoco_ros2_control_plugins/HeartbeatPublisherPlugin, updat_rate: 1.0}
        """,
    "a misspelt type in a ROS file": """
        mujoco_ros2_control_node:
          ros__parameters: {mujoco_plugins: {beat: {type: mujoco_ros2_control_plugins/Heartbeat}}}
        """,
    "no type in a ROS file": "/**: {ros__parameters: {mujoco_plugins: {beat: {update_rate: 1.0}}}}",
    "a section of another kind in a ROS file": "/**: {ros__parameters: {mujoco_plugins: {}}}\nsim: {speed: 2}",
    "use_sim_time that is no truth": "/**: {ros__parameters: {use_sim_time: 1, mujoco_plugins: {}}}",
    "parameters that are none": "/**: {ros__parameters: 3}",
}


@pytest.mark.parametrize("text", WRONG.values(), ids=WRONG)
def test_what_the_server_refuses_is_wrong_for_the_schema(schema, tmp_path, text):
    path = tmp_path / "c.yaml"
    path.write_text(textwrap.dedent(text))
    assert same(schema, path)
