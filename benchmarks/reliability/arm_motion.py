"""Prints when the arm moves: a process of its own, as the RTDE library holds up the rest of its process."""

import sys
import time

from rtde_receive import RTDEReceiveInterface

_MOVING_M_PER_S = 0.02


def main() -> None:
    """Print `watching` once connected to the host given, and `moving` when the tool moves; then end."""
    link = RTDEReceiveInterface(sys.argv[1], 125.0, ["actual_TCP_speed"])
    print("watching", flush=True)
    while sum(speed**2 for speed in link.getActualTCPSpeed()[:3]) < _MOVING_M_PER_S**2:
        time.sleep(0.01)
    print("moving", flush=True)


if __name__ == "__main__":
    main()
