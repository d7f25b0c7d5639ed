"""Topics whose readers in ROS are slower than the messages arrive."""

import threading

import pytest

PATIENCE = 20.0


class SlowReader:
    """Handles a message only when the test lets it."""

    def __init__(self):
        self.handled = []
        self.entered = threading.Semaphore(0)
        self.leave = threading.Semaphore(0)

    def handle(self, message):
        self.handled.append(message)
        self.entered.release()
        assert self.leave.acquire(timeout=PATIENCE)


@pytest.mark.parametrize(("depth", "kept"), [(1, [99]), (3, [97, 98, 99]), (0, [99]), (1000, list(range(1, 100)))])
def test_of_the_messages_that_wait_the_newest_are_kept(depth, kept):
    from mjplug_bridge_ros2.newest import Newest

    reader = SlowReader()
    newest = Newest(reader.handle, depth)
    newest.add(0)
    assert reader.entered.acquire(timeout=PATIENCE)
    for number in range(1, 100):
        newest.add(number)
    for _ in kept:
        reader.leave.release()
        assert reader.entered.acquire(timeout=PATIENCE)
    reader.leave.release()
    assert reader.handled == [0, *kept]
    newest.add(100)
    assert reader.entered.acquire(timeout=PATIENCE)
    reader.leave.release()
    newest.close()
    assert reader.handled[-1] == 100


def test_nothing_is_handled_after_the_end():
    from mjplug_bridge_ros2.newest import Newest

    reader = SlowReader()
    newest = Newest(reader.handle, 10)
    for number in range(5):
        newest.add(number)
    assert reader.entered.acquire(timeout=PATIENCE)
    newest.close()
    newest.close()
    newest.add(5)
    reader.leave.release()
    assert not reader.entered.acquire(timeout=0.2)
    assert reader.handled == [0]
