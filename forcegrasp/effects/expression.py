"""Formulas of a closed grammar: a sum of terms, each with a coefficient of its own. Nothing of a text is executed."""

from __future__ import annotations

import ast
from collections.abc import Callable, Collection, Iterator, Mapping

import numpy as np

from forcegrasp.effects.base import State, first_order_weight
from forcegrasp.errors import closest

_FUNCTIONS: dict[str, tuple[int, Callable[..., np.ndarray]]] = {
    "abs": (1, np.abs), "sign": (1, np.sign), "tanh": (1, np.tanh), "exp": (1, np.exp), "sqrt": (1, np.sqrt),
    "sin": (1, np.sin), "cos": (1, np.cos), "min": (2, np.minimum), "max": (2, np.maximum),
}  # fmt: skip
#: memory(x, tau) is x through a first-order lag, τ dm/dt = x − m, which starts from 0.
_MEMORY = "memory"
#: Words that no parameter may have as its name.
FUNCTIONS = (*_FUNCTIONS, _MEMORY)
_OPERATIONS: dict[type[ast.operator], Callable[..., np.ndarray]] = {
    ast.Add: np.add, ast.Sub: np.subtract, ast.Mult: np.multiply, ast.Div: np.divide, ast.Pow: np.power
}  # fmt: skip
_POWERS, _LARGEST = (2, 3), 1e30
#: Longest formula, in characters.
LONGEST = 400


class Expression:
    """A formula of signals and parameters, such as ``c1 * abs(velocity) * velocity + c2 * tanh(force / f0)``.

    There are numbers, ``+ - * /``, ``**2``, ``**3``, the functions abs, sign, tanh, exp, sqrt, sin, cos, min, max, and
    ``memory(x, tau)``. It is a sum of terms, each with a factor that is a parameter which stands nowhere else: its
    coefficient, without which the term is not there.

    Args:
      text: the formula.
      signals: names of the signals that it may hold.
      parameters: names of the parameters, of which it must hold all.

    Raises:
      ValueError: says in one line what can't be understood.
    """

    def __init__(self, text: str, signals: Collection[str], parameters: Collection[str]) -> None:
        self._signals, self._parameters = frozenset(signals), frozenset(parameters)
        if len(text) > LONGEST:
            raise ValueError(f"{len(text)} characters are too many; {LONGEST} may be used")
        try:
            self._tree = ast.parse(text.strip(), mode="eval").body
        except (SyntaxError, ValueError, RecursionError, MemoryError):
            raise ValueError("must be a formula, such as `c1 * abs(velocity) * velocity`") from None
        self._check(self._tree)
        named = [node.id for node in ast.walk(self._tree) if isinstance(node, ast.Name)]
        for name in self._parameters:
            if name not in named:
                raise ValueError(f"has no {name}, which is among the parameters")
        terms = [[f for f in _factors(term) if named.count(f) == 1 and f in parameters] for term in _terms(self._tree)]
        if not all(terms):
            raise ValueError("each term of the sum needs a parameter of its own as a factor, such as c1 * …")
        #: the coefficient of each term
        self.coefficients = tuple(factors[0] for factors in terms)
        #: the signals that it holds
        self.uses = frozenset(named) & self._signals
        self._memories = [
            node
            for node in ast.walk(self._tree)
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == _MEMORY
        ]
        #: names of the lags of its memories: parameters, or numbers
        self.lags = frozenset(node.args[1].id for node in self._memories if isinstance(node.args[1], ast.Name))

    def memory(self, rows: int, width: int) -> State:
        """Its memory at the start, for :meth:`value`."""
        return {f"memory{index}": np.zeros((rows, width)) for index in range(len(self._memories))}

    def value(
        self, signals: Mapping[str, np.ndarray], parameters: Mapping[str, np.ndarray], state: State, dt: float
    ) -> np.ndarray:
        """What it comes to in one step, ``(rows, width)``; brings its memory up to date.

        Args:
          signals: each ``(rows, width)``, or ``(rows, 1)``.
          parameters: each ``(rows, 1)``.
          state: its memory.
          dt: the step, seconds.
        """
        with np.errstate(all="ignore"):
            return self._value(self._tree, {**signals, **parameters}, state, dt)

    def _value(self, node: ast.AST, known: Mapping[str, np.ndarray], state: State, dt: float) -> np.ndarray:
        if isinstance(node, ast.Constant):
            return np.float64(node.value)  # pyright: ignore[reportArgumentType, reportReturnType]
        if isinstance(node, ast.Name):
            return known[node.id]
        if isinstance(node, ast.UnaryOp):
            value = self._value(node.operand, known, state, dt)
            return -value if isinstance(node.op, ast.USub) else value
        if isinstance(node, ast.BinOp):
            left, right = (self._value(side, known, state, dt) for side in (node.left, node.right))
            return _OPERATIONS[type(node.op)](left, right)
        assert isinstance(node, ast.Call)
        assert isinstance(node.func, ast.Name)
        values = [self._value(one, known, state, dt) for one in node.args]
        if node.func.id != _MEMORY:
            return _FUNCTIONS[node.func.id][1](*values)
        name = f"memory{self._memories.index(node)}"
        state[name] = state[name] + first_order_weight(dt, values[1]) * (values[0] - state[name])
        return state[name]

    def _check(self, node: ast.AST) -> None:
        """Raises ValueError about the first thing that is not of the grammar."""
        parts: list[ast.expr] = []
        if isinstance(node, ast.Constant):
            if not isinstance(node.value, (int, float)) or isinstance(node.value, bool) or abs(node.value) > _LARGEST:
                raise ValueError(f"{_shown(node)}: only numbers up to {_LARGEST:g} may be used")
        elif isinstance(node, ast.Name):
            if node.id not in self._signals | self._parameters:
                raise ValueError(f"{node.id}: unknown{closest(node.id, self._signals | self._parameters)}")
        elif isinstance(node, ast.UnaryOp) and isinstance(node.op, (ast.USub, ast.UAdd)):
            parts = [node.operand]
        elif isinstance(node, ast.BinOp) and type(node.op) in _OPERATIONS:
            parts = [node.left, node.right]
            if isinstance(node.op, ast.Pow):
                if not (isinstance(node.right, ast.Constant) and node.right.value in _POWERS):
                    raise ValueError(f"{_shown(node)}: only **2 and **3 may be used")
                parts = [node.left]
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and not node.keywords:
            parts = node.args
            self._check_call(node, node.func.id)
        else:
            raise ValueError(f"{_shown(node)}: may not be used; + - * / **2 and {', '.join(FUNCTIONS)} may")
        for part in parts:
            self._check(part)

    def _check_call(self, node: ast.Call, name: str) -> None:
        if name not in FUNCTIONS:
            raise ValueError(f"{name}: no such function{closest(name, FUNCTIONS)}")
        takes = 2 if name == _MEMORY else _FUNCTIONS[name][0]
        if len(node.args) != takes:
            raise ValueError(f"{name}: takes {takes} {'values' if takes > 1 else 'value'}")
        if name == _MEMORY:
            lag = node.args[1]
            is_number = isinstance(lag, ast.Constant) and isinstance(lag.value, (int, float)) and lag.value > 0
            if not is_number and not (isinstance(lag, ast.Name) and lag.id in self._parameters):
                raise ValueError("memory: takes a signal and a time constant, a parameter or a positive number")


def _terms(node: ast.AST) -> Iterator[ast.AST]:
    """The terms of a sum."""
    if isinstance(node, ast.BinOp) and isinstance(node.op, (ast.Add, ast.Sub)):
        yield from _terms(node.left)
        yield from _terms(node.right)
    elif isinstance(node, ast.UnaryOp):
        yield from _terms(node.operand)
    else:
        yield node


def _factors(node: ast.AST) -> Iterator[str]:
    """The names that a term is proportional to."""
    if isinstance(node, ast.Name):
        yield node.id
    elif isinstance(node, ast.UnaryOp):
        yield from _factors(node.operand)
    elif isinstance(node, ast.BinOp) and isinstance(node.op, (ast.Mult, ast.Div)):
        yield from _factors(node.left)
        if isinstance(node.op, ast.Mult):
            yield from _factors(node.right)


def _shown(node: ast.AST) -> str:
    return f"`{ast.unparse(node)[:40]}`"
