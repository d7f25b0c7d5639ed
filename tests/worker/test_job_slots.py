"""Which state a process works on, and which waits; the process is a list."""

import numpy as np
import pytest

from mjplug.worker.job_slots import JobSlots


class Process:
    """Keeps what it is asked, with the state as it is at that moment."""

    def __init__(self, slots):
        self.slots = slots
        self.asked = []
        self.gone = False

    def __call__(self, slot, job):
        if not self.gone:
            self.asked.append((job.time_ns, set(job.tasks), self.slots[slot][0]))
            self.slot = slot
        return not self.gone


class World:
    def __init__(self):
        self.slots = np.zeros((2, 1))
        self.state = 0.0
        self.handover = JobSlots(self.slots, self._take)
        self.process = Process(self.slots)

    def _take(self, out):
        out[0] = self.state

    def put(self, state, *tasks):
        self.state = state
        return self.handover.put(int(state), 0, frozenset(tasks))


@pytest.fixture
def world():
    return World()


def test_a_process_that_waits_is_asked_at_once(world):
    world.handover.connect(world.process)
    world.put(1, "a")
    assert world.process.asked == [(1, {"a"}, 1.0)]


def test_states_wait_for_a_process_and_the_newest_counts(world):
    for state in (1, 2, 3):
        world.put(state, "a")
    world.handover.connect(world.process)
    assert world.process.asked == [(3, {"a"}, 3.0)]
    assert world.handover.dropped == {"a": 2}


def test_a_busy_process_keeps_its_state_while_newer_ones_wait(world):
    world.handover.connect(world.process)
    world.put(1, "a")
    for state in (2, 3):
        world.put(state, "a")
        assert world.slots[world.process.slot][0] == 1.0
    done = world.handover.finish()
    assert (done.time_ns, done.tasks) == (1, {"a"})
    assert world.process.asked[1:] == [(3, {"a"}, 3.0)]
    world.put(4, "a")
    assert world.slots[world.process.slot][0] == 3.0


def test_waiting_tasks_are_merged_and_only_those_in_both_are_dropped(world):
    world.handover.connect(world.process)
    world.put(1, "a")
    world.put(2, "a", "b")
    world.put(3, "b", "c")
    assert world.handover.dropped == {"b": 1}
    world.handover.finish()
    assert world.process.asked[1:] == [(3, {"a", "b", "c"}, 3.0)]


def test_a_process_that_cannot_be_notified_loses_nothing(world):
    world.handover.connect(world.process)
    world.process.gone = True
    world.put(1, "a")
    assert world.handover.disconnect(keep_waiting=True) == set()
    heir = Process(world.slots)
    world.handover.connect(heir)
    assert heir.asked == [(1, {"a"}, 1.0)]


def test_what_is_under_way_is_lost_with_the_process_and_what_waits_is_kept(world):
    world.handover.connect(world.process)
    world.put(1, "a")
    world.put(2, "b")
    assert world.handover.disconnect(keep_waiting=True) == {"a"}
    assert world.handover.finish() is None
    world.handover.connect(world.process)
    assert world.process.asked[1:] == [(2, {"b"}, 2.0)]


def test_after_the_end_nothing_is_taken_any_more(world):
    world.handover.connect(world.process)
    world.put(1, "a")
    world.put(2, "b")
    assert world.handover.close() == {"a", "b"}
    assert not world.put(3, "a")
    world.handover.connect(world.process)
    assert len(world.process.asked) == 1


def test_everything_is_settled_when_nothing_waits_and_nothing_is_under_way(world):
    assert world.handover.settled
    world.put(1, "a")
    assert not world.handover.settled
    world.handover.connect(world.process)
    world.put(2, "a")
    world.handover.finish()
    assert not world.handover.settled
    world.handover.finish()
    assert world.handover.settled
    world.put(3, "a")
    world.handover.disconnect(keep_waiting=True)
    assert world.handover.settled
    world.put(4, "a")
    world.handover.close()
    assert world.handover.settled
