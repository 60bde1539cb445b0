"""Real-time priority: answers in time while other processes occupy the cores."""

import gc
import logging
import os

REAL_TIME_PRIORITY = 1
"""The lowest one: above every ordinary process, below every other real-time process."""

log = logging.getLogger(__name__)


def request_real_time_priority() -> bool:
    """Freeze the garbage collector's objects and request real-time priority, once all is set up; False if refused.

    Needs CAP_SYS_NICE (systemd: `CPUSchedulingPolicy=rr`, or `AmbientCapabilities=CAP_SYS_NICE`); without it a log line
    reports that and the process goes on as it is. Processes that it starts do not inherit the priority, and Linux
    leaves 5 % of each second to the others (`sched_rt_runtime_us`).
    """
    gc.collect()
    # Later collections skip what exists by now, so that their pauses are short.
    gc.freeze()
    try:
        os.sched_setscheduler(0, os.SCHED_RR | os.SCHED_RESET_ON_FORK, os.sched_param(REAL_TIME_PRIORITY))
    except (OSError, AttributeError) as error:
        log.warning(
            "no real-time priority for the PLC's server (%s): its replies may be late while other programs work; "
            "give the service CAP_SYS_NICE",
            error,
        )
        return False
    return True
