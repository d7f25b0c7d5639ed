"""Actions on real Zenoh: plain clients, and clients that send the keys and bytes of rmw_zenoh."""

import json
import queue
import threading
import uuid

import pytest
import zenoh
from counting import Count, Counter
from wire.ros_peer import WHO, request, tokens

from mjplug.contracts.diagnostics import Diagnostics
from mjplug.errors import WireError
from mjplug.plugin import Host
from mjplug.testing import World
from mjplug.wire.rmw_zenoh.attachment import Attachment
from mjplug.wire.rmw_zenoh.keys import RosSettings
from mjplug_schemas.action_msgs import CancelGoal, GoalInfo, GoalStatus, GoalStatusArray
from mjplug_schemas.std_srvs import Trigger
from mjplug_schemas.unique_identifier_msgs import UUID

TIMEOUT = 60.0
SUCCEEDED, CANCELED, ABORTED = GoalStatus.STATUS_SUCCEEDED, GoalStatus.STATUS_CANCELED, GoalStatus.STATUS_ABORTED
GOAL_ID = UUID(uuid=bytes(range(1, 17)))
GOAL_TEXT = str(uuid.UUID(bytes=GOAL_ID.uuid))
NONE = zenoh.ConsolidationMode.NONE


class Served:
    """A server with the action /count; a thread of its own steps it while `running`."""

    def __init__(self, network, handler="count"):
        self.world = World("bundled:box")
        self.host = Host("test", self.world.loop, network, str, self.world.workers, Diagnostics())
        self.counter = Counter(self.host)
        self.network = network
        self.host.create_action(Count, "/count", getattr(self.counter, handler))
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self.stepping = threading.Event()
        self._thread.start()

    def _run(self):
        while not self._stop.is_set():
            self.world.loop.step(int(self.stepping.is_set()))
            self._stop.wait(0.001)

    def close(self):
        self._stop.set()
        self._thread.join(TIMEOUT)


@pytest.fixture
def served(network, opened):
    return opened(Served(network))


def ask(client, key, payload, encoding=None, **options):
    """The replies to a query, one after the other, as they come in."""
    replies = queue.SimpleQueue()
    handler = zenoh.handlers.Callback(replies.put, drop=lambda: replies.put(None), indirect=False)
    client.session.get(key, handler, payload=payload, encoding=encoding, timeout=TIMEOUT, **options)
    while (reply := replies.get(timeout=TIMEOUT)) is not None:
        yield reply


def contents(replies):
    return [json.loads(bytes(reply.ok.payload)) for reply in replies]


def test_one_query_gets_feedback_and_then_the_result(client, served):
    client.settle()
    served.stepping.set()
    replies = list(ask(client, f"count?goal_id={GOAL_TEXT}", b'{"number": 2}', consolidation=NONE))
    assert {str(reply.ok.key_expr) for reply in replies} == {"count"}
    assert {str(reply.ok.encoding) for reply in replies} == {"application/json"}
    accepted, first, second, last = contents(replies)
    assert accepted["accepted"] is True
    assert accepted["goal_id"] == GOAL_TEXT
    assert first == {"feedback": {"number": 1}, "goal_id": GOAL_TEXT}
    assert second == {"feedback": {"number": 2}, "goal_id": GOAL_TEXT}
    assert last == {"status": SUCCEEDED, "result": {"reached": 2, "error_string": ""}, "goal_id": GOAL_TEXT}


def test_feedback_arrives_before_the_goal_ends(client, served):
    client.settle()
    replies = ask(client, "count", b'{"number": 2}', consolidation=NONE)
    assert "accepted" in json.loads(bytes(next(replies).ok.payload))
    # No step was taken yet.
    assert json.loads(bytes(next(replies).ok.payload))["feedback"] == {"number": 1}
    served.stepping.set()
    assert contents(replies)[-1]["result"]["reached"] == 2


def test_with_the_default_consolidation_the_only_reply_is_the_result(client, served):
    client.settle()
    served.stepping.set()
    (last,) = contents(ask(client, "count", b'{"number": 3}'))
    assert last["result"] == {"reached": 3, "error_string": ""}


def test_one_query_in_cdr_gets_the_messages_of_ros(client, served):
    client.settle()
    served.stepping.set()
    goal = Count.Goal(number=1).to_cdr()
    replies = list(ask(client, f"count?goal_id={GOAL_TEXT}", goal, "application/cdr", consolidation=NONE))
    kinds = [str(reply.ok.encoding).removeprefix("application/cdr;probe/action/Count_") for reply in replies]
    assert kinds == ["SendGoal_Response", "FeedbackMessage", "GetResult_Response"]
    accepted, fed_back, last = (bytes(reply.ok.payload) for reply in replies)
    assert Count.SendGoal.Response.from_cdr(accepted).accepted
    assert Count.FeedbackMessage.from_cdr(fed_back) == Count.FeedbackMessage(
        goal_id=GOAL_ID, feedback=Count.Feedback(number=1)
    )
    assert Count.GetResult.Response.from_cdr(last) == Count.GetResult.Response(
        status=SUCCEEDED, result=Count.Result(reached=1)
    )


@pytest.mark.parametrize(
    ("payload", "sentence"),
    [
        (b'{"number": -1}', "number is -1; it must not be negative"),
        (b'{"number": "x"}', "probe/action/Count_Goal: number must be an int64"),
        (b'{"steps": 1}', "probe/action/Count_Goal: unknown field 'steps'; known: number"),
        (b"\xff", "neither CDR nor a JSON object"),
    ],
)
def test_an_invalid_goal_gets_one_error_reply(client, served, payload, sentence):
    client.settle()
    (reply,) = ask(client, "count", payload, consolidation=NONE)
    assert sentence in reply.err.payload.to_string()


def test_a_wildcard_starts_no_goal(client, served):
    client.settle()
    # Other queryables reply too.
    texts = [reply.err.payload.to_string() for reply in ask(client, "*", None, consolidation=NONE) if reply.err]
    assert "count is an action; query exactly this key to call it" in texts
    assert served.counter.ended == []


@pytest.mark.parametrize("form", ["cdr", "json"])
def test_the_five_entities_are_on_plain_keys(client, served, form):
    suffix, encoding = ("", "application/cdr") if form == "cdr" else ("/@json", "application/json")

    def read(kind, payload):
        return kind.from_cdr(bytes(payload)) if form == "cdr" else kind.from_json(bytes(payload))

    def call(name, service, message):
        payload = message.to_cdr() if form == "cdr" else message.to_json()
        return read(service.Response, client.call(f"count/_action/{name}", payload, encoding=encoding).payload)

    feedback = client.listen(f"count/_action/feedback{suffix}")
    client.settle()
    sent = Count.SendGoal.Request(goal_id=GOAL_ID, goal=Count.Goal(number=2))
    assert call("send_goal", Count.SendGoal, sent).accepted
    served.stepping.set()
    result = call("get_result", Count.GetResult, Count.GetResult.Request(goal_id=GOAL_ID))
    assert result == Count.GetResult.Response(status=SUCCEEDED, result=Count.Result(reached=2))
    last = read(Count.FeedbackMessage, feedback.get(timeout=TIMEOUT).payload)
    while last.feedback.number < 2:
        last = read(Count.FeedbackMessage, feedback.get(timeout=TIMEOUT).payload)
    assert last.goal_id == GOAL_ID
    request = CancelGoal.Request(goal_info=GoalInfo(goal_id=GOAL_ID))
    assert call("cancel_goal", CancelGoal, request).return_code == CancelGoal.Response.ERROR_GOAL_TERMINATED


def test_a_late_subscriber_gets_the_states(client, served):
    client.settle()
    served.stepping.set()
    assert contents(ask(client, f"count?goal_id={GOAL_TEXT}", b'{"number": 1}'))[-1]["status"] == SUCCEEDED
    samples = queue.SimpleQueue()
    subscriber = zenoh.ext.declare_advanced_subscriber(
        client.session,
        "count/_action/status",
        zenoh.handlers.Callback(samples.put, indirect=False),
        history=zenoh.ext.HistoryConfig(detect_late_publishers=True, max_samples=1),
    )
    (state,) = GoalStatusArray.from_cdr(bytes(samples.get(timeout=TIMEOUT).payload)).status_list
    subscriber.undeclare()
    assert (state.goal_info.goal_id, state.status) == (GOAL_ID, SUCCEEDED)


def test_a_goal_of_one_query_is_cancelled_by_the_service(client, served):
    client.settle()
    served.stepping.set()
    replies = ask(client, f"count?goal_id={GOAL_TEXT}", b'{"number": 1000000}', consolidation=NONE)
    for _ in range(3):
        next(replies)
    response = client.call(f"count/_action/cancel_goal?goal_id={GOAL_TEXT}").json
    assert (response["return_code"], len(response["goals_canceling"])) == (0, 1)
    assert contents(replies)[-1]["status"] == CANCELED
    # The same in the message, as ROS 2 sends it.
    cancel = CancelGoal.Request(goal_info=GoalInfo(goal_id=GOAL_ID))
    response = client.call("count/_action/cancel_goal", cancel.to_json()).json
    assert response["return_code"] == CancelGoal.Response.ERROR_GOAL_TERMINATED
    for service in ("cancel_goal", "get_result"):
        answer = client.call(f"count/_action/{service}?goal_id=1")
        assert answer.text == "goal_id is '1'; it must be a UUID: 32 hexadecimal digits"


def test_a_client_that_leaves_does_not_end_its_goal(network, client_of, opened):
    served = opened(Served(network))
    leaving, other = client_of(network.session.endpoint), client_of(network.session.endpoint)
    leaving.settle()
    next(ask(leaving, f"count?goal_id={GOAL_TEXT}", b'{"number": 3}', consolidation=NONE))
    leaving.close()
    served.stepping.set()
    answer = other.call("count/_action/get_result", Count.GetResult.Request(goal_id=GOAL_ID).to_cdr())
    assert Count.GetResult.Response.from_cdr(answer.payload).result.reached == 3


def test_a_stopping_server_tells_the_clients_of_goals(client, served):
    client.settle()
    replies = ask(client, "count", b'{"number": 3}', consolidation=NONE)
    next(replies)
    served.world.loop.inbox.post(lambda: served.world.loop.scheduler.cancel("cancelled: the server is stopping"))
    last = contents(replies)[-1]
    assert last["status"] == ABORTED
    assert last["result"]["error_string"] == "cancelled: the server is stopping"


def test_the_list_of_interfaces_contains_the_action(client, served):
    listing = client.call("mjplug/interfaces").json
    (action,) = listing["actions"]
    assert (action["name"], action["key"], action["type"]) == ("/count", "count", "probe/action/Count")
    assert [entry["key"] for entry in action["services"]] == [
        "count/_action/send_goal",
        "count/_action/cancel_goal",
        "count/_action/get_result",
    ]
    assert [entry["type"] for entry in action["topics"]] == [
        "probe/action/Count_FeedbackMessage",
        "action_msgs/msg/GoalStatusArray",
    ]
    # Lists of topics and services show no parts of actions, as those of ros2.
    assert (listing["topics"], listing["services"]) == ([], [])
    described = client.call("mjplug/interfaces?schema=true").json["types"]["probe/action/Count"]
    assert set(described) == {"definition", "goal", "result", "feedback"}


def test_two_things_of_one_name_are_refused(network, served):
    with pytest.raises(WireError, match="the service /count/_action/send_goal already exists"):
        served.host.create_action(Count, "/count", served.counter.count)
    with pytest.raises(WireError, match="the service /count already exists"):
        served.host.create_service(Trigger, "/count", lambda request, call: Trigger.Response())


class TestRmwZenoh:
    """A bare Zenoh peer that sends what a node with rmw_zenoh sends."""

    @pytest.fixture
    def network(self, new_ros_network):
        return new_ros_network()

    def call(self, client, name, service, message):
        key = RosSettings().data_key(f"/count/_action/{name}", service)
        reply = request(client, key, message.to_cdr(), Attachment(3, 1, WHO).to_bytes())
        assert str(reply.ok.key_expr) == key
        assert Attachment.from_bytes(bytes(reply.ok.attachment)).sequence_number == 3
        return service.Response.from_cdr(bytes(reply.ok.payload))

    def test_an_action_has_the_five_tokens_of_rcl_action(self, client, served):
        client.settle()
        found = {}
        for token in tokens(client):
            chunks = token.split("/")
            if len(chunks) > 9 and chunks[9].startswith("%count"):
                found[chunks[9].rpartition("%")[2]] = chunks
        # The kind, the type as in DDS, and the quality of service.
        assert {name: (chunks[5], chunks[10], chunks[12]) for name, chunks in found.items()} == {
            "send_goal": ("SS", "probe::action::dds_::Count_SendGoal_", "::,10:,:,:,,"),
            "cancel_goal": ("SS", "action_msgs::srv::dds_::CancelGoal_", "::,10:,:,:,,"),
            "get_result": ("SS", "probe::action::dds_::Count_GetResult_", "::,10:,:,:,,"),
            "feedback": ("MP", "probe::action::dds_::Count_FeedbackMessage_", "::,10:,:,:,,"),
            "status": ("MP", "action_msgs::msg::dds_::GoalStatusArray_", ":1:,1:,:,:,,"),
        }
        assert found["status"][11] == "RIHS01_6c1684b00f177d37438febe6e709fc4e2b0d4248dca4854946f9ed8b30cda83e"
        assert found["cancel_goal"][11] == "RIHS01_573d8b0a534451d7bc2ac8c5ffde8ac14b8593b7001175d0cd6516dcbeb8689a"

    def test_a_ros_client_sends_a_goal_and_gets_feedback_states_and_result(self, client, served):
        settings = RosSettings()
        feedback = client.listen(settings.data_key("/count/_action/feedback", Count.FeedbackMessage))
        states = client.listen(settings.data_key("/count/_action/status", GoalStatusArray))
        client.settle()
        sent = Count.SendGoal.Request(goal_id=GOAL_ID, goal=Count.Goal(number=2))
        assert self.call(client, "send_goal", Count.SendGoal, sent).accepted
        served.stepping.set()
        result = self.call(client, "get_result", Count.GetResult, Count.GetResult.Request(goal_id=GOAL_ID))
        assert result == Count.GetResult.Response(status=SUCCEEDED, result=Count.Result(reached=2))
        seen = []
        while SUCCEEDED not in seen:
            sample = states.get(timeout=TIMEOUT)
            Attachment.from_bytes(bytes(sample.attachment))
            seen += [state.status for state in GoalStatusArray.from_cdr(bytes(sample.payload)).status_list]
        assert seen == [GoalStatus.STATUS_EXECUTING, SUCCEEDED]
        numbers = []
        while 2 not in numbers:
            sample = feedback.get(timeout=TIMEOUT)
            Attachment.from_bytes(bytes(sample.attachment))
            numbers.append(Count.FeedbackMessage.from_cdr(bytes(sample.payload)).feedback.number)
        assert numbers in ([1, 2], [2])

    def test_a_ros_client_cancels_its_goal(self, client, served):
        client.settle()
        sent = Count.SendGoal.Request(goal_id=GOAL_ID, goal=Count.Goal(number=10**9))
        assert self.call(client, "send_goal", Count.SendGoal, sent).accepted
        served.stepping.set()
        request = CancelGoal.Request(goal_info=GoalInfo(goal_id=GOAL_ID))
        response = self.call(client, "cancel_goal", CancelGoal, request)
        assert [info.goal_id for info in response.goals_canceling] == [GOAL_ID]
        result = self.call(client, "get_result", Count.GetResult, Count.GetResult.Request(goal_id=GOAL_ID))
        assert result.status == CANCELED

    def test_a_rejected_goal_and_an_unknown_one_get_typed_responses(self, client, served):
        client.settle()
        sent = Count.SendGoal.Request(goal_id=GOAL_ID, goal=Count.Goal(number=-1))
        assert not self.call(client, "send_goal", Count.SendGoal, sent).accepted
        result = self.call(client, "get_result", Count.GetResult, Count.GetResult.Request(goal_id=GOAL_ID))
        assert result.status == GoalStatus.STATUS_UNKNOWN
