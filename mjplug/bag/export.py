"""Writes the topics of a bag as tables, one row for each message: CSV, or Parquet."""

import csv
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any, Literal

from mjplug.bag.definitions import class_of
from mjplug.bag.errors import BagError
from mjplug.bag.reader import Bag, BagMessage, merged
from mjplug_schemas.errors import CodecError
from mjplug_schemas.idl import Primitive
from mjplug_schemas.shape import fields

Format = Literal["csv", "parquet"]

TIME_COLUMNS = ("t", "log_time_ns", "publish_time_ns")
"""The first columns: log time [s], log time and publish time [ns]."""

_BATCH = 10_000
"""Number of rows that are written to a Parquet file at once."""

_TIMES = ("builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration")


def rows(messages: Iterable[BagMessage], max_array: int) -> Iterator[tuple[BagMessage, dict[str, Any]]]:
    """Yields each message with its values by column.

    Nested fields are `pose.position.x`, elements of arrays `ranges[3]`, or `position[elbow]` if the message has a field
    `name` with as many texts. Times are in s. Arrays with more elements than `max_array`, and bytes, become their
    length, `data.length`.

    Args:
        messages: Messages of one topic.
        max_array: Maximum number of elements of an array.

    Raises:
        BagError: A message cannot be decoded.
    """
    for message in messages:
        topic = message.topic
        try:
            decoded = class_of(topic.type, topic.definition).from_cdr(message.data)
        except CodecError as error:
            raise BagError(f"a message of {topic.name} at {message.log_time} ns cannot be decoded: {error}") from None
        yield message, dict(_flat(decoded, "", max_array))


def _flat(message: Any, prefix: str, max_array: int) -> Iterator[tuple[str, Any]]:
    labels = getattr(message, "name", None)
    if not isinstance(labels, tuple) or not all(isinstance(label, str) for label in labels):
        labels = None
    elif len(set(labels)) < len(labels):
        # Two elements of one name would have one column.
        labels = None
    # Any: mypy does not accept a class as a hashable argument of a cached function.
    kind: Any = type(message)
    for field in fields(kind):
        value, name = getattr(message, field.name), f"{prefix}{field.name}"
        if field.octets:
            yield f"{name}.length", len(value)
        elif field.kind == "one":
            yield from _element(value, name, field.element, max_array)
        elif len(value) > max_array:
            yield f"{name}.length", len(value)
        else:
            named = labels is not None and field.name != "name" and len(value) == len(labels)
            for index, item in enumerate(value):
                label = labels[index] if named and labels is not None else index
                yield from _element(item, f"{name}[{label}]", field.element, max_array)


def _element(value: Any, name: str, kind: Any, max_array: int) -> Iterator[tuple[str, Any]]:
    if isinstance(kind, Primitive):
        yield name, value
    elif kind.TYPE in _TIMES:
        yield name, value.sec + value.nanosec / 1e9
    else:
        yield from _flat(value, f"{name}.", max_array)


def export(
    bag: Bag, folder: Path, chosen: Callable[[str], bool], format: Format, max_array: int
) -> dict[str, tuple[Path, int]]:
    """Writes one file for each topic.

    Args:
        bag: The bag.
        folder: The folder to create.
        chosen: Returns whether a topic is exported.
        format: The format of the files.
        max_array: Maximum number of elements of an array that become columns.

    Returns:
        The file of each topic with messages, and its number of rows.

    Raises:
        BagError: The bag is damaged, a message cannot be decoded, or a file cannot be written.
    """
    names = sorted({topic.name for file in bag.summaries() for topic in file.topics.values() if chosen(topic.name)})
    try:
        folder.mkdir(parents=True)
    except FileExistsError:
        raise BagError(f"{folder} already exists; choose another name with --output") from None
    except OSError as error:
        raise BagError(f"cannot create {folder}: {error.strerror}") from None
    written: dict[str, tuple[Path, int]] = {}
    used: set[str] = set()
    for name in names:
        columns = _columns(bag, name, max_array)
        if not columns:
            continue
        stem = name.removeprefix("/").replace("/", "_")
        while stem in used:
            stem += "_"
        used.add(stem)
        path = folder / f"{stem}.{format}"
        write = _write_csv if format == "csv" else _write_parquet
        try:
            written[name] = path, write(path, columns, rows(merged(bag, frozenset({name})), max_array))
        except OSError as error:
            raise BagError(f"cannot write {path}: {error.strerror or error}") from error
    return written


def _columns(bag: Bag, topic: str, max_array: int) -> dict[str, type]:
    """Returns the columns of a topic and the type of their values; they may differ from message to message."""
    columns: dict[str, type] = {}
    for _, values in rows(merged(bag, frozenset({topic})), max_array):
        for column, value in values.items():
            columns.setdefault(column, type(value))
    return columns


def _write_csv(path: Path, columns: dict[str, type], found: Iterator[tuple[BagMessage, dict[str, Any]]]) -> int:
    count = 0
    with path.open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow([*TIME_COLUMNS, *columns])
        for message, values in found:
            seconds, rest = divmod(message.log_time, 1_000_000_000)
            times = (f"{seconds}.{rest:09}", message.log_time, message.publish_time)
            table.writerow([*times, *(_text(values.get(column)) for column in columns)])
            count += 1
    return count


def _text(value: Any) -> Any:
    # As in pandas and NumPy: a missing value is empty, and texts of truth values are those of JSON.
    if value is None:
        return ""
    return str(value).lower() if isinstance(value, bool) else value


def _write_parquet(path: Path, columns: dict[str, type], found: Iterator[tuple[BagMessage, dict[str, Any]]]) -> int:
    import pyarrow  # noqa: PLC0415 - a large package, needed only here
    import pyarrow.parquet  # noqa: PLC0415

    kinds = {bool: pyarrow.bool_(), int: pyarrow.int64(), float: pyarrow.float64(), str: pyarrow.string()}
    times = [("t", pyarrow.float64()), ("log_time_ns", pyarrow.int64()), ("publish_time_ns", pyarrow.int64())]
    schema = pyarrow.schema([*times, *((name, kinds[kind]) for name, kind in columns.items())])
    count = 0
    batch: dict[str, list[Any]] = {name: [] for name in schema.names}

    def flush(writer: Any) -> None:
        arrays = [_array(pyarrow, batch[name], schema.field(name).type) for name in schema.names]
        writer.write_table(pyarrow.Table.from_arrays(arrays, schema=schema))
        for values in batch.values():
            values.clear()

    with pyarrow.parquet.ParquetWriter(path, schema) as writer:
        for message, values in found:
            count += 1
            row = (message.log_time / 1e9, message.log_time, message.publish_time)
            for name, value in zip(TIME_COLUMNS, row, strict=True):
                batch[name].append(value)
            for name in columns:
                batch[name].append(values.get(name))
            if count % _BATCH == 0:
                flush(writer)
        if batch["t"]:
            flush(writer)
    return count


def _array(pyarrow: Any, values: list[Any], kind: Any) -> Any:
    if kind == pyarrow.int64():
        # A uint64 above the largest int64 wraps around, as in its bits.
        values = [v if v is None or v < 2**63 else v - 2**64 for v in values]
    return pyarrow.array(values, kind)
