"""The materials and textures of a model."""

import hashlib
import io
import re
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, SubElement

from mjplug.convert.extras import optional
from mjplug.convert.report import Report
from mjplug.convert.rotations import numbers

Colour = tuple[float, ...]

MAX_TEXTURE = 2048
"""Longest side of a texture [pixels]."""

PLAIN: Colour = (0.7, 0.7, 0.7, 1.0)
"""Colour of a visual without one."""

GAZEBO_COLOURS: dict[str, Colour] = {
    "Black": (0.1, 0.1, 0.1, 1), "Blue": (0, 0, 0.8, 1), "DarkGray": (0.3, 0.3, 0.3, 1),
    "DarkGrey": (0.3, 0.3, 0.3, 1), "FlatBlack": (0.1, 0.1, 0.1, 1), "Gold": (0.8, 0.65, 0.15, 1),
    "Gray": (0.7, 0.7, 0.7, 1), "Grey": (0.7, 0.7, 0.7, 1), "Green": (0, 0.8, 0, 1), "Indigo": (0.33, 0, 0.5, 1),
    "Orange": (1, 0.5, 0.1, 1), "Purple": (0.6, 0.1, 0.8, 1), "Red": (0.8, 0, 0, 1), "Turquoise": (0, 0.8, 0.8, 1),
    "White": (1, 1, 1, 1), "Wood": (0.55, 0.4, 0.25, 1), "Yellow": (0.9, 0.9, 0, 1),
}  # fmt: skip
"""Colours of `Gazebo/X` materials."""


def free_name(wanted: str, taken: set[str]) -> str:
    """Returns the name, with a number if another object has it, and adds it to the names."""
    plain = re.sub(r"[^\w.-]+", "_", wanted).strip("_") or "part"
    name, number = plain, 0
    while name.lower() in taken:
        number += 1
        name = f"{plain}_{number}"
    taken.add(name.lower())
    return name


class Materials:
    """The materials that visuals use, and the files of their textures.

    Attributes:
        files: Contents of texture files by name.
        report: The report.
    """

    def __init__(self, report: Report) -> None:
        self.files: dict[str, bytes] = {}
        self.report = report
        self._names: set[str] = set()
        self._colours: dict[Colour, str] = {}
        self._textures: dict[bytes, str] = {}

    def colour(self, rgba: Colour, name: str = "") -> str:
        """Returns the material of a colour.

        Args:
            rgba: The colour.
            name: The name that the URDF gives it; default: `color_<rgba>`.
        """
        if rgba not in self._colours:
            default = "color_" + "".join(f"{round(part * 255):02x}" for part in rgba)
            self._colours[rgba] = free_name(name or default, self._names)
        return self._colours[rgba]

    def texture(self, image: Any, name: str) -> str:
        """Returns the material of a texture, which is written as a PNG.

        Args:
            image: An image of Pillow.
            name: The name for the material and the file.
        """
        # Several mesh files often use the same texture; encoding it takes much longer than reading its pixels.
        key = hashlib.blake2b(f"{image.mode} {image.size}".encode() + image.tobytes()).digest()
        if key not in self._textures:
            chosen = free_name(name, self._names)
            self.files[f"{chosen}.png"] = _png(image)
            self._textures[key] = chosen
        return self._textures[key]

    def texture_file(self, path: Path, name: str) -> str | None:
        """Returns the material of a texture file; None if it cannot be read here."""
        pillow = optional("PIL.Image")
        if pillow is None:
            self.report.add("loss", "texture; pip install 'mjplug[convert]' reads it", path.name)
            return None
        try:
            image = pillow.open(path)
            image.load()
        except (OSError, ValueError) as error:
            self.report.add("loss", "texture that cannot be read", path.name, str(error))
            return None
        return self.texture(image, name)

    def write(self, asset: Element) -> None:
        """Adds the textures and materials to `<asset>`."""
        for name in self._textures.values():
            SubElement(asset, "texture", name=name, type="2d", file=f"{name}.png")
        for rgba, name in self._colours.items():
            SubElement(asset, "material", name=name, rgba=numbers(rgba, 4))
        for name in self._textures.values():
            SubElement(asset, "material", name=name, texture=name)


def _png(image: Any) -> bytes:
    image = image.convert("RGBA" if "A" in image.getbands() or "transparency" in image.info else "RGB")
    if image.mode == "RGBA" and image.getchannel("A").getextrema() == (255, 255):
        image = image.convert("RGB")
    image.thumbnail((MAX_TEXTURE, MAX_TEXTURE))
    output = io.BytesIO()
    # Level 1 takes a tenth of the time of the default, and the files are about 10 % larger.
    image.save(output, "PNG", compress_level=1)
    return output.getvalue()
