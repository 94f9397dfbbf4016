"""How far networks are from onnxruntime: `python tools/network_numbers.py`.

docs/tutorials/your-own-component.md takes its numbers from here. For each shape there are networks
with weights as PyTorch draws them, and inputs with a standard deviation of 1. The component of each
is compared with onnxruntime, and with numpy in double precision. It takes half a minute.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import onnx
import onnxruntime

from orchestrator.paper.page import table
from orchestrator.runs.networks import component_text, read_network

#: Neurons of the layers, of which the first are inputs.
SHAPES = ((4, 8, 2), (1, 300, 1), (3, 300, 2), (12, 64, 64, 6), (16, 200, 200, 4))

#: Seeds of a shape and an activation, and inputs of each.
SEEDS, INPUTS = 20, 10

FUNCTIONS: dict[str, Callable[[Any], Any]] = {"Tanh": np.tanh, "Relu": lambda z: np.maximum(z, 0.0)}


def differences(path: Path, sizes: tuple[int, ...], activation: str, seed: int) -> Any:
    """How far a component is from onnxruntime and from numpy, over the largest output."""
    random, make = np.random.default_rng(seed), onnx.helper
    constants, nodes, value = {}, [], "x"
    for i, (n, m) in enumerate(pairwise(sizes)):
        for name, size in ((f"W{i}", (m, n)), (f"b{i}", (m,))):
            constants[name] = (random.uniform(-1.0, 1.0, size) / np.sqrt(n)).astype(np.float32)
        nodes.append(make.make_node("Gemm", [value, f"W{i}", f"b{i}"], [f"z{i}"], transB=1))
        nodes.append(make.make_node(activation, [f"z{i}"], [value := f"a{i}"]))
    last = f"z{len(sizes) - 2}"
    graph = make.make_graph(
        nodes[:-1],
        "network",
        [make.make_tensor_value_info("x", onnx.TensorProto.FLOAT, [1, sizes[0]])],
        [make.make_tensor_value_info(last, onnx.TensorProto.FLOAT, [1, sizes[-1]])],
        [onnx.numpy_helper.from_array(array, name) for name, array in constants.items()],
    )
    opsets = [make.make_opsetid("", 17)]
    onnx.save(make.make_model(graph, opset_imports=opsets, ir_version=8), str(path))
    session = onnxruntime.InferenceSession(str(path), providers=["CPUExecutionProvider"])
    component: dict[str, Any] = {"__name__": "component"}
    exec(component_text("Network", read_network(path), path.name), component)
    given = random.normal(size=(INPUTS, sizes[0])).astype(np.float32)
    single = np.array([session.run(None, {"x": x[None]})[0][0] for x in given])
    own = np.array([[*component["_network"](component["Vector"](map(float, x)))] for x in given])
    double = given.astype(float)
    for i in range(len(sizes) - 1):
        double = double @ constants[f"W{i}"].T.astype(float) + constants[f"b{i}"]
        double = FUNCTIONS[activation](double) if f"z{i}" != last else double
    return np.array([np.abs(own - other).max() for other in (single, double)]) / np.abs(own).max()


def main() -> None:
    """Print the table."""
    argparse.ArgumentParser(description=__doc__.splitlines()[0]).parse_args()
    rows = []
    with TemporaryDirectory() as folder:
        path = Path(folder) / "network.onnx"
        for sizes in SHAPES:
            for activation in FUNCTIONS:
                found = [differences(path, sizes, activation, seed) for seed in range(SEEDS)]
                largest = [f"{x:.1e}" for x in np.max(found, axis=0)]
                rows.append([" - ".join(map(str, sizes)), activation.lower(), *largest])
    print(table(("neurons", "activation", "to onnxruntime", "to numpy, in double"), rows))


if __name__ == "__main__":
    main()
