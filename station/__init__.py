"""Quality-inspection station for soft fruit."""

import os

# One thread: the rounding of a matrix product depends on how many threads share it, so an area would depend on the
# number of cores; small products gain nothing from more. Set here because numpy reads it at its first import.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
