"""What can go wrong, each with the sentence a person reads."""


class SettingsError(Exception):
    """Parameters of the bridge are wrong; the text has all of them, one a line."""


class ListingError(Exception):
    """A server's list of interfaces cannot be read."""


class TypeRefused(Exception):  # noqa: N818  (what happened is in the name)
    """A type of the server that this ROS installation does not have, or defines differently."""
