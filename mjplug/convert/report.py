"""What a conversion guessed, repaired and lost."""

import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass
from typing import Any, Literal

RECORD = "conversion.json"
"""Name of the file with the record of a conversion."""

Kind = Literal["guess", "repair", "loss", "warning", "error"]

TITLES: dict[Kind, str] = {
    "error": "errors: parts that are missing in the model",
    "warning": "warnings",
    "loss": "left out, because MuJoCo or mjplug has no counterpart",
    "repair": "repaired",
    "guess": "guessed, because the URDF does not contain it",
}
_SHOWN = 4

_WIDTH = 100
"""Length from which the subjects of a topic are on lines of their own."""


@dataclass(frozen=True, slots=True)
class Note:
    """One decision of the conversion.

    Attributes:
        kind: What happened.
        topic: What it is about, the same text for the same cause.
        subject: The link, joint or file.
        detail: The value or reason, such as `E = 12 N m`.
    """

    kind: Kind
    topic: str
    subject: str = ""
    detail: str = ""


class Report:
    """The notes of a conversion, in their order."""

    def __init__(self) -> None:
        self.notes: list[Note] = []

    def add(self, kind: Kind, topic: str, subject: str = "", detail: str = "") -> None:
        """Adds a note; the same note is kept once."""
        note = Note(kind, topic, subject, detail)
        if note not in self.notes:
            self.notes.append(note)

    def of(self, *kinds: Kind) -> list[Note]:
        """Returns the notes of these kinds."""
        return [note for note in self.notes if note.kind in kinds]

    def lines(self, kinds: Iterable[Kind] = ("error", "warning", "loss", "repair")) -> Iterator[str]:
        """Yields the notes as text, grouped by kind and topic."""
        for kind in kinds:
            topics = self._topics(kind)
            if topics:
                yield f"{TITLES[kind]}:"
            for topic, notes in topics.items():
                yield from _with_subjects(f"  {topic}", notes)

    def summary(self, *kinds: Kind) -> Iterator[str]:
        """Yields one line for each topic, with the subjects; with details only for a single note."""
        for kind in kinds:
            for topic, notes in self._topics(kind).items():
                texts = [note.subject for note in notes if note.subject] if len(notes) > 1 else _texts(notes)
                yield f"{topic}{_joined(texts)}"

    def _topics(self, kind: Kind) -> dict[str, list[Note]]:
        topics: dict[str, list[Note]] = {}
        for note in self.of(kind):
            topics.setdefault(note.topic, []).append(note)
        return topics

    def as_json(self) -> list[dict[str, str]]:
        """Returns the notes for `conversion.json`."""
        return [{key: value for key, value in asdict(note).items() if value} for note in self.notes]


def report_of(notes: Iterable[Mapping[str, Any]]) -> Report:
    """Returns the report of a conversion from the notes in its `conversion.json`."""
    report = Report()
    for note in notes:
        report.add(note["kind"], note["topic"], note.get("subject", ""), note.get("detail", ""))
    return report


def _texts(notes: list[Note]) -> list[str]:
    texts = [
        f"{note.subject} ({note.detail})" if note.subject and note.detail else note.subject or note.detail
        for note in notes
    ]
    return [text for text in texts if text]


def _joined(texts: list[str]) -> str:
    if not texts:
        return ""
    count = f" ({len(texts)})" if len(texts) > 1 else ""
    return f"{count}: {', '.join(texts[:_SHOWN])}{_rest(texts)}"


def _rest(texts: list[str]) -> str:
    return f", and {len(texts) - _SHOWN} more" if len(texts) > _SHOWN else ""


def _with_subjects(topic: str, notes: list[Note]) -> Iterator[str]:
    texts = _texts(notes)
    line = f"{topic}{_joined(texts)}"
    if len(line) <= _WIDTH or len(texts) < 2:
        yield line
        return
    yield f"{topic} ({len(texts)}):"
    yield from (f"    {text}" for text in texts[:_SHOWN])
    if len(texts) > _SHOWN:
        yield f"    and {len(texts) - _SHOWN} more"


def to_json(value: object) -> str:
    """Returns JSON with sorted keys, so that equal content has equal bytes."""
    return json.dumps(value, indent=1, sort_keys=True) + "\n"
