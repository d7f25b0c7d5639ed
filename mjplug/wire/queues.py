"""What may wait for a link of Zenoh, and how long, before it is dropped."""

import json

import zenoh

DROP_WAIT_US = 200
"""How long a put may wait for a full transmit queue before it drops the message [µs].

Zenoh's default of 1 ms is half a physics step; with no wait at all, half of a burst of 200 messages is lost.
"""

WORKER_DROP_WAIT_US = 1_000_000
"""The same for a worker process, which holds up nobody: an image may wait until the one before it has left, which takes
long on a machine with much else to do.
"""

_BATCHES = 16
"""How many batches of 64 kB may wait for a link; Zenoh's most. Its default of 2 makes a link that has just been opened,
or one on a busy machine, drop images.
"""

_BLOCKED_US = 1_000_000
"""How long a reply may wait for a client that does not read, before Zenoh closes the link to it [µs].

Zenoh's default is 5 s, in which answers to others would wait too.
"""

_QUEUE = "transport/link/tx/queue"


def tune(config: zenoh.Config, drop_wait: int) -> None:
    """Sets the queues of a session, where its configuration file does not.

    Args:
        config: The session's configuration.
        drop_wait: `DROP_WAIT_US` or `WORKER_DROP_WAIT_US`.
    """
    default = zenoh.Config()
    whole = f"{_QUEUE}/congestion_control/drop/max_wait_before_drop_fragments"
    ours = {
        f"{_QUEUE}/congestion_control/drop/wait_before_drop": drop_wait,
        # The bound for a message of several batches, which cannot be below that for one.
        whole: max(drop_wait, json.loads(default.get_json(whole))),
        f"{_QUEUE}/congestion_control/block/wait_before_close": _BLOCKED_US,
        f"{_QUEUE}/size/data": _BATCHES,
        f"{_QUEUE}/size/data_low": _BATCHES,
    }
    for key, value in ours.items():
        if config.get_json(key) == default.get_json(key):
            config.insert_json5(key, json.dumps(value))
