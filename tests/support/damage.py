"""Damages logs in known places, and tells what of them is left by a reading of its own."""

import zlib
from typing import NamedTuple

import lz4.frame
import zstandard

MAGIC_BYTES = 8
CHUNK, ATTACHMENT, METADATA, DATA_END = 6, 9, 12, 15


class Stretch(NamedTuple):
    """One record from byte `begin` to `end`."""

    opcode: int
    begin: int
    end: int


def number(data, at, size):
    return int.from_bytes(data[at : at + size], "little")


def stretches(data):
    """All records of a whole log up to the end of its data."""
    at, found = MAGIC_BYTES, []
    while not found or found[-1].opcode != DATA_END:
        end = at + 9 + number(data, at + 1, 8)
        found.append(Stretch(data[at], at, end))
        at = end
    return found


def messages(data):
    """Messages of a whole log by the place of their chunk: channel, time, publish time and bytes."""
    return {
        each.begin: list(_in_chunk(data[each.begin + 9 : each.end])) for each in stretches(data) if each.opcode == CHUNK
    }


def _in_chunk(body):
    size, crc, letters = number(body, 16, 8), number(body, 24, 4), number(body, 28, 4)
    compression, packed = body[32 : 32 + letters].decode(), body[40 + letters :]
    unpack = {"": bytes, "lz4": lz4.frame.decompress, "zstd": lambda given: zstandard.decompress(given, size)}
    inner, at = unpack[compression](packed), 0
    assert zlib.crc32(inner) == crc
    while at < len(inner):
        end = at + 9 + number(inner, at + 1, 8)
        if inner[at] == 5:
            yield number(inner, at + 9, 2), number(inner, at + 15, 8), number(inner, at + 23, 8), inner[at + 31 : end]
        at = end


def untouched(whole, damaged):
    """Those messages of a whole log whose chunk is still in a damaged one of the same length, byte for byte."""
    found = [(begin, end) for opcode, begin, end in stretches(whole) if opcode == CHUNK]
    same = {begin for begin, end in found if damaged[begin:end] == whole[begin:end]}
    return [message for begin, held in messages(whole).items() if begin in same for message in held]


def zeroed(data, begin, end):
    return data[:begin] + bytes(end - begin) + data[end:]


def flipped(data, at):
    return data[:at] + bytes([data[at] ^ 16]) + data[at + 1 :]
