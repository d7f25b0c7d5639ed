"""Settings of Zenoh's transmit queues: their size, and how long a message waits before it is dropped."""

import json

import zenoh

DROP_WAIT_US = 200
"""Maximum time for which a put waits for a full transmit queue before it drops the message [µs].

Zenoh's default of 1 ms is half a physics step. Without any wait, half of a burst of 200 messages is lost.
"""

WORKER_DROP_WAIT_US = 1_000_000
"""The same for a worker process, where waiting delays no physics: an image waits until the previous one has been sent,
which takes long on a busy machine.
"""

_QUEUE_BATCHES = 16
"""Size of a link's transmit queue, in batches of 64 kB; Zenoh's maximum. With Zenoh's default of 2, a link that has
just opened, or one on a busy machine, drops images.
"""

_BLOCK_TIMEOUT_US = 1_000_000
"""Maximum time for which a reply waits for a client that does not read, before Zenoh closes the link to it [µs].

Zenoh's default is 5 s; replies to other clients would wait as long.
"""

_QUEUE = "transport/link/tx/queue"


def tune(config: zenoh.Config, drop_wait: int) -> None:
    """Sets the queues of a session, except for values that its configuration file sets.

    Args:
        config: The session's configuration.
        drop_wait: `DROP_WAIT_US` or `WORKER_DROP_WAIT_US`.
    """
    default = zenoh.Config()
    whole = f"{_QUEUE}/congestion_control/drop/max_wait_before_drop_fragments"
    values = {
        f"{_QUEUE}/congestion_control/drop/wait_before_drop": drop_wait,
        # The limit for a message of several batches must not be below that for one batch.
        whole: max(drop_wait, json.loads(default.get_json(whole))),
        f"{_QUEUE}/congestion_control/block/wait_before_close": _BLOCK_TIMEOUT_US,
        f"{_QUEUE}/size/data": _QUEUE_BATCHES,
        f"{_QUEUE}/size/data_low": _QUEUE_BATCHES,
    }
    for key, value in values.items():
        if config.get_json(key) == default.get_json(key):
            config.insert_json5(key, json.dumps(value))
