"""Small neural networks as components: the numbers of numpy and onnxruntime, and bits in C."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from fmus.compilers import machines_compiler
from orchestrator.machine.errors import InputError
from orchestrator.runs.networks import ACTIVATIONS, Network, component_text, read_network
from support.language import Twins, module_of

SIZES = (4, 8, 5, 2)

FUNCTIONS = {
    "none": lambda x: x,
    "tanh": np.tanh,
    "relu": lambda x: np.maximum(x, 0.0),
    "sigmoid": lambda x: 1.0 / (1.0 + np.exp(-x)),
}


def weights(seed: int = 1) -> dict[str, Any]:
    """Layers with float32 weights, as training leaves them."""
    random, found = np.random.default_rng(seed), {}
    for i, (n, m) in enumerate(pairwise(SIZES), start=1):
        found[f"W{i}"] = random.normal(size=(m, n)).astype(np.float32)
        found[f"b{i}"] = random.normal(size=m).astype(np.float32)
    return found


def forward(arrays: dict[str, Any], activations: list[str], x: np.ndarray) -> np.ndarray:
    for i, name in enumerate(activations, start=1):
        x = FUNCTIONS[name](arrays[f"W{i}"].astype(float) @ x + arrays[f"b{i}"])
    return x


def made(path: Path, name: str) -> ModuleType:
    """The component of a file."""
    return module_of(component_text("Policy", read_network(path), path.name), path.parent, name)


def answer(module: ModuleType, x: np.ndarray) -> list[float]:
    [name] = module.Inputs._fields
    vector = vars(module)["Vector"]
    return [*module.advance(module.Inputs(**{name: vector(x)}))[0]]


@pytest.mark.parametrize("activation", ACTIVATIONS)
def test_network_of_an_npz_is_numpys(tmp_path: Path, activation: str):
    arrays, activations = weights(), [activation, "tanh", "none"]
    np.savez(tmp_path / "policy.npz", **arrays, activations=activations)
    module = made(tmp_path / "policy.npz", f"npz_{activation}")
    for x in np.random.default_rng(2).normal(size=(20, SIZES[0])):
        expected = forward(arrays, activations, x)
        np.testing.assert_allclose(answer(module, x), expected, rtol=1e-12, atol=1e-13)


def test_hidden_layers_have_tanh_and_the_last_one_none_if_nothing_is_said(tmp_path: Path):
    np.savez(tmp_path / "policy.npz", **weights())
    said = [layer.activation for layer in read_network(tmp_path / "policy.npz").layers]
    assert said == ["tanh", "tanh", "none"]


@pytest.mark.skipif(machines_compiler() is None, reason="there is no C compiler")
def test_both_kinds_give_the_same_bits(tmp_path: Path):
    np.savez(tmp_path / "policy.npz", **weights(), activations=["relu", "sigmoid", "tanh"])
    both = Twins(made(tmp_path / "policy.npz", "both_kinds"), tmp_path)
    for x in np.random.default_rng(3).normal(size=(50, SIZES[0])):
        assert both.python("advance", [*x]).bits == both.c("advance", [*x]).bits


@pytest.mark.parametrize("ways", ["gemm", "matmul"])
def test_network_of_an_onnx_is_onnxruntimes(tmp_path: Path, ways: str):
    """As PyTorch writes dense layers, and as Keras does."""
    onnx, runtime = pytest.importorskip("onnx"), pytest.importorskip("onnxruntime")
    make, arrays, nodes, value = onnx.helper, weights(), [], "observation"
    known = [onnx.numpy_helper.from_array(a, name) for name, a in arrays.items()]
    for i, operator in enumerate(("Relu", "Sigmoid", "Tanh"), start=1):
        if ways == "gemm":
            nodes.append(make.make_node("Gemm", [value, f"W{i}", f"b{i}"], [f"z{i}"], transB=1))
        else:
            known.append(onnx.numpy_helper.from_array(arrays[f"W{i}"].T.copy(), f"V{i}"))
            nodes.append(make.make_node("MatMul", [value, f"V{i}"], [f"p{i}"]))
            nodes.append(make.make_node("Add", [f"p{i}", f"b{i}"], [f"z{i}"]))
        value = f"a{i}" if i < 3 else "action"
        nodes.append(make.make_node(operator, [f"z{i}"], [value]))
    row = onnx.TensorProto.FLOAT
    graph = make.make_graph(
        nodes,
        "policy",
        [make.make_tensor_value_info("observation", row, [1, SIZES[0]])],
        [make.make_tensor_value_info("action", row, [1, SIZES[-1]])],
        known,
    )
    model = make.make_model(graph, opset_imports=[make.make_opsetid("", 17)], ir_version=8)
    onnx.save(model, str(tmp_path / "policy.onnx"))
    session = runtime.InferenceSession(str(tmp_path / "policy.onnx"))
    module = made(tmp_path / "policy.onnx", f"onnx_{ways}")
    assert module.Inputs._fields == ("observation",)
    assert module.Outputs._fields == ("action",)
    for x in np.random.default_rng(4).normal(size=(50, SIZES[0])).astype(np.float32):
        [[expected]] = session.run(None, {"observation": x[None, :]})[:1]
        np.testing.assert_allclose(answer(module, x), expected, rtol=0.0, atol=1e-6)


def changed(**others: Any) -> dict[str, Any]:
    return {name: array for name, array in {**weights(), **others}.items() if array is not None}


@pytest.mark.parametrize(
    ("arrays", "why"),
    [
        ({"a": np.zeros(3)}, "it has no W1; its arrays are a"),
        (changed(b2=None), "it has 3 arrays W and no b2"),
        (changed(W1=np.zeros(3)), "W1 has 1 dimensions"),
        (changed(b1=np.zeros(3)), "layer 1 has 8 neurons and 3 biases"),
        (changed(W2=np.zeros((5, 9))), "layer 1 gives 8 numbers, and layer 2 takes 9"),
        (changed(b3=np.array([np.nan, 0.0])), "layer 3 has a weight that is not finite"),
        (changed(activations=["tanh"]), "it has 3 layers and 1 activations"),
        (
            changed(activations=["tanh", "gelu", "none"]),
            "layer 2 has the activation 'gelu'; there are none, tanh, relu, sigmoid",
        ),
        (
            {"W1": np.zeros((400, 400)), "b1": np.zeros(400)},
            "it has 160000 weights; a component may have 100000",
        ),
    ],
)
def test_what_is_no_network_is_refused(tmp_path: Path, arrays: dict[str, Any], why: str):
    path = tmp_path / "policy.npz"
    np.savez(path, **arrays)
    with pytest.raises(InputError) as caught:
        read_network(path)
    assert str(caught.value) == f"{path}: {why}"


def test_files_that_cannot_be_read_are_refused(tmp_path: Path):
    with pytest.raises(InputError, match=r"policy\.pt: not an \.onnx or \.npz file"):
        read_network(tmp_path / "policy.pt")
    with pytest.raises(InputError, match=r"policy\.npz: no such file"):
        read_network(tmp_path / "policy.npz")
    (tmp_path / "policy.npz").write_bytes(b"nothing")
    with pytest.raises(InputError, match=r"policy\.npz: cannot be read: "):
        read_network(tmp_path / "policy.npz")


@pytest.mark.parametrize("name", ["in", "time", "fault", "h_max", "_x", "7"])
def test_names_that_ports_cannot_have_are_replaced(name: str):
    network = Network([], name, name)
    assert (network.input_port, network.output_port) == ("x", "y")
