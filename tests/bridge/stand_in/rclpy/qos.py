from enum import IntEnum


class QoSPolicyKind(IntEnum):
    INVALID = 1
    DURABILITY = 2
    DEADLINE = 4
    LIVELINESS = 8
    RELIABILITY = 16
    HISTORY = 32
    LIFESPAN = 64
    DEPTH = 128


class HistoryPolicy(IntEnum):
    SYSTEM_DEFAULT = 0
    KEEP_LAST = 1
    KEEP_ALL = 2
    UNKNOWN = 3


class ReliabilityPolicy(IntEnum):
    SYSTEM_DEFAULT = 0
    RELIABLE = 1
    BEST_EFFORT = 2
    UNKNOWN = 3


class DurabilityPolicy(IntEnum):
    SYSTEM_DEFAULT = 0
    TRANSIENT_LOCAL = 1
    VOLATILE = 2
    UNKNOWN = 3


class InvalidQoSProfileException(Exception):
    pass


class QoSProfile:
    """History, depth, reliability and durability; unused policies are missing."""

    _POLICIES = ("history", "depth", "reliability", "durability")

    def __init__(self, **kwargs):
        assert set(kwargs) <= set(self._POLICIES), f"Invalid arguments passed to constructor: {sorted(kwargs)}"
        if "history" not in kwargs and "depth" not in kwargs:
            raise InvalidQoSProfileException("History and/or depth settings are required.")
        self.history = HistoryPolicy(kwargs.get("history", HistoryPolicy.KEEP_LAST))
        if self.history is HistoryPolicy.KEEP_LAST and "depth" not in kwargs:
            raise InvalidQoSProfileException("History set to KEEP_LAST without a depth setting.")
        self.depth = kwargs.get("depth", 10)
        assert isinstance(self.depth, int)
        self.reliability = ReliabilityPolicy(kwargs.get("reliability", ReliabilityPolicy.RELIABLE))
        self.durability = DurabilityPolicy(kwargs.get("durability", DurabilityPolicy.VOLATILE))

    def __setattr__(self, name, value):
        assert name in self._POLICIES, name
        super().__setattr__(name, value)

    @property
    def wire(self):
        """What the graph matches by: reliable, latched, depth."""
        return (
            self.reliability is ReliabilityPolicy.RELIABLE,
            self.durability is DurabilityPolicy.TRANSIENT_LOCAL,
            self.depth,
        )
