"""Damage to the bytes of any file, and to the lines and numbers of a text."""

from __future__ import annotations

import re
from collections.abc import Callable

import numpy as np

Damage = Callable[[bytes, np.random.Generator], bytes]
NUMBER = re.compile(rb"(?<![\w.])[-+]?\d+(\.\d*)?([eE][-+]?\d+)?(?![\w.])")
HOSTILE_NUMBERS = (
    b"nan", b"inf", b"-inf", b"1e39", b"-1e300", b"1e400", b"1e-320", b"0", b"-1", b"99999999999999999999", b"",
    b"x", b"0x10", b"1_000", "\uff11".encode(), b"1e20", b"2147483648", b"-2147483649", b"1.7976931348623157e308",
)  # fmt: skip


def cut(data: bytes, random: np.random.Generator) -> bytes:
    """The file ends early."""
    return data[: int(random.integers(0, len(data)))]


def flip_bits(data: bytes, random: np.random.Generator) -> bytes:
    """One to eight bits anywhere."""
    changed = bytearray(data)
    for place in random.integers(0, len(data), int(random.integers(1, 9))):
        changed[place] ^= 1 << int(random.integers(8))
    return bytes(changed)


def flip_early_bits(data: bytes, random: np.random.Generator) -> bytes:
    """One to four bits of the first kilobyte, where headers are."""
    head = data[:1024]
    return flip_bits(head, random) + data[1024:] if head else data


def zero(data: bytes, random: np.random.Generator) -> bytes:
    """A lost block of a disk."""
    begin, length = int(random.integers(0, len(data))), int(random.integers(1, 600))
    end = min(len(data), begin + length)
    return data[:begin] + bytes(end - begin) + data[end:]


def drop(data: bytes, random: np.random.Generator) -> bytes:
    """Bytes are missing."""
    begin = int(random.integers(0, len(data)))
    return data[:begin] + data[begin + int(random.integers(1, 40)) :]


def insert(data: bytes, random: np.random.Generator) -> bytes:
    """Bytes of something else."""
    place = int(random.integers(0, len(data)))
    return data[:place] + random.bytes(int(random.integers(1, 40))) + data[place:]


def repeat(data: bytes, random: np.random.Generator) -> bytes:
    """A part twice."""
    begin, end = sorted(random.integers(0, len(data), 2))
    return data[:end] + data[begin:end] + data[end:]


def noise(data: bytes, random: np.random.Generator) -> bytes:
    """Another file altogether."""
    return random.bytes(int(random.integers(0, 4000)))


def number(data: bytes, random: np.random.Generator) -> bytes:
    """A number of a text becomes one that hardly anything holds, or none."""
    found = list(NUMBER.finditer(data))
    if not found:
        return data
    place = found[int(random.integers(len(found)))]
    return data[: place.start()] + HOSTILE_NUMBERS[int(random.integers(len(HOSTILE_NUMBERS)))] + data[place.end() :]


def lines(data: bytes, random: np.random.Generator) -> bytes:
    """A line is lost, comes twice, or trades places with another."""
    rows = data.split(b"\n")
    one, other = random.integers(0, len(rows), 2)
    action = int(random.integers(3))
    if action == 0:
        del rows[one]
    elif action == 1:
        rows.insert(other, rows[one])
    else:
        rows[one], rows[other] = rows[other], rows[one]
    return b"\n".join(rows)


def control_characters(data: bytes, random: np.random.Generator) -> bytes:
    """Escape sequences of a terminal, a NUL, marks of direction."""
    text = (b"\x1b[2J", b"\x00", "\u202e".encode(), b"\x07", b"\x1b]0;owned\x07")[int(random.integers(5))]
    place = int(random.integers(0, len(data) + 1))
    return data[:place] + text + data[place:]


ANY: tuple[Damage, ...] = (cut, flip_bits, flip_early_bits, zero, drop, insert, repeat, noise)
TEXT: tuple[Damage, ...] = (number, number, number, lines, control_characters)
