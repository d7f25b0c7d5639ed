"""Configurations of a few lines, in a folder of their own."""

import pytest

from mjplug.config.load import load
from mjplug.config.problem import ConfigError

DESIGN = """\
model: scene.xml
node_name: mjplug
namespace: ""
remap: {/scan: /robot1/scan}
sim:
  speed: 1.0
  paused: false
  keyframe: ""
  seed: 0
  clock_rate: 100.0
  on_divergence: pause
zenoh: {mode: auto, listen: [tcp/127.0.0.1:7447], connect: [], config: null}
ros2: {enabled: true, domain_id: 0}
plugins:
  external_wrench: {type: mujoco_ros2_control_plugins/ExternalWrenchPlugin, force_arrow_scale: 0.01}
  heartbeat: {type: heartbeat}
ros_params: []
"""


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def config(here):
    """Loads the text of a configuration file."""

    def load_text(text, *sets, model=None, **environ):
        (here / "c.yaml").write_text(text)
        return load("c.yaml", model=model, sets=sets, environ=environ)

    return load_text


def refusal(call, *args, **kwargs):
    with pytest.raises(ConfigError) as caught:
        call(*args, **kwargs)
    return str(caught.value)
