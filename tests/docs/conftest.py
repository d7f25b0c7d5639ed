"""A reader for each page, who stays until all tests are done with it."""

import pytest
from docs.terminal import Reader


@pytest.fixture(scope="session")
def reader_of(tmp_path_factory):
    readers = {}

    def reader_of(page):
        if page not in readers:
            readers[page] = Reader(page, tmp_path_factory.mktemp(page.partition(".")[0]))
            readers[page].save_files()
        return readers[page]

    yield reader_of
    for reader in readers.values():
        reader.leave()
