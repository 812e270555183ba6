"""Arrays of numbers as text in a JSON document: each content once, in the byte format that a browser reads."""

import base64
import hashlib
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

Kind = Literal["float32", "int16"]
STEPS = 2**15 - 4
"""Steps of an int16 to each side of the middle; -2**15 is reserved for nan, a few for rounding"""
NOTHING = -(2**15)
"""The int16 of nan; in a logarithmic array, of zero"""


@dataclass(frozen=True, kw_only=True)
class Blob:
    """An array: value = offset + scale * number, and 10 to the power of that if it is `logarithmic`."""

    kind: Kind
    data: str
    """its little-endian bytes in base 64"""
    offset: float = 0.0
    scale: float = 1.0
    logarithmic: bool = False

    def as_list(self) -> list[str | float | bool]:
        """The form in the document: the text, for int16 with offset and scale."""
        if self.kind == "float32":
            return [self.data]
        return [self.data, self.offset, self.scale, *([True] if self.logarithmic else [])]


class Blobs:
    """Collects arrays; an array is identified by its index."""

    def __init__(self) -> None:
        self.blobs: list[Blob] = []
        self._places: dict[bytes, int] = {}

    @property
    def size(self) -> int:
        """Total characters in the document."""
        return sum(len(blob.data) for blob in self.blobs)

    def exact(self, values: npt.ArrayLike) -> int:
        """Store an array as float32; its index."""
        array = np.asarray(values, dtype="<f4")
        return self._place(Blob(kind="float32", data=_text(array)))

    def compact(self, values: npt.ArrayLike, *, logarithmic: bool = False) -> int:
        """Store an array as int16, accurate to 1/65,000 of its range, or of that of its logarithm; its index.

        In a logarithmic array, values that are not positive count as zero.
        """
        numbers = np.asarray(values, dtype=float)
        if logarithmic:
            numbers = np.log10(np.where(numbers > 0.0, numbers, np.nan))
        known = numbers[np.isfinite(numbers)]
        low, high = (float(known.min()), float(known.max())) if len(known) else (0.0, 0.0)
        offset = float(f"{0.5 * (low + high):.9g}")
        scale = float(f"{max(high - offset, offset - low) / STEPS:.9g}") or 1.0
        steps = np.rint((np.where(np.isfinite(numbers), numbers, offset) - offset) / scale)
        steps[~np.isfinite(numbers)] = NOTHING
        data = _text(steps.astype("<i2"))
        return self._place(Blob(kind="int16", data=data, offset=offset, scale=scale, logarithmic=logarithmic))

    def _place(self, blob: Blob) -> int:
        how = repr((blob.kind, blob.offset, blob.scale, blob.logarithmic))
        key = hashlib.sha256(f"{how} {blob.data}".encode()).digest()
        if key not in self._places:
            self._places[key] = len(self.blobs)
            self.blobs.append(blob)
        return self._places[key]


def _text(array: npt.NDArray[np.generic]) -> str:
    return base64.b64encode(array.tobytes()).decode("ascii")
