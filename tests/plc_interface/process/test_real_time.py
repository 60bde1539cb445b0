"""Real-time priority of the process: granted or refused with the remedy, tried in a process of its own."""

import subprocess
import sys

SCRIPT = """
import gc, logging, os
from plc_interface.process.real_time import request_real_time_priority
logging.basicConfig(format="%(message)s")
got = request_real_time_priority()
policy = os.sched_getscheduler(0)
assert got == (policy == os.SCHED_RR | os.SCHED_RESET_ON_FORK), policy
assert gc.get_freeze_count() > 0
if got:
    os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    os.setuid(65534)
assert not request_real_time_priority()
"""


def test_it_gets_what_it_may_and_says_what_it_may_not():
    done = subprocess.run([sys.executable, "-c", SCRIPT], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr
    assert "give the service CAP_SYS_NICE" in done.stderr
