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

from fmus.build import source_of_script
from fmus.language import types
from fmus.native.translator import translated
from orchestrator.machine.compilers import machines_compiler
from orchestrator.machine.errors import InputError
from orchestrator.runs import networks
from orchestrator.runs.networks import ACTIVATIONS, Dense, Network, component_text, read_network
from support.language import Twins, module_of

SIZES = (4, 8, 5, 2)

FUNCTIONS: dict[str, Callable[..., Any]] = {
    "none": lambda x: x,
    "tanh": np.tanh,
    "relu": lambda x: np.maximum(x, 0.0),
    "sigmoid": lambda x: 1.0 / (1.0 + np.exp(-x)),
    "softplus": lambda x: np.logaddexp(0.0, x),
    "elu": lambda x, alpha: np.where(x > 0.0, x, alpha * np.expm1(np.minimum(x, 0.0))),
    "leaky relu": lambda x, alpha: np.where(x > 0.0, x, alpha * x),
    "clip": lambda x, low, high: np.minimum(np.maximum(x, low), high),
    "at least": np.maximum,
    "at most": np.minimum,
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
def test_network_of_an_npz_computes_the_numbers_of_numpy(tmp_path: Path, activation: str):
    arrays, activations = weights(), [activation, "tanh", "none"]
    np.savez(tmp_path / "policy.npz", **arrays, activations=activations)
    module = made(tmp_path / "policy.npz", f"npz_{activation}")
    for x in np.random.default_rng(2).normal(size=(20, SIZES[0])):
        expected = forward(arrays, activations, x)
        np.testing.assert_allclose(answer(module, x), expected, rtol=1e-12, atol=1e-13)


def test_default_activations_are_tanh_and_none_in_the_last_layer(tmp_path: Path):
    np.savez(tmp_path / "policy.npz", **weights())
    activations = [layer.activation for layer in read_network(tmp_path / "policy.npz").layers]
    assert activations == ["tanh", "tanh", "none"]


@pytest.mark.skipif(machines_compiler() is None, reason="there is no C compiler")
def test_both_kinds_give_the_same_bits(tmp_path: Path):
    """With all activations; inputs of any size leave none of them."""
    random = np.random.default_rng(3)
    numbers: dict[str, tuple[float, ...]] = {
        "clip": (-500.0, 900.0), "at least": (-400.0,), "at most": (700.0,), "elu": (0.7,),
        "leaky relu": (0.1,),
    }  # fmt: skip
    layers = [
        Dense(random.normal(size=(4, 4)), random.normal(size=4), name, numbers.get(name, ()))
        for name in {**numbers, **FUNCTIONS}
    ]
    layers[1] = layers[1]._replace(W=np.eye(4), b=np.zeros(4))
    text = component_text("Policy", Network(layers, "x", "y"), "policy.onnx")
    both = Twins(module_of(text, tmp_path, "both_kinds"), tmp_path)
    for x in random.normal(size=(50, 4)) * 10.0 ** random.integers(-5, 6, size=(50, 1)):
        answer = both.python("outputs", [*x])
        assert answer.bits == both.c("outputs", [*x]).bits
        for W, b, activation, constants in layers:
            x = FUNCTIONS[activation](W @ x + b, *constants)
        np.testing.assert_allclose(answer.numbers, x, rtol=1e-12, atol=1e-13)


def saved(
    path: Path,
    nodes: list[Any],
    shape: Sequence[Any],
    constants: dict[str, Any],
    opset: int = 17,
    double: bool = False,
) -> None:
    """Write a graph from the input of its first node, or `x`, to the output of its last one."""
    onnx = pytest.importorskip("onnx")
    make, kind = onnx.helper, onnx.TensorProto.DOUBLE if double else onnx.TensorProto.FLOAT
    given = {name for node in nodes for name in node.input if name}
    given -= {*constants, *(name for node in nodes for name in node.output)}
    graph = make.make_graph(
        nodes,
        "policy",
        [make.make_tensor_value_info(name, kind, shape) for name in sorted(given) or ["x"]],
        [make.make_tensor_value_info(nodes[-1].output[0], kind, None)],
        [onnx.numpy_helper.from_array(array, name) for name, array in constants.items()],
    )
    opsets = [make.make_opsetid("", opset), make.make_opsetid("ai.onnx.ml", 1)]
    onnx.save(make.make_model(graph, opset_imports=opsets, ir_version=8), str(path))


def evaluation(path: Path) -> Callable[[np.ndarray], np.ndarray]:
    """Evaluation of rows by onnxruntime, or by the reference if it lacks an operator or opset."""
    runtime = pytest.importorskip("onnxruntime")
    errors, options = runtime.capi.onnxruntime_pybind11_state, runtime.SessionOptions()
    # Otherwise it logs each model that it refuses.
    options.log_severity_level = 4
    options.intra_op_num_threads = 1
    session: Any
    try:
        session = runtime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
        [given] = session.get_inputs()
        name = given.name
    except (errors.NotImplemented, errors.Fail):
        session = pytest.importorskip("onnx.reference").ReferenceEvaluator(str(path))
        [name] = session.input_names
    return lambda x: session.run(None, {name: x})[0].ravel()


def rounding(network: Network, x: np.ndarray, steps: int = 3) -> np.ndarray:
    """Error bound of single precision, from the usual bound of a sum of n products.

    Args:
        network: in double precision.
        x: its inputs.
        steps: roundings of each sum besides those of its products.

    """
    error = np.zeros(network.n_inputs)
    for W, b, activation, numbers in network.layers:
        sizes = np.abs(W) @ np.abs(x) + np.abs(b)
        error = np.abs(W) @ error + (W.shape[1] + steps) * 2.0**-24 * sizes
        x = FUNCTIONS[activation](W @ x + b, *numbers)
        # Slopes are at most 1 or a number; onnxruntime's own activations are off by some units.
        if activation in ("elu", "leaky relu"):
            error = error * max([1.0, *np.abs(numbers)])
        error = error + 8 * 2.0**-24 * np.maximum(1.0, np.abs(x)) * (activation != "none")
    return error


@pytest.mark.parametrize("ways", ["gemm", "matmul"])
@pytest.mark.parametrize("sizes", [SIZES, (1, 300, 1), (3, 300, 2)])
def test_network_of_an_onnx_computes_the_numbers_of_onnxruntime(
    tmp_path: Path, ways: str, sizes: tuple[int, ...]
):
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
    expected, module = evaluation(path), made(path, f"onnx_{ways}_{sizes[1]}")
    for x in np.random.default_rng(4).normal(size=(50, sizes[0])).astype(np.float32):
        error = np.abs(answer(module, x) - expected(x[None, :]))
        assert (error <= rounding(network, x.astype(float))).all()


#: Small networks as exporters write them: opset, shape of the input, and lines. A line is a weight
#: and its sizes, the integers of a constant, or an operator, its inputs > its output, attributes.
EXPORTED: dict[str, tuple[int, list[Any], str]] = {
    "torch.onnx.export, TorchScript": (
        17,
        [1, 4],
        """
        net.0.weight : 8 4
        net.0.bias : 8
        net.2.weight : 1 8
        net.2.bias : 1
        Gemm onnx::Gemm_0 net.0.weight net.0.bias > /net/net.0/Gemm_0 alpha=1.0 transB=1
        Tanh /net/net.0/Gemm_0 > /net/net.1/Tanh_0
        Gemm /net/net.1/Tanh_0 net.2.weight net.2.bias > /net/net.2/Gemm_0 transB=1
        Constant > onnx::Squeeze_9 value=[-1]
        Squeeze /net/net.2/Gemm_0 onnx::Squeeze_9 > 10
        """,
    ),
    "torch.onnx.export, TorchScript, x.view(x.size(0), -1)": (
        13,
        ["batch", 2, 2],
        """
        0.weight : 8 4
        0.bias : 8
        2.weight : 2 8
        2.bias : 2
        Shape obs > /Shape_0
        Constant > /Constant_0 value=0
        Gather /Shape_0 /Constant_0 > /Gather_0 axis=0
        Constant > onnx::Unsqueeze_9 value=[0]
        Unsqueeze /Gather_0 onnx::Unsqueeze_9 > /Unsqueeze_0
        Constant > /Constant_1_0 value=[-1]
        Concat /Unsqueeze_0 /Constant_1_0 > /Concat_0 axis=0
        Reshape obs /Concat_0 > /Reshape_0
        Gemm /Reshape_0 0.weight 0.bias > /0/Gemm_0 alpha=1.0 transB=1
        LeakyRelu /0/Gemm_0 > /1/LeakyRelu_0 alpha=0.01
        Gemm /1/LeakyRelu_0 2.weight 2.bias > action transB=1
        """,
    ),
    "torch.onnx.export, TorchScript, BatchNorm1d and biases that are equal": (
        18,
        [1, 4],
        """
        0.weight : 8 4
        0.bias : 8
        1.weight : 8
        1.var : 8
        3.weight : 2 8
        3.bias : 2
        Identity 0.bias > 1.mean
        Identity 0.bias > 1.bias
        Gemm input 0.weight 0.bias > /0/Gemm_0 alpha=1.0 transB=1
        BatchNormalization /0/Gemm_0 1.weight 1.bias 1.mean 1.var > /1/BatchNorm_0 epsilon=1e-05
        Softplus /1/BatchNorm_0 > /2/Softplus_0
        Gemm /2/Softplus_0 3.weight 3.bias > 14 transB=1
        """,
    ),
    "torch.onnx.export, dynamo, one observation without a batch": (
        18,
        [4],
        """
        mean : 4
        std : 4
        val_0 : 4 8
        net.0.bias : 8
        val_2 : 8 2
        net.2.bias : 2
        low :
        high :
        Sub obs mean > sub
        Div sub std > div
        MatMul div val_0 > val_1
        Add val_1 net.0.bias > linear
        Relu linear > relu
        MatMul relu val_2 > val_3
        Add val_3 net.2.bias > linear_1
        Clip linear_1 low high > clamp
        """,
    ),
    "keras.Model.export, TensorFlow": (
        15,
        ["unk__5", 2, 2],
        """
        const_fold_opt__20 = [-1, 4]
        s/dense/Cast/Read:0 : 4 8
        s/dense/BiasAdd/Read:0 : 8
        s/dense_1/Cast/Read:0 : 8 2
        s/dense_1/BiasAdd/Read:0 : 2
        const_fold_opt__19 = [-1, 2, 1]
        Const:0 :
        Const_1:0 :
        Reshape keras_tensor const_fold_opt__20 > s/flatten/Reshape:0
        MatMul s/flatten/Reshape:0 s/dense/Cast/Read:0 > s/dense/MatMul:0
        Add s/dense/MatMul:0 s/dense/BiasAdd/Read:0 > s/dense/Add:0
        Tanh s/dense/Add:0 > s/dense/Tanh:0
        MatMul s/dense/Tanh:0 s/dense_1/Cast/Read:0 > s/dense_1/MatMul:0
        Add s/dense_1/MatMul:0 s/dense_1/BiasAdd/Read:0 > s/dense_1/Add:0
        Mul s/dense_1/Add:0 Const:0 > s/rescaling/mul:0
        Add s/rescaling/mul:0 Const_1:0 > s/rescaling/add:0
        Reshape s/rescaling/add:0 const_fold_opt__19 > Identity:0
        """,
    ),
    "keras.Model.export, PyTorch": (
        18,
        ["batch", 4],
        """
        onnx::MatMul_29 : 4 8
        onnx::Add_30 : 8
        onnx::MatMul_31 : 8 2
        onnx::Add_32 : 2
        Cast keras_tensor > /Cast_0 to=1
        Cast /Cast_0 > /Cast_1_0 to=1
        MatMul /Cast_1_0 onnx::MatMul_29 > /MatMul_0
        Cast /MatMul_0 > /Cast_2_0 to=1
        Add /Cast_2_0 onnx::Add_30 > /Add_0
        Constant > /Constant_0 value=0.0
        Constant > /Constant_1_0 value=6.0
        Clip /Add_0 /Constant_0 /Constant_1_0 > /Clip_0
        Shape /Clip_0 > /Shape_0
        Constant > /Constant_2_0 value=0
        Gather /Shape_0 /Constant_2_0 > /Gather_0 axis=0
        Cast /Gather_0 > /Cast_3_0 to=7
        Constant > onnx::Unsqueeze_3 value=[0]
        Unsqueeze /Cast_3_0 onnx::Unsqueeze_3 > /Unsqueeze_0
        Constant > /Constant_3_0 value=[8]
        Concat /Unsqueeze_0 /Constant_3_0 > /Concat_0 axis=0
        Reshape /Clip_0 /Concat_0 > /Reshape_0 allowzero=0
        MatMul /Reshape_0 onnx::MatMul_31 > /MatMul_1_0
        Add /MatMul_1_0 onnx::Add_32 > 31
        """,
    ),
    "skl2onnx.to_onnx, StandardScaler and MLPRegressor": (
        11,
        [None, 4],
        """
        coefficient : 4 8
        intercepts : 1 8
        coefficient1 : 8 1
        intercepts1 : 1 1
        shape_tensor = [-1, 1]
        ai.onnx.ml:Scaler X > variable1 offset=[0.1,-0.2,0.3,0.0] scale=[1.5,0.5,2.0,1.0]
        Cast variable1 > cast_input to=1
        MatMul cast_input coefficient > mul_result
        Add mul_result intercepts > add_result
        Sigmoid add_result > next_activations
        MatMul next_activations coefficient1 > mul_result1
        Add mul_result1 intercepts1 > add_result1
        Reshape add_result1 shape_tensor > variable
        """,
    ),
    "Stable-Baselines3, PPO, torch.clamp to the action space": (
        17,
        [1, 4],
        """
        policy_net.0.weight : 4 4
        policy_net.0.bias : 4
        policy_net.2.weight : 4 4
        action_net.weight : 4 4
        log_std : 4
        Identity log_std > action_net.bias
        Identity policy_net.0.bias > policy_net.2.bias
        Cast input > /Cast_0 to=1
        Flatten /Cast_0 > /Flatten_0 axis=1
        Gemm /Flatten_0 policy_net.0.weight policy_net.0.bias > /0/Gemm_0 alpha=1.0 transB=1
        Tanh /0/Gemm_0 > /1/Tanh_0
        Gemm /1/Tanh_0 policy_net.2.weight policy_net.2.bias > /2/Gemm_0 transB=1
        Tanh /2/Gemm_0 > /3/Tanh_0
        Gemm /3/Tanh_0 action_net.weight action_net.bias > /action_net/Gemm_0 transB=1
        Exp log_std > /Exp_0
        Shape /action_net/Gemm_0 > /Shape_0
        ConstantOfShape /Shape_0 > /ConstantOfShape_0
        Add /ConstantOfShape_0 /action_net/Gemm_0 > /Add_0
        Add /Add_0 /Exp_0 > /Add_1_0
        Shape /Add_1_0 > /Shape_1_0
        Expand /action_net/Gemm_0 /Shape_1_0 > /Expand_0
        Constant > /Constant_1_0 value=[-2.0,-2.0,-2.0,-2.0]
        Max /Expand_0 /Constant_1_0 > /Max_0
        Constant > /Constant_2_0 value=[2.0,2.0,2.0,2.0]
        Min /Max_0 /Constant_2_0 > 37
        """,
    ),
}


def exported(path: Path, name: str) -> list[Any]:
    """Write a file as an exporter does, with random weights, and give the shape of its input."""
    onnx, random = pytest.importorskip("onnx"), np.random.default_rng(5)
    opset, shape, text = EXPORTED[name]
    constants: dict[str, Any] = {}
    nodes = []
    for line in filter(None, map(str.strip, text.splitlines())):
        if " > " not in line:
            what, sign, sizes = re.split(" ([:=]) ?", line)
            drawn = random.uniform(0.3, 1.0, [int(n) for n in sizes.split() if sign == ":"])
            constants[what] = (
                np.array(ast.literal_eval(sizes)) if sign == "=" else drawn.astype(np.float32)
            )
            continue
        (operator, *inputs), (output, *options) = (part.split() for part in line.split(" > "))
        domain, _, operator = operator.rpartition(":")
        attributes = {k: ast.literal_eval(v) for k, v in (option.split("=") for option in options)}
        if "value" in attributes:
            array = np.array(attributes["value"])
            array = array.astype(np.float32) if array.dtype.kind == "f" else array
            attributes["value"] = onnx.numpy_helper.from_array(array)
        nodes.append(onnx.helper.make_node(operator, inputs, [output], domain=domain, **attributes))
    saved(path, nodes, shape, constants, opset)
    return [size if isinstance(size, int) else 1 for size in shape]


@pytest.mark.parametrize("name", EXPORTED)
def test_networks_of_exporters_compute_the_numbers_of_onnxruntime(tmp_path: Path, name: str):
    path = tmp_path / "policy.onnx"
    shape = exported(path, name)
    network, expected = read_network(path), evaluation(path)
    module = made(path, f"exported_{[*EXPORTED].index(name)}")
    for x in np.random.default_rng(6).normal(size=(20, *shape)).astype(np.float32):
        error = np.abs(answer(module, x.ravel()) - expected(x))
        assert (error <= rounding(network, x.ravel().astype(float), steps=10)).all()


#: Operators of random graphs; the last three are refused.
OPERATORS = [
    *["Gemm"] * 8, *["MatMul"] * 6, *["Tanh"] * 2, "Relu", "Sigmoid", "Add", "Add", "Sub", "Mul",
    "Div", "Identity", "Flatten", "Reshape", "Transpose", "Squeeze", "Unsqueeze", "Cast", "Dropout",
    "Clip", "Clip", "Max", "Min", "Elu", "LeakyRelu", "Softplus", "BatchNormalization", "Concat",
    "Concat", "Gather", "Expand", "Softmax", "Exp", "Selu",
]  # fmt: skip


#: Shapes of inputs; not all are supported.
SHAPES: list[list[Any]] = [
    [1, 3], [1, 2], ["batch", 3], [None, 2], [3], [1, 2, 2], [1], [1, 1], [2, 3], ["batch", "n"],
]  # fmt: skip

#: The types are FLOAT, INT64, BOOL, FLOAT16 and DOUBLE.
ATTRIBUTES: dict[str, list[dict[str, Any]]] = {
    "Cast": [{"to": to} for to in (1, 7, 9, 10, 11)],
    "Concat": [{"axis": 0}, {"axis": 1}, {"axis": -1}],
    "Dropout": [{}, {"seed": 3}, {"ratio": 0.3}],
    "BatchNormalization": [{}, {}, {"epsilon": 0.1}, {"momentum": 0.5}],
    "Reshape": [{}, {}, {}, {"allowzero": 1}],
    "Elu": [{}, {"alpha": 0.5}, {"alpha": -1.0}, {"beta": 1.0}],
    "LeakyRelu": [{}, {"alpha": 0.2}, {"alpha": 3.0}],
    "Gather": [{}, {"axis": 1}, {"axis": -1}],
    "Flatten": [{}, {"axis": 0}, {"axis": -1}, {"axis": 2}],
    "Transpose": [{}, {}, {"perm": [1, 0]}, {"perm": [0, 2, 1]}],
}


#: Attributes that became inputs in an opset; Max and Min had inputs of one shape before.
OLDER: dict[str, tuple[int, list[dict[str, Any]]]] = {
    "Clip": (11, [{}, {"min": -1.0}, {"min": -0.5, "max": 0.5}, {"max": 0.3}]),
    "Max": (8, [{}]),
    "Min": (8, [{}]),
    "Squeeze": (13, [{}, {"axes": [0]}, {"axes": [1]}, {"axes": [-1]}]),
    "Unsqueeze": (13, [{"axes": [0]}, {"axes": [1]}, {"axes": [-1]}, {"axes": [0, 2]}]),
}

#: Inputs after the first.
INPUTS: dict[str, Callable[[Graph], list[str]]] = {
    "MatMul": lambda graph: [graph.operand() if graph.chance(0.2) else graph.matrix()],
    **dict.fromkeys(("Add", "Sub", "Mul", "Div"), lambda graph: [graph.operand()]),
    **dict.fromkeys(
        ("Max", "Min", "Concat"),
        lambda graph: [graph.operand() for _ in range(graph.one_of([0, 1, 1, 1, 2]))],
    ),
    "Clip": lambda graph: graph.bounds(),
    "BatchNormalization": lambda graph: graph.moments(),
    "Gather": lambda graph: [graph.integers(*graph.one_of([(0,), (0, 0), (1, 0), (-1, 0, 0)]))],
    "Expand": lambda graph: [graph.integers(*graph.one_of([(1,), (2, 1, 1), (1, graph.columns)]))],
    "Reshape": lambda graph: (
        [graph.integers(*graph.one_of([(1, -1), (2, 2), (-1, 2), (0, -1), (-1,), (3, 1)]))]
        if graph.chance(0.8)
        else graph.shape_of()
    ),
    **dict.fromkeys(
        ("Squeeze", "Unsqueeze"), lambda graph: [graph.integers(graph.one_of([0, 1, -1]))]
    ),
}


class Graph:
    """A random graph, valid or not, with operands at any place."""

    def __init__(self, seed: int) -> None:
        self.random = np.random.default_rng(seed)
        onnx = pytest.importorskip("onnx")
        self.make = onnx.helper.make_node
        self.nodes: list[Any] = []
        self.constants: dict[str, Any] = {}
        newest = min(networks._NEWEST_OPSET, onnx.defs.onnx_opset_version())
        self.opset = int(self.random.integers(networks._OLDEST_OPSET, newest + 1))
        # The reference takes BatchNormalization of older ones for training.
        self.double = self.opset > 13 and self.chance(0.1)
        self.shape = self.one_of(SHAPES)
        self.columns = self.shape[-1] if isinstance(self.shape[-1], int) else 1
        self.values = ["x"]
        for _ in range(self.random.integers(1, 6)):
            self.step()
        self.nodes = self.needed()
        self.nodes[-1].output[0] = "y"

    def needed(self) -> list[Any]:
        """The nodes that lead to the last one: onnxruntime runs all, and may refuse others."""
        names, nodes = {*self.nodes[-1].output}, []
        for node in reversed(self.nodes):
            if names.intersection(node.output):
                nodes.append(node)
                names.update(node.input)
        return nodes[::-1]

    def one_of(self, choices: Sequence[Any]) -> Any:
        return choices[self.random.integers(len(choices))]

    def constant(self, *shape: int) -> str:
        """Numbers as an initializer, of a node, or of an initializer that a node changes."""
        array = self.random.normal(size=shape).astype(self.type)
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
                node = self.make("Cast", [name], [f"n{n}"], to=11 if self.double else 1)
            case _:
                return name
        self.nodes.append(node)
        return f"n{n}"

    @property
    def type(self) -> type[np.floating[Any]]:
        return np.float64 if self.double else np.float32

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

    def weights(self) -> dict[str, Any]:
        """Attributes of a Gemm."""
        factors = {factor: float(self.random.normal()) for factor in ("alpha", "beta")}
        chances = {"transA": 0.1, "transB": 0.5, "alpha": 0.3, "beta": 0.3}
        flags = {"transA": 1, "transB": self.one_of([0, 1])}
        return {k: v for k, v in {**flags, **factors}.items() if self.chance(chances[k])}

    def bounds(self) -> list[str]:
        chosen = self.one_of([(0, 0), (1, 0), (0, 1), (1, 1)])
        return [self.constant(*self.one_of([(), (), (2,)])) if choice else "" for choice in chosen]

    def moments(self) -> list[str]:
        """Inputs of a BatchNormalization; variances are not negative."""
        sizes = [self.columns] * 4 if self.chance(0.9) else [1, 2, 2, 1]
        names = [self.constant(n) for n in sizes]
        self.constants[names[-1]] = np.abs(self.constants.get(names[-1], self.type(1.0)))
        return names

    def shape_of(self) -> list[str]:
        """Add a Shape and return its output."""
        attributes = self.one_of([{}, {}, {"end": 1}, {"start": -1}])
        self.append("Shape", [self.value()], **attributes)
        return self.values[-1:]

    def step(self) -> None:
        """Add an operator, with inputs and attributes that may be invalid for it."""
        name, inputs = self.one_of(OPERATORS), [self.value()]
        attributes = self.one_of(ATTRIBUTES.get(name, [{}]))
        opset, older = OLDER.get(name, (0, []))
        if name == "Gemm":
            attributes = self.weights()
            inputs.append(self.matrix(bool(attributes.get("transB"))))
            inputs += [self.operand()] if self.chance(0.6) else []
        elif self.opset < opset:
            attributes = self.one_of(older)
        elif name in INPUTS:
            inputs += INPUTS[name](self)
        if name in ("Gemm", "MatMul", "Add", "Sub", "Mul", "Div", "Max") and self.chance(0.2):
            inputs[0], inputs[-1] = inputs[-1], inputs[0]
        self.append(name, inputs, **attributes)
        if name == "Cast":
            self.append("Cast", [self.values[-1]], to=11 if self.double else 1)

    def append(self, name: str, inputs: list[str], **attributes: Any) -> None:
        self.values.append(f"v{len(self.nodes)}")
        self.nodes.append(self.make(name, inputs, self.values[-1:], **attributes))


def test_random_graphs_compute_the_numbers_of_onnxruntime_or_are_refused(tmp_path: Path):
    taken = []
    for seed in range(1000):
        graph, path = Graph(seed), tmp_path / f"policy{seed}.onnx"
        saved(path, graph.nodes, graph.shape, graph.constants, graph.opset, graph.double)
        try:
            network = read_network(path)
        except InputError:
            continue
        expected, module = evaluation(path), made(path, f"random_{seed}")
        shape = [size if isinstance(size, int) else 1 for size in graph.shape]
        for _ in range(3):
            x = graph.random.normal(size=shape).astype(graph.type)
            bound = rounding(network, x.ravel().astype(float), steps=60)
            wrong = np.abs(answer(module, x.ravel()) - expected(x)) > bound
            assert not wrong.any(), (seed, [node.op_type for node in graph.nodes])
        taken.append({node.op_type for node in graph.nodes})
    assert len(taken) > 150
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
            lambda make: [make("Tanh", ["x"], ["a"]), make("Gemm", ["x", "W", "a"], ["y"])],
            [1, 3],
            "operator Gemm: x comes from an earlier layer: the network has branches",
        ),
        (
            lambda make: [make("Max", ["x", "W"], ["y"])],
            [1, 3],
            "operator Max: its inputs have shapes that do not fit",
        ),
        (
            lambda make: [make("Cast", ["H"], ["h"], to=1), make("Add", ["x", "h"], ["y"])],
            [1, 3],
            "operator Cast: numbers of the type float16 are not supported",
        ),
        (
            lambda make: [make("LeakyRelu", ["x"], ["y"], alpha=float("nan"))],
            [1, 3],
            "layer 1 has a number that is not finite",
        ),
        (
            lambda make: [make("Div", ["x", "Z"], ["y"])],
            [1, 3],
            "layer 1 has a number that is not finite",
        ),
        (dense("x", "z"), [1, 3], "its inputs are x, z; one is wanted: cut it out by onnx.utils"),
        (
            lambda make: [make("Binarizer", ["x"], ["y"], domain="ai.onnx.ml")],
            [1, 3],
            "operator Binarizer: ai.onnx.ml is not supported",
        ),
        (
            lambda make: [make("Mul", ["x", "x"], ["y"])],
            [1, 3],
            "operator Mul: it multiplies, divides or selects by what depends on the input",
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
def test_graphs_without_dense_layers_are_refused(
    tmp_path: Path, nodes: Callable[[Any], list[Any]], shape: list[Any], why: str
):
    path = tmp_path / "policy.onnx"
    constants = {"W": SQUARE, "H": np.ones(3, np.float16), "Z": np.zeros(3, np.float32)}
    saved(path, nodes(pytest.importorskip("onnx").helper.make_node), shape, constants)
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
        with pytest.raises(InputError, match="it has the opset 6 of ONNX; export it with one of"):
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
    words = ast.get_docstring(tree)
    assert words is not None
    [shown] = re.findall("`(.*?)` by `auv-fmu new", words)
    assert shown.isprintable()


def test_a_layer_has_as_many_weights_as_a_matrix_of_the_language():
    assert networks.MOST_OF_A_LAYER == types._MOST_NUMBERS


@pytest.mark.parametrize("sizes", [(1, 4095), (1, 2046, 1, 2048)])
def test_as_many_neurons_as_a_network_may_have_can_be_translated(
    tmp_path: Path, sizes: tuple[int, ...]
):
    assert sum(sizes) == networks.MOST_NEURONS
    arrays = {name: np.zeros_like(array) for name, array in weights(sizes=sizes).items()}
    np.savez(tmp_path / "policy.npz", **arrays, activations=["tanh"] * (len(sizes) - 1))
    made(tmp_path / "policy.npz", f"largest_{len(sizes)}")
    assert translated(source_of_script(tmp_path / f"largest_{len(sizes)}.py").definition)


def test_functions_of_the_file_itself_are_read(tmp_path: Path):
    """As the exporters of PyTorch 2.0 to 2.5 write them."""
    onnx = pytest.importorskip("onnx")
    make, path, kind = onnx.helper, tmp_path / "policy.onnx", onnx.TensorProto.FLOAT
    opsets = [make.make_opsetid("", 17), make.make_opsetid("own", 1)]
    # It has the name of an operator.
    nodes = [make.make_node("MatMul", ["a", "b"], ["c"]), make.make_node("Tanh", ["c"], ["d"])]
    function = make.make_function("own", "Relu", ["a", "b"], ["d"], nodes, opsets[:1])
    graph = make.make_graph(
        [make.make_node("Relu", ["x", "W"], ["y"], domain="own")],
        "policy",
        [make.make_tensor_value_info("x", kind, [1, 3])],
        [make.make_tensor_value_info("y", kind, [1, 3])],
        [onnx.numpy_helper.from_array(SQUARE, "W")],
    )
    model = make.make_model(graph, opset_imports=opsets, functions=[function], ir_version=8)
    onnx.save(model, str(path))
    [layer] = read_network(path).layers
    assert layer.activation == "tanh"
    np.testing.assert_array_equal(layer.W, SQUARE.T)


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
        (changed(b3=np.array([np.nan, 0.0])), "layer 3 has a number that is not finite"),
        (changed(activations=["tanh"]), "it has 3 layers and 1 activations"),
        (
            changed(activations=["tanh", "gelu", "none"]),
            "layer 2 has the activation 'gelu'; there are none, tanh, relu, sigmoid, softplus",
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
        (
            {"W1": np.zeros((4096, 1)), "b1": np.zeros(4096)},
            "it has 4097 inputs and neurons; a component may have 4096",
        ),
    ],
)
def test_arrays_that_are_not_a_network_are_refused(
    tmp_path: Path, arrays: dict[str, Any], why: str
):
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
