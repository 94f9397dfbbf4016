"""The example `sine_network` as a plain slave of PythonFMU."""

from math import sin, tanh

from pythonfmu import Fmi2Causality, Fmi2Slave, Real

W1 = (-0.653, 2.608, -2.315, 0.747, -0.101)
W2 = (
    (4.56, 2.227, -2.736, 1.485, 4.725),
    (0.769, 0.479, 0.239, 1.046, 0.191),
    (0.298, -2.434, 2.268, 1.734, -5.93),
    (-1.921, -0.031, -0.229, -1.846, 1.725),
    (-0.157, 1.605, -0.386, 0.819, 0.677),
)
W3 = (4.044, 1.976, 3.903, -3.042, -0.248)


class SineNetwork(Fmi2Slave):
    """A neural network that has learned the sine."""

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.sin_input = self.sin_output_tf = self.sin_output_ref = 0.0
        self.register_variable(Real("sin_input", causality=Fmi2Causality.input))
        for name in ("sin_output_tf", "sin_output_ref"):
            self.register_variable(Real(name, causality=Fmi2Causality.output))

    def do_step(self, current_time, step_size):
        x = self.sin_input
        first = [tanh(w * x) for w in W1]
        second = [tanh(sum(w * y for w, y in zip(row, first, strict=True))) for row in W2]
        self.sin_output_tf = sum(w * y for w, y in zip(W3, second, strict=True))
        self.sin_output_ref = sin(x)
        return True
