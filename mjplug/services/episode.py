"""The selector's parameter `episode` of `~/reset_world` and `~/restore_state`."""

from collections.abc import Mapping

from mjplug.errors import RequestError, quoted

MAX_EPISODE = 2**62
"""Numbers of episodes are below this, so that resets can be counted from there."""

_MAX_DIGITS = 19


def episode_in(parameters: Mapping[str, str]) -> int | None:
    """Returns the number of the episode that a request begins; None if it gives none.

    Raises:
        RequestError: It is not a number from 0 to `MAX_EPISODE` - 1.
    """
    text = parameters.get("episode")
    if text is None:
        return None
    # The length is checked first, because converting a long number takes long.
    if text.isascii() and text.isdecimal() and len(text) <= _MAX_DIGITS and (number := int(text)) < MAX_EPISODE:
        return number
    raise RequestError(f"parameter episode is {quoted(text)}; it must be a whole number from 0 to {MAX_EPISODE - 1}")
