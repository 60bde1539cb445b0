"""Fault of the pages' process: reported by the station once pages that were heard are silent."""

import time

from station.messages.operation import PAGES_SILENT
from station.runtime.rpc.operator import SILENT_S, PanelServer


def test_pages_that_were_heard_and_are_silent_are_a_fault():
    panel = PanelServer.__new__(PanelServer)
    panel._heard_s = None
    assert panel.hmi_fault() is None, "a station without pages, or whose pages are not there yet"
    panel._heard_s = time.monotonic()
    assert panel.hmi_fault() is None
    panel._heard_s -= SILENT_S + 1
    fault = panel.hmi_fault()
    assert fault is not None
    assert fault.id == PAGES_SILENT.id
