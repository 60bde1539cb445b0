"""Make this process answer in time while others keep the cores busy."""

import gc
import logging
import os

REAL_TIME_PRIORITY = 1
"""The lowest one: above every ordinary process, below everything else that asked for real time."""

log = logging.getLogger(__name__)


def favour_latency() -> bool:
    """Call once all is set up: take its objects out of the garbage collector's rounds, and ask for real-time priority.

    Needs CAP_SYS_NICE (systemd: `CPUSchedulingPolicy=rr`, or `AmbientCapabilities=CAP_SYS_NICE`); without it a log
    line says so and the process goes on as it is. Processes that it starts do not inherit the priority, and Linux
    leaves 5 % of each second to the others (`sched_rt_runtime_us`).

    Returns:
        Whether the process has real-time priority now.
    """
    gc.collect()
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
