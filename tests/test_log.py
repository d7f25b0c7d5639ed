"""What the log makes of text that other programs chose."""

import io
import logging
import sys

import pytest

from mjplug.config.problem import Mark, Problem, Source
from mjplug.log import PrintableQueueHandler, logging_to_stderr
from mjplug.log_scope import LogScope, receive
from mjplug.printable import lines, one_line

HOSTILE = "z\x1b[31m\r\n12:00:00 FORGED\x9b\u202etxt\u2028\x07\x7f\ud800"
ESCAPED = r"z\x1b[31m\r\n12:00:00 FORGED\x9b\u202etxt\u2028\x07\x7f\ud800"


def logged(monkeypatch, act):
    stream = io.StringIO()
    monkeypatch.setattr(sys, "stderr", stream)
    with logging_to_stderr(0):
        act(logging.getLogger("mjplug.wire"))
    return stream.getvalue()


def test_a_message_is_one_line_without_control_characters(monkeypatch):
    text = logged(monkeypatch, lambda log: log.warning("token %s", HOSTILE))
    assert text[9:] == f"warning: token {ESCAPED}\n"


def test_letters_of_all_scripts_stay_as_they_are():
    text = "Grüße, 機械 🤖 naïve — 5 °C"
    assert one_line(text) == text
    assert one_line("") == ""
    assert one_line("a\tb\xa0c") == r"a\tb\xa0c"


def test_a_traceback_keeps_its_lines_and_none_of_them_looks_like_a_log_line(monkeypatch):
    def fail(log):
        try:
            raise ValueError(HOSTILE)
        except ValueError:
            log.exception("it failed: %s", HOSTILE)

    first, *rest, last = logged(monkeypatch, fail).splitlines()
    assert first[9:] == f"error: it failed: {ESCAPED}"
    assert rest[0] == "    Traceback (most recent call last):"
    assert all(line.startswith("    ") for line in [*rest, last])
    assert last.endswith(r"12:00:00 FORGED\x9b\u202etxt\u2028\x07\x7f\ud800")


def test_what_a_worker_process_escaped_is_not_escaped_again(monkeypatch):
    def forward(log):
        try:
            raise ValueError(HOSTILE)
        except ValueError:
            record = log.makeRecord("mjplug.wire", logging.ERROR, "", 0, "bad", (), sys.exc_info())
        log.handle(PrintableQueueHandler(None).prepare(record))

    text = logged(monkeypatch, forward)
    assert "bad\n    Traceback" in text
    assert "\\\\" not in text
    assert "FORGED" not in {line.lstrip()[:6] for line in text.splitlines()}


@pytest.mark.parametrize("text", ["one", "one\ntwo", "a\tb", "\n", f"x\n{HOSTILE}"])
def test_further_lines_are_indented(text):
    first, *rest = lines(text).split("\n")
    assert "\x1b" not in lines(text)
    assert all(line.startswith("    ") for line in rest)
    assert not first.startswith(" ") or text.startswith(" ")


def test_a_problem_of_the_configuration_escapes_the_name_of_its_file():
    problem = Problem("no such key 'a\nb'", Mark(Source("a\x1b[2J\nFORGED.yaml"), 0, 0), hint="x\x1b")
    assert str(problem) == "a\\x1b[2J\\nFORGED.yaml: error: no such key 'a\n    b'; x\\x1b"


def test_lines_of_a_server_are_logged_where_python_takes_the_lock_of_a_handler_without_asking(monkeypatch):
    def handle(handler, record):
        """As `logging.Handler.handle` from Python 3.13 on."""
        with handler.lock:
            handler.emit(record)
        return record

    monkeypatch.setattr(logging.Handler, "handle", handle)
    heard = []
    handler = logging.Handler()
    handler.emit = heard.append
    with LogScope().active():
        end = receive(handler, ["mjplug"])
        logging.getLogger("mjplug.wire").warning("a line")
        end()
    assert [record.getMessage() for record in heard] == ["a line"]
