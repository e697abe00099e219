"""Messages between the pool and its workers: plain data and buffers of bytes, over a pair of sockets.

    length of the text, uint32 little-endian | text, JSON: [content, lengths of the buffers] | the buffers

Whoever reads them checks nothing: both ends are of one version, and nobody else has them.
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
    """content: plain data for JSON. buffers: what is too long for it, or not text."""

    content: Plain
    buffers: tuple[bytes, ...] = ()


def send(end: socket.socket, message: Message) -> None:
    """Send a message, however long it takes until there is room. Raises OSError when nobody reads any more."""
    text = json.dumps([message.content, [len(buffer) for buffer in message.buffers]]).encode("ascii")
    end.sendall(_LENGTH.pack(len(text)) + text)
    for buffer in message.buffers:
        end.sendall(buffer)


def receive(end: socket.socket) -> Message:
    """Wait for the next message. Raises EOFError, or OSError, when there will be none."""
    message = next(_incoming(end, 0))
    assert message is not None
    return message


def receive_available(end: socket.socket) -> Iterator[Message | None]:
    """The messages that come, each once it is whole, and None wherever more has to be waited for.

    So nobody has to wait for a sender that has stopped half way through. Raises EOFError, or OSError, when there will
    be no more.
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
    """An error as plain data. One of many complaints at once becomes one of a single text."""
    kind = "InputError" if isinstance(error, InputError) else "RenderError"
    parts = {name: getattr(error, name) for name in ("what", "where", "got", "expected", "hint")}
    return {"kind": kind} | parts


def error_from_plain(plain: Plain) -> HsplatError:
    """The error again, without its traceback."""
    return _KINDS[plain["kind"]](**{name: text for name, text in plain.items() if name != "kind"})
