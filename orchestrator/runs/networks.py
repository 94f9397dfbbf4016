"""Small neural networks as components: from dense layers in a file to the language of equations.

A file is an .onnx, or an .npz with the arrays `W1`, `b1`, `W2`, `b2` ... (a row of W is a neuron)
and `activations`, one name a layer; without these, hidden layers have tanh and the last one none.
"""

from __future__ import annotations

import re
import textwrap
from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise
from keyword import iskeyword
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fmus.ports.port import FAULT, H_MAX, TIME
from orchestrator.machine.errors import InputError, reason

#: What a layer may do with each of its sums, by the names in files.
ACTIVATIONS = ("none", "tanh", "relu", "sigmoid")

#: More numbers than the text of a component should hold.
MOST_WEIGHTS = 100_000

#: What ONNX calls them.
_OF_ONNX = {"Tanh": "tanh", "Relu": "relu", "Sigmoid": "sigmoid"}

#: What changes nothing of a row of numbers.
_PASSES = frozenset(("Identity", "Flatten", "Dropout", "Cast", "Reshape", "Squeeze", "Unsqueeze"))

#: Ports that every component has, or any may have.
_PORTS_OF_ALL = (FAULT.name, H_MAX.name, TIME.name)

_WIDTH = 98


class Dense(NamedTuple):
    """activation(W x + b)."""

    W: Any  #: array of neurons by inputs
    b: Any  #: array of neurons
    activation: str


class Network(NamedTuple):
    """Dense layers, one after the other."""

    layers: Sequence[Dense]
    inputs: str  #: what its file calls the inputs
    outputs: str

    @property
    def input_port(self) -> str:
        """The group of ports of its inputs."""
        return _port(self.inputs, "x")

    @property
    def output_port(self) -> str:
        """The group of ports of its outputs."""
        found = _port(self.outputs, "y")
        return f"{found}_out" if found == self.input_port else found

    @property
    def n_inputs(self) -> int:
        """How many numbers it takes."""
        return int(self.layers[0].W.shape[1])

    @property
    def n_outputs(self) -> int:
        """How many numbers it gives."""
        return int(self.layers[-1].W.shape[0])


def read_network(path: Path) -> Network:
    """The network in a file.

    Raises:
        InputError: it cannot be read, or has other layers than dense ones.

    """
    readers: dict[str, Callable[[Path], Network]] = {".npz": _from_npz, ".onnx": _from_onnx}
    if path.suffix not in readers:
        raise InputError(f"{path}: not an .onnx or .npz file")
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    try:
        network = readers[path.suffix](path)
        _check(network)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    except Exception as error:
        raise InputError(f"{path}: cannot be read: {reason(error)}") from None
    return network


def _check(network: Network) -> None:
    """Refuse layers that do not follow each other, and numbers that no text should hold."""
    for i, (one, other) in enumerate(pairwise(network.layers), start=1):
        if one.W.shape[0] != other.W.shape[1]:
            raise InputError(
                f"layer {i} gives {one.W.shape[0]} numbers, and layer {i + 1} takes "
                f"{other.W.shape[1]}"
            )
    for i, layer in enumerate(network.layers, start=1):
        if layer.b.shape != layer.W.shape[:1]:
            raise InputError(f"layer {i} has {layer.W.shape[0]} neurons and {layer.b.size} biases")
        if layer.activation not in ACTIVATIONS:
            raise InputError(
                f"layer {i} has the activation {layer.activation!r}; there are "
                f"{', '.join(ACTIVATIONS)}"
            )
        if not (np.isfinite(layer.W).all() and np.isfinite(layer.b).all()):
            raise InputError(f"layer {i} has a weight that is not finite")
    weights = sum(layer.W.size for layer in network.layers)
    if weights > MOST_WEIGHTS:
        raise InputError(f"it has {weights} weights; a component may have {MOST_WEIGHTS}")


def _from_npz(path: Path) -> Network:
    with np.load(path, allow_pickle=False) as file:
        n = sum(re.fullmatch(r"W\d+", name) is not None for name in file.files)
        if n == 0:
            raise InputError(f"it has no W1; its arrays are {', '.join(file.files) or 'none'}")
        names = [f"{letter}{i}" for i in range(1, n + 1) for letter in "Wb"]
        for name in names:
            if name not in file.files:
                raise InputError(f"it has {n} arrays W and no {name}")
            if file[name].ndim != (2 if name.startswith("W") else 1):
                raise InputError(f"{name} has {file[name].ndim} dimensions")
        said = [str(name) for name in file["activations"]] if "activations" in file.files else []
        activations = said or ["tanh"] * (n - 1) + ["none"]
        if len(activations) != n:
            raise InputError(f"it has {n} layers and {len(activations)} activations")
        layers = [
            Dense(file[f"W{i}"].astype(float), file[f"b{i}"].astype(float), activations[i - 1])
            for i in range(1, n + 1)
        ]
    return Network(layers, "x", "y")


def _from_onnx(path: Path) -> Network:
    try:
        # An extra: few need it.
        import onnx  # noqa: PLC0415
    except ImportError:
        raise InputError(
            "reading it needs the package onnx: pip install 'auv-fmu[networks]'"
        ) from None
    graph = onnx.load(str(path)).graph
    known = {tensor.name: onnx.numpy_helper.to_array(tensor) for tensor in graph.initializer}
    inputs = [value.name for value in graph.input if value.name not in known]
    if len(inputs) != 1 or len(graph.output) != 1:
        raise InputError(
            f"it has {len(inputs)} inputs and {len(graph.output)} outputs; one each is wanted"
        )
    layers: list[Dense] = []
    value = inputs[0]
    for node in graph.node:
        attributes = {a.name: onnx.helper.get_attribute_value(a) for a in node.attribute}
        if node.op_type == "Constant":
            known[node.output[0]] = onnx.numpy_helper.to_array(attributes["value"])
            continue
        given = [known[name] for name in node.input if name in known]
        if value not in node.input:
            raise InputError(f"{node.op_type} does not follow the layer before: it has branches")
        _append(layers, node.op_type, attributes, given, at_left=node.input[0] == value)
        value = node.output[0]
    if not layers or value != graph.output[0].name:
        raise InputError("it has no dense layers, or its output is not the last of them")
    return Network(layers, inputs[0], graph.output[0].name)


def _append(
    layers: list[Dense],
    operator: str,
    attributes: dict[str, Any],
    given: Sequence[Any],
    *,
    at_left: bool,
) -> None:
    """Add an operator of ONNX to the layers, of which numbers come as rows."""
    if operator == "Gemm":
        W = attributes.get("alpha", 1.0) * (given[0] if attributes.get("transB") else given[0].T)
        b = attributes.get("beta", 1.0) * given[1] if len(given) > 1 else np.zeros(len(W))
        layers.append(Dense(W.astype(float), np.ravel(b).astype(float), "none"))
    elif operator == "MatMul" and at_left:
        W = given[0].T.astype(float)
        layers.append(Dense(W, np.zeros(len(W)), "none"))
    elif operator == "Add" and layers and layers[-1].activation == "none":
        b = np.broadcast_to(np.ravel(given[0]), layers[-1].b.shape).astype(float)
        layers[-1] = layers[-1]._replace(b=layers[-1].b + b)
    elif operator in _OF_ONNX and layers and layers[-1].activation == "none":
        layers[-1] = layers[-1]._replace(activation=_OF_ONNX[operator])
    elif operator not in _PASSES:
        known = ", ".join(("Gemm", "MatMul", "Add", *_OF_ONNX))
        raise InputError(f"it has the operator {operator} here; dense layers consist of {known}")


def component_text(name: str, network: Network, source: str) -> str:
    """The text of a component that computes a network.

    Args:
        name: of the component, as a class is named.
        network: of dense layers.
        source: name of the file that it comes from.

    """
    sizes = [network.n_inputs, *(len(layer.W) for layer in network.layers)]
    used = {layer.activation for layer in network.layers} - {"none"}
    names = sorted(_IMPORTS[word] for word in used & _IMPORTS.keys())
    imports = [f"from math import {', '.join(names)}"] if names else []
    head = [
        f'"""{name}: a neural network of dense layers, {" - ".join(map(str, sizes))}.\n\n'
        f"Made from {source} by `auv-fmu new component --from`, with its weights written out.\n"
        '"""',
        "from __future__ import annotations",
        "\n".join([*imports, "from typing import Annotated, NamedTuple"]),
        "from auv_fmu.linear_algebra import Matrix, Vector\n"
        "from fmus.ports.variable import Variable",
        *(text for i, layer in enumerate(network.layers, 1) for text in _constants(i, layer)),
    ]
    body = [
        _CLASSES.format(
            inputs=network.input_port,
            n=network.n_inputs,
            outputs=network.output_port,
            m=network.n_outputs,
        ),
        *(_FUNCTIONS[word] for word in sorted(used & _FUNCTIONS.keys())),
        _forward(network),
    ]
    return "\n\n\n".join(["\n\n".join(head), *body]) + "\n"


def _port(name: str, otherwise: str) -> str:
    word = re.sub(r"\W", "_", name)
    can = word.isidentifier() and not word.startswith("_") and not iskeyword(word)
    return word if can and word not in _PORTS_OF_ALL else otherwise


def _constants(i: int, layer: Dense) -> Iterator[str]:
    rows = ",\n".join(_lines(row) for row in layer.W)
    yield f"W{i} = Matrix(\n    (\n{textwrap.indent(rows, ' ' * 8)},\n    )\n)  # fmt: skip"
    yield f"b{i} = Vector(\n{textwrap.indent(_lines(layer.b), ' ' * 4)}\n)  # fmt: skip"


def _lines(numbers: Any) -> str:
    """Numbers as a tuple, in lines."""
    text = ", ".join(repr(float(x)) for x in numbers)
    text = f"({text},)" if len(numbers) == 1 else f"({text})"
    return "\n ".join(textwrap.wrap(text, _WIDTH - 10, break_on_hyphens=False))


_CLASSES = '''\
class Inputs(NamedTuple):
    """What the network sees."""

    {inputs}: Annotated[Vector, {n}, Variable("", "Input of the network")]


class Outputs(NamedTuple):
    """What it answers."""

    {outputs}: Annotated[Vector, {m}, Variable("", "Output of the network")]


def begin(inputs: Inputs) -> Outputs:
    """Outputs at the start."""
    return Outputs(_network(inputs.{inputs}))


def advance(inputs: Inputs) -> Outputs:
    """Outputs of a step: computed at its beginning, held through it."""
    return Outputs(_network(inputs.{inputs}))'''

_FUNCTIONS = {
    "relu": """def _relu(x: float) -> float:
    return x if x > 0.0 else 0.0""",
    "sigmoid": """def _sigmoid(x: float) -> float:
    # Of two forms the one whose exp cannot be too large.
    return 1.0 / (1.0 + exp(-x)) if x >= 0.0 else exp(x) / (1.0 + exp(x))""",
}

#: What they take from math.
_IMPORTS = {"sigmoid": "exp", "tanh": "tanh"}

_CALLS = {"tanh": "tanh", "relu": "_relu", "sigmoid": "_sigmoid"}


def _forward(network: Network) -> str:
    n, m = network.n_inputs, network.n_outputs
    lines = [
        f"def _network(x: Annotated[Vector, {n}]) -> Annotated[Vector, {m}]:",
        '    """The layers, one after the other."""',
    ]
    given = "x"
    for i, layer in enumerate(network.layers, start=1):
        lines.append(f"    z{i} = W{i} @ {given} + b{i}")
        given = f"z{i}"
        if layer.activation != "none":
            lines.append(f"    a{i} = Vector({_CALLS[layer.activation]}(z) for z in z{i})")
            given = f"a{i}"
    return "\n".join([*lines, f"    return {given}"])
