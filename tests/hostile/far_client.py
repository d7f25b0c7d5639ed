"""A client on another machine: `far_client.py ENDPOINT CONFIG`. Commands come by lines of its input.

`call` calls a service, `clock` waits for a message on /clock that comes from now on; each prints one line.
"""

import sys

from mjplug.client import ClientError, connect

with connect(sys.argv[1], timeout=60.0, config=sys.argv[2]) as client:
    clock = client.subscribe("/clock", depth=1)
    print("connected", flush=True)
    for line in sys.stdin:
        try:
            if line.strip() == "call":
                print(client.call("/mjplug/set_pause", paused=False, check=False, timeout=2.0).message, flush=True)
            else:
                clock.latest()
                for _ in range(3):
                    clock.next(2.0)
                print("clock", flush=True)
        except ClientError as error:
            print(f"failed: {error}".splitlines()[0], flush=True)
