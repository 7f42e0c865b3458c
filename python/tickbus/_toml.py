"""Writes Python values as TOML, the language of driver.cfg."""

from __future__ import annotations

import operator
import os
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Union

if TYPE_CHECKING:
    from typing import TypeAlias

Tables: TypeAlias = Union[str, Mapping[str, Any]]

_ESCAPES = {'"': '\\"', "\\": "\\\\"}


def document(tables: Tables) -> str:
    """Tables as in a driver.cfg. A text is returned unchanged."""
    if isinstance(tables, str):
        return tables
    if not isinstance(tables, Mapping):
        raise TypeError(f"tables are a text in TOML or a mapping, not {type(tables).__name__}")
    text = ""
    for name, content in tables.items():
        if isinstance(content, Mapping):
            text += f"[{_key(name)}]\n{section(content)}"
        elif isinstance(content, Sequence) and all(isinstance(part, Mapping) for part in content):
            text += "".join(f"[[{_key(name)}]]\n{section(part)}" for part in content)
        else:
            raise TypeError(
                f"{name!r}: a table of driver.cfg is a mapping, or a list of them, not {type(content).__name__};"
                f" such as {{'fieldbus': {{'kind': 'loopback'}}}}"
            )
    return text


def section(keys: Mapping[str, Any]) -> str:
    """The keys of one table, one per line."""
    return "".join(f"{_key(name)} = {_value(value)}\n" for name, value in keys.items())


def _key(name: object) -> str:
    if not isinstance(name, str):
        raise TypeError(f"a key of driver.cfg is a text, not {name!r}")
    bare = name != "" and all(c.isascii() and (c.isalnum() or c in "-_") for c in name)
    return name if bare else _text(name)


def _value(value: object) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, float):
        return float.__repr__(value)
    if isinstance(value, os.PathLike):
        return _text(os.fsdecode(value))
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{_key(name)} = {_value(part)}" for name, part in value.items()) + " }"
    if isinstance(value, Sequence) and not isinstance(value, (bytes, bytearray, memoryview)):
        return "[" + ", ".join(map(_value, value)) + "]"
    try:
        return str(operator.index(value))  # type: ignore[arg-type]
    except TypeError:
        raise TypeError(
            f"{value!r} cannot stand in a driver.cfg: expected a text, a number, a bool, a path, a list or a mapping"
        ) from None


def _text(content: str) -> str:
    escaped = (_ESCAPES.get(c) or (f"\\u{ord(c):04X}" if c < " " or c == "\x7f" else c) for c in content)
    return '"' + "".join(escaped) + '"'
