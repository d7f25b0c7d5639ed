"""The pytest plugin `mjplug`: the fixture `mjplug_server`.

pytest loads it in every run where mjplug is installed, so it imports nothing of mjplug before a test uses the fixture.
`-p no:mjplug` switches it off.
"""

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from mjplug import RunningServer


@pytest.fixture
def mjplug_server() -> "Iterator[Callable[..., RunningServer]]":
    """Opens servers with the arguments of `mjplug.open_server`, and stops them at the end of the test.

    Environment variables such as `MJPLUG_SIM__SPEED` are ignored, unless `environ` is given.

        def test_the_box_stands_still(mjplug_server):
            server = mjplug_server("bundled:box", run=False)
            server.step(100)
            assert server.data.qvel[0] == 0.0

    If a server fails and the test has not caught the error, the test fails.
    """
    with ExitStack() as servers:

        def open_one(config: Any, **options: Any) -> "RunningServer":
            from mjplug import open_server  # noqa: PLC0415

            return servers.enter_context(open_server(config, **{"environ": {}, **options}))

        yield open_one
