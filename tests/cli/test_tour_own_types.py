"""Topics and services of types that only the server has a class for: they are read and written as JSON."""

import json

import pytest
import yaml

from mjplug.client import RequestRefused, WrongTypeError, connect


def test_messages_of_an_unknown_type_are_shown(tour):
    tour.ask("service", "call", "/thermometer/calibrate", "{offset: 20.5}")
    assert tour.ask("topic", "type", "/thermometer/reading") == "tour_msgs/msg/Reading\n"
    reading = {"value": 20.5, "label": "warm", "history": [1.0, 2.0]}
    assert yaml.safe_load(tour.ask("topic", "echo", "/thermometer/reading", "--once").removesuffix("---\n")) == reading
    assert json.loads(tour.ask("topic", "echo", "/thermometer/reading", "--once", "-o", "json")) == reading
    assert tour.ask("topic", "echo", "/thermometer/reading", "--once", "--field", "history[1]") == "2.0\n---\n"
    assert tour.ask("topic", "echo", "/thermometer/reading", "--once", "--csv").splitlines() == [
        "value,label,history[0],history[1]",
        "20.5,warm,1.0,2.0",
    ]
    assert "this message has no 'heat' there" in tour.fail(
        2, "topic", "echo", "/thermometer/reading", "--once", "--field", "heat"
    )


def test_services_of_an_unknown_type_are_called(tour):
    assert tour.ask("service", "call", "/thermometer/calibrate", "{offset: 3}") == "message: offset 3.0\n"
    said = tour.fail(7, "service", "call", "/thermometer/calibrate", "{offset: -1}")
    assert said == "error: /thermometer/calibrate refused: an offset is not negative\n"
    assert "unknown field 'offst', did you mean 'offset'?" in tour.fail(
        7, "service", "call", "/thermometer/calibrate", "{offst: 1}"
    )


def test_messages_of_an_unknown_type_are_published(tour):
    tour.ask("topic", "pub", "--once", "/thermometer/simulated", "{value: 7}")
    with connect(tour.endpoint) as client, client.subscribe("/thermometer/reading", dict) as readings:
        while readings.next(10.0)["value"] != 7.0:
            pass
        client.publish("/thermometer/simulated", {"value": 8})
        while readings.next(10.0)["value"] != 8.0:
            pass


def test_the_client_says_what_to_do_about_an_unknown_type(tour):
    with connect(tour.endpoint) as client:
        with pytest.raises(WrongTypeError, match=r"unknown type 'tour_msgs/msg/Reading'.*; use `dict` to read it"):
            client.subscribe("/thermometer/reading")
        with pytest.raises(RequestRefused, match="an offset is not negative"):
            client.call("/thermometer/calibrate", offset=-1.0)
        assert client.call("/thermometer/calibrate", offset=1.0) == {"message": "offset 1.0"}
