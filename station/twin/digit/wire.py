"""The twin camera's messages: a 4-byte big-endian length, a JSON header of that length, then the payload's bytes.

A header names its `kind`; `bytes` in it is the payload's length. The client's request is a header alone:

| request | answer |
|---|---|
| `{"kind": "stream"}` | a `frame` for each frame from now on, until the connection closes |
| `{"kind": "leds", "red": 0..15, "green": 0..15, "blue": 0..15}` | `leds`, the same values |
| `{"kind": "truth"}`, tests only; `"sequence"` names a past frame, the newest where left out | `truth` |

`frame` carries `sequence`, `age_s` (capture to sending), `height`, `width` and the pixels, BGR, row by row. `truth`
carries `sequence`, `closing_mm`, `force_n`, `height`, `width` and the mask, 0 or 255; `error` carries `message`.
"""

import asyncio
import json
import struct
from typing import Any

_LENGTH = struct.Struct(">I")
_LONGEST_HEADER = 4096


def packed(kind: str, payload: bytes | memoryview = b"", **fields: float | str) -> bytes:
    """One message: its kind, the payload's bytes after the header, and the header's other entries."""
    header = json.dumps({"kind": kind, "bytes": len(payload), **fields}).encode()
    return _LENGTH.pack(len(header)) + header + payload


async def read_request(reader: asyncio.StreamReader) -> dict[str, Any]:
    """Read one request.

    Raises:
        ValueError: it is no request.
        asyncio.IncompleteReadError: the client has gone.
    """
    (length,) = _LENGTH.unpack(await reader.readexactly(_LENGTH.size))
    if length > _LONGEST_HEADER:
        raise ValueError(f"a header of {length} bytes; at most {_LONGEST_HEADER} are taken")
    text = await reader.readexactly(length)
    try:
        request = json.loads(text)
    except RecursionError as error:
        raise ValueError("a header is nested too deep") from error
    if not isinstance(request, dict):
        raise ValueError("a header must be a JSON object")  # noqa: TRY004 (one error for all that is no request)
    return request
