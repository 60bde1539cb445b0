"""Messages on the station's processes: their faults, restarts and end."""

from station.messages.message import Listed, Nested, Number, define

NOT_RUNNING = define("supervision.not_running", "is not running")
ENDED = define("supervision.ended", "ended with {how}")
NOT_READY = define("supervision.not_ready", "was not ready after {limit_s} s")
NO_PROGRESS = define("supervision.no_progress", "made no progress for {limit_s} s")
DID_NOT_START = define(
    "supervision.did_not_start",
    "the process {process} {trouble} before it was ready: {output}",
    trouble=Nested(),
)
RESTARTED = define("supervision.restarted", "the process {process} {trouble}: it is started again", trouble=Nested())
GIVEN_UP = define(
    "supervision.given_up",
    "the process {process} {trouble}, after {restarts} restarts within {within_s} s: it is not started again; find the"
    " cause in its log and restart the station",
    trouble=Nested(),
    restarts=Number(0),
)
ALL_GIVEN_UP = define(
    "supervision.all_given_up",
    "the station stopped, because these processes fail again and again: {processes}; find the cause in their logs and"
    " restart the station",
    processes=Listed(),
)
TASK_ENDED = define("supervision.task_ended", "the task {task} ended unexpectedly; restart the station")
