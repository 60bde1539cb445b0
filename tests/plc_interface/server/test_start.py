"""Failed starts of the Modbus server: each cause is one sentence with the remedy."""

import socket

import pytest

from plc_interface.server.server import ModbusServerError, why_not
from station.errors import StationError


def sentence(serve, **settings):
    with pytest.raises(StationError) as caught:
        serve(**settings)
    return str(caught.value)


def test_a_port_in_use(serve, unused_port):
    with socket.socket() as other:
        other.bind(("127.0.0.1", unused_port))
        other.listen()
        text = sentence(serve, port=unused_port)
    assert text.startswith(f"Modbus TCP cannot be served on 127.0.0.1, port {unused_port}: another program listens")
    assert "modbus.port" in text


def test_an_address_of_another_machine(serve):
    absent = sentence(serve, host="192.0.2.1")
    assert "set modbus.host" in absent
    assert "starts again until its network is up" in absent


def test_a_host_that_nobody_knows(serve):
    assert "set modbus.host" in sentence(serve, host="no-such-host.invalid")


def test_a_low_port_without_the_right():
    text = why_not("modbus", "10.0.0.1", 502, PermissionError(13, "Permission denied"))
    assert text.startswith("Modbus TCP cannot be served on 10.0.0.1, port 502: ports below 1024 need a right")
    assert "CAP_NET_BIND_SERVICE" in text
    assert issubclass(ModbusServerError, StationError)


def test_it_serves_on_ipv6(serve, unused_port):
    if not socket.has_ipv6:
        pytest.skip("this machine has no IPv6")
    try:
        serving = serve(host="::1")
    except StationError:
        pytest.skip("this machine has no IPv6 loopback")
    with socket.create_connection(("::1", serving.settings.port)) as client:
        client.sendall(b"\0\1\0\0\0\6\1\3\0\xf1\0\1")
        assert client.recv(100) == b"\0\1\0\0\0\5\1\3\2\x12\x34"
