"""Settings of the CAN outputs: values that do not fit are refused with the reason; the driver is off by default."""

import re

import pytest
from pydantic import ValidationError

from station.settings.can import CanSettings


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"gate_node": 17}, "three different node ids"),
        ({"station_node": 16}, "three different node ids"),
        ({"heartbeat_s": 0.3}, "heartbeat_lost_s is 0.5 s and has to be at least twice heartbeat_s, 0.6 s"),
        ({"encoder_period_s": 0.11}, "count_stale_s is 0.2 s and has to be at least twice encoder_period_s"),
        ({"channel": "can0"}, "has to be a multicast address"),
        ({"channel": "192.0.2.1"}, "has to be a multicast address"),
        ({"interface": "socketcan"}, "has to be the name of a network interface, such as can0"),
        ({"interface": "pcan"}, "'virtual', 'udp_multicast' or 'socketcan'"),
        ({"encoder_node": 128}, "less than or equal to 127"),
        ({"pulse_ms": 256}, "less than or equal to 255"),
    ],
)
def test_what_does_not_fit_is_refused(values, message):
    with pytest.raises(ValidationError, match=re.escape(message)):
        CanSettings(**values)


def test_the_driver_is_off_unless_asked_for():
    assert CanSettings().enabled is False
    assert CanSettings(interface="socketcan", channel="can0").channel == "can0"
    assert CanSettings(channel="ff15::1").channel == "ff15::1"
