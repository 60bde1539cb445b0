"""Telegraf's Modbus input: every register but the control block, as fields of a measurement for each block.

Telegraf's documentation, "Modbus Input Plugin", configuration type `request`.
"""

from plc_interface.registers.generate.notices import MADE_BY, UNTESTED
from plc_interface.registers.generate.type_names import NAMES
from plc_interface.registers.map import GROUPS
from plc_interface.registers.register import Kind


def telegraf() -> str:
    """The file `telegraf.conf`."""
    lines = [
        f"# {MADE_BY} {UNTESTED}",
        '# High word first; where the station is configured for the low word first write byte_order = "CDAB" and leave',
        "# out the UINT64 fields. Telegraf 1.29 or newer: an older one refuses the whole file for its STRING fields.",
        "[[inputs.modbus]]",
        '  name = "fruit-station"',
        '  controller = "tcp://127.0.0.1:5020"',
        '  timeout = "1s"',
        '  configuration_type = "request"',
    ]
    for group in GROUPS[1:]:
        lines += [
            "",
            "  [[inputs.modbus.request]]",
            "    slave_id = 1",
            '    byte_order = "ABCD"',
            '    register = "holding"',
            f'    measurement = "fruit_station_{group.name}"',
            "    fields = [",
        ]
        for register in group.registers:
            length = f", length = {register.words}" if register.kind is Kind.TEXT else ""
            lines.append(
                f'      {{ address = {register.address}, name = "{register.name}", '
                f'type = "{NAMES[register.kind].telegraf}"{length} }},'
            )
        lines.append("    ]")
    texts = [register.name for group in GROUPS[1:] for register in group.registers if register.kind is Kind.TEXT]
    lines += ["", "# Texts without the NULs that fill their registers", "[[processors.strings]]"]
    lines.append('  namepass = ["fruit_station_*"]')
    for name in texts:
        lines += ["", "  [[processors.strings.trim_right]]", f'    field = "{name}"', '    cutset = "\\u0000"']
    return "\n".join([*lines, ""])
