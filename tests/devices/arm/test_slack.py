"""Timer slack of ur-rtde's threads: they are woken loosely, as wake-ups are most of its process's cost."""

import subprocess
import sys

PR_GET_TIMERSLACK = 30
PRINT_SLACKS = f"""
import ctypes, threading
from station.devices.arm.process import TIMER_SLACK_NS, relax_timers
read = lambda: found.append(ctypes.CDLL(None).prctl({PR_GET_TIMERSLACK}))
found = []
relax_timers()
for thread in [threading.Thread(target=read)]:
    thread.start()
    thread.join()
print(found == [TIMER_SLACK_NS], found)
"""


def test_threads_that_ur_rtde_starts_later_are_woken_loosely_too():
    output = subprocess.run([sys.executable, "-c", PRINT_SLACKS], capture_output=True, text=True, check=True).stdout
    assert output.startswith("True"), output
