"""Spoilt configuration files: bombs, odd types, boundary values for the parameters of plugins, and broken bytes."""

import yaml
from hostile.payloads import spoilt

VALUES = (
    "null",
    "~",
    "''",
    "true",
    "1",
    "-1",
    "0",
    "0.0",
    "-0.0",
    "1e308",
    "-1e308",
    "5e-324",
    ".inf",
    "-.inf",
    ".nan",
    "1e999",
    str(2**63),
    str(2**64),
    str(-(2**70)),
    "9" * 400,
    "[]",
    "{}",
    "[1, 2, 3]",
    "{a: 1}",
    "[[[]]]",
    "x",
    '"\\0"',
    '"\\e[31m"',
    "é",
    "名",
    "!!python/object/apply:os.system [id]",
    "!!binary aGk=",
    "!!str 1",
    "2001-01-01",
    "1:30",
    "0x10",
    "0o7",
    "*x",
    "&x [*x]",
    "<<",
    "../../etc/passwd",
    "/dev/zero",
    "/dev/null",
    "/proc/self/mem",
    "tcp/127.0.0.1:99999",
    "'*'",
    "a/b",
    "package://nothing/x.xml",
    "bundled:nothing",
    "bundled:box",
    "x" * 5000,
    '"' + "\\U0001F4A5" * 50 + '"',
    "? x",
    "- - -",
)

KEYS = (
    "model",
    "node_name",
    "namespace",
    "remap",
    "sim",
    "zenoh",
    "ros2",
    "plugins",
    "ros_params",
    "on_plugin_error",
    "sim.speed",
    "sim.paused",
    "sim.keyframe",
    "sim.start_position_file",
    "sim.initial_positions",
    "sim.seed",
    "sim.clock_rate",
    "sim.on_divergence",
    "zenoh.mode",
    "zenoh.listen",
    "zenoh.connect",
    "zenoh.config",
    "ros2.enabled",
    "ros2.domain_id",
    "ros2.distro",
    "unknown",
    "sim.unknown",
    "plugins.new",
    "plugins.new.type",
)


def configuration(text, random):
    """Returns a spoilt configuration file made from a right one."""
    kind = random.random()
    if kind < 0.12:
        return _bomb(random).encode()
    if kind < 0.35:
        return spoilt(text.encode(), random)
    tree = yaml.safe_load(text)
    lines = []
    for _ in range(random.choice((1, 1, 2, 3))):
        path, value = _path(tree, random), random.choice(VALUES)
        if random.random() < 0.3:
            value = _near(tree, path, random)
        _put(tree, path, f"@@{len(lines)}@@")
        lines.append(value)
    out = yaml.safe_dump(tree, sort_keys=False, allow_unicode=True)
    for i, value in enumerate(lines):
        # The value stands as raw text, so that it can be what no YAML writer would write.
        out = out.replace(f"'@@{i}@@'", value)
    return out.encode("utf-8", "replace")


def _path(tree, random):
    """Returns the place of a setting, or of a parameter of a plugin as its schema has it."""
    if random.random() < 0.35:
        return tuple(random.choice(KEYS).split("."))
    plugins = tree.get("plugins")
    plugins = (
        {name: entry for name, entry in plugins.items() if isinstance(entry, dict)} if isinstance(plugins, dict) else {}
    )
    if not plugins:
        return ("plugins", "new")
    name = random.choice(list(plugins))
    return ("plugins", name, random.choice([*_parameters(plugins[name].get("type", "")), *plugins[name], "unknown"]))


def _parameters(kind):
    """Returns the names of a plugin's parameters."""
    from mjplug.errors import MjplugError
    from mjplug.plugin import registry

    try:
        fields = registry.find(kind).parameters_type.model_fields
    except MjplugError:
        return []
    return list(fields)


def _near(tree, path, random):
    """Returns a number close to what a place holds, or at a limit of numbers."""
    value = tree
    for name in path:
        value = value.get(name) if isinstance(value, dict) else None
    numbers = [0, -1, 1e-9, 1e9, 1e300, 5e-324, 2**31, 2**53, 0.1]
    if isinstance(value, int | float) and not isinstance(value, bool):
        numbers += [value * 1e6, -value, value / 1e6, value + 1]
    return repr(random.choice(numbers))


def _put(tree, path, value):
    for name in path[:-1]:
        if not isinstance(tree.get(name), dict):
            tree[name] = {}
        tree = tree[name]
    tree[path[-1]] = value


def _bomb(random):
    kind, many = random.randrange(8), random.choice((10, 100, 1000, 100_000))
    if kind == 0:
        levels = "".join(f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]\n" for i in range(1, 12))
        return f"model: bundled:box\na0: &a0 [x, x]\n{levels}"
    if kind == 1:
        return f"model: {'[' * many}{']' * many}"
    if kind == 2:
        return "model: " + "{a: " * many + "1" + "}" * many
    if kind == 3:
        return "model: bundled:box\n" + "".join(f"k{i}: {i}\n" for i in range(many))
    if kind == 4:
        return "".join(" " * i + f"a{i}:\n" for i in range(min(many, 2000)))
    if kind == 5:
        return "a: &a {<<: *a}\nmodel: bundled:box" if many > 100 else "a: &a {b: *a}\nmodel: *a"
    if kind == 6:
        return "model: bundled:box\nplugins:\n" + "".join(
            f"  p{i}: {{type: heartbeat}}\n" for i in range(min(many, 100))
        )
    return f"model: {'x' * many * 10}\nnode_name: {'y' * many}\n"
