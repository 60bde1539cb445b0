"""x"""
from typing import NamedTuple
from pathlib import Path
import json
CHART = Path("/tmp/x/soak.svg")
class Ending(NamedTuple):
    """What the line had decided at the end."""

    decided: dict[str, int]
    unsent: int | None
    took_s: float
def page(samples, *args): 
    Path("/tmp/x/soak_samples.json").write_text(json.dumps([s.at_s for s in samples]))
    import pickle
    Path("/tmp/x/soak.pickle").write_bytes(pickle.dumps((samples,args)))
    return str(args)
def draw(*a): ...
