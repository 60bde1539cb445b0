"""Handshake faults of the PLC: shown on the page of its registers."""

from station.channel.panel_maintenance import Registers
from station.messages.line import TRIGGER_NOT_RESET, WRONG_ACKNOWLEDGEMENT


def test_the_handshakes_faults_are_on_the_page_of_the_registers(pages, monkeypatch):
    faults = TRIGGER_NOT_RESET(), WRONG_ACKNOWLEDGEMENT()

    def shown():
        status, _, body = pages("GET", "/maintenance/registers/part")
        assert status == 200
        return body.decode()

    async def answer(*_, **__):
        return Registers(registers=(), age_s=0.1, faults=faults)

    monkeypatch.setattr(pages.context.gateway, "request", answer)
    page = shown()
    assert page.count("<li>") == 2
    assert all(words in page for words in ("did not reset its trigger bit", "acknowledged another sequence"))
    faults = ()
    assert "<li>" not in shown()
