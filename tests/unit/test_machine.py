"""Reports describe the machine."""

from __future__ import annotations

import json

from hsplat_cli.terminal import describe_machine


def test_the_machine_is_described() -> None:
    facts = describe_machine("a device")
    assert facts["device"] == "a device"
    assert facts["processor"] and facts["system"] and facts["cores"] >= 1
    assert {"python", "numpy", "moderngl", "flip-evaluator", "scikit-image"} <= set(facts["versions"])
    json.dumps(facts)
