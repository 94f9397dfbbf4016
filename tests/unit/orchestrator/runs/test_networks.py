"""Small neural networks as components: the numbers of numpy and onnxruntime, and bits in C."""

from __future__ import annotations

import ast
import re
from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from fmus.compilers import machines_compiler
from fmus.language import types
from orchestrator.machine.errors import InputError
from orchestrator.runs import networks
from orchestrator.runs.networks import ACTIVATIONS, Dense, Network, component_text, read_network
from support.language import Twins, module_of

SIZES = (4, 8, 5, 2)

FUNCTIONS = {
    "none": lambda x: x,
    "tanh": np.tanh,
    "relu": lambda x: np.maximum(x, 0.0),
    "sigmoid": lambda x: 1.0 / (1.0 + np.exp(-x)),
}


def weights(seed: int = 1, sizes: Sequence[int] = SIZES) -> dict[str, Any]:
    """Layers with float32 weights, as training leaves them."""
    random, found = np.random.default_rng(seed), {}
    for i, (n, m) in enumerate(pairwise(sizes), start=1):
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
    return [*module.outputs(module.Inputs(**{name: vector(x)}))[0]]


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
        assert both.python("outputs", [*x]).bits == both.c("outputs", [*x]).bits


def saved(
    path: Path, nodes: list[Any], shape: Sequence[Any], constants: dict[str, Any], opset: int = 17
) -> None:
    """Write a graph from `x` to `y`."""
    onnx = pytest.importorskip("onnx")
    make, kind = onnx.helper, onnx.TensorProto.FLOAT
    graph = make.make_graph(
        nodes,
        "policy",
        [make.make_tensor_value_info("x", kind, shape)],
        [make.make_tensor_value_info("y", kind, None)],
        [onnx.numpy_helper.from_array(array, name) for name, array in constants.items()],
    )
    opsets = [make.make_opsetid("", opset)]
    onnx.save(make.make_model(graph, opset_imports=opsets, ir_version=8), str(path))


def session_of(path: Path) -> Any:
    runtime = pytest.importorskip("onnxruntime")
    options = runtime.SessionOptions()
    # It tells of each model that it refuses.
    options.log_severity_level = 4
    options.intra_op_num_threads = 1
    return runtime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])


def rounding(network: Network, x: np.ndarray, steps: int = 3) -> np.ndarray:
    """How far single precision may be off, by the usual bound of a sum of n products.

    Args:
        network: in double precision.
        x: its inputs.
        steps: roundings of each sum besides those of its products.

    """
    error = np.zeros(network.n_inputs)
    for W, b, activation in network.layers:
        sizes = np.abs(W) @ np.abs(x) + np.abs(b)
        error = np.abs(W) @ error + (W.shape[1] + steps) * 2.0**-24 * sizes
        x = FUNCTIONS[activation](W @ x + b)
        # The activations have slopes of at most 1, and onnxruntime's own are off by some units.
        error = error + 8 * 2.0**-24 * (activation != "none")
    return error


@pytest.mark.parametrize("ways", ["gemm", "matmul"])
@pytest.mark.parametrize("sizes", [SIZES, (1, 300, 1), (3, 300, 2)])
def test_network_of_an_onnx_is_onnxruntimes(tmp_path: Path, ways: str, sizes: tuple[int, ...]):
    """As PyTorch writes dense layers, and as Keras does."""
    onnx = pytest.importorskip("onnx")
    make, arrays, nodes, value = onnx.helper.make_node, weights(sizes=sizes), [], "x"
    known, activations = dict(arrays), ("Relu", "Sigmoid", "Tanh")[: len(sizes) - 1]
    for i, operator in enumerate(activations, start=1):
        if ways == "gemm":
            nodes.append(make("Gemm", [value, f"W{i}", f"b{i}"], [f"z{i}"], transB=1))
        else:
            known[f"V{i}"] = arrays[f"W{i}"].T.copy()
            nodes.append(make("MatMul", [value, f"V{i}"], [f"p{i}"]))
            nodes.append(make("Add", [f"p{i}", f"b{i}"], [f"z{i}"]))
        value = f"a{i}" if i < len(activations) else "y"
        nodes.append(make(operator, [f"z{i}"], [value]))
    path = tmp_path / "policy.onnx"
    saved(path, nodes, [1, sizes[0]], known)
    network = read_network(path)
    assert [layer.W.shape for layer in network.layers] == [(m, n) for n, m in pairwise(sizes)]
    session = session_of(path)
    module = made(path, f"onnx_{ways}_{sizes[1]}")
    for x in np.random.default_rng(4).normal(size=(50, sizes[0])).astype(np.float32):
        [[expected]] = session.run(None, {"x": x[None, :]})[:1]
        assert (np.abs(answer(module, x) - expected) <= rounding(network, x.astype(float))).all()


#: What random graphs consist of, and what is refused.
OPERATORS = [
    *["Gemm"] * 8, *["MatMul"] * 6, *["Tanh"] * 2, "Relu", "Sigmoid", "Add", "Add", "Sub", "Mul",
    "Div", "Identity", "Flatten", "Reshape", "Transpose", "Squeeze", "Unsqueeze", "Cast", "Dropout",
    "Clip", "Softmax", "Exp", "Concat",
]  # fmt: skip


#: Of inputs; not all can be taken.
SHAPES: list[list[Any]] = [
    [1, 3], [1, 2], ["batch", 3], [None, 2], [3], [1, 2, 2], [1], [1, 1], [2, 3], ["batch", "n"],
]  # fmt: skip

#: The types are FLOAT, INT64, BOOL, FLOAT16 and DOUBLE.
ATTRIBUTES: dict[str, list[dict[str, Any]]] = {
    "Cast": [{"to": to} for to in (1, 7, 9, 10, 11)],
    "Concat": [{"axis": 0}],
    "Flatten": [{}, {"axis": 0}, {"axis": -1}, {"axis": 2}],
    "Transpose": [{}, {}, {"perm": [1, 0]}, {"perm": [0, 2, 1]}],
}


class Graph:
    """A random graph, right or wrong, with operands in any place."""

    def __init__(self, seed: int) -> None:
        self.random = np.random.default_rng(seed)
        self.make = pytest.importorskip("onnx").helper.make_node
        self.nodes: list[Any] = []
        self.constants: dict[str, Any] = {}
        self.shape = self.one_of(SHAPES)
        self.columns = self.shape[-1] if isinstance(self.shape[-1], int) else 1
        self.values = ["x"]
        for _ in range(self.random.integers(1, 6)):
            self.step()
        self.nodes[-1].output[0] = "y"

    def one_of(self, choices: Sequence[Any]) -> Any:
        return choices[self.random.integers(len(choices))]

    def constant(self, *shape: int) -> str:
        """Numbers as an initializer, of a node, or of an initializer that a node changes."""
        array = self.random.normal(size=shape).astype(np.float32)
        name, n = f"c{len(self.constants)}", len(self.nodes)
        self.constants[name] = array
        match self.one_of(["as it is"] * 4 + ["Constant", "Identity", "Transpose", "Cast"]):
            case "Constant" if array.ndim == 1:
                node = self.make("Constant", [], [f"n{n}"], value_floats=[*map(float, array)])
            case "Identity":
                node = self.make("Identity", [name], [f"n{n}"])
            case "Transpose":
                self.constants[name] = array.T.copy()
                node = self.make("Transpose", [name], [f"n{n}"])
            case "Cast":
                self.constants[name] = array.astype(np.float64)
                node = self.make("Cast", [name], [f"n{n}"], to=1)
            case _:
                return name
        self.nodes.append(node)
        return f"n{n}"

    def integers(self, *numbers: int) -> str:
        name = f"c{len(self.constants)}"
        self.constants[name] = np.array(numbers, dtype=np.int64)
        return name

    def value(self) -> str:
        """Mostly the last one."""
        return self.values[-1] if self.chance(0.8) else self.one_of(self.values)

    def matrix(self, is_transposed: bool = False) -> str:
        """Weights; most of them fit the numbers before them."""
        rows = self.columns if self.chance(0.9) else self.one_of([1, 2, 3])
        self.columns = self.one_of([1, 2, 3, 3, 4])
        shape = (rows, self.columns)
        return self.constant(*(shape[::-1] if is_transposed else shape))

    def operand(self) -> str:
        shapes = [(), (1,), (1, self.columns), (self.columns,), (3, 1), (2, 2)]
        return self.constant(*self.one_of(shapes)) if self.chance(0.8) else self.value()

    def chance(self, share: float) -> bool:
        return bool(self.random.random() < share)

    def step(self) -> None:
        """Add an operator, with inputs and attributes that it may not take."""
        name, inputs = self.one_of(OPERATORS), [self.value()]
        attributes: dict[str, Any] = {}
        if name == "Gemm":
            flags = {"transA": 1, "transB": self.one_of([0, 1])}
            factors = {factor: float(self.random.normal()) for factor in ("alpha", "beta")}
            chances = {"transA": 0.1, "transB": 0.5, "alpha": 0.3, "beta": 0.3}
            attributes = {k: v for k, v in {**flags, **factors}.items() if self.chance(chances[k])}
            inputs.append(self.matrix(bool(attributes.get("transB"))))
            inputs += [self.operand()] if self.chance(0.6) else []
        elif name == "MatMul":
            inputs.append(self.operand() if self.chance(0.2) else self.matrix())
        elif name in ("Add", "Sub", "Mul", "Div"):
            inputs.append(self.operand())
        elif name == "Reshape":
            inputs.append(
                self.integers(*self.one_of([(1, -1), (2, 2), (-1, 2), (0, -1), (-1,), (3, 1)]))
            )
        elif name in ("Squeeze", "Unsqueeze"):
            inputs.append(self.integers(self.one_of([0, 1, -1])))
        else:
            attributes = self.one_of(ATTRIBUTES.get(name, [{}]))
        if name in ("Gemm", "MatMul", "Add", "Sub", "Mul", "Div") and self.chance(0.2):
            inputs[0], inputs[-1] = inputs[-1], inputs[0]
        self.append(name, inputs, **attributes)
        if name == "Cast":
            self.append("Cast", [self.values[-1]], to=1)

    def append(self, name: str, inputs: list[str], **attributes: Any) -> None:
        self.values.append(f"v{len(self.nodes)}")
        self.nodes.append(self.make(name, inputs, self.values[-1:], **attributes))


def test_random_graphs_are_onnxruntimes_or_refused(tmp_path: Path):
    taken = []
    for seed in range(500):
        graph, path = Graph(seed), tmp_path / f"policy{seed}.onnx"
        saved(path, graph.nodes, graph.shape, graph.constants)
        try:
            network = read_network(path)
        except InputError:
            continue
        session, module = session_of(path), made(path, f"random_{seed}")
        shape = [size if isinstance(size, int) else 1 for size in graph.shape]
        for _ in range(3):
            x = graph.random.normal(size=shape).astype(np.float32)
            [expected] = session.run(None, {"x": x})
            bound = rounding(network, x.ravel().astype(float), steps=60)
            wrong = np.abs(answer(module, x.ravel()) - expected.ravel()) > bound
            assert not wrong.any(), (seed, [node.op_type for node in graph.nodes])
        taken.append({node.op_type for node in graph.nodes})
    assert len(taken) > 60
    assert set.union(*taken) >= {*networks._OPERATORS, *networks._OF_ONNX}


def dense(*inputs: str, **attributes: Any) -> Callable[[Any], list[Any]]:
    """A graph of one Gemm."""
    return lambda make: [make("Gemm", inputs, ["y"], **attributes)]


SQUARE = np.arange(9.0, dtype=np.float32).reshape(3, 3)


@pytest.mark.parametrize(
    ("nodes", "shape", "why"),
    [
        (dense("x", "W", "x"), ["batch", "n"], "the shape [?, ?]"),
        (dense("x", "W"), [2, 3], "the shape [2, 3]"),
        (dense("x", "W"), [1, 4], "cannot be read"),
        (dense("W", "W"), [1, 3], "y does not depend on the network's input"),
        (
            lambda make: [make("Cast", ["x"], ["i"], to=7), make("Cast", ["i"], ["y"], to=1)],
            [1, 3],
            "operator Cast: only a cast to float or double is supported",
        ),
        (
            lambda make: [make("Tanh", ["x"], ["a"]), make("Add", ["a", "x"], ["y"])],
            [1, 3],
            "operator Add: x comes from an earlier layer: the network has branches",
        ),
        (
            lambda make: [make("Mul", ["x", "x"], ["y"])],
            [1, 3],
            "operator Mul: more than one of its inputs depends on the network's",
        ),
        (lambda make: [make("Identity", ["x"], ["y"])], [1, 3], "it has no dense layers"),
        (lambda make: [make("Exp", ["x"], ["y"])], [1, 3], "operator Exp: not supported; "),
        (dense("x", "W"), [1, 5000], "cannot be read"),
        (
            lambda make: [make("Relu", ["x"], ["y"])],
            [1, 5000],
            "a row has 5000 numbers; it may have 4096",
        ),
    ],
)
def test_graphs_that_are_no_dense_layers_are_refused(
    tmp_path: Path, nodes: Callable[[Any], list[Any]], shape: list[Any], why: str
):
    path = tmp_path / "policy.onnx"
    saved(path, nodes(pytest.importorskip("onnx").helper.make_node), shape, {"W": SQUARE})
    with pytest.raises(InputError, match=re.escape(why)) as caught:
        read_network(path)
    assert "\n" not in str(caught.value)


def test_layers_without_an_activation_between_them_stay_apart(tmp_path: Path):
    """Their product may be many more numbers."""
    make, path = pytest.importorskip("onnx").helper.make_node, tmp_path / "policy.onnx"
    nodes = [make("MatMul", ["x", "A"], ["z"]), make("MatMul", ["z", "B"], ["y"])]
    arrays = {"A": np.ones((3, 1), np.float32), "B": np.ones((1, 3), np.float32)}
    saved(path, nodes, [1, 3], arrays)
    assert [layer.W.shape for layer in read_network(path).layers] == [(1, 3), (3, 1)]


@pytest.mark.parametrize("opset", [6, 12])
def test_attributes_of_older_opsets_are_known_or_the_opset_is_refused(tmp_path: Path, opset: int):
    make, path = pytest.importorskip("onnx").helper.make_node, tmp_path / "policy.onnx"
    nodes = [make("Unsqueeze", ["x"], ["row"], axes=[0]), make("MatMul", ["row", "W"], ["y"])]
    saved(path, nodes, [3], {"W": SQUARE}, opset)
    if opset == 6:
        with pytest.raises(InputError, match="it has no opset of ONNX from 7 on"):
            read_network(path)
    else:
        [layer] = read_network(path).layers
        np.testing.assert_array_equal(layer.W, SQUARE.T)


NAMES = (
    'a"b',
    'a"""b',
    "a\\",
    "a\nimport os",
    "\\x",
    "\\N{",
    "a`b",
    "ü",
    "\udcff",
    "<b>",
    "'",
    "\x00",
)


@pytest.mark.parametrize("name", NAMES)
def test_any_name_of_a_file_gives_a_module(tmp_path: Path, name: str):
    network = Network([Dense(np.eye(2), np.zeros(2), "none")], "x", "y")
    text = component_text("Policy", network, f"{name}.npz")
    (tmp_path / "policy.py").write_text(text, encoding="utf-8")
    tree = ast.parse((tmp_path / "policy.py").read_bytes())
    assert ast.unparse(tree.body[1]) == "from __future__ import annotations"
    said = ast.get_docstring(tree)
    assert said is not None
    [shown] = re.findall("`(.*?)` by `auv-fmu new", said)
    assert shown.isprintable()


def test_a_layer_has_as_many_weights_as_a_matrix_of_the_language():
    assert networks.MOST_OF_A_LAYER == types._MOST_NUMBERS


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
            {"W1": np.zeros((300, 300)), "b1": np.zeros(300)},
            "layer 1 has 90000 weights; a layer may have 65536",
        ),
        (
            changed(**{f"W{i}": np.zeros((250, 250)) for i in (1, 2)}, b1=np.zeros(250)),
            "layer 2 gives 250 numbers, and layer 3 takes 5",
        ),
        (
            {
                **{f"W{i}": np.zeros((250, 250)) for i in (1, 2)},
                **{f"b{i}": np.zeros(250) for i in (1, 2)},
            },
            "it has 125000 weights; a component may have 100000",
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
