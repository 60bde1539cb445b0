"""Messages of the arm: causes and remedies of its faults, its requests and its poses."""

from station.messages.message import Nested, Number, define

FAULT = define("arm.fault", "arm: {cause}. {remedy}", cause=Nested(), remedy=Nested())

REMEDY_LINK_LOST = define(
    "arm.remedy_link_lost",
    "Check that the controller is on and its network cable is in; the station keeps trying to connect",
)
REMEDY_STALE = define(
    "arm.remedy_stale", "Wait a moment; if it stays, check the network between the station and the controller"
)
REMEDY_DEADLINE = define(
    "arm.remedy_deadline", "Look at the arm and the pendant; the station has disconnected and connects again"
)
REMEDY_PROTECTIVE_STOP = define(
    "arm.remedy_protective_stop",
    "Find out why the arm stopped, clear its way, then confirm the protective stop",
)
REMEDY_EMERGENCY_STOP = define(
    "arm.remedy_emergency_stop",
    "Make the cell safe, release the emergency stop button, then power on and release the brakes",
)
REMEDY_SAFEGUARD_STOP = define(
    "arm.remedy_safeguard_stop",
    "Close the guard or clear the light curtain, make sure that nobody is at the arm, then upload the program again",
)
REMEDY_SAFETY_FAULT = define(
    "arm.remedy_safety_fault",
    "Read the pendant's log and remove the cause, then power on and release the brakes",
)
REMEDY_NOT_POWERED = define(
    "arm.remedy_not_powered", "Make sure that nobody is at the arm, then power on and release the brakes"
)
REMEDY_LOCAL_CONTROL = define(
    "arm.remedy_local_control", "Switch the pendant to remote control, then upload the program again"
)
REMEDY_PROGRAM_STOPPED = define(
    "arm.remedy_program_stopped",
    "Find out who stopped the program on the pendant and why, then upload it again",
)
REMEDY_WATCHDOG = define(
    "arm.remedy_watchdog", "Remove what made the station unhealthy or slow, then upload the program again"
)
REMEDY_REGISTERS_IN_USE = define(
    "arm.remedy_registers_in_use",
    "Close the other RTDE client, or disable EtherNet/IP, PROFINET and MODBUS on the controller: they claim "
    "registers 0 to 23; then upload the program again",
)
REMEDY_UNREACHABLE = define("arm.remedy_unreachable", "Teach the pose again, or widen the controller's safety limits")
REMEDY_NOT_REACHED = define(
    "arm.remedy_not_reached",
    "Look at the arm: something held it, or its encoders or its payload setting are wrong",
)
REMEDY_STOPPED = define("arm.remedy_stopped", "Nothing to do: the station stopped the motion itself")
REMEDY_BUSY = define("arm.remedy_busy", "Wait for the motion that is under way, or stop it")
REMEDY_UNHEALTHY = define("arm.remedy_unhealthy", "Remove what keeps the station from being healthy")
REMEDY_CLOSED = define("arm.remedy_closed", "Open the arm again")

EMERGENCY_STOP = define("arm.emergency_stop", "an emergency stop is active")
SAFETY_FAULT = define("arm.safety_fault", "the safety system reports a violation or a fault")
PROTECTIVE_STOP = define("arm.protective_stop", "the arm is in a protective stop")
SAFEGUARD_STOP = define("arm.safeguard_stop", "a safeguard stop, as by an open guard, has stopped the arm")
STOPPED_FOR_SAFETY = define(
    "arm.stopped_for_safety", "the arm's safety system has stopped it; the pendant shows the reason"
)
NOT_POWERED = define("arm.not_powered", "the arm is not powered, or its brakes are on")
BUTTON_PRESSED = define("arm.button_pressed", "an emergency stop button is still pressed")
LOCAL_CONTROL = define(
    "arm.local_control", "the controller is in local control and takes neither programs nor commands"
)
REGISTERS_IN_USE = define("arm.registers_in_use", "another client or a fieldbus holds the controller's input registers")
OWN_REGISTERS_HELD = define(
    "arm.own_registers_held",
    "the controller still holds its input registers for the station's connection that was cut",
)
WATCHDOG = define("arm.watchdog", "the controller's watchdog stopped the program, because the station was not healthy")
PROGRAM_STOPPED = define("arm.program_stopped", "the control program was stopped on the controller")
PROGRAM_STOPPED_BECAUSE = define(
    "arm.program_stopped_because", "the control program was stopped on the controller ({reason})", reason=Nested()
)
PROGRAM_NOT_BEGUN = define("arm.program_not_begun", "the control program did not begin to play")
COMMAND_NOT_TAKEN = define("arm.command_not_taken", "the control program plays and did not take the command")
COMMAND_NOT_TAKEN_BECAUSE = define(
    "arm.command_not_taken_because",
    "the control program plays and did not take the command ({reason})",
    reason=Nested(),
)

NOT_OPENED = define("arm.not_opened", "the arm was not opened")
CLOSED = define("arm.closed", "the arm was closed")
NOT_CONNECTED_YET = define("arm.not_connected_yet", "the arm is not connected yet")
NOT_CONNECTED = define("arm.not_connected", "the arm is not connected")
NOT_CONNECTED_BECAUSE = define("arm.not_connected_because", "the arm is not connected: {reason}", reason=Nested())
CONNECTION_FAILED = define("arm.connection_failed", "ur-rtde could not connect: {reason}", reason=Nested())
NOTHING_RECEIVED = define("arm.nothing_received", "ur-rtde receives nothing: {reason}", reason=Nested())
NO_REASON = define("arm.no_reason", "no reason given")
LINK_CUT = define("arm.link_cut", "the controller closed the connection")
STATE_OLD = define("arm.state_old", "the controller's state is {age_s} s old", age_s=Number(2))
STATE_LATE = define("arm.state_late", "the arm's process reported no state within {limit_s} s")
STATE_NOT_RECEIVED = define("arm.state_not_received", "the controller's state is not received yet")
NOT_COMMANDED = define("arm.not_commanded", "the connection that commands the arm is not open yet")
LINK_BUSY = define(
    "arm.link_busy", "the connection to the arm was busy for {limit_s} s (request: {request})", request=Nested()
)
PROCESS_SILENT = define(
    "arm.process_silent", "the arm's process did not answer within {limit_s} s (request: {request})", request=Nested()
)
PROCESS_UNUSABLE = define("arm.process_unusable", "the arm's process cannot be used: {reason}")
PROCESS_NOT_STARTED = define("arm.process_not_started", "the arm's process cannot be started: {reason}")
PROCESS_ENDED = define("arm.process_ended", "the arm's process ended with code {code}", code=Number())
PROCESS_ENDED_AFTER = define(
    "arm.process_ended_after",
    "the arm's process ended with code {code}; its last output: {output}",
    code=Number(),
)

DASHBOARD_SILENT = define("arm.dashboard_silent", "the dashboard server at {host} does not answer")
DASHBOARD_PROTOCOL = define("arm.dashboard_protocol", "the dashboard server at {host} breaks its protocol")
DASHBOARD_CLOSED = define("arm.dashboard_closed", "the dashboard server at {host} closed the connection")
DASHBOARD_ABSENT = define("arm.dashboard_absent", "no controller answers at {address}")
DASHBOARD_UNKNOWN_HOST = define(
    "arm.dashboard_unknown_host", "no controller answers at {address}: there is no machine of that name"
)
DASHBOARD_OTHER = define("arm.dashboard_other", "what answers at {address} is no dashboard server: {greeting}")

POSE = define("arm.pose", "the pose {name}")
POSE_BESIDE_NEST = define("arm.pose_beside_nest", "the pose beside the nest")
UNHEALTHY = define("arm.unhealthy", "the station has not reported that it is healthy")
BUSY = define("arm.busy", "the arm cannot go to {pose}: it is still on its way elsewhere", pose=Nested())
UNREACHABLE = define(
    "arm.unreachable",
    "the controller reports {pose} as out of reach or outside its safety limits",
    pose=Nested(),
)
NO_WAY_BESIDE_NEST = define(
    "arm.no_way_beside_nest",
    "the controller has no way to the offset from the nest x {x_mm}, y {y_mm}, z {z_mm} mm",
    x_mm=Number(1),
    y_mm=Number(1),
    z_mm=Number(1),
)
OFFSET_TOO_LONG = define(
    "arm.offset_too_long",
    "the offset from the nest, x {x_mm}, y {y_mm}, z {z_mm} mm, is longer than the {limit_mm} mm allowed by "
    "arm.centring.most_mm; raise it where the fingers have more room all around",
    x_mm=Number(1),
    y_mm=Number(1),
    z_mm=Number(1),
)
MOTION_STOPPED = define("arm.motion_stopped", "the station stopped the arm on its way to {pose}", pose=Nested())
NOT_REACHED = define("arm.not_reached", "the arm came to rest without reaching {pose}", pose=Nested())
TOO_LATE = define("arm.too_late", "the arm did not reach {pose} within {limit_s} s", pose=Nested())
NO_REST = define("arm.no_rest", "the arm did not come to rest in time")
RECOVERY_TOO_LONG = define("arm.recovery_too_long", "{recovery} did not end within {limit_s} s", recovery=Nested())
RECOVERY_PROTECTIVE_STOP = define("arm.recovery_protective_stop", "leaving the protective stop")
RECOVERY_POWER = define("arm.recovery_power", "powering on")
RECOVERY_UPLOAD = define("arm.recovery_upload", "uploading the program")

REQUEST_START = define("arm.request_start", "start")
REQUEST_WATCH = define("arm.request_watch", "receive the controller's state")
REQUEST_COMMAND = define("arm.request_command", "start the control program")
REQUEST_UPLOAD = define("arm.request_upload", "upload the control program again")
REQUEST_BEAT = define("arm.request_beat", "read the arm's state")
REQUEST_BESIDE = define("arm.request_beside", "compute the way to a pose beside the nest")
REQUEST_MOVE = define("arm.request_move", "begin a motion")
REQUEST_REACHABLE = define("arm.request_reachable", "check that the pose is reachable")
REQUEST_HALT = define("arm.request_halt", "brake")

CHECK_CONTROLLER = define(
    "arm.check_controller",
    "{model} at {host}, serial number {serial}, PolyScope {version}: {mode}, safety {safety}, {control}",
    control=Nested(),
)
CHECK_REMOTE = define("arm.check_remote", "remote control")
CHECK_LOCAL = define("arm.check_local", "local control")
CHECK_RTDE = define("arm.check_rtde", "RTDE at {address}, controller {version}")
CHECK_RTDE_REFUSES = define("arm.check_rtde_refuses", "RTDE at {address}, controller {version}, refuses protocol 2")
CHECK_RTDE_FROZEN = define(
    "arm.check_rtde_frozen",
    "RTDE at {address}, controller {version}, whose state is frozen or more than {limit_s} s late",
)
CHECK_RTDE_REGISTERS = define(
    "arm.check_rtde_registers", "RTDE at {address}, controller {version}, its input registers are in use"
)
CHECK_RTDE_LATE = define("arm.check_rtde_late", "what is at {address} answers an RTDE request later than {limit_s} s")
CHECK_RTDE_CLOSES = define("arm.check_rtde_closes", "what is at {address} closes the connection at an RTDE request")
CHECK_NO_ANSWER = define("arm.check_no_answer", "nothing answers at {address}")
CHECK_PROGRAMS = define("arm.check_programs", "programs are taken at {address}")
CHECK_NO_PROGRAMS = define("arm.check_no_programs", "nothing takes programs at {address}")
REMEDY_HOST = define(
    "arm.remedy_host",
    "Check arm.host in station.yaml, and that the controller is on and its network cable is in",
)
REMEDY_FROZEN = define(
    "arm.remedy_frozen",
    "Check the network between the station and the controller; if the pendant does not react either, restart the "
    "controller",
)
REMEDY_UPDATE = define("arm.remedy_update", "Update the controller's software")
