"""A result is read whole or not at all."""

import struct

from plc_interface.registers.map import BY_NAME

READS = 10_000
BLOCK = BY_NAME["result_sequence"].address
BEHIND = BY_NAME["result_sequence_end"].end
AGAIN = BY_NAME["result_sequence_again"].address - BLOCK
SIZE = BY_NAME["result_fruit_length_mm_x10"].address - BLOCK
AREA = BY_NAME["result_area_mm2"].address - BLOCK


def result(sequence):
    """A result in which every value follows from its sequence."""
    return {
        "result_sequence": sequence,
        "result_trigger_id": sequence % 65_536,
        "result_area_mm2": float(sequence),
        "result_ended_utc_ms": sequence << 20,
        "result_duration_ms": sequence,
        "result_sequence_again": sequence,
        "result_fruit_length_mm_x10": sequence % 65_536,
        "result_size_class": sequence % 65_536,
        "result_sequence_end": sequence,
    }


def test_no_read_of_ten_thousand_is_torn_while_results_change(serve, connect):
    serving = serve()
    sequence = 0

    def change():
        """As often as the loop comes round, and so between any two requests."""
        nonlocal sequence
        sequence += 1
        serving.image.commit(result(sequence))
        serving.again = serving.loop.call_soon(change)

    plc = connect(serving)
    serving.call(change)
    request = struct.pack(">BHH", 3, BLOCK, BEHIND - BLOCK)
    seen = set()
    try:
        for _ in range(READS // 20):
            plc.send(b"".join(plc.request(request) for _ in range(20)))
            for _ in range(20):
                block = plc.receive()[2][2:]
                first, trigger_id = struct.unpack_from(">IH", block, 0)
                (area,) = struct.unpack_from(">f", block, 2 * AREA)
                (again,) = struct.unpack_from(">I", block, 2 * AGAIN)
                length, size_class, last = struct.unpack_from(">HHI", block, 2 * SIZE)
                assert (first, first, float(first)) == (again, last, area)
                assert first % 65_536 == trigger_id == length == size_class
                seen.add(first)
    finally:
        serving.call(serving.again.cancel)
    assert len(seen) > 100
