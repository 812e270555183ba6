"""The lengths of frames on a network, from their bits."""

from fractions import Fraction

from orchestration.foundation.basics.times import NANOSECONDS
from orchestration.systems.system.computers import Message, Network

ERROR_BITS = 31
"""The bits after a corrupted frame: the error frame, and the pause of CAN after it"""


def frame_nanoseconds(network: Network, message: Message, more: int = 0) -> int:
    """The time from the first bit of a frame to the end of the pause after it [ns], rounded half to even.

    `more` bits are added.
    """
    slow, fast = _bits(network, message.bytes)
    time = _seconds(slow + more, network.bit_rate) + _seconds(fast, network.data_bit_rate or network.bit_rate)
    return round(time * NANOSECONDS)


def _seconds(bits: int, rate: float) -> Fraction:
    return bits / Fraction(repr(float(rate)))


def _bits(network: Network, size: int) -> tuple[int, int]:
    """The bits of a frame at the bit rate, and at the data bit rate."""
    longest = network.stuffing == "longest"
    if network.kind == "can":
        return 8 * size + 47 + (longest * (34 + 8 * size - 1) // 4), 0
    if network.kind == "can-fd":
        return _bits_of_fd(size, longest)
    if network.kind == "ethernet":
        return 8 * (max(46, size) + 38), 0
    return 8 * size, 0


FD_SIZES = (0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64)


def _bits_of_fd(size: int, longest: bool) -> tuple[int, int]:
    """The bits of a CAN FD frame (ISO 11898-1:2015) with an identifier of 11 bits, padded to the next valid size.

    At the bit rate: 17 bits up to BRS, and 12 of ACK, its delimiter, end of frame and the pause. At the data bit rate:
    ESI, 4 of length, the data, 4 of the stuff count, the checksum of 17 or 21 bits with its fixed stuff bits (6 or 7),
    and its delimiter. Dynamic stuff bits occur up to the end of the data.
    """
    size = next(each for each in FD_SIZES if each >= size)
    checksum = 17 + 6 if size <= 16 else 21 + 7
    before, after = 17, 5 + 8 * size
    stuffed = (before - 1) // 4 if longest else 0
    stuffed_later = (before + after - 1) // 4 - stuffed if longest else 0
    return before + 12 + stuffed, after + 4 + checksum + 1 + stuffed_later
