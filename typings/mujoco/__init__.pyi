# MuJoCo ships no types for its compiled modules: its names are taken as they are.
from typing import Any

def __getattr__(name: str) -> Any: ...
