"""Records and signatures of the kernels, made from their headers: `python tests/support/kernel_records.py` writes them.

A struct that is a member of others is a record, a NamedTuple in renderer/kernels/records.py. The struct that a kernel
takes is its signature in renderer/kernels/signatures.pyi, which only mypy reads.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

from renderer.kernels import SOURCES, Member, Struct, read_headers

RECORDS, SIGNATURES = SOURCES.parent / "records.py", SOURCES.parent / "signatures.pyi"
_RECORDS_HEAD = '''\
"""Records that kernels take: the structs of the headers `sources/*/kernels.h` that are members of others.

`tests/support/kernel_records.py` makes this file from the headers.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
'''
_SIGNATURES_HEAD = """\
# The signatures of kernels, whose parameters the headers `sources/*/kernels.h` describe.
#
# `tests/support/kernel_records.py` makes this file from the headers. Only mypy reads it.

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.records import """


def records() -> str:
    """Return the content of renderer/kernels/records.py."""
    header = read_headers(SOURCES)
    names = [name for name in header.names if name not in header.arguments.values()]
    return "\n".join([_RECORDS_HEAD, *(line for name in names for line in _record(name, header.struct_named(name)))])


def _record(name: str, struct: Struct) -> Iterator[str]:
    yield from ("", f"class {name}(NamedTuple):")
    first, *others = struct.comment
    if others:
        yield from (f'    """{first}', *(f"    {line}".rstrip() for line in others), '    """', "")
    else:
        yield from (f'    """{first}"""', "")
    for key, member in struct.members.items():
        yield from (f"    # {line}" for line in member.comment)
        yield f"    {key}: {member.type.annotation}"
    yield ""


def signatures() -> str:
    """Return the content of renderer/kernels/signatures.pyi."""
    header = read_headers(SOURCES)
    structs = {name: header.struct_of(name) for name in header.arguments}
    lines = [line for kernel in structs.values() for line in _protocols(kernel)]
    lines += ["", "class Kernels:"]
    for name, kernel in structs.items():
        if _members_of_call(kernel):
            lines.append(f"    {name}: {kernel.annotation}")
        else:
            lines += _method(name, kernel.members, "None")
    text = "\n".join([*lines, ""])
    used = sorted(set(re.findall(r"\w+", text)) & set(header.names) - set(header.arguments.values()))
    imported = "".join(f"    {name},\n" for name in used)
    return f"{_SIGNATURES_HEAD}(\n{imported})\n{text}"


def _protocols(kernel: Struct) -> Iterator[str]:
    """Yield the lines of the types of a kernel and of the function that its `partial` returns; none without `partial`.

    A kernel has `partial` if some members of its struct are given anew at each call."""
    of_call = _members_of_call(kernel)
    if not of_call:
        return
    others = {key: member for key, member in kernel.members.items() if key not in of_call}
    yield from ("", f"class {kernel.annotation}Call(Protocol):", *_method("__call__", of_call, "None"))
    partial = _method("partial", others, f"{kernel.annotation}Call")
    yield from ("", f"class {kernel.annotation}(Protocol):", *partial)


def _members_of_call(kernel: Struct) -> dict[str, Member]:
    return {key: member for key, member in kernel.members.items() if member.is_of_call}


def _method(name: str, members: dict[str, Member], result: str) -> list[str]:
    parameters = [f"        {key}: {member.type.annotation}," for key, member in members.items()]
    return [f"    def {name}(", "        self,", "        *,", *parameters, f"    ) -> {result}: ..."]


if __name__ == "__main__":
    RECORDS.write_text(records(), encoding="ascii")
    SIGNATURES.write_text(signatures(), encoding="ascii")
