"""Ctrl-C while MuJoCo's viewer is open."""

import signal
import threading

import pytest

from mjplug.window.interrupt import DelayedInterrupt


def test_ctrl_c_is_noted_and_raised_at_the_end_of_the_block():
    reached = []
    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt), DelayedInterrupt() as interrupt:  # noqa: PT012
        assert not interrupt.requested
        signal.raise_signal(signal.SIGINT)
        assert interrupt.requested
        reached.append("end")
    assert reached == ["end"]
    assert signal.getsignal(signal.SIGINT) is before


def test_a_second_ctrl_c_is_raised_at_once():
    with pytest.raises(KeyboardInterrupt), DelayedInterrupt():  # noqa: PT012
        signal.raise_signal(signal.SIGINT)
        signal.raise_signal(signal.SIGINT)
        pytest.fail("not reached")


def test_an_error_in_the_block_is_not_replaced():
    with pytest.raises(ValueError, match="broken"), DelayedInterrupt():  # noqa: PT012
        signal.raise_signal(signal.SIGINT)
        raise ValueError("broken")


def test_on_another_thread_nothing_is_installed():
    seen = []

    def run():
        with DelayedInterrupt() as interrupt:
            seen.append((interrupt.requested, signal.getsignal(signal.SIGINT)))

    thread = threading.Thread(target=run)
    thread.start()
    thread.join()
    assert seen == [(False, signal.getsignal(signal.SIGINT))]
