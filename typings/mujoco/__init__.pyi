# MuJoCo's bindings are compiled and come without types: to pyright, all that is in them is Any.
from typing import Any

def __getattr__(name: str) -> Any: ...
