"""A key of a scene: equal where the contents are, code of functions included."""

from __future__ import annotations

import hashlib
import json
from typing import Any

from dolfin_tongue.base.arrays import FloatArray
from dolfin_tongue.record.codec import Encoder
from dolfin_tongue.scene.scene import Scene


def fingerprint(scene: Scene) -> str:
    """Return a key that two scenes share if their contents are the same."""
    encoder = Encoder()
    content = encoder.encode(scene)
    hashes = {name: _hash(array) for name, array in encoder.arrays.items()}
    text = json.dumps(_canonical(content, hashes))
    return hashlib.sha256(text.encode()).hexdigest()


def _hash(array: FloatArray) -> str:
    head = f"{array.dtype.kind}{array.shape}".encode()
    return hashlib.sha256(head + array.tobytes()).hexdigest()


def _canonical(value: Any, hashes: dict[str, str]) -> Any:
    """JSON without what does not matter: order of mappings, names of arrays, 1 or 1.0."""
    if isinstance(value, list):
        return [_canonical(item, hashes) for item in value]
    if isinstance(value, dict):
        if "array" in value:
            return hashes[value["array"]]
        found = {name: _canonical(part, hashes) for name, part in value.items()}
        if "mapping" in found:
            found["mapping"].sort(key=json.dumps)
        return found
    return float(value) if type(value) is int else value
