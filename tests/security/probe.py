"""Tries a server's doors in a process of its own, as somebody, and prints what happened as JSON.

python -m security.probe FILE ENDPOINT look KEY…      waits until each of the keys was heard
python -m security.probe FILE ENDPOINT attack         calls every service, publishes to every topic
python -m security.probe FILE ENDPOINT knock          counts what comes in without being asked for
"""

import json
import sys
import time

import zenoh
from security.conftest import Client
from waits import TIMEOUT

from mjplug_schemas import registry

ATTACHMENT = (1).to_bytes(8, "little") * 2 + b"\x10" + bytes(16)
"""As rmw_zenoh puts it on every message."""


def look(client, keys):
    heard = {key: client.listen(key) for key in keys}
    return {key: len(samples.get(timeout=TIMEOUT).payload.to_bytes()) for key, samples in heard.items()}


def attack(client):
    """Sends what would work: the default request to each service, the default message to each topic."""
    (listing,) = (json.loads(answer) for answer in client.ask("mjplug/interfaces"))
    answered = {}
    for service in listing["services"]:
        request = registry.find(service["type"]).Request()
        plain = client.ask(service["key"], payload=request.to_cdr(), encoding="application/cdr")
        text = client.ask(service["key"], payload=request.to_json(), encoding="application/json")
        ros = client.ask(
            service["ros2_key"],
            payload=request.to_cdr(),
            attachment=ATTACHMENT,
            target=zenoh.QueryTarget.ALL_COMPLETE,
        )
        answered[service["name"]] = len(plain) + len(text) + len(ros)
    for topic in listing["topics"]:
        message = registry.find(topic["type"])()
        for key, payload in (
            (topic["key"], message.to_cdr()),
            (topic["json_key"], message.to_json()),
            (topic["ros2_key"], message.to_cdr()),
        ):
            block = zenoh.CongestionControl.BLOCK
            client.session.put(key, payload, attachment=ATTACHMENT, congestion_control=block)
    client.settle()
    return {"answered": answered, "topics": {topic["name"]: topic["direction"] for topic in listing["topics"]}}


def knock(file, endpoint):
    try:
        client = Client(file, endpoint, patience_ms=2000)
    except zenoh.ZError:
        return {"connected": False, "bytes": 0}
    heard = [client.listen(key) for key in ("**", "**/@json", "**/@adv/**", "**/@view/**")]
    time.sleep(2.0)
    size = sum(len(samples.get().payload.to_bytes()) for samples in heard for _ in range(samples.qsize()))
    answers = sum(len(answer) for answer in client.ask("mjplug/interfaces", timeout=2.0))
    return {"connected": True, "bytes": size + answers}


def main(file, endpoint, what, *keys):
    if what == "knock":
        print(json.dumps(knock(file, endpoint)))
        return
    client = Client(file, endpoint)
    try:
        print(json.dumps(look(client, keys) if what == "look" else attack(client)))
    finally:
        client.close()


if __name__ == "__main__":
    main(*sys.argv[1:])
