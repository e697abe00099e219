"""Open arrays by tensorstore, with limits of its memory and its threads, and state its failures as errors of input."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from renderer.errors import InputError, require_package
from renderer.scene import short_text

if TYPE_CHECKING:
    import tensorstore

# The bytes of decoded chunks and indices of shards that tensorstore keeps. A box is read once, so that only the chunks
# at the borders of two slabs, and the indices of shards, are needed twice.
_CACHE_BYTES = 64 << 20
# Cached chunks and indices are not asked for again by the next slab, as a store is opened for one reading.
_ONCE = {"recheck_cached_data": "open", "recheck_cached_metadata": "open"}
# The number of threads that decode chunks. More threads than cores do not help, and each holds a chunk.
_NUM_DECODERS = 4
# The number of local files that are read at a time. Reading waits for the disk, so that these are more than decoders.
_NUM_FILES = 8
# The number of requests that are sent at a time. At a latency of 20 ms, 512 MiB in chunks of 64^3 bytes took 3.4 s with
# 16 requests, 2.2 s with 32 and 1.7 s with 64, and 0.8 s from a local disk.
_NUM_REQUESTS = 32
# The number of times that a failed request is sent again, and the first and the longest wait between two.
_RETRIES = {"max_retries": 5, "initial_delay": "250ms", "max_delay": "4s"}
# A server that sends fewer bytes in a second than this, over this many seconds, has stalled: the request is sent again.
# A slow line of 64 KiB/s gives each of 32 requests 2 KiB/s.
_STALL_SETTINGS = {
    "TENSORSTORE_CURL_CONNECT_TIMEOUT_SECONDS": "20",
    "TENSORSTORE_CURL_LOW_SPEED_TIME_SECONDS": "20",
    "TENSORSTORE_CURL_LOW_SPEED_LIMIT_BYTES": "1024",
}
# The seconds that a request may take in any case, with its retries: six times 20 s, and the waits between them.
REQUEST_SECONDS = 150.0

# The environment variables with the address of a server in place of Amazon's, in the order in which AWS takes them.
_ENDPOINTS = ("AWS_ENDPOINT_URL_S3", "AWS_ENDPOINT_URL")
# The environment variables with the region of a bucket. A server in place of Amazon's needs one, which may be any.
_REGIONS = ("AWS_REGION", "AWS_DEFAULT_REGION")
_ANY_REGION = "us-east-1"

# The name of an error of tensorstore at the beginning of its message.
_CODE = re.compile(r"([A-Z_]{4,30}): ")
# The names of errors of tensorstore for requests that a server refuses.
_REFUSALS = ("PERMISSION_DENIED", "UNAUTHENTICATED")
# The hints for errors of tensorstore, by their names.
_REFUSED = "the server refuses access: check the credentials (`AWS_...`, `GOOGLE_APPLICATION_CREDENTIALS`) or the URL"
_BROKEN_LINE = "the server or the network failed, also after retries: run the command again, and a film goes on"
_HINTS = {
    "ABORTED": _BROKEN_LINE,
    "UNAVAILABLE": _BROKEN_LINE,
    "DEADLINE_EXCEEDED": _BROKEN_LINE,
    "NOT_FOUND": "a part of the store is missing: copy or download it again",
    "DATA_LOSS": "the store is damaged: copy or download it again",
    "FAILED_PRECONDITION": "the store is damaged, or its metadata belong to another array: copy or download it again",
}


class RefusedError(InputError):
    """An error of access that a server refuses. S3 refuses missing files, too, where listing a bucket is refused."""


def import_library() -> Any:
    """Return the module of tensorstore; raises InputError if it is not installed.

    Tensorstore takes its limits for servers that stall from the environment alone, once: this sets those of them that
    the user has not set, in the child process that reads a store.
    """
    require_package("tensorstore", extra="zarr")
    for name, value in _STALL_SETTINGS.items():
        os.environ.setdefault(name, value)  # noqa: TID251  it is written here, and read by the library
    import tensorstore

    return tensorstore


def make_context() -> tensorstore.Context:
    """Return tensorstore's context for one store: a cache, threads and requests of its own."""
    library = import_library()
    remote: dict[str, object] = {}
    for kind in ("http", "s3", "gcs"):
        remote[f"{kind}_request_concurrency"] = {"limit": _NUM_REQUESTS}
        remote[f"{kind}_request_retries"] = _RETRIES
    context: tensorstore.Context = library.Context(
        {
            "cache_pool": {"total_bytes_limit": _CACHE_BYTES},
            "data_copy_concurrency": {"limit": _NUM_DECODERS},
            "file_io_concurrency": {"limit": _NUM_FILES},
            **remote,
        }
    )
    return context


def s3_server() -> dict[str, str]:
    """Return the members of tensorstore's specification that name a server in place of Amazon's; none without one.

    Tensorstore takes credentials from the environment by itself, but not the address of a server.
    """
    endpoint, region = (
        next(filter(None, (os.environ.get(name) for name in names)), "")  # noqa: TID251  as its credentials are
        for names in (_ENDPOINTS, _REGIONS)
    )
    return {"endpoint": endpoint, "aws_region": region or _ANY_REGION} if endpoint else {}


@contextmanager
def errors_of_library(what: str, where: str) -> Iterator[None]:
    """Turn errors of tensorstore in the `with` block into InputError. what: the sentence that states the failure."""
    try:
        yield
    except TimeoutError as error:
        raise InputError(what, where=where, got="no answer in time", hint=_BROKEN_LINE) from error
    except (ValueError, KeyError, OSError, TypeError) as error:
        text = " ".join(str(error).split()).partition(" [")[0]
        found = _CODE.match(text)
        code = found[1] if found else ""
        got = short_text(text[found.end() :] if found else text, 400)
        if code in _REFUSALS:
            raise RefusedError(what, where=where, got=got, hint=_REFUSED) from error
        raise InputError(what, where=where, got=got, hint=_HINTS.get(code)) from error


def open_array(driver: str, kvstore: Mapping[str, Any], options: Mapping[str, Any], context: Any) -> Any:
    """Return an open array that can only be read, with the index 0 as the first one along each axis."""
    library = import_library()
    spec = {"driver": driver, "kvstore": dict(kvstore), **_ONCE, **options}
    opened = library.open(spec, context=context, read=True, open=True).result(REQUEST_SECONDS)
    return opened[library.d[:].translate_to[0]]
