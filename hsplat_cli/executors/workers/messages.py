"""Sends messages between the pool and its workers: plain data and buffers of bytes, over a pair of sockets.

    length of the text, uint32 little-endian | text, JSON: [content, lengths of the buffers] | the buffers

Readers check nothing: both ends have the same version, and nobody else has them.
"""

from __future__ import annotations

import json
import socket
import struct
from collections.abc import Generator, Iterator
from dataclasses import dataclass
from typing import Any

from renderer.errors import HsplatError, InputError, RenderError

_LENGTH = struct.Struct("<I")

Plain = dict[str, Any]


@dataclass(frozen=True)
class Message:
    """A message. content: plain data for JSON. buffers: what is too long for that, or not text."""

    content: Plain
    buffers: tuple[bytes, ...] = ()


def send(end: socket.socket, message: Message) -> None:
    """Send a message; waits for room. Raises OSError when nobody reads any more."""
    text = json.dumps([message.content, [len(buffer) for buffer in message.buffers]]).encode("ascii")
    end.sendall(_LENGTH.pack(len(text)) + text)
    for buffer in message.buffers:
        end.sendall(buffer)


def receive(end: socket.socket) -> Message:
    """Wait for the next message. Raises EOFError or OSError where none will come."""
    message = next(_incoming(end, 0))
    assert message is not None
    return message


def receive_available(end: socket.socket) -> Iterator[Message | None]:
    """Yield each message once it is whole, and None where more has to be waited for; never waits.

    Raises EOFError or OSError where no more will come.
    """
    return _incoming(end, socket.MSG_DONTWAIT)


def _incoming(end: socket.socket, flags: int) -> Iterator[Message | None]:
    while True:
        (length,) = _LENGTH.unpack((yield from _receive_exactly(end, _LENGTH.size, flags)))
        content, lengths = json.loads((yield from _receive_exactly(end, length, flags)))
        buffers = []
        for length in lengths:
            buffers.append((yield from _receive_exactly(end, length, flags)))
        yield Message(content, tuple(buffers))


def _receive_exactly(end: socket.socket, num_bytes: int, flags: int) -> Generator[None, None, bytes]:
    content = bytearray(num_bytes)
    missing = memoryview(content)
    while missing:
        try:
            num = end.recv_into(missing, 0, flags)
        except BlockingIOError:
            yield None
            continue
        if num == 0:
            raise EOFError
        missing = missing[num:]
    return bytes(content)


_KINDS: dict[str, type[HsplatError]] = {kind.__name__: kind for kind in (InputError, RenderError)}


def error_to_plain(error: HsplatError) -> Plain:
    """Return an error as plain data; the problems of a SceneError become one text."""
    kind = "InputError" if isinstance(error, InputError) else "RenderError"
    parts = {name: getattr(error, name) for name in ("what", "where", "got", "expected", "hint")}
    return {"kind": kind} | parts


def error_from_plain(plain: Plain) -> HsplatError:
    """Return the error, without its traceback."""
    return _KINDS[plain["kind"]](**{name: text for name, text in plain.items() if name != "kind"})
