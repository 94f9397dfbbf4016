"""Small neural networks as components: from dense layers in a file to the language of equations.

A file is an .onnx, or an .npz with the arrays `W1`, `b1`, `W2`, `b2` ... (a row of W is a neuron)
and `activations`, a name for each layer; default: tanh in hidden layers, none in the last.

An .onnx is a graph of operators. `_OPERATORS` computes each as in the ONNX standard; others are
refused by name.

"""

from __future__ import annotations

import math
import re
import textwrap
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from functools import partial
from itertools import pairwise
from keyword import iskeyword
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fmus.ports.port import FAULT, H_MAX, TIME
from orchestrator.machine.errors import InputError, reason
from orchestrator.machine.texts import in_docstring

#: Activations of a sum z, in the language of equations; {} stands for a number.
_ACTIVATIONS = {
    "none": "z",
    "tanh": "tanh(z)",
    "relu": "z if z > 0.0 else 0.0",
    # In this form, exp cannot overflow.
    "sigmoid": "1.0 / (1.0 + exp(-z)) if z >= 0.0 else exp(z) / (1.0 + exp(z))",
    "softplus": "max(z, 0.0) + log1p(exp(-abs(z)))",
    "elu": "z if z > 0.0 else {} * expm1(z)",
    "leaky relu": "z if z > 0.0 else {} * z",
    "clip": "min(max(z, {}), {})",
    "at least": "max(z, {})",
    "at most": "min(z, {})",
}

#: Activations in an .npz: the ones without numbers.
ACTIVATIONS = tuple(name for name, text in _ACTIVATIONS.items() if "{" not in text)

#: Limit of weights, for the length of the text.
MOST_WEIGHTS = 100_000

#: Limit of the language of equations for a matrix.
MOST_OF_A_LAYER = 65_536

#: Limit of inputs and neurons: each takes up to 8 of the numbers that a call of C may hold.
MOST_NEURONS = 4096

#: The largest number in single precision, which stands for no bound.
_FLOAT_MAX = float(np.finfo(np.float32).max)

#: Activations of ONNX: our name, and the attributes or inputs of their numbers with defaults.
_OF_ONNX: dict[str, tuple[str, dict[str, float]]] = {
    "Tanh": ("tanh", {}),
    "Relu": ("relu", {}),
    "Sigmoid": ("sigmoid", {}),
    "Softplus": ("softplus", {}),
    "Elu": ("elu", {"alpha": 1.0}),
    "LeakyRelu": ("leaky relu", {"alpha": 0.01}),
    "Clip": ("clip", {"min": -_FLOAT_MAX, "max": _FLOAT_MAX}),
    "Max": ("at least", {"bound": -_FLOAT_MAX}),
    "Min": ("at most", {"bound": _FLOAT_MAX}),
}

#: The supported types of numbers, by their codes in ONNX.
_FLOAT = 1
_FLOATS = {_FLOAT: np.float32, 11: np.float64}
_INTEGERS = {6: np.int32, 7: np.int64}

#: Earlier opsets have other operators by the same names; later ones are not known here.
_OLDEST_OPSET, _NEWEST_OPSET = 7, 28

#: Ports that every component has, or may have.
_PORTS_OF_ALL = (FAULT.name, H_MAX, TIME.name)

_WIDTH = 98


class Dense(NamedTuple):
    """activation(W x + b)."""

    W: Any  #: array of neurons by inputs
    b: Any  #: array of neurons
    activation: str
    numbers: Sequence[float] = ()  #: parameters of the activation

    @property
    def is_activation(self) -> bool:
        """Tell whether its sums are its inputs."""
        n, m = self.W.shape
        return n == m and np.array_equal(self.W, np.eye(n)) and not self.b.any()


class Network(NamedTuple):
    """Consecutive dense layers."""

    layers: Sequence[Dense]
    inputs: str  #: their name in the file
    outputs: str

    @property
    def input_port(self) -> str:
        """Name of the group of ports of its inputs."""
        return _port(self.inputs, "x")

    @property
    def output_port(self) -> str:
        """Name of the group of ports of its outputs."""
        port = _port(self.outputs, "y")
        return f"{port}_out" if port == self.input_port else port

    @property
    def n_inputs(self) -> int:
        """Number of inputs."""
        return int(self.layers[0].W.shape[1])

    @property
    def n_outputs(self) -> int:
        """Number of outputs."""
        return int(self.layers[-1].W.shape[0])


def read_network(path: Path) -> Network:
    """Read the network in a file.

    Raises:
        InputError: it cannot be read, or has layers that are not dense.

    """
    readers: dict[str, Callable[[Path], Network]] = {".npz": _from_npz, ".onnx": _from_onnx}
    if path.suffix not in readers:
        raise InputError(f"{path}: not an .onnx or .npz file")
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    try:
        # A division by 0 gives a weight that is not finite.
        with np.errstate(all="ignore"):
            network = readers[path.suffix](path)
        _check(network)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    except Exception as error:
        raise InputError(f"{path}: cannot be read: {reason(error)}") from None
    return network


def _check(network: Network) -> None:
    """Check the sizes of layers and that numbers are finite."""
    for i, (layer, following) in enumerate(pairwise(network.layers), start=1):
        if layer.W.shape[0] != following.W.shape[1]:
            raise InputError(
                f"layer {i} gives {layer.W.shape[0]} numbers, and layer {i + 1} takes "
                f"{following.W.shape[1]}"
            )
    sizes = [0 if layer.is_activation else layer.W.size for layer in network.layers]
    for i, (layer, size) in enumerate(zip(network.layers, sizes, strict=True), start=1):
        if size > MOST_OF_A_LAYER:
            raise InputError(f"layer {i} has {size} weights; a layer may have {MOST_OF_A_LAYER}")
        if layer.b.shape != layer.W.shape[:1]:
            raise InputError(f"layer {i} has {layer.W.shape[0]} neurons and {layer.b.size} biases")
        if not all(np.isfinite(array).all() for array in (layer.W, layer.b, layer.numbers)):
            raise InputError(f"layer {i} has a number that is not finite")
    if sum(sizes) > MOST_WEIGHTS:
        raise InputError(f"it has {sum(sizes)} weights; a component may have {MOST_WEIGHTS}")
    neurons = network.n_inputs + sum(len(layer.W) for layer in network.layers)
    if neurons > MOST_NEURONS:
        raise InputError(
            f"it has {neurons} inputs and neurons; a component may have {MOST_NEURONS}"
        )


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
        activations = ["tanh"] * (n - 1) + ["none"]
        if "activations" in file.files:
            activations = [*map(str, file["activations"])] or activations
        if len(activations) != n:
            raise InputError(f"it has {n} layers and {len(activations)} activations")
        for i, name in enumerate(activations, start=1):
            if name not in ACTIVATIONS:
                raise InputError(
                    f"layer {i} has the activation {name!r}; there are {', '.join(ACTIVATIONS)}"
                )
        layers = [
            Dense(file[f"W{i}"].astype(float), file[f"b{i}"].astype(float), activations[i - 1])
            for i in range(1, n + 1)
        ]
    return Network(layers, "x", "y")


def _from_onnx(path: Path) -> Network:
    try:
        # An extra: few need it.
        import onnx.inliner  # noqa: PLC0415
    except ImportError:
        raise InputError(
            "reading it needs the package onnx: pip install 'auv-fmu[networks]'"
        ) from None
    model = onnx.load(str(path))
    if model.functions:
        model = onnx.inliner.inline_local_functions(model)
    graph, to_array = model.graph, onnx.numpy_helper.to_array
    for each in (*model.opset_import, *graph.node):
        each.domain = "" if each.domain == "ai.onnx" else each.domain
    opset = max((entry.version for entry in model.opset_import if not entry.domain), default=0)
    if not _OLDEST_OPSET <= opset <= _NEWEST_OPSET:
        raise InputError(
            f"it has the opset {opset} of ONNX; export it with one of {_OLDEST_OPSET} to "
            f"{_NEWEST_OPSET}"
        )
    constants = {tensor.name: to_array(tensor) for tensor in graph.initializer}
    given = [value for value in graph.input if value.name not in constants]
    for what, values in (("input", given), ("output", graph.output)):
        if len(values) != 1:
            names = ", ".join(value.name for value in values) or "none"
            raise InputError(
                f"its {what}s are {names}; one is wanted: cut it out by onnx.utils.extract_model"
            )
    shape = _one_row(given[0])
    nodes = [*_without_scalers(graph.node, onnx.helper)]
    del graph.node[:]
    graph.node.extend(nodes)
    # These refuse what the standard does not allow, such as shapes and types that do not fit.
    model = onnx.shape_inference.infer_shapes(
        model, check_type=True, strict_mode=True, data_prop=True
    )
    onnx.checker.check_model(model)
    graph = model.graph
    shapes = dict(map(_known_shape, (*graph.input, *graph.value_info, *graph.output)))
    layers, output = _Layers(given[0].name, shape, constants, shapes), graph.output[0].name
    for node in _needed(graph):
        attributes = {a.name: onnx.helper.get_attribute_value(a) for a in node.attribute}
        if "value" in attributes:
            attributes["value"] = to_array(attributes["value"])
        try:
            if node.domain:
                raise InputError(f"{node.domain} is not supported")
            layers.evaluate(node.op_type, node.input, node.output, attributes)
        except (InputError, ValueError, TypeError, IndexError) as error:
            raise InputError(f"operator {node.op_type}: {reason(error)}") from None
    return Network(layers.up_to(output), given[0].name, output)


def _one_row(given: Any) -> tuple[int, ...]:
    """Declare the input of a graph for one row if it has several dimensions; return its shape."""
    declared = given.type.tensor_type
    if declared.elem_type not in _FLOATS:
        raise InputError(f"its input {given.name} is not of the type float or double")
    sizes = [dimension.dim_value for dimension in declared.shape.dim]
    batch, *others = sizes if len(sizes) > 1 else (1, *sizes)
    if batch > 1 or not others or min(others) < 1:
        shown = ", ".join(str(size) if size > 0 else "?" for size in sizes)
        raise InputError(
            f"its input {given.name} has the shape [{shown}]; export it for one row of n numbers: "
            "[1, n]"
        )
    if len(sizes) == 1:
        return (*others,)
    declared.shape.dim[0].dim_value = 1
    return (1, *others)


def _without_scalers(nodes: Sequence[Any], make: Any) -> Iterator[Any]:
    """Replace the Scaler of scikit-learn by Sub and Mul."""
    for node in nodes:
        if (node.domain, node.op_type) != ("ai.onnx.ml", "Scaler"):
            yield node
            continue
        [scaled] = node.output
        offset, scale, moved = (f"{scaled}.{name}" for name in ("offset", "scale", "moved"))
        for attribute in node.attribute:
            floats = attribute.floats
            tensor = make.make_tensor("value", _FLOAT, [len(floats)], floats)
            yield make.make_node("Constant", [], [f"{scaled}.{attribute.name}"], value=tensor)
        yield make.make_node("Sub", [node.input[0], offset], [moved])
        yield make.make_node("Mul", [moved, scale], [scaled])


def _known_shape(value: Any) -> tuple[str, tuple[int, ...] | None]:
    """Return the name and the shape of a value; None: the shape is not constant."""
    declared = value.type.tensor_type
    sizes = [size.dim_value if size.HasField("dim_value") else -1 for size in declared.shape.dim]
    is_known = declared.HasField("shape") and -1 not in sizes
    return value.name, tuple(sizes) if is_known else None


def _needed(graph: Any) -> Sequence[Any]:
    """Return the nodes that the output depends on, without nodes that only give a shape."""
    names, nodes = {graph.output[0].name}, []
    for node in reversed(graph.node):
        if names.intersection(node.output):
            nodes.append(node)
            names.update(() if node.op_type == "Shape" else node.input)
    return nodes[::-1]


class _Value(NamedTuple):
    """The value of a name in a graph: a constant, or an affine function of a layer."""

    offset: Any  #: array: the constant, or the value where the layer gives zeros
    slopes: Any = None  #: arrays: how each number of the layer changes it; None: a constant
    layer: int = 0  #: number of layers before it
    is_sum: bool = False  #: True if it was multiplied by a matrix


class _Layers:
    """Layers of a graph, found by evaluating it.

    Operators are functions of arrays. An affine function is stored as its offset and its slopes; an
    operator that keeps it affine is evaluated at each of them. An activation ends a layer.

    """

    def __init__(
        self,
        inputs: str,
        shape: tuple[int, ...],
        constants: Mapping[str, Any],
        shapes: Mapping[str, tuple[int, ...] | None],
    ) -> None:
        self._layers: list[Dense] = []
        self._shapes = shapes
        self._constants = constants
        self._known = {inputs: self._results(shape)}

    def up_to(self, name: str) -> list[Dense]:
        """Return all layers up to a value."""
        rest = self._dense(self._variable(name), "none")
        if not rest.is_activation:
            return [*self._layers, rest]
        if not self._layers:
            raise InputError("it has no dense layers")
        return self._layers

    def evaluate(
        self,
        name: str,
        inputs: Sequence[str],
        outputs: Collection[str],
        attributes: Mapping[str, Any],
    ) -> None:
        """Evaluate an operator.

        Raises:
            InputError: it is not supported, or not with these inputs.
            IndexError, TypeError, ValueError: its inputs or attributes do not fit.

        """
        [output, *_] = outputs
        for constant in {*inputs} & self._constants.keys():
            self._known.setdefault(constant, _Value(_numbers(self._constants[constant])))
        if name == "Shape":
            value = self._shape(inputs[0], **attributes)
        elif name in _OF_ONNX:
            value = self._activated(name, inputs, attributes)
        elif name not in _OPERATORS:
            supported = ", ".join((*_OPERATORS, *_OF_ONNX, "Shape"))
            raise InputError(f"not supported; layers may consist of {supported}")
        elif name == "BatchNormalization" and len(outputs) > 1:
            raise InputError("more than one output is not supported; export it for inference")
        else:
            value = self._computed(_OPERATORS[name], inputs, attributes)
        shape, standard = value.offset.shape, self._shapes.get(output)
        if standard not in (None, shape):
            raise InputError(f"its result has the shape {shape}, and not {standard}")
        self._known[output] = value

    def _shape(self, name: str, start: int = 0, end: int | None = None) -> _Value:
        """Return the shape of a value as numbers."""
        shape = self._known[name].offset.shape if name in self._known else self._shapes.get(name)
        if shape is None:
            raise InputError(f"the shape of {name} is not known before a run")
        return _Value(np.array(shape, dtype=np.int64)[start:end])

    def _activated(self, name: str, inputs: Sequence[str], attributes: Mapping[str, Any]) -> _Value:
        """Evaluate an activation; its numbers are attributes, or inputs after the first."""
        word, defaults = _OF_ONNX[name]
        if name in ("Max", "Min"):
            # The variable may be any of the inputs.
            inputs = sorted(inputs, key=lambda name: not self._is_variable(name))
        if len(inputs) > 1 + len(defaults):
            raise InputError("more than two inputs are not supported")
        shapes = [self._known[each].offset.shape for each in inputs if each]
        if np.broadcast_shapes(*shapes) != shapes[0]:
            raise InputError("its inputs have shapes that do not fit")
        given = {
            place: self._number(each)
            for place, each in zip(defaults, inputs[1:], strict=False)
            if each
        }
        numbers = {**defaults, **attributes, **given}
        return self._end_layer(inputs[0], word, tuple(numbers.values()))

    def _number(self, name: str) -> float:
        """Return the number in a constant whose elements are all equal."""
        if self._is_variable(name):
            raise InputError(_PRODUCT)
        numbers = np.unique(self._known[name].offset)
        if len(numbers) != 1:
            raise InputError(f"{name} has {len(numbers)} different numbers; one is supported")
        return float(numbers[0])

    def _computed(
        self, operator: _Operator, inputs: Sequence[str], attributes: Mapping[str, Any]
    ) -> _Value:
        """Evaluate an operator that keeps its inputs constant or affine."""
        function = partial(operator.function, **attributes)
        places = [i for i, each in enumerate(inputs) if each and self._is_variable(each)]
        factors = [i for i in places if i in operator.factors]
        if len(factors) > 1 or not {*places} <= {*operator.factors, *operator.terms}:
            raise InputError(_PRODUCT)
        for i in factors if operator.is_sum else ():
            if self._known[inputs[i]].is_sum:
                # The product of the weights of two layers may be many more numbers.
                self._known[inputs[i]] = self._end_layer(inputs[i], "none")
        values = [self._known[each] if each else None for each in inputs]
        offset = _numbers(function(*(value and value.offset for value in values)))
        if not places:
            return _Value(offset)
        variable = [self._variable(inputs[i]) for i in places]
        if (size := offset.size * len(variable[0].slopes)) > MOST_NEURONS**2:
            raise InputError(f"{size} weights are too many")
        # A sum of constants has no slope, and neither has a constant product in it.
        without = {*operator.terms, *(() if factors else operator.factors)}
        still = [
            value and (np.zeros_like(value.offset) if i in without else value.offset)
            for i, value in enumerate(values)
        ]
        slopes = []
        for each in zip(*(value.slopes for value in variable), strict=True):
            for i, slope in zip(places, each, strict=True):
                still[i] = slope
            slopes.append(function(*still))
        is_sum = any(value.is_sum for value in variable) or bool(factors and operator.is_sum)
        return _Value(offset, np.stack(slopes).astype(float), len(self._layers), is_sum)

    def _is_variable(self, name: str) -> bool:
        if name not in self._known:
            raise InputError(f"its input {name} is not supported")
        return self._known[name].slopes is not None

    def _variable(self, name: str) -> _Value:
        """Return an affine function of the last layer."""
        value = self._known.get(name)
        if value is None or value.slopes is None:
            raise InputError(f"{name} does not depend on the network's input")
        if value.layer != len(self._layers):
            raise InputError(f"{name} comes from an earlier layer: the network has branches")
        return value

    def _dense(self, value: _Value, activation: str, numbers: Sequence[float] = ()) -> Dense:
        W = value.slopes.reshape(len(value.slopes), -1).T
        return Dense(W, value.offset.ravel(), activation, numbers)

    def _end_layer(self, name: str, activation: str, numbers: Sequence[float] = ()) -> _Value:
        """End a layer; its results have the shape of its sums."""
        value = self._variable(name)
        self._layers.append(self._dense(value, activation, numbers))
        return self._results(value.offset.shape)

    def _results(self, shape: tuple[int, ...]) -> _Value:
        """Return the results of the last layer, or the inputs."""
        n = math.prod(shape)
        if n > MOST_NEURONS:
            raise InputError(f"a row has {n} numbers; it may have {MOST_NEURONS}")
        return _Value(np.zeros(shape), np.eye(n).reshape(n, *shape), len(self._layers))


#: Message about a value that is neither constant nor affine.
_PRODUCT = "it multiplies, divides or selects by what depends on the input"


def _numbers(array: Any) -> Any:
    """Convert single to double precision; integers stay as they are."""
    array = np.asarray(array)
    if array.dtype.kind not in "biu" and array.dtype not in (np.float32, np.float64):
        raise InputError(f"numbers of the type {array.dtype} are not supported; export it in float")
    return array.astype(float) if array.dtype.kind == "f" else array


# Operators of ONNX as functions of arrays. Inputs are positional, attributes have names. In older
# opsets, some inputs are attributes.


def _constant(**content: Any) -> Any:
    [(name, value)] = content.items()
    if name not in ("value", "value_float", "value_floats", "value_int", "value_ints"):
        raise InputError(f"{name} is not supported")
    is_integer = name.startswith("value_int")
    return value if name == "value" else np.array(value, dtype=np.int64 if is_integer else float)


def _gemm(
    a: Any,
    b: Any,
    c: Any = None,
    *,
    alpha: float = 1.0,
    beta: float = 1.0,
    transA: int = 0,
    transB: int = 0,
) -> Any:
    if a.ndim != 2 or b.ndim != 2:
        raise InputError("its factors are not matrices")
    product = alpha * ((a.T if transA else a) @ (b.T if transB else b))
    return product if c is None else product + np.broadcast_to(beta * c, product.shape)


def _divide(a: Any, b: Any) -> Any:
    if a.dtype.kind != "f":
        raise InputError("a division of integers is not supported")
    return a / b


def _cast(x: Any, *, to: int, saturate: int = 1, round_mode: str = "") -> Any:
    """Convert between types for which the other two attributes have no meaning."""
    types = _FLOATS if x.dtype.kind == "f" else {**_FLOATS, **_INTEGERS}
    if to not in types:
        raise InputError("only a cast to float or double is supported")
    return x.astype(types[to])


def _dropout(x: Any, ratio: Any = None, training_mode: Any = None, *, seed: int = 0) -> Any:
    if training_mode is not None and training_mode.any():
        raise InputError("training_mode is not supported")
    return x


def _reshape(x: Any, shape: Any, *, allowzero: int = 0) -> Any:
    copied = [n or (0 if allowzero else x.shape[i]) for i, n in enumerate(shape)]
    return x.reshape(copied)


def _batch_normalization(
    x: Any,
    scale: Any,
    bias: Any,
    mean: Any,
    var: Any,
    *,
    epsilon: float = float(np.float32(1e-5)),
    momentum: float = 0.9,
    spatial: int = 1,
    training_mode: int = 0,
) -> Any:
    if training_mode or not spatial:
        raise InputError("training_mode and spatial = 0 are not supported")
    if {each.shape for each in (scale, bias, mean, var)} != {x.shape[1:2]}:
        raise InputError("its inputs have shapes that do not fit")
    scale, bias, mean, var = (
        each.reshape(-1, *(1,) * (x.ndim - 2)) for each in (scale, bias, mean, var)
    )
    return (x - mean) * (scale / np.sqrt(var + epsilon)) + bias


class _Operator(NamedTuple):
    """An operator, and its inputs that may depend on the inputs of the network."""

    function: Callable[..., Any]
    factors: Sequence[int] = ()  #: indices of inputs; only one of them may depend
    terms: Sequence[int] = ()  #: indices of inputs that are added
    is_sum: bool = False  #: True if it multiplies matrices


_OPERATORS = {
    "Gemm": _Operator(_gemm, (0, 1), (2,), is_sum=True),
    "MatMul": _Operator(np.matmul, (0, 1), is_sum=True),
    "Add": _Operator(np.add, terms=(0, 1)),
    "Sub": _Operator(np.subtract, terms=(0, 1)),
    "Mul": _Operator(np.multiply, (0, 1)),
    "Div": _Operator(_divide, (0,)),
    "BatchNormalization": _Operator(_batch_normalization, (0,), (2, 3)),
    "Concat": _Operator(lambda *x, axis: np.concatenate(x, axis), terms=range(MOST_NEURONS)),
    "Constant": _Operator(_constant),
    "Cast": _Operator(_cast, (0,)),
    "Dropout": _Operator(_dropout, (0,)),
    "Expand": _Operator(
        lambda x, shape: np.broadcast_to(x, np.broadcast_shapes(x.shape, tuple(shape))), (0,)
    ),
    "Flatten": _Operator(lambda x, *, axis=1: x.reshape(math.prod(x.shape[:axis]), -1), (0,)),
    "Gather": _Operator(lambda x, indices, *, axis=0: np.take(x, indices, axis), (0,)),
    "Identity": _Operator(lambda x: x, (0,)),
    "Reshape": _Operator(_reshape, (0,)),
    "Squeeze": _Operator(
        lambda x, axes=None: np.squeeze(x, None if axes is None else tuple(axes)), (0,)
    ),
    "Transpose": _Operator(lambda x, *, perm=None: np.transpose(x, perm), (0,)),
    "Unsqueeze": _Operator(lambda x, axes: np.expand_dims(x, tuple(axes)), (0,)),
}


def component_text(name: str, network: Network, source: str) -> str:
    """Write the text of a component that computes a network.

    Args:
        name: of the class.
        network: of dense layers.
        source: name of the network's file.

    """
    sizes = [network.n_inputs, *(len(layer.W) for layer in network.layers)]
    network_text = _forward(network)
    names = sorted({*re.findall(r"\b(exp|expm1|log1p|tanh)\(", network_text)})
    imports = [f"from math import {', '.join(names)}"] if names else []
    head = [
        f'"""{name}: a neural network of dense layers, {" - ".join(map(str, sizes))}.\n\n'
        f"Made from `{in_docstring(source)}` by `auv-fmu new component --from`, with its weights "
        "written out.\n"
        '"""',
        "from __future__ import annotations",
        "\n".join([*imports, "from typing import Annotated, NamedTuple"]),
        "from auv_fmu import Matrix, Variable, Vector",
        *(text for i, layer in enumerate(network.layers, 1) for text in _constants(i, layer)),
    ]
    body = [
        _CLASSES.format(
            inputs=network.input_port,
            n=network.n_inputs,
            outputs=network.output_port,
            m=network.n_outputs,
        ),
        network_text,
    ]
    return "\n\n\n".join(["\n\n".join(head), *body]) + "\n"


def _port(name: str, otherwise: str) -> str:
    word = re.sub(r"\W", "_", name)
    can = word.isidentifier() and not word.startswith("_") and not iskeyword(word)
    return word if can and word not in _PORTS_OF_ALL else otherwise


def _constants(i: int, layer: Dense) -> Iterator[str]:
    if layer.is_activation:
        return
    rows = ",\n".join(_lines(row) for row in layer.W)
    yield f"W{i} = Matrix(\n    (\n{textwrap.indent(rows, ' ' * 8)},\n    )\n)  # fmt: skip"
    yield f"b{i} = Vector(\n{textwrap.indent(_lines(layer.b), ' ' * 4)}\n)  # fmt: skip"


def _lines(numbers: Any) -> str:
    """Write numbers as a tuple, in lines."""
    text = ", ".join(repr(float(x)) for x in numbers)
    text = f"({text},)" if len(numbers) == 1 else f"({text})"
    return "\n ".join(textwrap.wrap(text, _WIDTH - 10, break_on_hyphens=False))


_CLASSES = '''\
class Inputs(NamedTuple):
    """Inputs of the network."""

    {inputs}: Annotated[Vector, {n}, Variable("", "Input of the network")]


class Outputs(NamedTuple):
    """Outputs of the network."""

    {outputs}: Annotated[Vector, {m}, Variable("", "Output of the network")]


def outputs(inputs: Inputs) -> Outputs:
    """Compute the outputs."""
    return Outputs(_network(inputs.{inputs}))'''


def _forward(network: Network) -> str:
    n, m = network.n_inputs, network.n_outputs
    lines = [
        f"def _network(x: Annotated[Vector, {n}]) -> Annotated[Vector, {m}]:",
        '    """The layers, one after the other."""',
    ]
    given = "x"
    for i, layer in enumerate(network.layers, start=1):
        if not layer.is_activation:
            lines.append(f"    z{i} = W{i} @ {given} + b{i}")
            given = f"z{i}"
        if layer.activation != "none":
            text = _ACTIVATIONS[layer.activation].format(*map(repr, layer.numbers))
            lines.append(f"    a{i} = Vector({text} for z in {given})")
            given = f"a{i}"
    return "\n".join([*lines, f"    return {given}"])
