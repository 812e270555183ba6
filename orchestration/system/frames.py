"""How long a frame occupies a network, bit by bit."""

from fractions import Fraction

from orchestration.system.computers import Message, Network
from orchestration.system.times import NANOSECONDS

ERROR_BITS = 31
"""What a corrupted frame takes beside its own length: the error frame, and what CAN waits after it"""


def frame_nanoseconds(network: Network, message: Message, more: int = 0) -> int:
    """From the first bit to the end of the pause after the last one [ns], rounded half to even; `more` bits beside."""
    slow, fast = _bits(network, message.bytes)
    time = _seconds(slow + more, network.bit_rate) + _seconds(fast, network.data_bit_rate or network.bit_rate)
    return round(time * NANOSECONDS)


def _seconds(bits: int, rate: float) -> Fraction:
    return bits / Fraction(repr(float(rate)))


def _bits(network: Network, size: int) -> tuple[int, int]:
    """Bits of a frame at the bit rate, and at that of the data."""
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
    """Of ISO 11898-1:2015, with an identifier of 11 bits; sizes between those that there are, are filled up.

    At the bit rate: 17 bits up to BRS, and 12 of ACK, its delimiter, end of frame and the pause. At that of the data:
    ESI, 4 of length, the data, 4 that count stuff bits, the checksum of 17 or 21 bits with the fixed stuff bits in it
    (6 or 7), and its delimiter. What is stuffed besides is all up to the end of the data.
    """
    size = next(each for each in FD_SIZES if each >= size)
    checksum = 17 + 6 if size <= 16 else 21 + 7
    before, after = 17, 5 + 8 * size
    stuffed = (before - 1) // 4 if longest else 0
    stuffed_later = (before + after - 1) // 4 - stuffed if longest else 0
    return before + 12 + stuffed, after + 4 + checksum + 1 + stuffed_later
