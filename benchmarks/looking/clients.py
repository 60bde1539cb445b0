"""Panels without a browser: each takes the stream of the page Run and fetches what that page fetches.

Run as a program: `clients.py HOST PORT COUNT`; says `looking` once all are told what is new, and goes on until ended.
"""

import asyncio
import re
import sys

PART, PICTURE = re.compile(rb'data-live="([a-z._]+)"'), re.compile(rb"/fruit/\d+/picture\.svg")


async def answered(
    host: str, port: int, path: str, cookie: bytes = b""
) -> tuple[asyncio.StreamReader, asyncio.StreamWriter, bytes]:
    """Ask for something; gives the answer's head, and the connection with its body still to come."""
    reader, writer = await asyncio.open_connection(host, port, limit=1 << 20)
    lines = [f"GET {path} HTTP/1.1", f"Host: {host}:{port}", "Accept-Language: en", f"Cookie: {cookie.decode()}"]
    writer.write("\r\n".join([*lines, "Connection: close", "", ""]).encode())
    return reader, writer, await reader.readuntil(b"\r\n\r\n")


async def fetched(host: str, port: int, path: str, cookie: bytes = b"") -> tuple[bytes, bytes]:
    """An answer's head and body."""
    reader, writer, head = await answered(host, port, path, cookie)
    body = await reader.read()
    writer.close()
    return head, body


async def look(host: str, port: int, looking: asyncio.Event) -> None:
    """One panel: the page and its picture, then the stream, and the picture of each new fruit."""
    head, page = await fetched(host, port, "/")
    cookie = (re.search(rb"set-cookie: ([^;\r]+)", head, re.IGNORECASE) or [b"", b""])[1]
    query = "&".join(f"part={name.decode()}" for name in PART.findall(page))
    shown = b""
    reader, writer, _ = await answered(host, port, f"/live?{query}", cookie)
    while line := await reader.readline():
        pictures = PICTURE.findall(line)
        if pictures and pictures[-1] != shown:
            shown = pictures[-1]
            await fetched(host, port, shown.decode(), cookie)
        if line.startswith(b"data:"):
            looking.set()
    writer.close()
    raise ConnectionError("the stream ended")


async def main(host: str, port: int, count: int) -> None:
    """Look until ended."""
    begun = [asyncio.Event() for _ in range(count)]
    async with asyncio.TaskGroup() as group:
        for each in begun:
            group.create_task(look(host, port, each))
        for each in begun:
            await each.wait()
        print("looking", flush=True)


if __name__ == "__main__":
    asyncio.run(main(sys.argv[1], int(sys.argv[2]), int(sys.argv[3])))
