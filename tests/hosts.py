"""Loopback addresses for emulated controllers, whose ports are fixed."""

import secrets


def fresh_host() -> str:
    """A loopback address that no other test, process or run has, but for one chance in two million."""
    return f"127.{64 + secrets.randbelow(32)}.{secrets.randbelow(250) + 1}.{secrets.randbelow(250) + 1}"
