"""Messages of the line's CAN: the bus, its nodes and the reject actuations."""

from station.messages.message import Name, Nested, Number, define

# The interface.
INTERFACE = define("can.interface", "the CAN interface {interface} {channel}")
INTERFACE_PORT = define(
    "can.interface_port",
    "the CAN interface {interface} {channel} port {port}",
    port=Number(),
)
NOT_OPENED = define("can.not_opened", "{bus} cannot be opened: {error}; {remedy}", bus=Nested(), remedy=Nested())
NOT_SENDING = define("can.not_sending", "{bus} does not send: {error}; {remedy}", bus=Nested(), remedy=Nested())
NOT_RECEIVING = define("can.not_receiving", "{bus} does not receive: {error}; {remedy}", bus=Nested(), remedy=Nested())
DEAF = define(
    "can.deaf", "{bus} receives nothing: the receiving thread has ended; it is reopened by itself", bus=Nested()
)
CLOSED = define("can.closed", "{bus} is closed", bus=Nested())
BUS_OFF = define(
    "can.bus_off",
    "{bus} is bus-off after too many errors; check cable, termination and bit rate; it is reopened by itself",
    bus=Nested(),
)
BUS_FAILED = define("can.bus_failed", "the bus failed: {error}; check the interface")
DO_ROUTE = define(
    "can.do_route", "this machine needs a network route for multicast: choose another can.channel, or add a route"
)
DO_KERNEL = define(
    "can.do_kernel", "this machine's kernel has no CAN: load the modules can and can_raw, or set can.interface"
)
DO_BRING_UP = define(
    "can.do_bring_up",
    "look for it with: ip link show type can; bring it up with: ip link set {channel} up type can bitrate {bitrate} "
    "restart-ms 100",
)

# The nodes.
GATE = define("can.gate", "the reject gate (node {node})", node=Number())
ENCODER = define("can.encoder", "the line encoder (node {node})", node=Number())
NO_HEARTBEAT = define(
    "can.no_heartbeat",
    "no heartbeat of {node} on {interface} {channel}; check its power, cable, bit rate and node id ({setting})",
    node=Nested(),
)
ANOTHER_DEVICE = define(
    "can.another_device",
    "{node} is another device: its {what} is {found}, expected {expected}; connect the right one, or set its node id "
    "and {setting} to the same number",
    node=Nested(),
    what=Nested(),
)
READING = define("can.reading", "reading its {object}")
WRITING = define("can.writing", "setting its {object} to {value}")
READING_MAPPING = define("can.reading_mapping", "reading the mapping of its {pdo}")
WRITING_MAPPING = define("can.writing_mapping", "setting the mapping of its {pdo}")
DEVICE_TYPE = define("can.device_type", "device type")
VENDOR = define("can.vendor", "vendor")
PRODUCT = define("can.product", "product")
REVISION = define("can.revision", "revision")
ANOTHER_MAPPING = define(
    "can.another_mapping",
    "{node} accepted its PDO mapping and has another one: {pdo} is {found}, expected {expected}; compare its firmware "
    "with the data sheet that the station ships",
    node=Nested(),
)
ANOTHER_VALUE = define(
    "can.another_value",
    "{node} was given {object} {written} and holds {read}; compare its firmware with the data sheet that the station "
    "ships",
    node=Nested(),
)
REFUSED = define(
    "can.refused",
    "{node} refused {access}: {error}; compare its firmware with the data sheet that the station ships",
    node=Nested(),
    access=Nested(),
)
NO_ANSWER = define(
    "can.no_answer",
    "{node} did not answer {access}; check its power and cable, and that there is no second master",
    node=Nested(),
    access=Nested(),
)
NONSENSE = define(
    "can.nonsense",
    "{node} answered {access} with nonsense: {error}; compare its firmware with the data sheet that the station ships",
    node=Nested(),
    access=Nested(),
)
FAILED_MEANWHILE = define(
    "can.failed_meanwhile",
    "the bus failed during {access} of {node}: {error}; check the interface",
    node=Nested(),
    access=Nested(),
)
STATE_REFUSED = define(
    "can.state_refused",
    "{node} did not become {state} when commanded; check its state, and that there is no second master",
    node=Nested(),
)
SILENT = define("can.silent", "{node} sends no heartbeat any more; check its power and cable", node=Nested())
STATE_CHANGED = define(
    "can.state_changed",
    "{node} is {state} without a command: it was restarted, or lost the station's heartbeat; it is brought up again",
    node=Nested(),
)
EMERGENCY = define(
    "can.emergency",
    "{node}: {what} (emergency {code}, error register {register}); {remedy}",
    node=Nested(),
    what=Nested(),
    remedy=Nested(),
)

# Emergencies, and what to do.
CURRENT_HIGH = define("can.current_high", "the current at an output is too high")
SHORT_CIRCUIT = define("can.short_circuit", "an output has a short circuit")
NO_LOAD = define("can.no_load", "an output carries no load")
SUPPLY_HIGH = define("can.supply_high", "its supply voltage is too high")
SUPPLY_LOW = define("can.supply_low", "its supply voltage is too low")
FRAMES_LOST = define("can.frames_lost", "it lost CAN frames")
ERROR_PASSIVE = define("can.error_passive", "its CAN controller is error passive")
HEARTBEAT_LOST = define("can.heartbeat_lost", "it lost the station's heartbeat and set its safe output")
RECOVERED = define("can.recovered", "it recovered from bus-off")
WRONG_LENGTH = define("can.wrong_length", "it got an order of the wrong length")
COUNT_LOST = define("can.count_lost", "it lost the encoder's count")
GENERIC = define("can.generic", "a generic error")
CURRENT = define("can.current", "a current is wrong")
VOLTAGE = define("can.voltage", "a voltage is wrong")
TEMPERATURE = define("can.temperature", "a temperature is wrong")
HARDWARE = define("can.hardware", "its hardware is faulty")
SOFTWARE = define("can.software", "its software is faulty")
MODULE = define("can.module", "an additional module is faulty")
COMMUNICATION = define("can.communication", "its communication is disturbed")
EXTERNAL = define("can.external", "an external error")
ADDITIONAL = define("can.additional", "an additional function is faulty")
UNKNOWN = define("can.unknown", "an error that CiA 301 does not list")
DO_FLAP = define("can.do_flap", "look for what blocks the flap, and check its valve")
DO_VALVE = define("can.do_valve", "check the cable and the valve of the flap")
DO_SUPPLY = define("can.do_supply", "check its power supply")
DO_LOAD = define("can.do_load", "check the load and the bit rate of the bus")
DO_CABLE = define("can.do_cable", "check cable, termination and bit rate of the bus")
DO_STATION = define("can.do_station", "find out why the station stopped")
DO_AGAIN = define("can.do_again", "bring the bus up again; compare the node with its data sheet")
DO_ENCODER = define("can.do_encoder", "check the encoder's power, cable and node id")
DO_MANUAL = define("can.do_manual", "look the code up in the node's manual")

# Why nothing can be ordered.
NOT_STARTED = define("can.not_started", "the CAN driver is not started")
UNHEALTHY = define(
    "can.unhealthy", "the station is not healthy, so it withholds its heartbeat, and the gate keeps its safe output"
)
COMING_UP = define("can.coming_up", "the CAN bus is being brought up")
NO_COUNT = define("can.no_count", "the encoder's count is not known; check the encoder's power and cable")
DRIVER_FAILED = define("can.driver_failed", "the CAN driver failed; read its log")
DRIVER_STOPPED = define("can.driver_stopped", "the driver was stopped")

# Reject actuations.
SHOT = define("can.shot", "reject {sequence}: {what}", sequence=Number(), what=Nested())
NOT_ORDERED = define("can.not_ordered", "it was not ordered: {why}", why=Nested())
FIRED_LATE = define(
    "can.fired_late",
    "the gate fired {counts} counts after count {at_count}; check the encoder and can.tolerance_counts",
    counts=Number(),
)
FIRED_EARLY = define(
    "can.fired_early",
    "the gate fired {counts} counts before count {at_count}; check the encoder and can.tolerance_counts",
    counts=Number(),
)
ORDER_LATE = define(
    "can.order_late",
    "count {at_count} was past when the gate got the order, at {now_count}; the fruit went by: raise "
    "can.distance_counts or shorten the inspection",
)
GATE_FULL = define("can.gate_full", "all places of the gate are taken; if this occurs often, slow the line down")
LANE_REFUSED = define(
    "can.lane_refused",
    "the gate does not accept lane {lane} (answer {answer}); check the lane",
    lane=Number(),
    answer=Number(),
)
ORDERED_TWICE = define("can.ordered_twice", "it is ordered already; give each reject a sequence of its own")
ORDER_MALFORMED = define(
    "can.order_malformed",
    "expected a sequence from 1 to {most}, a lane from 1 to {lanes} and a count from 0 to {most}, found {sequence}, "
    "{lane} and {at_count}",
    lanes=Number(),
    at_count=Name(),
)
COUNT_PAST = define(
    "can.count_past",
    "count {at_count} is past, the belt is at {now_count}; nothing was ordered and the fruit went by: shorten the "
    "inspection, or raise the distance from the nest to the gate",
)
COUNT_TOO_FAR = define(
    "can.count_too_far",
    "count {at_count} is further ahead than the way from the nest to the gate, the belt is at {now_count}: the encoder "
    "was reset, or not known at the trigger; look at the fruit",
)
NOT_CONFIRMED = define(
    "can.not_confirmed",
    "the gate did not confirm the order within {limit_s} s; check the gate, and treat the fruit as not diverted",
)
NOT_REPORTED = define(
    "can.not_reported", "the belt is past count {at_count} and the gate did not report; check the gate and the fruit"
)
BELT_SLOW = define("can.belt_slow", "the belt did not reach count {at_count} within {limit_s} s; check that it runs")
GATE_LOST = define("can.gate_lost", "the gate was lost before it reported ({why}); look at the fruit", why=Nested())
UNORDERED_REPORT = define(
    "can.unordered_report",
    "the gate reports reject {sequence}, which was not ordered; check that there is no second master on the bus",
    sequence=Number(),
)
