# onnxruntime's bindings are compiled and hardly typed: to pyright, all that is in them is Any.
from typing import Any

def __getattr__(name: str) -> Any: ...
