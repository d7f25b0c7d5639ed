"""Actions of plugins: acceptance, feedback, results, cancellation, and what ends goals from outside."""

import threading
import uuid

import pytest
from counting import Count, Counter

from mjplug.plugin import Event, PluginError, RequestError
from mjplug.plugin.action_server import MAX_GOALS, MAX_LISTED, MAX_RESULTS, RESULT_TIMEOUT
from mjplug.testing import World
from mjplug_schemas.action_msgs import CancelGoal, GoalInfo, GoalStatus
from mjplug_schemas.builtin_interfaces import Time
from mjplug_schemas.unique_identifier_msgs import UUID

NAME = "/test/count"
SUCCEEDED, CANCELED, ABORTED = GoalStatus.STATUS_SUCCEEDED, GoalStatus.STATUS_CANCELED, GoalStatus.STATUS_ABORTED
EXECUTING, CANCELING = GoalStatus.STATUS_EXECUTING, GoalStatus.STATUS_CANCELING
NONE, UNKNOWN = CancelGoal.Response.ERROR_NONE, CancelGoal.Response.ERROR_UNKNOWN_GOAL_ID
TERMINATED = CancelGoal.Response.ERROR_GOAL_TERMINATED


@pytest.fixture
def world():
    return World("bundled:box")


@pytest.fixture
def counter(world):
    host = world.host()
    counter = Counter(host)
    host.create_action(Count, "count", counter.count)
    return counter


def offer(world, handler, **options):
    host = world.host()
    return host, host.create_action(Count, "count", handler, **options)


def identifier(number):
    return UUID(uuid=number.to_bytes(16, "big"))


def send(world, number, goal_id):
    """Sends a goal to the service; returns the response."""
    request = Count.SendGoal.Request(goal_id=identifier(goal_id), goal=Count.Goal(number=number))
    return world.call(f"{NAME}/_action/send_goal", request).response


def result_of(world, goal_id):
    return world.call(f"{NAME}/_action/get_result", Count.GetResult.Request(goal_id=identifier(goal_id)))


def cancel(world, goal_id=0, stamp=None):
    info = GoalInfo(goal_id=identifier(goal_id), stamp=stamp or Time())
    return world.call(f"{NAME}/_action/cancel_goal", CancelGoal.Request(goal_info=info)).response


def states(world):
    """The last published states, by the number in the identifier."""
    latest = world.published(f"{NAME}/_action/status")[-1]
    return {int.from_bytes(one.goal_info.goal_id.uuid, "big"): one.status for one in latest.status_list}


def numbers(goal):
    return [feedback.number for feedback in goal.fed_back]


def test_a_goal_gets_feedback_and_then_its_result(world, counter):
    goal = world.send_goal(NAME, Count.Goal(number=3))
    assert numbers(goal) == [1]
    world.step(2)
    assert numbers(goal) == [1, 2, 3]
    assert not goal.ended
    world.step(1)
    assert (goal.status, goal.result) == (SUCCEEDED, Count.Result(reached=3))
    assert counter.ended == [goal.id]


def test_a_goal_without_a_wait_ends_at_once(world, counter):
    goal = world.send_goal(NAME, Count.Goal(number=0))
    assert (goal.status, goal.result, goal.fed_back) == (SUCCEEDED, Count.Result(), [])
    assert list(states(world).values()) == [SUCCEEDED]


def test_a_handler_may_be_a_function(world):
    offer(world, lambda request, goal: Count.Result(reached=request.number))
    goal = world.send_goal(NAME, Count.Goal(number=7))
    assert (goal.status, goal.result.reached) == (SUCCEEDED, 7)


def test_the_five_entities_serve_a_goal_as_ros_does(world, counter):
    world.step(5)
    stamp = Time.from_ns(world.time_ns)
    assert send(world, 2, goal_id=1) == Count.SendGoal.Response(accepted=True, stamp=stamp)
    assert states(world) == {1: EXECUTING}
    waiting = result_of(world, 1)
    assert not waiting.answered
    world.step(2)
    assert waiting.response == Count.GetResult.Response(status=SUCCEEDED, result=Count.Result(reached=2))
    assert states(world) == {1: SUCCEEDED}
    fed_back = world.published(f"{NAME}/_action/feedback")
    assert fed_back == [
        Count.FeedbackMessage(goal_id=identifier(1), feedback=Count.Feedback(number=number)) for number in (1, 2)
    ]
    # A client that asks late gets the same result.
    assert result_of(world, 1).response == waiting.response


def test_the_topics_have_the_qos_of_ros(world, counter):
    feedback, status = (world.transport.qos[f"{NAME}/_action/{topic}"] for topic in ("feedback", "status"))
    assert (feedback.reliability, feedback.durability, feedback.depth) == ("reliable", "volatile", 10)
    assert (status.reliability, status.durability, status.depth) == ("reliable", "transient_local", 1)


def test_feedback_without_a_reader_is_not_published(world, counter):
    world.transport.publishers[f"{NAME}/_action/feedback"].matched = False
    send(world, 2, goal_id=1)
    world.step(2)
    assert world.published(f"{NAME}/_action/feedback") == []


def test_a_rejected_goal_leaves_no_trace(world, counter):
    goal = world.send_goal(NAME, Count.Goal(number=-1))
    assert goal.refusal == "number is -1; it must not be negative"
    assert send(world, -1, goal_id=1) == Count.SendGoal.Response(accepted=False)
    assert result_of(world, 1).response.status == 0
    assert world.published(f"{NAME}/_action/status") == []
    # The identifier is free again.
    assert send(world, 1, goal_id=1).accepted


def test_an_identifier_is_accepted_once(world, counter):
    assert send(world, 1, goal_id=1).accepted
    assert not send(world, 1, goal_id=1).accepted
    world.step(1)
    assert not send(world, 1, goal_id=1).accepted
    assert not send(world, 1, goal_id=0).accepted


@pytest.mark.parametrize("text", ["", "x", "123", "0" * 33])
def test_an_identifier_that_is_no_uuid_is_refused(world, counter, text):
    goal = world.send_goal(NAME, Count.Goal(number=1), goal_id=text)
    assert goal.refusal == f"goal_id is {text!r}; it must be a UUID: 32 hexadecimal digits"


def test_a_client_may_choose_the_identifier_in_the_selector(world, counter):
    chosen = uuid.uuid4()
    goal = world.send_goal(NAME, Count.Goal(number=1), goal_id=str(chosen))
    assert goal.id == chosen.bytes


def test_a_cancelled_goal_ends_at_once_and_its_handler_cleans_up(world, counter):
    goal = world.send_goal(NAME, Count.Goal(number=100))
    world.step(3)
    response = world.cancel_goal(NAME, goal).response
    assert response.return_code == NONE
    assert [info.goal_id.uuid for info in response.goals_canceling] == [goal.id]
    assert (goal.status, goal.result) == (CANCELED, Count.Result())
    assert counter.ended == [goal.id]
    world.step(5)
    assert len(goal.fed_back) == 4


def test_a_handler_may_choose_the_result_of_a_cancelled_goal_and_take_time(world):
    counter = Counter(world.host())
    offer(world, counter.count_and_report)
    goal = world.send_goal(NAME, Count.Goal(number=100))
    world.step(3)
    world.cancel_goal(NAME, goal)
    assert list(states(world).values()) == [CANCELING]
    # A second request changes nothing.
    assert world.cancel_goal(NAME, goal).response.return_code == NONE
    world.step(1)
    assert not goal.ended
    world.step(1)
    assert (goal.status, goal.result) == (CANCELED, Count.Result(reached=3, error_string="cancelled"))
    published = [message.status_list[0].status for message in world.published(f"{NAME}/_action/status")]
    assert published == [EXECUTING, CANCELING, CANCELED]


def test_the_wait_of_a_cancelled_goal_does_not_come_back(world):
    """A handler that catches the cancellation must not be resumed at the step that it waited for before."""
    steps = []

    def handler(request, goal):
        try:
            yield host.step + 10
        except Exception:
            yield host.step + 100
            steps.append(host.step)
        return Count.Result()

    host, _ = offer(world, handler)
    goal = world.send_goal(NAME)
    world.step(5)
    world.cancel_goal(NAME, goal)
    world.step(200)
    assert steps == [105]


def test_goals_that_ended_or_are_unknown_cannot_be_cancelled(world, counter):
    assert cancel(world, 9).return_code == UNKNOWN
    send(world, 0, goal_id=1)
    assert cancel(world, 1).return_code == TERMINATED
    assert cancel(world, 1).goals_canceling == ()


def test_goals_are_cancelled_by_their_stamps(world, counter):
    stamps = {}
    for goal_id in (1, 2, 3):
        stamps[goal_id] = send(world, 1000, goal_id).stamp
        world.step(1)
    response = cancel(world, stamp=stamps[2])
    assert response.return_code == NONE
    assert states(world) == {1: CANCELED, 2: CANCELED, 3: EXECUTING}
    send(world, 1000, goal_id=4)
    # This goal, and all that were accepted at or before the stamp: none is left.
    assert len(cancel(world, 4, stamp=stamps[2]).goals_canceling) == 1
    assert states(world)[4] == CANCELED
    assert len(cancel(world).goals_canceling) == 1
    assert states(world) == {1: CANCELED, 2: CANCELED, 3: CANCELED, 4: CANCELED}
    assert cancel(world) == CancelGoal.Response()


def test_a_reset_aborts_the_goals_with_its_reason(world, counter):
    goal = world.send_goal(NAME, Count.Goal(number=100))
    send(world, 100, goal_id=1)
    waiting = result_of(world, 1)
    world.reset()
    assert (goal.status, goal.result.error_string) == (ABORTED, "cancelled: the world was reset")
    assert waiting.response.status == ABORTED
    assert len(counter.ended) == 2
    # The action works on.
    assert send(world, 0, goal_id=2).accepted


def test_a_restored_state_aborts_the_goals(world, counter):
    state = world.save()
    goal = world.send_goal(NAME, Count.Goal(number=100))
    world.restore(state)
    assert (goal.status, goal.result.error_string) == (ABORTED, "cancelled: a state was restored")


def test_the_plugin_may_make_the_result_of_an_aborted_goal(world):
    count = Counter(world.host()).count
    offer(world, count, on_abort=lambda reason: Count.Result(reached=-1, error_string=reason[:9]))
    goal = world.send_goal(NAME, Count.Goal(number=100))
    world.reset()
    assert goal.result == Count.Result(reached=-1, error_string="cancelled")


def test_a_failing_handler_aborts_its_goal(world):
    def handler(request, goal):
        yield host.step + 1
        raise ZeroDivisionError("by test")

    host, _ = offer(world, handler)
    goal = world.send_goal(NAME)
    world.step(1)
    assert (goal.status, goal.result.error_string) == (ABORTED, "internal error: ZeroDivisionError('by test')")


def test_a_refusal_after_a_wait_aborts_the_goal(world):
    def handler(request, goal):
        yield host.step + 1
        raise RequestError("the arm is stuck")

    host, _ = offer(world, handler)
    goal = world.send_goal(NAME)
    world.step(1)
    assert (goal.status, goal.result.error_string) == (ABORTED, "the arm is stuck")


def test_a_handler_may_choose_the_outcome(world):
    def handler(request, goal):
        yield host.step + 1
        return goal.aborted(Count.Result(reached=5))

    host, _ = offer(world, handler)
    goal = world.send_goal(NAME)
    world.step(1)
    assert (goal.status, goal.result) == (ABORTED, Count.Result(reached=5))


def test_one_goal_may_end_another(world):
    """As joint_trajectory_controller does: a new goal replaces the old one."""
    current = []

    def handler(request, goal):
        for replaced in current:
            replaced.set()
        event = Event()
        current[:] = [event]
        yield event
        return goal.aborted(Count.Result(error_string="replaced"))

    offer(world, handler)
    first, second = (world.send_goal(NAME) for _ in range(2))
    assert (first.status, first.result.error_string) == (ABORTED, "replaced")
    assert not second.ended


def test_a_result_of_the_wrong_type_aborts_the_goal(world):
    def handler(request, goal):
        yield host.step + 1
        return Count.Feedback()

    host, _ = offer(world, handler)
    goal = world.send_goal(NAME)
    world.step(1)
    assert goal.status == ABORTED
    assert "expected a probe/action/Count_Result, not Feedback" in goal.result.error_string


def test_feedback_of_the_wrong_type_is_refused(world):
    def handler(request, goal):
        goal.feedback(Count.Result())
        return Count.Result()

    offer(world, handler)
    assert "expected a probe/action/Count_Feedback, not Result" in world.send_goal(NAME).refusal


def test_too_many_goals_are_rejected(world, counter):
    for goal_id in range(1, MAX_GOALS + 1):
        assert send(world, 10, goal_id).accepted
    goal = world.send_goal(NAME, Count.Goal(number=10))
    assert goal.refusal == "busy: 64 goals are under way, which is the maximum; try again later"
    world.step(10)
    assert send(world, 10, MAX_GOALS + 1).accepted


def test_old_results_are_forgotten(world, counter):
    for goal_id in range(1, MAX_RESULTS + 3):
        send(world, 0, goal_id)
    assert result_of(world, 2).response.status == 0
    assert result_of(world, 3).response.status == SUCCEEDED
    # Only the last of them are listed.
    assert list(states(world)) == list(range(MAX_RESULTS + 3 - MAX_LISTED, MAX_RESULTS + 3))


def test_results_are_kept_for_ten_seconds_of_wall_time(world, counter, monkeypatch):
    now = [100.0]
    monkeypatch.setattr("mjplug.plugin.action_server.perf_counter", lambda: now[0])
    send(world, 0, goal_id=1)
    for callback in world.loop.on_second:
        callback(now[0] + RESULT_TIMEOUT - 0.1)
    assert result_of(world, 1).response.status == SUCCEEDED
    for callback in world.loop.on_second:
        callback(now[0] + RESULT_TIMEOUT)
    assert result_of(world, 1).response.status == 0
    assert send(world, 0, goal_id=1).accepted


def test_a_disabled_plugin_accepts_no_goals(world):
    host = world.host(disable_on_error=True)
    counter = Counter(host)
    host.create_action(Count, "count", counter.count)
    host.create_timer(1e-9, lambda: 1 / 0)
    goal = world.send_goal(NAME, Count.Goal(number=100))
    world.step(1)
    assert goal.status == ABORTED
    assert "ZeroDivisionError" in goal.result.error_string
    assert "was disabled" in world.send_goal(NAME, Count.Goal(number=1)).refusal


def test_a_name_that_breaks_the_rules_of_ros_is_refused(world):
    with pytest.raises(PluginError, match="is not a valid ROS name"):
        world.host().create_action(Count, "a b", lambda request, goal: Count.Result())


def test_a_goal_is_prepared_on_the_thread_of_the_transport(world):
    threads = []

    def prepare(request):
        threads.append(threading.current_thread())
        if request.number < 0:
            raise RequestError("negative")
        return 10 * request.number

    offer(world, lambda prepared, goal: Count.Result(reached=prepared), prepare=prepare)
    sender = threading.Thread(target=lambda: goals.append(world.transport.send_goal(NAME, Count.Goal(number=4))))
    goals = []
    sender.start()
    sender.join()
    world.step(0)
    assert (threads, goals[0].result.reached) == ([sender], 40)
    assert world.send_goal(NAME, Count.Goal(number=-4)).refusal == "negative"
    assert not send(world, -4, goal_id=1).accepted
