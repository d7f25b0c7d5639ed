"""`mjplug convert` and `mjplug serve` with a URDF or xacro file."""

import json
from pathlib import Path

import pytest
from convert.robots import ARM, BOX, joint, link, robot

from mjplug.client import connect

XACRO = '<robot name="{name}" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:arg name="mass" default="1"/>{rest}'


@pytest.fixture
def here(tmp_path):
    (tmp_path / "arm.urdf").write_text(ARM)
    rest = ARM.partition(">")[2].replace('<mass value="2.0"/>', '<mass value="$(arg mass)"/>')
    (tmp_path / "arm.urdf.xacro").write_text(XACRO.format(name="arm", rest=rest))
    return tmp_path


def test_a_robot_is_converted_checked_and_served(cli, here):
    done = cli("convert", "arm.urdf", "-o", "out/arm")
    assert done.returncode == 0
    assert done.stdout.splitlines()[0] == "arm: 4 links, 2 moving joints, 2 position servos, fixed base"
    assert done.stdout.splitlines()[-1] == "wrote out/arm; to run it: mjplug serve out/arm/mjplug.yaml"
    names = {"mjplug.yaml", "scene.xml", "robot.xml", "robot.urdf", "conversion.json"}
    assert {path.name for path in (here / "out" / "arm").iterdir()} == names
    again = cli("convert", "arm.urdf", "-o", "out/arm")
    assert (again.returncode, again.stderr) == (
        4,
        "error: out/arm already exists; choose another folder, or replace it with --force\n",
    )
    assert cli("convert", "arm.urdf", "-o", "out/arm", "--force", "--scene", "tabletop").returncode == 0
    checked = cli("serve", "out/arm/mjplug.yaml", "--check")
    assert "ok · model arm (" in checked.stdout


def test_arguments_of_xacro_and_a_report_in_json(cli, here):
    done = cli("convert", "arm.urdf.xacro", "mass:=3.5", "--check", "--json")
    report = json.loads(done.stdout)
    assert report["folder"] is None
    assert report["joints"]["elbow"]["actuator"] == "position"
    assert not (here / "arm").exists()
    assert cli("convert", "arm.urdf.xacro", "mass:=3.5").returncode == 0
    assert 'mass="3.5"' in (here / "arm" / "robot.xml").read_text()


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (["arm.urdf.xacro", "mass=3"], 2, "'mass=3' is not an argument of a xacro file; write NAME:=VALUE"),
        (["arm.urdf.xacro", "mas:=3"], 4, "arm.urdf.xacro has no argument 'mas', did you mean 'mass'?"),
        (["arm.urdf", "mass:=3"], 4, "arm.urdf does not use xacro, so it has no arguments"),
        (["no.urdf"], 4, "no.urdf cannot be read: No such file or directory"),
        (["arm.urdf", "--collision", "all"], 2, "'all': must be urdf, visual, or visual:LINK,LINK"),
        (["arm.urdf", "--decompose", "base=9"], 2, "must be none, auto, all, or LINK=THRESHOLD"),
        (["arm.urdf", "--package", "x"], 2, "'x' must be NAME=FOLDER"),
        (["arm.urdf", "--package", "x=nowhere"], 4, "the folder of package 'x' is 'nowhere', which does not exist"),
        (["arm.urdf", "--scene", "table"], 4, "there is no scene 'table', did you mean 'tabletop'?"),
        (["arm.urdf", "--srdf", "no.srdf"], 4, "no.srdf cannot be read"),
        (["arm.urdf", "--collision", "visual:hand"], 4, "names links that the robot does not have: hand"),
    ],
)
def test_mistakes(cli, here, arguments, code, message):
    done = cli("convert", *arguments)
    assert (done.returncode, done.stdout) == (code, "")
    assert message in " ".join(done.stderr.replace("│", " ").split())
    assert "Traceback" not in done.stderr


def test_a_urdf_is_served_with_joints_frames_and_description(serve, here):
    server = serve("arm.urdf.xacro", "mass:=1.5", "--speed", "5", cwd=here)
    with connect(server.endpoint) as client:
        for name in ("/joint_states", "/tf", "/tf_static", "/robot_description"):
            client.wait_for(name)
        states = client.subscribe("/joint_states", depth=1)
        state = states.next(timeout=20.0)
        assert list(state.name) == ["shoulder", "elbow"]
        assert max(map(abs, state.position)) < 0.01
        frames = {
            transform.child_frame_id
            for name in ("/tf", "/tf_static")
            for transform in client.subscribe(name).next(timeout=20.0).transforms
        }
        assert frames == {"base", "upper", "lower", "tool0"}
        description = client.subscribe("/robot_description").next(timeout=20.0).data
        assert '<mass value="1.5"' in description
        assert "xacro:" not in description
        client.publish("/joint_commands", {"name": ["elbow"], "position": [0.5]})
        assert any(abs(state.position[1] - 0.5) < 0.01 for state, _ in zip(states, range(2000), strict=False))


def test_a_configuration_with_a_urdf_takes_only_the_model(cli, here):
    (here / "robot.yaml").write_text("model: arm.urdf\nmodel_options: {scene: tabletop, gravcomp: 'off'}\n")
    done = cli("serve", "robot.yaml", "--check")
    assert done.stdout.startswith("ok · model arm (9 bodies, 26 DOFs, 2 actuators, 2 ms steps) · plugins: none")
    (here / "robot.yaml").write_text("model: arm.urdf\nmodel_options: {scen: tabletop, srdf: no.srdf}\n")
    done = cli("serve", "robot.yaml", "--check")
    assert done.returncode == 3
    assert "model_options.scen: unknown key" in done.stderr
    assert "model_options.srdf: there is no file 'no.srdf'" in done.stderr


def test_what_is_missing_in_a_robot_is_reported(cli, tmp_path):
    mesh = '<mesh filename="package://nowhere/part.stl"/>'
    (tmp_path / "r.urdf").write_text(robot(link("base", shape=BOX), link("a", shape=mesh), joint("j", "base", "a")))
    done = cli("convert", "r.urdf")
    assert done.returncode == 0
    assert done.stderr.startswith("errors: parts that are missing in the model:\n")
    assert "a ('package://nowhere/part.stl': there is no package 'nowhere'" in done.stderr
    assert cli("convert", "r.urdf", "--strict", "-o", "strict").returncode == 4
    assert not (tmp_path / "strict").exists()


def test_the_name_of_a_robot_leads_to_no_other_folder(cli, here):
    for name in ("../../escaped", "..", "/tmp/escaped"):
        (here / "named.urdf").write_text(ARM.replace('name="arm"', f'name="{name}"', 1))
        done = cli("convert", "named.urdf", "--force")
        assert done.returncode == 0
        folder = done.stdout.splitlines()[-1].partition("wrote ")[2].partition(";")[0]
        assert (here / folder / "robot.xml").resolve().is_relative_to(here)
        assert folder == Path(folder).name


def test_two_servers_convert_the_same_file_at_once(serve, here):
    from concurrent.futures import ThreadPoolExecutor

    environ = {"XDG_CACHE_HOME": str(here / "cache")}
    with ThreadPoolExecutor(2) as threads:
        servers = list(threads.map(lambda _: serve("arm.urdf", "--paused", env=environ, cwd=here), range(2)))
    assert all("model arm (" in server.ready for server in servers)
    (folder,) = (here / "cache" / "mjplug" / "models").iterdir()
    assert (folder / "conversion.json").is_file()


def test_each_start_of_a_server_reports_what_is_missing(cli, tmp_path):
    mesh = '<mesh filename="package://nowhere/part.stl"/>'
    zero = '<inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/>'
    (tmp_path / "r.urdf").write_text(
        robot(link("base", shape=BOX), link("a", shape=mesh, inertia=zero), joint("j", "base", "a"))
    )
    for _ in range(2):
        done = cli("serve", "r.urdf", "--check")
        assert done.returncode == 0
        (missing,) = [line for line in done.stderr.splitlines() if "collision mesh left out" in line]
        assert "warning: collision mesh left out, so the link passes through things: a ('package://nowhere" in missing
        assert done.stderr.count("repaired: impossible inertia: a (principal") == 1
        record = done.stderr.split("values were guessed; ")[1].split(" lists them")[0]
        assert json.loads(Path(record).read_text())["robot"] == "test"


def test_a_report_with_many_long_lines_gives_each_subject_its_own(cli, tmp_path):
    parts = [link("base", shape=BOX)]
    for i in range(6):
        parts += [link(f"a{i}", visual=f'<mesh filename="package://some_description/meshes/visual/part_{i}.dae"/>')]
        parts += [joint(f"j{i}", "base", f"a{i}")]
    (tmp_path / "r.urdf").write_text(robot(*parts))
    lines = cli("convert", "r.urdf", "--check", "--package", f"some_description={tmp_path}").stderr.splitlines()
    assert lines[:2] == ["warnings:", "  visual mesh left out (6):"]
    uri = "package://some_description/meshes/visual/part_0.dae"
    assert lines[2] == f"    a0 ({uri}: there is no such file in {tmp_path})"
    assert lines[6] == "    and 2 more"
