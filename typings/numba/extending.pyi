# numba ships no types, and its decorators change what they decorate.
from typing import Any

def __getattr__(name: str) -> Any: ...
