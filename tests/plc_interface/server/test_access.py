"""Access to the Modbus server: addresses that may connect and read, and those that may write."""

import pytest

from plc_interface.registers.map import BY_NAME
from plc_interface.server.access import AllowList, plain_address
from plc_interface.server.exceptions import Trouble

KEY = BY_NAME["write_key"].address


@pytest.mark.parametrize(
    ("address", "plain"),
    [("10.0.0.1", "10.0.0.1"), ("::ffff:10.0.0.1", "10.0.0.1"), ("fe80::1%eth0", "fe80::1"), ("::1", "::1")],
)
def test_plain_address(address, plain):
    assert plain_address(address) == plain


def test_allow_list():
    allowed = AllowList(["192.168.1.0/24", "fd00::/8", "10.0.0.7"])
    inside, outside = ["192.168.1.200", "fd12::3", "10.0.0.7"], ["192.168.2.1", "10.0.0.8", "::1"]
    assert all(map(allowed.allows, inside))
    assert not any(map(allowed.allows, outside))
    assert not AllowList([]).allows("127.0.0.1")


def test_a_client_that_may_not_read_is_parted_from(serve, connect, caplog):
    serving = serve(readers=("127.0.0.2",))
    stranger = connect(serving, "127.0.0.3")
    assert stranger.is_closed()
    assert serving.server.statistics.troubles[Trouble.NOT_ALLOWED] == 1
    assert serving.server.statistics.refused_connections == 1
    assert serving.server.connections == 0
    assert [line for line in caplog.messages if line.startswith("127.0.0.3:") and "modbus.readers" in line]
    assert connect(serving, "127.0.0.2").read(KEY, 1) == b"\0\0"


def test_a_client_that_may_only_read_writes_nothing(serve, connect, caplog):
    serving = serve(writers=("127.0.0.2",))
    reader = connect(serving, "127.0.0.3")
    assert reader.write(KEY, 0x5AFE) == bytes([0x90, 1])
    assert reader.read(KEY, 1) == b"\0\0"
    assert serving.server.statistics.troubles[Trouble.NO_RIGHT] == 1
    assert not serving.changes
    assert [line for line in caplog.messages if line.startswith("127.0.0.3:") and "modbus.writers" in line]
    connect(serving, "127.0.0.2").claim()
