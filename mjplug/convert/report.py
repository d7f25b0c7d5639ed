"""What a conversion guessed, repaired and lost."""

import json
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass
from typing import Literal

Kind = Literal["guess", "repair", "loss", "warning", "error"]

TITLES: dict[Kind, str] = {
    "error": "errors: parts that are missing in the model",
    "warning": "warnings",
    "loss": "left out, because MuJoCo or mjplug has no counterpart",
    "repair": "repaired",
    "guess": "guessed, because the URDF does not contain it",
}
_SHOWN = 4


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
            topics: dict[str, list[Note]] = {}
            for note in self.of(kind):
                topics.setdefault(note.topic, []).append(note)
            if topics:
                yield f"{TITLES[kind]}:"
            for topic, notes in topics.items():
                yield f"  {topic}{_subjects(notes)}"

    def as_json(self) -> list[dict[str, str]]:
        """Returns the notes for `conversion.json`."""
        return [{key: value for key, value in asdict(note).items() if value} for note in self.notes]


def _subjects(notes: list[Note]) -> str:
    shown = [
        f"{note.subject} ({note.detail})" if note.subject and note.detail else note.subject or note.detail
        for note in notes
    ]
    shown = [text for text in shown if text]
    if not shown:
        return ""
    more = f", and {len(shown) - _SHOWN} more" if len(shown) > _SHOWN else ""
    count = f" ({len(shown)})" if len(shown) > 1 else ""
    return f"{count}: {', '.join(shown[:_SHOWN])}{more}"


def to_json(value: object) -> str:
    """Returns JSON with sorted keys, so that equal content has equal bytes."""
    return json.dumps(value, indent=1, sort_keys=True) + "\n"
