"""The exceptions of bags. Their text is a sentence for the user."""

from mjplug.errors import MjplugError


class BagError(MjplugError):
    """A bag cannot be read or written."""


class MissingExtraError(BagError):
    """The packages of the extra `record` are not installed."""

    def __init__(self, missing: str) -> None:
        super().__init__(
            f"recording needs the extra `record` ({missing} is not installed): pip install 'mjplug[record]'"
        )


def require_parquet() -> None:
    """Checks that the extra `parquet` is installed.

    Raises:
        BagError: It is not.
    """
    try:
        import pyarrow.parquet  # noqa: F401, PLC0415
    except ImportError:
        raise BagError("Parquet needs the extra `parquet`: pip install 'mjplug[parquet]'; --csv needs none") from None


def require_mcap() -> None:
    """Checks that the extra is installed.

    Raises:
        MissingExtraError: It is not.
    """
    try:
        import lz4.frame  # noqa: F401, PLC0415
        import mcap  # noqa: F401, PLC0415
        import zstandard  # noqa: F401, PLC0415
    except ImportError as error:
        raise MissingExtraError(error.name or "mcap") from None
