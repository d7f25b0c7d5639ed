"""Messages in a step request, and samples of topics in its response. Physics thread only."""

from collections.abc import Generator, Sequence

from mjplug.contracts.remote_samples import RemoteSamples
from mjplug.contracts.topics import PublishedTopic, ReadTopic, Topics
from mjplug.errors import RequestError
from mjplug.physics.scheduler import Event
from mjplug_schemas.errors import CodecError
from mjplug_schemas.message import Message
from mjplug_schemas.mjplug_msgs import Sample

MAX_SAMPLES = 64
"""Maximum number of inputs, and of outputs, of a request."""

MAX_INPUT_BYTES = 64 * 1024
"""Maximum total size of the inputs in CDR [bytes], because physics waits while they are decoded."""

MAX_JSON_INPUT_BYTES = 8 * 1024
"""Maximum total size of the inputs in JSON [bytes]; JSON takes several times as long to decode."""


class Inputs:
    """The messages of a request.

    Args:
        topics: The topics of the server.
        samples: The messages.

    Raises:
        RequestError: A message cannot be decoded, or the server does not read its topic. None has been handled.
    """

    def __init__(self, topics: Topics, samples: Sequence[Sample]) -> None:
        self._messages: list[tuple[list[ReadTopic], Message]] = []
        if not samples:
            return
        _check_number("inputs", len(samples))
        for what, most, size in (
            ("", MAX_INPUT_BYTES, sum(len(sample.cdr) for sample in samples)),
            (" in JSON", MAX_JSON_INPUT_BYTES, sum(len(sample.json_text) for sample in samples)),
        ):
            if size > most:
                raise RequestError(f"the inputs have {size} bytes{what}; at most {most} are accepted")
        self._messages = [_decode(topics, i, sample) for i, sample in enumerate(samples)]

    def handle(self) -> None:
        """Handles the messages in their order.

        Raises:
            RequestError: A plugin refuses a message; the text says which messages were handled before it.
        """
        for i, (readers, message) in enumerate(self._messages):
            try:
                for reader in readers:
                    reader.handle(message)
            except RequestError as error:
                before = f"; the {i} inputs before it were handled" if i else ""
                raise RequestError(
                    f"inputs[{i}] ({readers[0].topic.name}): {error}; no step was taken{before}"
                ) from None


def _decode(topics: Topics, index: int, sample: Sample) -> tuple[list[ReadTopic], Message]:
    try:
        readers = topics.readers(sample.topic)
        kind = readers[0].topic.type
        if sample.type not in ("", kind.TYPE):
            raise RequestError(f"type is {sample.type!r}; {kind.TYPE!r} is expected")
        if bool(sample.cdr) == bool(sample.json_text):
            raise RequestError("exactly one of cdr and json_text must be given")
        return readers, kind.from_cdr(sample.cdr) if sample.cdr else kind.from_json(sample.json_text)
    except (RequestError, CodecError) as error:
        raise RequestError(f"inputs[{index}]: {error}") from None


class Outputs:
    """The topics whose samples a request wants. A context manager: messages are kept from its beginning to its end.

    Args:
        topics: The topics of the server.
        names: Full names of the topics.
        form: `cdr` or `json`.

    Raises:
        RequestError: The server does not publish a topic.
    """

    def __init__(self, topics: Topics, names: Sequence[str], form: str) -> None:
        _check_number("outputs", len(names))
        self._published: list[PublishedTopic] = []
        self._fetched: dict[PublishedTopic, bytes] = {}
        for i, name in enumerate(names):
            try:
                published = topics.publishers(name)
            except RequestError as error:
                raise RequestError(f"outputs[{i}]: {error}") from None
            for one in published:
                try:
                    if one.remote is not None:
                        one.remote[0].check(one.remote[1])
                except RequestError as error:
                    raise RequestError(f"outputs[{i}] ({name}): {error}") from None
            self._published += published
        self._form = form

    def __enter__(self) -> "Outputs":
        for published in self._published:
            published.observe()
        return self

    def __exit__(self, *_: object) -> None:
        for published in self._published:
            published.leave()

    def fetch(self) -> Generator[Event, None, None]:
        """Fetches the samples that worker processes make of the present state; yields what to wait for.

        Raises:
            RequestError: A worker process could not make them.
        """
        if not self._published:
            return
        by_worker: dict[RemoteSamples, list[PublishedTopic]] = {}
        for published in self._published:
            if published.remote is not None:
                by_worker.setdefault(published.remote[0], []).append(published)
        wanted = {
            remote: remote.request(one.remote[1] for one in ones if one.remote is not None)
            for remote, ones in by_worker.items()
        }
        for remote, request in wanted.items():
            yield request.ended
            if request.failure:
                names = ", ".join(sorted({one.topic.name for one in by_worker[remote]}))
                raise RequestError(f"no sample of {names}: {request.failure}; all steps were taken")
            for one in by_worker[remote]:
                if one.remote is not None:
                    self._fetched[one] = request.samples[one.remote[1]]

    def samples(self) -> tuple[Sample, ...]:
        """Returns one sample for each publisher of the topics; it is empty if there was no message."""
        return tuple(self._sample(published) for published in self._published)

    def _sample(self, published: PublishedTopic) -> Sample:
        topic = published.topic
        fetched = self._fetched.get(published)
        cdr, fresh = published.newest() if fetched is None else (fetched, True)
        if self._form == "json" and cdr:
            text = topic.type.from_cdr(cdr).to_json().decode()
            return Sample(topic=topic.name, type=topic.type.TYPE, json_text=text, fresh=fresh)
        # Not validated, because that would copy large messages.
        return Sample.unchecked(topic=topic.name, type=topic.type.TYPE, cdr=cdr, json_text="", fresh=fresh)


def _check_number(what: str, count: int) -> None:
    if count > MAX_SAMPLES:
        raise RequestError(f"{what} has {count} entries; at most {MAX_SAMPLES} are accepted")
