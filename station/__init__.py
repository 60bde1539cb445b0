"""Quality-inspection station for soft fruit."""

import os

# The sums of a matrix product hang on how many threads share it, and small ones gain nothing: the same image then has
# the same area whatever the number of cores. It is read when numpy is first imported, so it stands here.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
