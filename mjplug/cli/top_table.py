"""The text of `mjplug top`: one `/diagnostics` message as lines."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from mjplug_schemas.diagnostic_msgs import DiagnosticArray, DiagnosticStatus

_LEVELS = {0: "ok", 1: "WARN", 2: "ERROR", 3: "STALE"}
_OWN = ("simulation", "wire", "inbox", "topics", "plugins")
_LOST = ("refused as busy on ", "refused on ", "replaced on ")
_PERCENT, _CALLS, _UPDATE, _HERTZ = " (%)", " calls (Hz)", " update (us)", " (Hz)"


@dataclass(frozen=True, slots=True)
class Line:
    """A line of text, with the level of its diagnostic status."""

    text: str
    level: int = 0
    heading: bool = False


def lines(message: DiagnosticArray, server: str) -> list[Line]:
    """Returns the lines about one server.

    Args:
        message: The message.
        server: The server's full name.
    """
    statuses = {status.name.partition(": ")[2]: status for status in message.status if status.hardware_id == server}
    figures = {name: {entry.key: entry.value for entry in status.values} for name, status in statuses.items()}
    head = statuses.get("simulation", DiagnosticStatus(message="no status of the simulation", level=3))
    found = [Line(f"{server}: {head.message}", head.level)]
    found += _overview(figures.get("simulation", {}), figures.get("wire", {}))
    if (wire := statuses.get("wire")) is not None and wire.level:
        found.append(Line(f"wire: {wire.message}", wire.level))
    parts = {name: status for name, status in statuses.items() if name not in _OWN}
    found += _plugins(figures.get("plugins", {}), parts, figures)
    return found + _topics(figures.get("topics", {})) + _lost(figures.get("wire", {}), figures.get("inbox", {}))


def _overview(simulation: Mapping[str, str], wire: Mapping[str, str]) -> list[Line]:
    if not simulation:
        return []

    def figure(name: str) -> str:
        return _short(simulation.get(name, "?"))

    rows = (
        (
            f"time {simulation.get('simulated time (s)', '?')[:-3]} s",
            f"speed {figure('real-time factor')} (set to {figure('wanted speed')})",
            f"{figure('step rate (Hz)')} steps/s",
            f"load {figure('load (%)')} %",
        ),
        (
            f"step p50 {figure('step time p50 (us)')} us",
            f"p99 {figure('step time p99 (us)')} us",
            f"late p99 {figure('step lateness p99 (us)')} us",
            f"fell behind {figure('times fallen behind')} times, {figure('wall time lost (s)')} s lost",
        ),
        (
            f"resets {figure('resets')}",
            f"divergences {figure('divergences')}",
            f"waiting requests {figure('waiting requests')}",
            f"open {_short(wire.get('open requests', '?'))}, refused {_short(wire.get('refused', '?'))}",
            f"contacts {figure('contacts')}",
        ),
    )
    return [Line("  ".join(f"{cell:<22}" for cell in row).rstrip()) for row in rows]


def _plugins(
    times: Mapping[str, str], parts: Mapping[str, DiagnosticStatus], figures: Mapping[str, Mapping[str, str]]
) -> list[Line]:
    """Returns a table with a row for each plugin instance and each of its parts."""
    instances = [key.removesuffix(_PERCENT) for key in times if key.endswith(_PERCENT)]
    names = list(dict.fromkeys([*instances, *sorted(parts)]))
    rows, levels = [], []
    for name in sorted(names, key=lambda name: (name.partition(": ")[0], name)):
        status = parts.get(name)
        level = status.level if status else 0
        state = f"{_LEVELS.get(level, '?')} {status.message}" if status and status.message != "ok" else _LEVELS[level]
        own = figures.get(name, {})
        extras = [f"{key} {_short(own[key])}" for key in ("states dropped", "restarts") if own.get(key, "0") != "0"]
        cells = [_short(times.get(f"{name}{unit}", "-")) for unit in (_PERCENT, _CALLS, _UPDATE)]
        rows.append([name, *cells, ", ".join([state, *extras])])
        levels.append(level)
    return _table(["PLUGIN", "% TIME", "CALLS/S", "UPDATE us", "STATE"], rows, levels)


def _topics(rates: Mapping[str, str]) -> list[Line]:
    rows = [[name.removesuffix(_HERTZ), _short(rate)] for name, rate in rates.items()]
    return _table(["TOPIC WITH SUBSCRIBERS", "MESSAGES/S"], rows, [0] * len(rows))


def _lost(wire: Mapping[str, str], inbox: Mapping[str, str]) -> list[Line]:
    """Returns a table of messages and requests that did not reach the simulation, by topic and service."""
    rows: dict[str, list[str]] = {}
    for key, count in (*wire.items(), *inbox.items()):
        for column, prefix in enumerate(_LOST):
            if key.startswith(prefix):
                rows.setdefault(key.removeprefix(prefix), ["0"] * len(_LOST))[column] = _short(count)
                break
    table = [[name, counts[1], counts[0], counts[2]] for name, counts in sorted(rows.items())]
    return _table(["NOT DELIVERED", "REFUSED", "BUSY", "REPLACED"], table, [0] * len(table))


def _table(heading: Sequence[str], rows: Sequence[Sequence[str]], levels: Iterable[int]) -> list[Line]:
    """Returns a table with right-aligned numbers; the last column is not padded."""
    if not rows:
        return []
    widths = [max(map(len, column)) for column in zip(heading, *rows, strict=True)]

    def line(row: Sequence[str]) -> str:
        cells = [
            f"{row[0]:<{widths[0]}}",
            *(f"{cell:>{width}}" for cell, width in zip(row[1:4], widths[1:4], strict=True)),
        ]
        return "  ".join([*cells, *row[4:]]).rstrip()

    return [
        Line(""),
        Line(line(heading), heading=True),
        *(Line(line(row), level) for row, level in zip(rows, levels, strict=True)),
    ]


def _short(number: str) -> str:
    """Returns a number with three significant digits."""
    try:
        value = float(number)
    except ValueError:
        return number
    if not math.isfinite(value):
        return number
    if value == int(value) and abs(value) < 1e9:
        return str(int(value))
    # 999.6 with three digits would be 1e+03.
    return f"{value:.0f}" if abs(value) >= 999.5 else f"{value:.3g}" if abs(value) >= 0.01 else "<0.01"
