"""The memory of images is not fetched from the kernel again and again."""

import subprocess
import sys

FAULTS = """
import resource, sys
import numpy as np
from station.memory import keep_freed_memory
if sys.argv[1] == "kept":
    keep_freed_memory()
held = []
def draw():
    image = (np.ones((640, 480, 3), np.float32) + 1.0).astype(np.uint8)
    held.append(image)
    del held[:-90]
for _ in range(100):
    draw()
before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
for _ in range(100):
    draw()
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""


def faults(how: str) -> int:
    command = [sys.executable, "-c", FAULTS, how]
    return int(subprocess.run(command, capture_output=True, text=True, timeout=60, check=True).stdout)


def test_what_was_freed_is_used_again():
    assert faults("kept") < 0.2 * faults("as it is")


HEAPS = """
import ctypes, sys, threading
import numpy as np
from station.memory import keep_freed_memory
if sys.argv[1] == "kept":
    keep_freed_memory()
def draw():
    np.ones((480, 640, 3), np.float32)
for _ in range(4):
    thread = threading.Thread(target=draw)
    thread.start()
    thread.join()
libc = ctypes.CDLL(None)
libc.fdopen.restype = ctypes.c_void_p
libc.malloc_info(0, ctypes.c_void_p(libc.fdopen(1, b"w")))
libc.fflush(None)
"""


def heaps(how: str) -> int:
    command = [sys.executable, "-c", HEAPS, how]
    return subprocess.run(command, capture_output=True, text=True, timeout=60, check=True).stdout.count("<heap ")


def test_the_threads_share_what_was_freed():
    assert heaps("as it is") > 1
    assert heaps("kept") == 1


RETURNED = """
import psutil
from station.memory import keep_freed_memory, return_freed_memory
keep_freed_memory()
images, lasting, size = [], [], 1_000_000
for _ in range(80):
    images.append(size * b"a")
    lasting.append(size // 1_000 * b"a")
full = psutil.Process().memory_info().rss
images.clear()
retained = psutil.Process().memory_info().rss
return_freed_memory()
print(full - retained, retained - psutil.Process().memory_info().rss)
"""


def test_what_was_freed_between_lasting_objects_is_returned_when_asked():
    command = [sys.executable, "-c", RETURNED]
    output = subprocess.run(command, capture_output=True, text=True, timeout=60, check=True).stdout
    retained, returned = (int(each) / 1e6 for each in output.split())
    assert retained < 10
    assert returned > 70
