"""Models and a loop without threads or sockets."""

import os
import sys
from pathlib import Path

import left_over
import pytest
import warm_python
from machine import BYTECODE, CACHE

# Compiled modules are kept, whatever the machine's settings say, and NumPy starts no threads: both before NumPy and
# MuJoCo are imported here, and in every program that a test starts.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
os.environ.update(PYTHONPYCACHEPREFIX=BYTECODE, XDG_CACHE_HOME=CACHE, OPENBLAS_NUM_THREADS="1")
sys.dont_write_bytecode, sys.pycache_prefix = False, BYTECODE
warm_python.enabled = True
left_over.mark()

# ruff: noqa: E402
import mujoco
from hypothesis import settings

from mjplug.testing import World

# A busy machine is no failure.
settings.register_profile("unhurried", deadline=None)
settings.load_profile("unhurried")

BOX = """
<mujoco>
  <option timestep="0.002" gravity="0 0 0"/>
  <worldbody>
    <body name="box" pos="0 0 1"><freejoint name="box_free"/>
      <geom type="box" size=".1 .2 .3" mass="2" pos=".05 0 .02"/></body>
    <body name="ball" pos="2 0 1"><freejoint/><geom type="sphere" size=".1" mass="1"/></body>
    <body name="post" pos="5 0 0"><geom type="box" size=".1 .1 1"/></body>
  </worldbody>
</mujoco>
"""

ARM = """
<mujoco>
  <compiler angle="radian"/>
  <option timestep="0.002"/>
  <worldbody>
    <geom type="plane" size="5 5 .1"/>
    <body name="upper" pos="0 0 2"><joint name="shoulder" axis="0 1 0" range="-1.5 1.5" limited="true"/>
      <geom type="capsule" size=".05" fromto="0 0 0 .5 0 0"/>
      <body name="lower" pos=".5 0 0"><joint name="elbow" axis="0 1 0"/>
        <geom type="capsule" size=".04" fromto="0 0 0 .4 0 0"/>
        <body name="slider" pos=".4 0 0"><joint name="extension" type="slide" axis="1 0 0" range="0 .2" limited="true"/>
          <geom type="sphere" size=".03"/></body></body></body>
    <body name="pendulum" pos="3 0 2"><joint name="socket" type="ball"/>
      <geom type="capsule" size=".05" fromto="0 0 0 0 0 -.5"/></body>
    <body name="cube" pos="1 1 .1"><freejoint name="cube_free"/><geom type="box" size=".1 .1 .1"/></body>
    <body name="brick" pos="-1 1 .1"><freejoint/><geom type="box" size=".1 .05 .1"/></body>
  </worldbody>
  <actuator>
    <position joint="shoulder" kp="200" kv="10"/>
    <general joint="elbow" dyntype="filter" dynprm=".1" gainprm="5"/>
  </actuator>
  <keyframe>
    <key name="bent" time="422.274" qpos=".5 -.7 .1  1 0 0 0  1 1 .5 1 0 0 0  -1 1 .5 1 0 0 0" ctrl=".5 .3" act=".25"/>
  </keyframe>
</mujoco>
"""


@pytest.fixture
def box_model():
    return mujoco.MjModel.from_xml_string(BOX)


@pytest.fixture
def arm_model():
    return mujoco.MjModel.from_xml_string(ARM)


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_makereport():
    """Keeps undecodable characters out of reports, which a process of a parallel run could not send."""
    report = yield
    report.sections = [(name, text.encode("utf-8", "backslashreplace").decode()) for name, text in report.sections]
    return report


LONG = ("worker", "examples", "docs", "security")
"""Folders whose modules take long: where processes share the tests, the last ones should be short."""


def pytest_collection_modifyitems(config, items):
    """Lets the modules that take long come first."""
    tests = Path(__file__).parent
    items.sort(key=lambda item: item.path.relative_to(tests).parts[0] not in LONG)


_left_over = []


@pytest.hookimpl(trylast=True)
def pytest_sessionfinish(session):
    """Lets the run fail if a process that a test has started outlives all tests."""
    warm_python.close()
    _left_over.extend(left_over.found())
    if hasattr(session.config, "workeroutput"):
        session.config.workeroutput["left_over"] = _left_over
    elif _left_over:
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


def pytest_terminal_summary(terminalreporter):
    """Names the processes after the failures, which often explain them."""
    if _left_over:
        terminalreporter.section("the tests have left processes behind")
        for line in _left_over:
            terminalreporter.line(line)


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node):
    """Takes what a process of a parallel run has found."""
    _left_over.extend(getattr(node, "workeroutput", {}).get("left_over", ()))


@pytest.fixture
def box_world(box_model):
    return World(box_model)


@pytest.fixture
def arm_world(arm_model):
    return World(arm_model)
