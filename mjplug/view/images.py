"""The camera images that pages show: each image is encoded once for all pages, and only if a page can take it."""

import asyncio
import importlib.util
import logging
from collections import OrderedDict
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor

from mjplug.client.errors import ClientError, WrongTypeError
from mjplug.view.outbox import IMAGE, NewestSlot, Outbox, Slot
from mjplug_schemas.errors import CodecError

_log = logging.getLogger(__name__)

TYPES = ("sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage")

_KEPT = 16
"""Number of encoded images that are kept for other pages."""


class Encoder:
    """Encodes images on a thread of its own, each of them once."""

    def __init__(self) -> None:
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="view images")
        # By the identity of the payload, which all pages share.
        self._images: OrderedDict[int, tuple[bytes, asyncio.Future[bytes]]] = OrderedDict()

    async def encode(self, type: str, payload: bytes) -> bytes:
        """Returns an image as the payload of an item.

        Raises:
            WrongTypeError: It cannot be shown.
        """
        entry = self._images.get(id(payload))
        if entry is None:
            loop = asyncio.get_running_loop()
            # The payload is kept with its result, so that its identity is not used again.
            entry = self._images[id(payload)] = payload, loop.run_in_executor(self._thread, _encode, type, payload)
            while len(self._images) > _KEPT:
                self._images.popitem(last=False)
        try:
            return await asyncio.shield(entry[1])
        except CodecError as error:
            raise WrongTypeError(f"an image cannot be decoded: {error}") from None

    def close(self) -> None:
        """Ends the thread."""
        self._thread.shutdown(wait=False, cancel_futures=True)


def _encode(type: str, payload: bytes) -> bytes:
    # Imports OpenCV, which takes a while.
    from mjplug.view.pictures import encode  # noqa: PLC0415

    return encode(type, payload)


class _ImageSlot(NewestSlot):
    """A slot that reports when the page takes the image."""

    def __init__(self, number: int, taken: Callable[[], None]) -> None:
        super().__init__(IMAGE, channel=number)
        self._taken = taken

    def _take(self) -> bytes:
        self._taken()
        return super()._take()


class ImageChannel:
    """The newest image of a topic. The next one is encoded when the page has taken the last one.

    Attributes:
        slot: Where the encoded image waits.

    Args:
        number: Number of the channel.
        type: The type of the topic.
        outbox: The outbox of the page.
        encoder: Encodes the images.
        report: Called with the reason when images cannot be shown.

    Raises:
        ClientError: The topic has no images, or OpenCV is not installed.
    """

    def __init__(self, number: int, type: str, outbox: Outbox, encoder: Encoder, report: Callable[[str], None]) -> None:
        if type not in TYPES:
            raise ClientError(f"the topic is {type}; a topic of images is one of: {', '.join(TYPES)}")
        if importlib.util.find_spec("cv2") is None or importlib.util.find_spec("numpy") is None:
            raise ClientError("images need OpenCV. Install it with: pip install opencv-python-headless")
        self._slot = _ImageSlot(number, self._taken)
        self.slot: Slot = self._slot
        self._type = type
        self._outbox = outbox
        self._encoder = encoder
        self._report = report
        self._reported = ""
        self._newest: bytes | None = None
        self._waiting = False
        self._task: asyncio.Task[None] | None = None

    @property
    def wants_all(self) -> bool:
        """Only the newest image is shown."""
        return False

    def receive(self, payloads: Sequence[bytes], lost: int) -> None:
        """Takes the newest image."""
        self._newest = payloads[-1]
        self._start()

    def _taken(self) -> None:
        self._waiting = False
        self._start()

    def _start(self) -> None:
        if self._newest is not None and not self._waiting and self._task is None:
            payload, self._newest = self._newest, None
            self._task = asyncio.create_task(self._encode(payload))

    async def _encode(self, payload: bytes) -> None:
        try:
            image = await self._encoder.encode(self._type, payload)
        except (ClientError, ImportError) as error:
            if str(error) != self._reported:
                self._reported = str(error)
                self._report(self._reported)
        else:
            self._slot.put(image)
            self._waiting = True
            self._outbox.fill(self._slot)
        finally:
            self._task = None
        self._start()
