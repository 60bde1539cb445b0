"""Messages of the gripper: causes and remedies of its faults, its state, and what answers on its wire."""

from station.messages.message import Name, Nested, Number, define

FAULT = define("gripper.fault", "gripper: {cause}; {remedy}", cause=Nested(), remedy=Nested())
REPORTED = define("gripper.reported", "{cause} (fault {number}, {name})", cause=Nested(), number=Name())

ACTIVATE_FIRST = define("gripper.activate_first", "it received a motion before its activation was complete")
ACTIVATION_BIT = define("gripper.activation_bit", "it received a motion without being activated")
OVER_TEMPERATURE = define("gripper.over_temperature", "it is too hot")
NO_COMMUNICATION = define("gripper.no_communication", "it received nothing for a second")
UNDER_VOLTAGE = define("gripper.under_voltage", "its supply voltage is too low")
RELEASING = define("gripper.releasing", "it is releasing on its own")
INTERNAL_FAULT = define("gripper.internal_fault", "its electronics report a fault")
ACTIVATION_FAULT = define("gripper.activation_fault", "its activation failed")
OVERCURRENT = define("gripper.overcurrent", "its motor drew too much current")
RELEASED = define("gripper.released", "it has released on its own")
UNKNOWN = define("gripper.unknown", "it reports a fault that its manual does not list")
EMERGENCY_STOP = define("gripper.emergency_stop", "the robot is emergency stopped")

REMEDY_ACTIVATE = define("gripper.remedy_activate", "activate it first")
REMEDY_OVER_TEMPERATURE = define(
    "gripper.remedy_over_temperature", "let it cool down, and look for a finger that is held or stiff"
)
REMEDY_NO_COMMUNICATION = define("gripper.remedy_no_communication", "check the RS-485 wiring and its terminator")
REMEDY_UNDER_VOLTAGE = define(
    "gripper.remedy_under_voltage",
    "check the 24 V supply and its cable, clear the fingers and activate the gripper again",
)
REMEDY_RELEASING = define(
    "gripper.remedy_releasing",
    "wait until the fingers do not move, clear the fingers and activate the gripper again",
)
REMEDY_INTERNAL_FAULT = define(
    "gripper.remedy_internal_fault",
    "switch it off and on, clear the fingers and activate the gripper again",
)
REMEDY_BLOCKED = define(
    "gripper.remedy_blocked",
    "look for what blocks the fingers, clear the fingers and activate the gripper again",
)
REMEDY_RELEASED = define("gripper.remedy_released", "clear the fingers and activate the gripper again")
REMEDY_UNKNOWN = define("gripper.remedy_unknown", "look at its LED and its manual")
REMEDY_EMERGENCY_STOP = define(
    "gripper.remedy_emergency_stop",
    "make the cell safe, release the button, bring the robot back to running, then activate the gripper",
)

NO_VALUES = define("gripper.no_values", "the URCap has no values of the gripper")
REMEDY_NO_VALUES = define(
    "gripper.remedy_no_values",
    "check that the arm is switched on, the gripper's cable at the wrist, and the gripper's light",
)

NOT_ACTIVE = define("gripper.not_active", "it is not activated")
REMEDY_CLEAR_AND_ACTIVATE = define(
    "gripper.remedy_clear_and_activate", "clear the fingers and activate it: they travel their whole way"
)
REMEDY_WAIT = define("gripper.remedy_wait", "wait: the station activates it where that is safe")
JAWS_UNKNOWN = define("gripper.jaws_unknown", "it is not activated, and what is between its jaws is not known")
REMEDY_EMPTY_JAWS = define(
    "gripper.remedy_empty_jaws",
    "take out what is between them, then press Start on the page Run: the jaws travel their whole way",
)
STOPPED = define("gripper.stopped", "the move was stopped on request")
REMEDY_STOPPED = define("gripper.remedy_stopped", "start the next move when it is wanted")

LATE = define("gripper.late", "{step} did not end in time", step=Nested())
LATE_AT = define(
    "gripper.late_at",
    "{step} did not end in time: the fingers are at count {count}, {state}",
    step=Nested(),
    count=Number(),
    state=Nested(),
)
REMEDY_LATE = define(
    "gripper.remedy_late",
    "look for what holds the fingers, and for a second master that commands the gripper",
)
STEP_RESET = define("gripper.step_reset", "its reset")
STEP_ACTIVATION = define("gripper.step_activation", "its activation")
STEP_MOVE = define("gripper.step_move", "the move to count {count}", count=Number())
STATE_IDLE = define("gripper.state_idle", "with no motion requested")
STATE_MOVING = define("gripper.state_moving", "and it still reports a motion")
STATE_CONTACT_OPENING = define("gripper.state_contact_opening", "stopped by something outside the fingers")
STATE_CONTACT_CLOSING = define("gripper.state_contact_closing", "stopped by something between the fingers")
STATE_AT_POSITION = define("gripper.state_at_position", "and it reports this as the requested position")

WIDTH_OUT_OF_REACH = define(
    "gripper.width_out_of_reach",
    "a width of {width_mm} mm was requested, its fingers reach 0 to {widest_mm} mm",
    widest_mm=Number(2),
)
REMEDY_WIDTH = define("gripper.remedy_width", "correct the recipe's widths or the gripper's calibration")
SPEED_OUT_OF_RANGE = define(
    "gripper.speed_out_of_range",
    "a speed of {speed_mm_s} mm/s was requested, it moves at {slowest_mm_s} to {fastest_mm_s} mm/s",
)
REMEDY_SPEED = define("gripper.remedy_speed", "correct the recipe's speed")
FORCE_OUT_OF_RANGE = define(
    "gripper.force_out_of_range", "a force of {force_n} N was requested, it grips with {weakest_n} to {strongest_n} N"
)
REMEDY_FORCE = define(
    "gripper.remedy_force",
    "correct the recipe's force; a soft fruit is protected by small width steps, not by the force",
)

PLACE_URCAP = define("gripper.place_urcap", "URCap at {address}")
PLACE_MODBUS_RTU = define("gripper.place_modbus_rtu", "Modbus RTU unit {unit} at {address}", unit=Number())
SILENT = define("gripper.silent", "{place} did not answer within {limit_s} s", place=Nested())
REMEDY_SILENT_ROBOT = define(
    "gripper.remedy_silent_robot", "check that the robot is powered and the gripper shows a steady LED"
)
REMEDY_SILENT_LINE = define("gripper.remedy_silent_line", "check the 24 V supply, the wiring and the unit number")
LINK_LOST = define("gripper.link_lost", "the connection to {place} broke", place=Nested())
LINK_LOST_BECAUSE = define(
    "gripper.link_lost_because",
    "the connection to {place} broke ({reason})",
    place=Nested(),
    reason=Nested(),
)
CLOSED_BY_PEER = define("gripper.closed_by_peer", "closed by the other end")
REMEDY_NETWORK = define("gripper.remedy_network", "check the network and the robot; the fingers may still be moving")
REMEDY_CABLE = define("gripper.remedy_cable", "check the cable and the adapter; the fingers may still be moving")
UNREACHABLE = define("gripper.unreachable", "no connection to {place}", place=Nested())
UNREACHABLE_BECAUSE = define(
    "gripper.unreachable_because", "no connection to {place} ({reason})", place=Nested(), reason=Nested()
)
NO_ANSWER = define("gripper.no_answer", "no answer")
REMEDY_URCAP = define(
    "gripper.remedy_urcap",
    "check the robot's address and network, and that the Robotiq URCap is installed and running",
)
REMEDY_SERIAL = define(
    "gripper.remedy_serial",
    "check the serial port or the gateway's address, and that no other program has it open",
)
WRONG_ANSWER = define(
    "gripper.wrong_answer",
    "{place} answered {answer} to {request}",
    place=Nested(),
)
NOT_MODBUS_RTU = define(
    "gripper.not_modbus_rtu",
    "{place} sent what is no Modbus RTU answer: {octets}",
    place=Nested(),
)
MODBUS_EXCEPTION = define("gripper.modbus_exception", "{place} answered with exception {number}", place=Nested())
WRONG_FUNCTION = define(
    "gripper.wrong_function",
    "{place} answered function {found} instead of {expected}",
    place=Nested(),
    found=Number(),
    expected=Number(),
)
WRONG_NUMBER = define(
    "gripper.wrong_number",
    "{place} answered with another number of registers: {found} instead of {expected}",
    place=Nested(),
    found=Number(),
    expected=Number(),
)
REMEDY_PORT = define(
    "gripper.remedy_port",
    "check that the address is the robot's and that nothing else uses the URCap's port",
)
REMEDY_LINE = define(
    "gripper.remedy_line",
    "check baud rate, unit number, wiring and terminator, and that no second master is on the line",
)

CHECK_FOUND = define(
    "gripper.check_found",
    "{place}: position {count}, width {width_mm} mm, {state}",
    place=Nested(),
    count=Number(),
    width_mm=Number(1),
)
CHECK_TROUBLE = define("gripper.check_trouble", "{found}; {trouble}", found=Nested(), trouble=Nested())
CHECK_AT = define("gripper.check_at", "{place}: {trouble}", place=Nested(), trouble=Nested())
CHECK_NOT_ACTIVE = define("gripper.check_not_active", "not activated")
CHECK_UNCALIBRATED = define(
    "gripper.check_uncalibrated",
    "outside the calibrated counts {open} to {closed}",
    open=Number(),
    closed=Number(),
)
REMEDY_CALIBRATE = define(
    "gripper.remedy_calibrate",
    "read the counts with the gripper open and closed and correct gripper.calibration",
)
