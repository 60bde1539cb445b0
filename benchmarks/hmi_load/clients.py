"""Clients without a browser: panels that show the page Run, or readers that page through the history.

Run as a program: `clients.py HOST PORT COUNT {panels,readers}`; prints `looking` once all have pages, and goes on until
ended. A panel takes the page's stream and fetches what that page fetches; a reader opens a page a second.
"""

import asyncio
import re
import sys

PAGE_S = 1.0
"""How long a reader reads a page."""
FRUIT, IMAGE, OLDER = (
    re.compile(rb'"(/history/\d+)"'),
    re.compile(rb"/history/image/\w+\.png"),
    re.compile(rb"below=(\d+)"),
)
PART, PICTURE = re.compile(rb'data-live="([a-z._]+)"'), re.compile(rb"/fruit/\d+/picture\.svg")


async def answered(
    host: str, port: int, path: str, cookie: bytes = b""
) -> tuple[asyncio.StreamReader, asyncio.StreamWriter, bytes]:
    """Send a request; returns the answer's head, and the connection with its body still to come."""
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


async def show_panel(host: str, port: int, started: asyncio.Event) -> None:
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
            started.set()
    writer.close()
    raise ConnectionError("the stream ended")


async def page_through(host: str, port: int, started: asyncio.Event) -> None:
    """One reader: the history page by page, every fruit of a page with its images, from the newest to the oldest."""
    head, _ = await fetched(host, port, "/history")
    cookie = (re.search(rb"set-cookie: ([^;\r]+)", head, re.IGNORECASE) or [b"", b""])[1]

    async def page(path: str) -> bytes:
        head, body = await fetched(host, port, path, cookie)
        if b" 200 " not in head.split(b"\r\n", 1)[0]:
            raise ConnectionError(f"{path}: {head[:80]!r}")
        await asyncio.sleep(PAGE_S)
        return body

    path = "/history"
    while True:
        rows = await page(path)
        for fruit in dict.fromkeys(FRUIT.findall(rows)):
            for image in dict.fromkeys(IMAGE.findall(await page(fruit.decode()))):
                await fetched(host, port, image.decode(), cookie)
            started.set()
        older = OLDER.search(rows)
        path = f"/history?below={older[1].decode()}" if older else "/history"


async def main(host: str, port: int, count: int, who: str) -> None:
    """Show or read pages until ended."""
    started_events = [asyncio.Event() for _ in range(count)]
    does = {"panels": show_panel, "readers": page_through}[who]
    async with asyncio.TaskGroup() as group:
        for each in started_events:
            group.create_task(does(host, port, each))
        for each in started_events:
            await each.wait()
        print("looking", flush=True)


if __name__ == "__main__":
    asyncio.run(main(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]), sys.argv[4]))
