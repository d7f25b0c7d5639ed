"""Runs coroutines where an event loop may run already: Playwright keeps one in the thread of the tests."""

import asyncio
from concurrent.futures import ThreadPoolExecutor


def run(coroutine):
    """Runs a coroutine in a thread of its own; returns its result, or raises its error."""
    with ThreadPoolExecutor(1) as executor:
        return executor.submit(asyncio.run, coroutine).result()
