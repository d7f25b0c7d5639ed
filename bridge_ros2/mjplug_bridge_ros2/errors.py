"""Errors of the bridge; their texts are shown to the user."""


class SettingsError(Exception):
    """Parameters of the bridge are invalid; the text contains one line for each."""


class ListingError(Exception):
    """A server's list of interfaces cannot be read."""


class TypeRefused(Exception):  # noqa: N818  (the name says what happened)
    """A type of the server is not installed in ROS, or its definition differs."""
