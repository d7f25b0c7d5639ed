"""A tour of `mjplug topic`: every command against a live server, with text and exit codes."""

import ast
import contextlib
import csv
import io
import json
import re
import signal
import socket
import subprocess
import threading

import pytest
import yaml
from cli.process import COMMAND, environment
from slow_listener import SlowListener
from waits import TIMEOUT

from mjplug.cli import rate_meter, topic_echo, topic_rates
from mjplug.client import connect, connection
from mjplug_schemas.geometry_msgs import Twist
from mjplug_schemas.mujoco_ros2_control_msgs import FreeJointStateArray
from mjplug_schemas.rihs01 import type_hash
from mjplug_schemas.rosgraph_msgs import Clock
from mjplug_schemas.std_msgs import UInt64

POSITION = "free_joints[0].pose.pose.position"


def documents(text):
    return [document for document in yaml.safe_load_all(text) if document is not None]


def test_topics_are_listed(tour):
    listed = tour.ask("topic", "list").splitlines()
    assert listed == sorted(listed)
    assert {"/clock", "/cmd_vel", "/free_joints/free_joint_states", "/mjplug/epoch"} <= {*listed}
    assert "/clock [rosgraph_msgs/msg/Clock]" in tour.ask("topic", "list", "-t").splitlines()
    assert tour.ask("topic", "list", "--count-topics") == f"{len(listed)}\n"
    told = {topic["name"]: topic for topic in json.loads(tour.ask("topic", "list", "--json"))}
    assert list(told) == listed
    assert told["/cmd_vel"]["subscribers"] == ["/mjplug"]


def test_a_topic_is_described(tour):
    assert tour.ask("topic", "type", "/clock") == "rosgraph_msgs/msg/Clock\n"
    assert tour.ask("topic", "find", "std_msgs/UInt64") == "/mjplug/epoch\n"
    assert tour.ask("topic", "find", "std_msgs/msg/UInt64") == "/mjplug/epoch\n"
    assert tour.ask("topic", "find", "std_msgs/msg/Bool") == ""
    assert tour.ask("topic", "info", "~/epoch").splitlines() == [
        "Type: std_msgs/msg/UInt64", "Publisher count: 1", "Subscription count: 0",
    ]  # fmt: skip


def test_a_topic_is_described_with_its_ends_in_the_form_of_ros2(tour):
    qos = ["  Lifespan: Infinite", "  Deadline: Infinite", "  Liveliness: AUTOMATIC"]
    assert tour.ask("topic", "info", "~/epoch", "--verbose").splitlines() == [
        "Type: std_msgs/msg/UInt64",
        "",
        "Publisher count: 1",
        "",
        "Node name: mjplug",
        "Node namespace: /",
        "Topic type: std_msgs/msg/UInt64",
        f"Topic type hash: {type_hash(UInt64)}",
        "Endpoint type: PUBLISHER",
        "Key: mjplug/epoch (JSON: mjplug/epoch/@json)",
        "QoS profile:",
        "  Reliability: RELIABLE",
        "  History (Depth): KEEP_LAST (1)",
        "  Durability: TRANSIENT_LOCAL",
        *qos,
        "  Liveliness lease duration: Infinite",
        "",
        "Subscription count: 0",
        "",
    ]
    read = tour.ask("topic", "info", "-v", "/cmd_vel").splitlines()
    assert read[:5] == ["Type: geometry_msgs/msg/Twist", "", "Publisher count: 0", "", "Subscription count: 1"]
    assert "Endpoint type: SUBSCRIPTION" in read


def test_topics_are_listed_with_the_number_of_their_ends(tour):
    published, subscribed = tour.ask("topic", "list", "-v").split("\n\n")[:2]
    assert published.startswith("Published topics:\n * /clock [rosgraph_msgs/msg/Clock] 1 publisher\n")
    assert subscribed.startswith("Subscribed topics:\n * /cmd_vel [geometry_msgs/msg/Twist] 1 subscriber")
    assert "/cmd_vel" not in published
    assert "/clock" not in subscribed


def test_echo_shows_messages_as_yaml_documents(tour):
    shown = documents(tour.ask("topic", "echo", "/clock", "-n", "3"))
    times = [Clock.from_json(json.dumps(each)).clock for each in shown]
    assert [type(time.sec) for time in times] == [int] * 3
    assert times == sorted(times, key=lambda time: (time.sec, time.nanosec))
    (once,) = documents(tour.ask("topic", "echo", "/clock", "rosgraph_msgs/Clock", "--once", "--flow-style"))
    assert set(once["clock"]) == {"sec", "nanosec"}


def test_echo_shows_messages_as_json_and_as_csv(tour):
    lines = tour.ask("topic", "echo", "/free_joints/free_joint_states", "-n", "2", "-o", "json").splitlines()
    assert [FreeJointStateArray.from_json(line).free_joints[0].name for line in lines] == ["box", "box"]
    table = list(csv.reader(io.StringIO(tour.ask("topic", "echo", "/clock", "-n", "2", "--csv"))))
    assert table[0] == ["clock.sec", "clock.nanosec"]
    assert [[cell.isdecimal() for cell in row] for row in table[1:]] == [[True, True]] * 2


def test_echo_shows_a_part_of_a_message(tour):
    tour.ask("sim", "pause")
    tour.ask("sim", "reset", "-k", "lifted")
    with stepping(tour):
        (position,) = documents(
            tour.ask("topic", "echo", "/free_joints/free_joint_states", "--once", "--field", POSITION)
        )
        height = tour.ask("topic", "echo", "/free_joints/free_joint_states", "--once", "--field", f"{POSITION}.z")
    assert position == {"x": 0.0, "y": 0.0, "z": 2.0}
    assert height == "2.0\n---\n"
    assert tour.ask("topic", "echo", "~/epoch", "--once", "--field", "data").splitlines()[1] == "---"


class stepping:  # noqa: N801  (reads as a statement)
    """Takes steps of a paused simulation until the end of the block."""

    def __init__(self, tour):
        self._client = connect(tour.endpoint)
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._step)

    def _step(self):
        while not self._over.is_set():
            self._client.call("~/step_simulation", steps=20)

    def __enter__(self):
        self._thread.start()

    def __exit__(self, *_):
        self._over.set()
        self._thread.join(TIMEOUT)
        self._client.close()


def test_a_part_as_csv_has_its_name_in_the_heading(tour):
    field = f"{POSITION}.z"
    table = tour.ask("topic", "echo", "/free_joints/free_joint_states", "--once", "--csv", "--field", field)
    assert table.splitlines()[0] == field
    table = tour.ask("topic", "echo", "/thermometer/reading", "--once", "--csv", "--field", "history")
    assert table.splitlines() == ["history[0],history[1]", "1.0,2.0"]


def test_echo_shows_the_messages_for_which_an_expression_is_true(tour):
    (clock,) = documents(tour.ask("topic", "echo", "/clock", "--filter", "m.clock.nanosec % 4000000 == 0", "--once"))
    assert clock["clock"]["nanosec"] % 4_000_000 == 0
    # Of a part, m is the part.
    part = tour.ask("topic", "echo", "/clock", "--field", "clock.nanosec", "--filter", "m % 8000000 == 0", "-n", "2")
    assert [value % 8_000_000 for value in documents(part)] == [0, 0]
    reading = tour.ask("topic", "echo", "/thermometer/reading", "--filter", "m.label == 'warm'", "--once")
    assert documents(reading)[0]["label"] == "warm"


def test_echo_shows_messages_as_they_come(tour):
    raw, end = tour.ask("topic", "echo", "/clock", "--once", "--raw").splitlines()
    assert end == "---"
    assert isinstance(Clock.from_cdr(ast.literal_eval(raw)), Clock)
    assert len(ast.literal_eval(raw)) == len(Clock().to_cdr())


def test_echo_takes_the_quality_of_service_as_ros2_does(tour):
    latched = ("topic", "echo", "~/epoch", "--once", "--field", "data", "--timeout", "0.5")
    for more in ((), ("--qos-durability", "transient_local"), ("--qos-profile", "action_status_default")):
        assert tour.ask(*latched, *more, "--qos-reliability", "best_effort", "--qos-depth", "3").endswith("---\n")
    for more in (("--qos-durability", "volatile"), ("--qos-profile", "sensor_data")):
        assert "no message on /mjplug/epoch" in tour.fail(6, *latched, *more)
    # An option counts more than the profile.
    assert tour.ask(*latched, "--qos-profile", "sensor_data", "--qos-durability", "transient_local").endswith("---\n")
    assert "'durable' is not one of" in tour.fail(2, *latched, "--qos-durability", "durable")


def test_echo_leaves_out_what_is_long_or_unwanted(tour):
    topic = "/free_joints/free_joint_states"
    assert documents(tour.ask("topic", "echo", topic, "--once", "--no-arr"))[0]["free_joints"] == "<1 values>"
    beat = tour.ask("topic", "echo", "/mujoco_heartbeat", "--once", "-l", "6")
    assert beat == "data: MuJoCo...\n---\n"
    whole = tour.ask("topic", "echo", "/mujoco_heartbeat", "--once", "-l", "6", "--full-length")
    assert whole.startswith("data: 'MuJoCo ROS2 Control Heartbeat #")
    assert re.fullmatch(
        r"data: <\d+ characters>\n---\n", tour.ask("topic", "echo", "/mujoco_heartbeat", "--once", "--no-str")
    )


@pytest.mark.parametrize(
    ("code", "words", "sentence"),
    [
        (1, ("echo", "/clok"), r"unknown topic '/clok', did you mean '/clock'\?; there are: /clock, /cmd_vel, "),
        (1, ("info", "cmd_ve"), r"unknown topic '/cmd_ve', did you mean '/cmd_vel'\?"),
        (1, ("type", "/clo ck"), r"'/clo ck' is not a valid ROS name"),
        (2, ("echo", "/clock", "std_msgs/String"), r"topic /clock is rosgraph_msgs/msg/Clock, not std_msgs/msg/String"),
        (2, ("echo", "/clock", "std_msgs/msg/Strin"), r"unknown type .*did you mean 'std_msgs/msg/String'\?"),
        (2, ("echo", "/clock", "--field", "clock.se"), r"'clock.se': there is no field 'se', did you mean 'sec'\?"),
        (2, ("echo", "/clock", "--field", "clock.sec.x"), r"there is no field 'x'; int32 is not a message"),
        (2, ("echo", "/clock", "--field", "clock..sec"), r"'clock\.\.sec' is not a field; write it as in"),
        (2, ("echo", "/clock", "--field", "clock[3]"), r"this message has no 3 there"),
        (2, ("echo", "/clock", "-o", "xml"), r"'xml' is not one of 'yaml', 'json', 'csv'"),
        (6, ("echo", "/cmd_vel", "--timeout", "0.2"), r"no message on /cmd_vel within 0\.2 s"),
        (6, ("hz", "/cmd_vel", "--timeout", "0.5"), r"no message on /cmd_vel within 0\.5 s"),
        (2, ("delay", "/mujoco_heartbeat"), r"std_msgs/msg/String has no header with a stamp"),
        (2, ("hz", "-s", "/mujoco_heartbeat"), r"std_msgs/msg/String has no header with a stamp"),
        (2, ("find", "std_msgs/UInt46"), r"unknown type 'std_msgs/msg/UInt46', did you mean 'std_msgs/msg/UInt64'\?"),
        (1, ("pub", "/chatter", "{data: x}"), r"unknown topic '/chatter'; .*; if the name is right, give its type"),
        (1, ("echo", "/chatter"), r"unknown topic '/chatter'; .*; if the name is right, give its type"),
        (2, ("find", "UInt64"), r"unknown type 'UInt64', did you mean 'std_msgs/msg/UInt64'\?"),
        (2, ("echo", "/clock", "--filter", "m.clok.sec"), r"there is no field 'clok', did you mean 'clock'\?"),
        (2, ("echo", "/clock", "--filter", "open('x')"), r"\"open\('x'\)\" cannot be called; allowed: abs, all"),
        (2, ("hz", "/clock", "--filter", "m.sec"), r"there is no field 'sec'; known: clock"),
        (2, ("echo", "/clock", "--raw", "--csv"), r"Invalid value for --raw: it cannot be combined with --field"),
        (6, ("pub", "--once", "/chatter", "std_msgs/String", "{data: x}", "--timeout", "0.2"), r"no subscriber for"),
        (2, ("pub", "/cmd_vel", "{linear: {x: fast}}"), r"linear\.x must be a float64 \(a number\), got \"fast\""),
        (2, ("pub", "/cmd_vel", "{lineal: {x: 1}}"), r"unknown field 'lineal', did you mean 'linear'\?"),
        (2, ("pub", "/cmd_vel", "{linear:{x: 1}}"), r"YAML syntax: .*; write fields as YAML, with a space"),
        (2, ("pub", "/cmd_vel", "0.5"), r"'0.5' contains no fields; write fields as YAML"),
        (2, ("pub", "/cmd_vel", "std_srvs/srv/Trigger", "{}"), r"std_srvs/srv/Trigger is a service"),
    ],
)  # fmt: skip
def test_errors_are_reported_in_one_sentence(tour, code, words, sentence):
    assert re.search(sentence, tour.fail(code, "topic", *words))


def test_published_messages_arrive_as_often_as_asked(tour):
    with connect(tour.endpoint) as client, client.subscribe("/cmd_vel", Twist) as commands:
        printed = tour.ask("topic", "pub", "/cmd_vel", "{linear: {x: 0.5}}", "-t", "3", "-r", "100")
        assert printed.splitlines() == [
            f"publishing #{i}: {{linear: {{x: 0.5, y: 0.0, z: 0.0}}, angular: {{x: 0.0, y: 0.0, z: 0.0}}}}"
            for i in (1, 2, 3)
        ]
        received = [commands.next(TIMEOUT) for _ in range(3)]
        assert received == [Twist.from_json('{"linear": {"x": 0.5}}')] * 3
        assert (
            tour.ask("topic", "pub", "-1", "-p", "0", "/cmd_vel", "geometry_msgs/msg/Twist", "{angular: {z: 1}}") == ""
        )
        assert commands.next(TIMEOUT).angular.z == 1.0


def test_the_rate_of_a_1_khz_topic_is_measured_to_one_hertz(tour, monkeypatch):
    arrivals, stamps, original = [], [], topic_rates.arrival

    def arrival(sample, kind):
        arrivals.append(original(sample, kind))
        clock = Clock.from_cdr(sample.payload.to_bytes()).clock
        stamps.append(clock.sec + clock.nanosec / 1e9)
        return arrivals[-1]

    monkeypatch.setattr(topic_rates, "arrival", arrival)
    rate, spread = tour.ask("topic", "hz", "/clock", "-n", "2").splitlines()[-2:]
    found = re.fullmatch(r"\tmin: [\d.]+s max: [\d.]+s std dev: [\d.]+s window: (\d+) lost: \d+", spread)
    last = int(found[1]) - 1
    # A busy machine may make the server run slower; by its stamps, it is a thousand in each simulated second.
    pace = (stamps[last] - stamps[0]) / (arrivals[last] - arrivals[0])
    assert 0.0 < pace < 1.1
    assert float(rate.removeprefix("average rate: ")) == pytest.approx(1000.0 * pace, abs=1.0)


def test_a_rate_in_simulated_time_does_not_depend_on_the_speed(tour):
    tour.ask("sim", "speed", "0.5")
    assert tour.ask("topic", "hz", "/clock", "-s", "-n", "1").startswith("average rate: 1000.000\n")
    wall = float(tour.ask("topic", "hz", "/clock", "-n", "2").splitlines()[-2].removeprefix("average rate: "))
    # A busy machine may make the server run slower still.
    assert 0.0 < wall < 650.0


def test_bandwidth_counts_the_bytes_of_the_messages(tour, monkeypatch):
    times, original = [], rate_meter.bandwidth

    def bandwidth(arrivals):
        times[:] = [time for time, _ in arrivals]
        return original(arrivals)

    monkeypatch.setattr(rate_meter, "bandwidth", bandwidth)
    report = tour.ask("topic", "bw", "/clock", "-n", "1")
    size = len(Clock().to_cdr())
    assert f"Message size mean: {size} B min: {size} B max: {size} B" in report
    found = re.match(r"([\d.]+) (K?)B/s from 100 messages\n", report)
    shown = float(found[1]) * (1000.0 if found[2] else 1.0)
    assert shown == pytest.approx(99 * size / (times[-1] - times[0]), rel=0.01)


def test_bandwidth_is_that_between_the_first_and_the_last_arrival():
    assert rate_meter.bandwidth([(7.0, 900), (8.0, 100), (9.0, 100)]).startswith("100 B/s from 3 messages\n")


def test_delay_is_the_age_in_simulated_time(tour):
    report = tour.ask("topic", "delay", "/free_joints/free_joint_states", "-n", "1")
    age = float(report.splitlines()[0].removeprefix("average delay: "))
    # Stamps are of the step that published, a millisecond long; on a busy machine the message comes later.
    assert abs(age) < 5.0


def test_waiting_for_a_first_message_reports_why(tour, monkeypatch):
    monkeypatch.setattr(topic_echo, "SILENCE", 0.3)
    assert "waiting for /cmd_vel: no server publishes it\n" in tour.fail(
        6, "topic", "echo", "/cmd_vel", "--timeout", "0.6"
    )
    tour.ask("sim", "pause")
    said = tour.fail(6, "topic", "echo", "/mujoco_heartbeat", "--timeout", "0.6")
    assert said.splitlines() == [
        "waiting for /mujoco_heartbeat: the simulation is paused (mjplug sim resume)",
        "error: no message on /mujoco_heartbeat within 0.6 s",
    ]


def test_a_topic_without_messages_is_reported(tour):
    assert tour.ask("topic", "hz", "/cmd_vel", "-n", "1") == "no messages yet: no server publishes it\n"
    tour.ask("sim", "pause")
    why = "no messages yet: the simulation is paused (mjplug sim resume)\n"
    # Said once, however many reports there are.
    assert tour.ask("topic", "hz", "/mujoco_heartbeat", "-n", "2") == why
    assert tour.ask("topic", "bw", "/mujoco_heartbeat", "-n", "1") == why


def test_rates_of_several_topics_are_a_table(tour):
    table = tour.ask("topic", "hz", "/clock", "/mujoco_heartbeat", "/cmd_vel", "-n", "2").splitlines()[-5:]
    assert table[0].split() == ["topic", "rate", "min_delta", "max_delta", "std_dev", "window", "lost"]
    assert set(table[1]) == {"="}
    rows = {row.split()[0]: [float(cell) for cell in row.split()[1:]] for row in table[2:4]}
    # The third one has no messages.
    assert list(rows) == ["/clock", "/mujoco_heartbeat"]
    # 1000 Hz and 20 Hz of simulated time, which a busy machine makes slower alike.
    assert rows["/clock"][0] / rows["/mujoco_heartbeat"][0] == pytest.approx(50.0, rel=0.5)


def test_echo_shows_the_age_of_messages_and_what_was_lost_before_them(tour):
    shown = tour.ask("topic", "echo", "/clock", "--age", "--flow-style", "-n", "2").splitlines()
    head = r"# age [\d.]+ s, sequence number \d+, simulated time ([\d.]+) s, epoch \d+, publisher [0-9a-f]{32}"
    assert re.match(head, shown[0]), shown
    sec, nanosec = re.findall(r"\d+", shown[1])
    assert re.match(head, shown[0])[1] == f"{int(sec)}.{int(nanosec):09d}"
    # A comment, so that the output is still YAML.
    assert len(documents("\n".join(shown))) == 2
    assert "only in YAML" in tour.fail(2, "topic", "echo", "/clock", "--age", "--csv")


def test_a_rate_of_chosen_messages_is_lower(tour):
    every = "m.clock.nanosec % 4000000 == 0"
    assert tour.ask("topic", "hz", "/clock", "-s", "-n", "1", "--filter", every).startswith("average rate: 250.000\n")


@pytest.fixture
def start(tour):
    """Starts commands in processes of their own, as a shell does."""
    running = []

    def start(*words):
        running.append(
            subprocess.Popen(
                [*COMMAND, *words],
                env=environment({"MJPLUG_CONNECT": tour.endpoint}),
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                text=True,
            )
        )
        return running[-1]

    yield start
    for process in running:
        process.kill()
        process.communicate()


def test_ctrl_c_ends_with_130_and_without_output(start):
    process = start("topic", "echo", "/clock")
    assert process.stdout.readline() == "clock:\n"
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=TIMEOUT)
    assert (process.returncode, err) == (130, "")


def test_a_closed_pipe_ends_it_without_an_error(start):
    process = start("topic", "echo", "/clock")
    assert process.stdout.readline() == "clock:\n"
    process.stdout.close()
    assert process.wait(TIMEOUT) == 0
    assert process.stderr.read() == ""


def test_output_that_cannot_be_written_is_a_sentence(tour):
    words = [*COMMAND, "topic", "list", "-e", tour.endpoint]
    with open("/dev/full", "w") as full:
        done = subprocess.run(words, stdout=full, stderr=subprocess.PIPE, text=True, timeout=TIMEOUT, check=False)
    assert (done.returncode, done.stderr) == (1, "error: cannot write: No space left on device\n")
    closed = subprocess.run(
        ["sh", "-c", '"$@" >&-', "sh", *words], stderr=subprocess.PIPE, text=True, timeout=TIMEOUT, check=False
    )
    assert (closed.returncode, closed.stderr) == (0, "")


def test_no_server_is_exit_code_5(tour):
    said = tour.fail(5, "topic", "list", "--connect", "tcp/127.0.0.1:1")
    assert said.startswith("error: connection refused by tcp/127.0.0.1:1: no mjplug server listens there; start one (")
    assert "is not a Zenoh endpoint" in tour.fail(5, "topic", "list", "-e", "localhost:7447")
    assert "unknown server '/mjplu', did you mean '/mjplug'?" in tour.fail(1, "topic", "list", "--server", "/mjplu")


def test_a_server_that_answers_late_is_reached(tour):
    with SlowListener(tour.endpoint, delay=1.5) as listener:
        assert "/clock" in tour.ask("topic", "list", "-e", listener.endpoint).splitlines()


def test_a_command_waits_for_a_server_that_starts_later_if_it_is_told_to(tour, monkeypatch):
    with contextlib.ExitStack() as stack, socket.socket() as closed:
        closed.bind(("127.0.0.1", 0))
        port = closed.getsockname()[1]
        examine, failures = connection.examine, []

        def start_listening(*arguments, **options):
            failures.append(examine(*arguments, **options))
            if len(failures) == 2:
                closed.close()
                stack.enter_context(SlowListener(tour.endpoint, port=port))
            return failures[-1]

        monkeypatch.setattr(connection, "examine", start_listening)
        listed = tour.ask("topic", "list", "-e", f"tcp/127.0.0.1:{port}", "--wait", "60")
    assert "/clock" in listed.splitlines()
    assert all(failure.reason.startswith("connection refused by ") for failure in failures[:2])
