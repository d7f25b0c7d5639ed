"""A reader for each page, who stays until all tests are done with it; few keep their servers running at a time."""

import pytest
from docs.terminal import Reader

AT_WORK = 2
"""Readers that may keep servers running: an idle server costs a few per cent of a core."""


@pytest.fixture(scope="session")
def reader_of(tmp_path_factory):
    readers = {}

    def reader_of(page):
        # The dictionary keeps the order of use; a reader who left starts a server anew when a block needs it.
        reader = readers.pop(page, None)
        if reader is None:
            reader = Reader(page, tmp_path_factory.mktemp(page.partition(".")[0]))
            reader.save_files()
        readers[page] = reader
        for idle in list(readers.values())[:-AT_WORK]:
            idle.leave()
        return reader

    yield reader_of
    for reader in readers.values():
        reader.leave()
